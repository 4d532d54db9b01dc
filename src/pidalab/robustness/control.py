"""What a loop asks of its actuator: the largest gain from measurement noise to the control signal."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from pidalab._check import Array
from pidalab._search import succeeded
from pidalab.loop import Loop, require_well_posed
from pidalab.robustness._grid import divided, scan

QUIET = 1e-4  # |L| below which the turns of the dead time no longer show in |C S|
LOUD = 0.5  # |L| above which they always are followed,
TURNS = 500.0  # and below which dead time times frequency, in rad, it is quicker to follow them all
REACH, FEW = 1.5, 12  # share by which |C| may grow between points; peaks that are looked at closely, at most


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
    require_well_posed(loop)

    def gain(w: np.ndarray) -> np.ndarray:
        return np.abs(loop.transfer("u", "n", 1j * w))

    w = _frequencies(loop, gain)
    height = gain(w)
    best = int(np.nanargmax(height))
    found, at = float(height[best]), float(w[best])
    for i in _hills(loop, w, height):
        top = _top(gain, np.log(w[max(i - 1, 0)]), np.log(w[min(i + 1, w.size - 1)]))
        found, at = max((found, at), top)
    # at zero frequency C S is 1/P, or C where it does not integrate
    static = loop.process.gain()
    for value, where in ((abs(1 / static) if static else math.inf, 0.0), (height[-1], math.inf)):
        if _approached(loop, where) and value >= found * (1 - 1e-7):
            return float(value), where
    return found, at


def _frequencies(loop: Loop, gain: Callable[[Any], Any]) -> Array:
    """Return frequencies that follow C S wherever it may be largest."""
    looked = scan(loop)
    w, size = looked.w, looked.size
    if loop.process.delay * w[size >= QUIET].max(initial=0.0) < TURNS:
        return divided(w, looked.parts(QUIET))
    least = np.nanmax(gain(divided(w, looked.parts(LOUD))))
    with np.errstate(all="ignore"):
        controller = gain(w) * np.abs(1 + loop.L(1j * w))
        # |C S| is at most |C|/(1 - |L|); as much as |C| changes from point to point it may grow between them
        low, high = np.fmin(controller[:-1], controller[1:]), np.fmax(controller[:-1], controller[1:])
        most = high * (high / low) / (1 - np.fmax(size[:-1], size[1:]))
    here = ~((most < least) & (most > 0))
    shown = np.zeros(w.size)
    shown[:-1][here] = size[:-1][here]
    shown[1:][here] = np.fmax(shown[1:], size[1:])[here]
    return divided(w, looked.parts(QUIET, size=shown))


def _hills(loop: Loop, w: Array, height: Array) -> list[int]:
    """Points of the grid beside which the highest peak may lie: those whose surroundings are looked at closely."""
    own = np.nan_to_num(height, nan=0.0, posinf=np.finfo(float).max)
    beside = np.concatenate([[0.0], own, [0.0]])
    hills = np.flatnonzero((own >= beside[:-2]) & (own >= beside[2:]) & (own > 0))
    # beside a point L cannot come closer to -1 than the way to the next one allows
    L = loop.L(1j * w)
    way = np.abs(np.diff(L, prepend=L[:1], append=L[-1:]))
    closest = np.abs(1 + L[hills]) - np.fmax(way[hills], way[hills + 1])
    hills = hills[~(closest * own.max() > REACH * own[hills] * np.abs(1 + L[hills]))]
    if hills.size <= FEW:
        return hills.tolist()
    # many ripples of a dead time: a parabola through three points tells which are the highest
    inner = np.clip(hills, 1, w.size - 2)
    before, here, after = own[inner - 1], own[inner], own[inner + 1]
    bend, lean = 2 * here - before - after, np.abs(after - before)
    estimate = here + lean**2 / (8 * np.maximum(bend, lean) + 1e-300)
    return hills[np.argsort(estimate)[-FEW:]].tolist()


def _top(gain: Callable[[Any], Any], low: float, high: float) -> tuple[float, float]:
    """Highest value between two logarithms of frequencies, and where it lies."""
    from scipy.optimize import minimize_scalar

    found = succeeded(
        minimize_scalar(
            lambda x: -float(gain(np.exp(x))), bounds=(low, high), method="bounded", options={"xatol": 1e-10}
        ),
        "a peak of |C S|",
    )
    return -float(found.fun), float(np.exp(found.x))


def _approached(loop: Loop, end: float) -> bool:
    """Whether |C S| tends to 1/P(0) at zero frequency, by integral action, or to a constant at infinite frequency."""
    (c_num, c_den), (f_num, f_den) = loop.blocks["controller"], loop.blocks["output_filter"]
    if end == 0.0:
        return bool(c_den[-1] == 0 or f_den[-1] == 0)
    return len(c_num) + len(f_num) == len(c_den) + len(f_den)
