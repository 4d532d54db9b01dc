r"""Design the controller with the least IAE under limits on robustness and noise.

The controller of order m is

.. math:: C(s) = \frac{K_{-1} s^{-1} + K_0 + \dots + K_m s^m}{(1 + T_F s)^{m+1}}, \qquad K_k \ge 0 .

The search chooses the gains :math:`K_k` and the filter time :math:`T_F`. It minimises the IAE of a load step
subject to :math:`\max |S| \le M_s` and to :math:`\max |C S| \le M_{ks}` over all frequencies, with exact dead time. A
limit on the noise gain can replace the limit on \|C S\|.

The problem is not convex: a PIDA with almost no acceleration and a true PIDA with a slower filter can both be local
optima. The search therefore passes through a grid of filter times.
"""

from pidalab.optimal.design import least_iae, load

__all__ = ["least_iae", "load"]
