"""Compute gains from the ultimate gain and period of a plant, which a relay experiment can measure."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from pidalab import _check
from pidalab.controllers import PIDA
from pidalab.loop import Loop
from pidalab.plant.doubts import doubt, with_doubts
from pidalab.plant.record.cleaning import column
from pidalab.process import Process, fopdt, ipdt, lags
from pidalab.robustness.margins import ms_or_infinite

# Each rule gives kp/Ku, ti/Tu and td/Tu.
RULES = {
    ("Ziegler-Nichols", "PI"): (0.45, 1 / 1.2, 0.0),
    ("Ziegler-Nichols", "PID"): (0.6, 0.5, 0.125),
    ("Tyreus-Luyben", "PI"): (1 / 3.2, 2.2, 0.0),
    ("Tyreus-Luyben", "PID"): (1 / 2.2, 2.2, 1 / 6.3),
    ("little overshoot", "PID"): (1 / 3, 0.5, 1 / 3),
    ("no overshoot", "PID"): (0.2, 0.5, 1 / 3),
}
SHARES = (0.2, 1.0)  # (dead time) / lag of the first-order models in `models_of`
FEWEST_CYCLES, FEWEST_IN_CYCLE = 3, 8
# Largest relative deviation of a period, and also the largest share of samples in which u is between its two levels.
SETTLED = 0.05
OFF_PHASE = 10.0  # a doubt is given if the phase differs from -180 degrees by more than this, in degrees


class Oscillation(NamedTuple):
    """The oscillation of a plant under relay control. ``print`` shows it with its doubts.

    Attributes
    ----------
    ku, tu : float
        Ultimate gain, in units of u per unit of y, and ultimate period, in the unit of the times.
    amplitude : float
        Amplitude of the output's component at the period `tu`.
    phase : float
        Phase of the plant at this period, in degrees. It is -180 for a relay without hysteresis.
    bias : float
        Share of the time that u spends at its upper level. It is 0.5 without bias.
    cycles : int
        Number of measured cycles.
    """

    ku: float
    tu: float
    amplitude: float
    phase: float
    bias: float
    cycles: int

    def __str__(self) -> str:
        text = (
            f"oscillation over {self.cycles} cycles: amplitude {self.amplitude:.4g}, period {self.tu:.5g}, u at its "
            f"upper level for {100 * self.bias:.0f} % of the time; ultimate gain {self.ku:.4g}"
        )
        off = abs(self.phase + 180.0) > OFF_PHASE
        return with_doubts(text, [doubt("relay phase", phase=self.phase)] if off else [])


def relay_oscillation(t: ArrayLike, u: ArrayLike, y: ArrayLike) -> Oscillation:
    r"""Measure the oscillation of a plant under relay control.

    Parameters
    ----------
    t, u, y : array_like, shape (n,)
        Times, the held output of the relay, and the output of the plant.

    Returns
    -------
    Oscillation

    Raises
    ------
    ValueError
        If the input does not switch between two levels, if it has fewer than three cycles, or if the periods differ.

    Notes
    -----
    Let :math:`U_1` and :math:`Y_1` be the first Fourier coefficients of u and y over whole periods of a steady
    oscillation. For any waveform and bias of u, :math:`P(j\omega) = Y_1/U_1` and :math:`K_u = |U_1/Y_1|`. The usual
    formula :math:`4 d/(\pi a)` assumes that u is a square wave of amplitude d, and that y is a sine of amplitude a.

    Examples
    --------
    >>> import numpy as np
    >>> from pidalab.plant.ultimate import relay_oscillation
    >>> t = np.arange(0.0, 60.0, 0.01)
    >>> wave = relay_oscillation(t, np.sign(np.sin(t) + 1e-9), -0.5 * 4 / np.pi * np.sin(t))
    >>> f"{wave.ku:.3f} {wave.tu:.2f} {wave.phase:.0f}"
    '2.000 6.28 -180'
    """
    t, u, y = column("t", t), column("u", u), column("y", y)
    middle = 0.5 * (np.nanmin(u) + np.nanmax(u))
    high = u > middle
    between = np.abs(u - middle) < 0.4 * float(np.ptp(u))
    if np.ptp(u) == 0 or np.mean(between) > SETTLED:
        raise ValueError("u must switch between two levels like a relay: choose the relay's output (--u)")
    rises = np.flatnonzero(high[1:] & ~high[:-1]) + 1
    cycles = min(rises.size - 1, 5)
    if cycles < FEWEST_CYCLES:
        raise ValueError(f"record {FEWEST_CYCLES} cycles of the relay or more, found {max(cycles, 0)}")
    rises = rises[-cycles - 1 :]
    periods = np.diff(t[rises])
    if np.ptp(periods) > 2 * SETTLED * np.mean(periods) + 2 * np.median(np.diff(t)):
        raise ValueError(
            f"the last periods are {', '.join(f'{x:.4g}' for x in periods)}: let the oscillation settle"
        )
    part = slice(rises[0], rises[-1])
    now, tu = t[part], float(np.mean(periods))
    if now.size < FEWEST_IN_CYCLE * cycles:
        raise ValueError(f"sample {FEWEST_IN_CYCLE} times or more in a period, found {now.size / cycles:.1f}")
    held = np.diff(t[rises[0] : rises[-1] + 1])
    # The coefficient of u is exact, since u is held. Each sample of y is weighted with half of both adjacent intervals.
    w = 2j * np.pi / tu
    edges = np.exp(-w * t[rises[0] : rises[-1] + 1])
    first_u = np.sum(u[part] * np.diff(edges)) / (-w * np.sum(held))
    weights = 0.5 * (held + np.append(held[-1], held[:-1]))
    first_y = np.sum((y[part] - y[part].mean()) * np.exp(-w * now) * weights) / np.sum(held)
    plant = complex(first_y / first_u)
    phase = math.degrees(math.atan2(plant.imag, plant.real))
    bias = float(np.sum(held[high[part]]) / np.sum(held))
    return Oscillation(1 / abs(plant), tu, 2 * abs(first_y), phase - 360.0 * (phase > 0), bias, cycles)


def models_of(ku: float, tu: float) -> dict[str, Process]:
    """Return simple plants that have the given ultimate gain and period.

    Examples
    --------
    >>> from pidalab.plant.ultimate import models_of
    >>> list(models_of(2.0, 10.0))
    ['integrator', 'delay/lag 0.2', 'delay/lag 1', 'three lags']
    """
    ku, w = _check.real("ku", ku), 2 * math.pi / _check.real("tu", tu, above=0.0)
    if ku == 0:
        raise ValueError("ku must not be 0")
    models = {"integrator": ipdt(w / ku, tu / 4)}
    for share in SHARES:
        x = brentq(lambda x, share=share: share * x + math.atan(x) - math.pi, 1e-6, math.pi / share)
        models[f"delay/lag {share:g}"] = fopdt(math.hypot(1.0, x) / ku, x / w, share * x / w)
    return models | {"three lags": lags(3, math.sqrt(3) / w, 8 / ku)}


def rule_table(ku: float, tu: float) -> list[tuple[str, str, PIDA, list[float]]]:
    """Return rows: rule, kind, controller, and a list of Ms for the models of `models_of` (infinite if unstable).

    Examples
    --------
    >>> from pidalab.plant.ultimate import rule_table
    >>> rule, kind, controller, ms = rule_table(2.0, 10.0)[2]
    >>> rule, kind, round(controller.kp, 3), controller.ti
    ('Tyreus-Luyben', 'PI', 0.625, 22.0)
    """
    models = models_of(ku, tu).values()
    table = []
    for (rule, kind), (kp, ti, td) in RULES.items():
        controller = PIDA(kp * ku, ti * tu, td * tu)
        table.append((rule, kind, controller, [ms_or_infinite(Loop(model, controller)) for model in models]))
    return table
