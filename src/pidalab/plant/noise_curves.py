"""The trade-off between error and noise of one plant: the least IAE for each limit of noise, and rules."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pidalab import _check
from pidalab._text import KINDS, set_out
from pidalab.comparison import designs, first_horizon
from pidalab.comparison.judging import DesignRow, measure_row
from pidalab.process import Process, require_no_zero_at_origin
from pidalab.relative_noise import noise_scale
from pidalab.requirements import Requirements
from pidalab.rules import Design
from pidalab.rules.registry import ORDER
from pidalab.style import GREY, LOOKS, STYLE

NOISE_SHARES = (0.1, 0.25, 0.6, 1.5, 3.0)  # limits of the relative noise gain
DRAWN_RULES = ("simc", "amigo", "haalman", "lambda", "magnitude optimum")
RULE_MARKERS = "os^Dv*P"
FITS = 1.001  # ratio of Ms to its limit up to which a rule is in a panel


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
        As from `pidalab.optimal.curves.find_curves`.
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
        The curves, ordered by Ms, kind and noise. There is no point where no controller keeps both limits.
    rules : tuple of DesignRow
        Rules, or the reason why they do not apply.
    """

    process: Process
    points: tuple[TradeOffPoint, ...]
    rules: tuple[DesignRow, ...]

    def curve(self, kind: str, ms: float) -> list[TradeOffPoint]:
        """Return the points of one curve.

        Parameters
        ----------
        kind : str
            Kind of controller.
        ms : float
            Limit of Ms.

        Returns
        -------
        list of TradeOffPoint

        Examples
        --------
        >>> import pidalab
        >>> found = pidalab.trade_off(pidalab.lags(3, delay=1.0), [1.6], limits=[0.2, 0.6], kinds=["PI"], rules=[])
        >>> [f"{point.iae:.2f}" for point in found.curve("PI", 1.6)]
        ['4.60', '4.60']
        """
        return [point for point in self.points if (point.kind, point.ms) == (kind, ms)]

    def plot(self) -> Figure:
        """Draw the least IAE over the relative noise gain, with the rules as markers.

        Returns
        -------
        matplotlib.figure.Figure
            A panel for each limit of Ms, with the rules that keep no lower limit.

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
        levels = list(dict.fromkeys(point.ms for point in self.points))
        kinds = list(dict.fromkeys(point.kind for point in self.points))
        if not levels:
            raise ValueError("there is nothing to draw: no controller keeps the limits")
        names = dict.fromkeys(row.rule for row in self.rules)
        marks = dict(zip(names, itertools.cycle(RULE_MARKERS), strict=False))
        with rc_context(STYLE):  # type: ignore[arg-type]
            drawn = Figure(figsize=(6.4, 4.2))
            axes = np.atleast_1d(drawn.subplots(1, len(levels), sharex=True, sharey=True))
            for ax, ms, calmer in zip(axes, levels, [0.0, *levels], strict=False):
                for kind in kinds:
                    points = [(p.relative_noise_gain, p.iae) for p in self.curve(kind, ms)]
                    ax.loglog(*np.reshape(points, (-1, 2)).T, **LOOKS[kind], label=kind)
                for row in self.rules:
                    if (
                        row.applies
                        and calmer * FITS < row.ms <= ms * FITS
                        and not math.isnan(row.relative_noise)
                    ):
                        look = {"color": LOOKS[row.kind]["color"], "marker": marks[row.rule], "linestyle": ""}
                        ax.plot([row.relative_noise], [row.iae], markersize=6, **look)
                ax.set(title=f"Ms at most {ms:g}", xlabel="relative noise gain")
            axes[0].set(ylabel="IAE of a load step")
            handles, labels = axes[0].get_legend_handles_labels()
            handles += [Line2D([], [], color=GREY, marker=mark, linestyle="") for mark in marks.values()]
            drawn.legend(handles, [*labels, *marks], loc="outside upper left", ncols=3)
        return drawn

    def __str__(self) -> str:
        kinds = list(dict.fromkeys(point.kind for point in self.points))
        iae = {(p.ms, p.relative_noise_gain, p.kind): f"{p.iae:.4g}" for p in self.points}
        rows = [["Ms", "noise gain", *kinds]]
        for ms, noise in dict.fromkeys((ms, noise) for ms, noise, _ in iae):
            rows.append([f"{ms:g}", f"{noise:.4g}", *(iae.get((ms, noise, kind), "-") for kind in kinds)])
        lines = [set_out(row, [8, 12, *[10] * len(kinds)]) for row in rows]
        return "\n".join(
            [f"{self.process!r}: least IAE of a load step, by Ms and relative noise gain", *lines]
        )


def trade_off(
    process: Process,
    ms: Sequence[float] = (1.4, 2.0),
    *,
    limits: Sequence[float] = NOISE_SHARES,
    kinds: Sequence[str] = KINDS,
    rules: Iterable[str] = DRAWN_RULES,
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
    rules : iterable of str, optional
        Names of rules to compare. haalman designs for the least of `ms`.

    Returns
    -------
    TradeOff

    Raises
    ------
    TypeError, ValueError
        For limits out of range, and for a process without any time constant or dead time.

    Notes
    -----
    Each point is the best of short descents from its neighbours, see `pidalab.optimal.curves`. It differs from a full
    search by less than the width of a line and takes a fraction of the time.

    Examples
    --------
    >>> import pidalab
    >>> print(pidalab.trade_off(pidalab.lags(3, delay=1.0), [1.6], limits=[0.2, 0.6], kinds=["PI"], rules=[]))
    Process(num=[1], den=[1, 3, 3, 1], delay=1): least IAE of a load step, by Ms and relative noise gain
    Ms        noise gain        PI
    1.6              0.2     4.596
    1.6              0.6     4.596
    """
    from pidalab.optimal.curves import find_curves

    require_no_zero_at_origin("process", process)
    for kind in kinds:
        _check.choice("kinds", kind, KINDS)
    levels = sorted(_check.real("ms", level, above=1.0) for level in ms)
    allowed = sorted(_check.real("limits", limit, above=0.0) for limit in limits)
    scale = noise_scale(process)
    gains = {limit * scale.gain: limit for limit in allowed}
    wanted = sorted(dict.fromkeys(kinds), key=ORDER.__getitem__)
    h, noise = scale.sample_time, list(gains)
    curves = (
        find_curves(process, ORDER[wanted[-1]], ms=levels, noise_gains=noise, sample_time=h) if wanted else {}
    )
    points = [
        TradeOffPoint(kind, level, limit, design.iae, design)
        for level, kind, (gain, limit) in itertools.product(levels, wanted, gains.items())
        if (design := curves.get((ORDER[kind], level, gain))) is not None
    ]
    requirements = Requirements(ms=levels[0], noise_gain=noise[len(noise) // 2], sample_time=h)
    horizon = first_horizon(process)
    rows = [
        measure_row(*candidate, process, h, horizon) for candidate in designs(process, requirements, rules)
    ]
    return TradeOff(process, tuple(points), tuple(row for row in rows if row.kind in wanted))
