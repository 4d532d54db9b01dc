r"""The best controller: least IAE under limits of robustness and noise.

.. math:: C(s) = \frac{K_{-1} s^{-1} + K_0 + \dots + K_m s^m}{(1 + T_F s)^{m+1}}, \qquad K_k \ge 0,

with free filter time, so that controller and filter are designed together. The IAE of a load step is minimised subject
to :math:`\max |S| \le M_s` and to :math:`\max |C S| \le M_{ks}`, or to a limit of the noise gain, over all frequencies
and with exact dead time.

The problem is not convex. A PIDA close to the PID and a true PIDA with a slower filter can both be local optima. The
search therefore goes through a grid of filter times, downwards and upwards (see `pidalab.optimal.design`).
"""

from pidalab.optimal.design import least_iae, load

__all__ = ["least_iae", "load"]
