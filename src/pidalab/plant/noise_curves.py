"""The trade-off between error and noise of one plant: the least IAE for each limit of noise, and rules."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

from pidalab import _check
from pidalab._text import KINDS, set_out
from pidalab.comparison import designs, first_horizon
from pidalab.comparison.judging import DesignRow, measure_row
from pidalab.process import Process, require_no_zero_at_origin
from pidalab.relative_noise import noise_scale
from pidalab.requirements import Requirements
from pidalab.rules import Design
from pidalab.rules.registry import ORDER

NOISE_SHARES = (0.1, 0.25, 0.6, 1.5, 3.0)  # limits of the relative noise gain
DRAWN_RULES = ("simc", "amigo", "haalman", "lambda", "magnitude optimum")


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
    """Result of `trade_off`. `Report.plot_trade_off` draws it.

    Attributes
    ----------
    process : Process
        The plant.
    points : tuple of TradeOffPoint
        The curves, ordered by Ms, kind and noise. There is no point where no controller keeps both limits.
    rules : tuple of DesignRow
        Rules with their relative noise gain, or the reason why they do not apply.
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
    curves = {}
    if wanted:
        noise: dict[str, Any] = {"noise_gains": list(gains), "sample_time": scale.sample_time}
        curves = find_curves(process, ORDER[wanted[-1]], ms=levels, **noise)
    points = [
        TradeOffPoint(kind, level, limit, design.iae, design)
        for level, kind, (gain, limit) in product(levels, wanted, gains.items())
        if (design := curves.get((ORDER[kind], level, gain))) is not None
    ]
    middle = list(gains)[len(gains) // 2]
    requirements = Requirements(ms=levels[0], noise_gain=middle, sample_time=scale.sample_time)
    horizon = first_horizon(process)
    candidates = designs(process, requirements, rules)
    rows = [measure_row(*candidate, process, scale.sample_time, horizon) for candidate in candidates]
    rows = [row._replace(noise_gain=row.noise_gain / scale.gain) for row in rows if row.kind in wanted]
    return TradeOff(process, tuple(points), tuple(rows))
