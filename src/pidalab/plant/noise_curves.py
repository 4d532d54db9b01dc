"""The trade-off between error and noise of one plant: the least IAE for each limit of noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from pidalab import _check, optimal
from pidalab._text import KINDS, set_out
from pidalab.process import Process
from pidalab.relative_noise import noise_scale
from pidalab.rules import Design
from pidalab.rules.registry import ORDER
from pidalab.style import LOOKS, STYLE

NOISE_SHARES = (0.1, 0.25, 0.6, 1.5, 3.0)  # limits of the relative noise gain


class TradeOffPoint(NamedTuple):
    """The best controller of a kind under two limits.

    Attributes
    ----------
    kind : str
        "PI", "PID" or "PIDA".
    ms, relative_noise_gain : float
        The limits.
    iae : float
        IAE of a unit step of the load.
    design : Design
        As from `pidalab.optimal.load`.
    """

    kind: str
    ms: float
    relative_noise_gain: float
    iae: float
    design: Design


@dataclass(frozen=True)
class TradeOff:
    """Result of `trade_off`.

    Attributes
    ----------
    process : Process
        The plant.
    points : tuple of TradeOffPoint
        Ordered by Ms, kind and noise. There is no point where no controller keeps both limits.
    """

    process: Process
    points: tuple[TradeOffPoint, ...]

    def plot(self) -> Figure:
        """Draw the least IAE over the relative noise gain.

        Returns
        -------
        matplotlib.figure.Figure
            A panel for each limit of Ms.

        Raises
        ------
        ValueError
            If no controller keeps the limits.

        Examples
        --------
        >>> import pidalab
        >>> traded = pidalab.trade_off(pidalab.lags(3, delay=1.0), [1.6], limits=[0.2, 0.6], kinds=["PI"])
        >>> len(traded.plot().axes)
        1
        """
        kinds, levels = (list(dict.fromkeys(point[k] for point in self.points)) for k in (0, 1))
        if not levels:
            raise ValueError("there is nothing to draw: no controller keeps the limits")
        with rc_context(STYLE):  # type: ignore[arg-type]
            drawn = Figure(figsize=(6.4, 4.2))
            axes = np.atleast_1d(drawn.subplots(1, len(levels), sharex=True, sharey=True))
            for (ax, ms), kind in product(zip(axes, levels, strict=True), kinds):
                curve = [p[2:4] for p in self.points if (p.kind, p.ms) == (kind, ms)]
                ax.loglog(*np.reshape(curve, (-1, 2)).T, **LOOKS[kind], label=kind)
                ax.set(title=f"Ms at most {ms:g}", xlabel="relative noise gain")
            axes[0].set(ylabel="IAE of a load step")
            axes[0].legend()
        return drawn

    def __str__(self) -> str:
        kinds = list(dict.fromkeys(point.kind for point in self.points))
        iae = {(p.ms, p.relative_noise_gain, p.kind): f"{p.iae:.4g}" for p in self.points}
        rows = [["Ms", "noise gain", *kinds]]
        for ms, noise in dict.fromkeys(key[:2] for key in iae):
            rows.append([f"{ms:g}", f"{noise:.4g}", *(iae.get((ms, noise, kind), "-") for kind in kinds)])
        title = f"{self.process!r}: least IAE of a load step, by Ms and relative noise gain"
        return "\n".join([title, *(set_out(row, [8, 12, *[10] * len(kinds)]) for row in rows)])


def trade_off(
    process: Process,
    ms: Sequence[float] = (1.4, 2.0),
    *,
    limits: Sequence[float] = NOISE_SHARES,
    kinds: Sequence[str] = KINDS,
) -> TradeOff:
    """Find the least error for each limit of noise, at two limits of Ms, for PI, PID and PIDA.

    Parameters
    ----------
    process : Process
        The plant.
    ms : sequence of float, optional
        Limits of Ms, each above 1.
    limits : sequence of float, optional
        Limits of the relative noise gain, see `pidalab.relative_noise_gain`.
    kinds : sequence of str, optional
        Kinds of controllers.

    Returns
    -------
    TradeOff

    Raises
    ------
    TypeError, ValueError
        For limits out of range, and for a process without any time constant or dead time.

    Examples
    --------
    >>> import pidalab
    >>> print(pidalab.trade_off(pidalab.lags(3, delay=1.0), [1.6], limits=[0.2, 0.6], kinds=["PI"]))
    Process(num=[1], den=[1, 3, 3, 1], delay=1): least IAE of a load step, by Ms and relative noise gain
    Ms        noise gain        PI
    1.6              0.2     4.594
    1.6              0.6     4.594
    """
    for kind in kinds:
        _check.choice("kinds", kind, KINDS)
    levels = sorted(_check.real("ms", level, above=1.0) for level in ms)
    allowed = sorted(_check.real("limits", limit, above=0.0) for limit in limits)
    scale = noise_scale(process)
    points = []
    for level, kind in product(levels, sorted(dict.fromkeys(kinds), key=ORDER.__getitem__)):
        design = None
        for limit in reversed(allowed):
            noise = limit * scale.gain
            # the optimum for a higher limit is that for this one, too, if it meets this one
            if design is None or design.noise_gain > noise:
                try:
                    design = optimal.load(
                        process, ORDER[kind], ms=level, noise_gain=noise, sample_time=scale.sample_time
                    )
                except ValueError:
                    break  # no controller makes so little noise
            points.append(TradeOffPoint(kind, level, limit, design.iae, design))
    return TradeOff(process, tuple(sorted(points, key=lambda p: (p.ms, ORDER[p.kind], p[2]))))
