r"""Magnitude optimum tuning of PID_n^m, from a model or from a record (vrancic2021).

The loop follows its set point best if :math:`|T(j\omega)|` stays 1 up to as high a frequency as possible: if the real
part of :math:`L(j\omega)` stays -1/2. Written as a power series in :math:`\omega`, that real part has coefficients that
are linear in the gains, eqs. (13) and (14). The m + 2 gains meet m + 2 conditions:

.. math:: \sum_{c=0}^{m+1} (-1)^{c+1} A_{2r+1-c} K_{c-1} = \begin{cases} -\tfrac12 & r = 0 \\ 0 & r = 1 \dots m+1,
          \end{cases}

eqs. (15) and (16), where areas with a negative index are 0 and those of the filter are included. So 2m + 4 areas are
needed. The system is solved in exact fractions, because its condition number grows by more than a hundred with each m.
It is singular if the controller could cancel every pole of process and filter: its gains are then without bound.

The conditions say what the loop does at low frequencies. They do not make it stable: with a delay that dominates, or a
process that oscillates, there are orders at which it is not. From a process the functions here raise an error then;
areas do not tell.
"""

from pidalab.rules.magnitude_optimum.design import gains, tune
from pidalab.rules.magnitude_optimum.noise import filter_time, tune_for_filter_noise, tune_for_noise

__all__ = ["filter_time", "gains", "tune", "tune_for_filter_noise", "tune_for_noise"]
