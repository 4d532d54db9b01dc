"""What a loop asks of its actuator: the largest gain from measurement noise to the control signal."""

from __future__ import annotations

import math

from pidalab.loop import Loop
from pidalab.robustness._arrays import SENSITIVITY
from pidalab.robustness.loops import explore_in_s, factors_of


def max_control_sensitivity(loop: Loop) -> tuple[float, float]:
    r"""Largest gain Mks from measurement noise to control signal, and the frequency where it lies.

    Parameters
    ----------
    loop : Loop
        The loop, stable or not; its output filter is part of the controller.

    Returns
    -------
    mks, wmks : float
        The supremum of \|C/(1 + L)\| over all frequencies, in units of u per unit of y; ``wmks`` is 0 or inf where
        it is only approached.

    Raises
    ------
    ValueError
        For an ill-posed loop: no dead time and a direct feedthrough of exactly -1.

    Examples
    --------
    >>> import pidalab
    >>> from pidalab.robustness import max_control_sensitivity
    >>> controller = pidalab.HighOrderPID([0.3, 0.8, 0.4], filter_time=0.05, filter_order=2)
    >>> mks, w = max_control_sensitivity(pidalab.Loop(pidalab.lags(3, delay=1.0), controller))
    >>> print(f"{mks:.4f} {w:.2f}")
    4.0109 19.75
    """
    looked, controller = explore_in_s(loop), factors_of(loop, "controller", "output_filter")
    # at zero frequency C S is 1/P, or C where it does not integrate
    (c_num, c_den), (f_num, f_den) = loop.blocks["controller"], loop.blocks["output_filter"]
    static, at_zero, at_end = loop.process.gain(), -math.inf, -math.inf
    if c_den[-1] == 0 or f_den[-1] == 0:
        at_zero = abs(1 / static) if static else math.inf
    if len(c_num) + len(f_num) == len(c_den) + len(f_den):  # C S tends to a constant
        at_end = abs(loop.transfer("u", "n", 1j * looked.grid[-1]))
    return looked.supremum(SENSITIVITY, at_zero, float(at_end), controller)
