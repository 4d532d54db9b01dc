r"""The controller with the least IAE under limits of robustness and noise.

.. math:: C(s) = \frac{K_{-1} s^{-1} + K_0 + \dots + K_m s^m}{(1 + T_F s)^{m+1}}, \qquad K_k \ge 0,

The filter time is free, so that controller and filter are designed together. The IAE of a load step is minimised
subject to :math:`\max |S| \le M_s` and to a limit of noise. This may be :math:`\max |C S| \le M_{ks}` over all
frequencies, or a limit of the noise gain. The dead time is exact.

The problem is not convex. There may be two local optima, a PIDA close to the PID and a true PIDA with a slower filter.
Therefore the search goes through a grid of filter times, downwards and upwards (see `pidalab.optimal.design`).
"""

from pidalab.optimal.design import least_iae, load

__all__ = ["least_iae", "load"]
