"""The trade-off of one plant: the least IAE for each limit of noise, and where rules lie beside it."""

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

NOISE_SHARES = (0.1, 0.25, 0.6, 1.5, 3.0)  # of the ultimate gain: limits of noise
DRAWN_RULES = ("simc", "amigo", "haalman", "lambda", "magnitude optimum")  # rules that are drawn


class TradeOffPoint(NamedTuple):
    """The best controller of a kind under two limits.

    Attributes
    ----------
    kind : str
        "PI", "PID" or "PIDA".
    ms, relative_noise_gain : float
        The limits.
    iae : float
        Of a unit step of the load.
    design : Design
        As of `pidalab.optimal.curves.find_curves`.
    """

    kind: str
    ms: float
    relative_noise_gain: float
    iae: float
    design: Design


@dataclass(frozen=True)
class TradeOff:
    """Result of `trade_off`; `plot_trade_off` of a report draws it.

    Attributes
    ----------
    process : Process
        The plant.
    points : tuple of TradeOffPoint
        The curves: by Ms, by kind, from the least noise to the most. Where no controller keeps both limits, there is
        none.
    rules : tuple of DesignRow
        Rules as they come, with their relative noise gain; one that does not apply says why.
    """

    process: Process
    points: tuple[TradeOffPoint, ...]
    rules: tuple[DesignRow, ...]

    def curve(self, kind: str, ms: float) -> list[TradeOffPoint]:
        """Return the points of one curve.

        Parameters
        ----------
        kind : str
            Of a controller.
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
        found = {(point.ms, point.relative_noise_gain, point.kind): point.iae for point in self.points}
        lines = [
            f"{self.process!r}: least IAE of a load step, by Ms and relative noise gain",
            set_out(["Ms", "noise gain", *kinds], [8, 12, *[10] * len(kinds)]),
        ]
        for ms, noise in dict.fromkeys((point.ms, point.relative_noise_gain) for point in self.points):
            cells = [f"{found[ms, noise, kind]:.4g}" if (ms, noise, kind) in found else "-" for kind in kinds]
            lines.append(set_out([f"{ms:g}", f"{noise:.4g}", *cells], [8, 12, *[10] * len(kinds)]))
        return "\n".join(lines)


def trade_off(
    process: Process,
    ms: Sequence[float] = (1.4, 2.0),
    *,
    limits: Sequence[float] = NOISE_SHARES,
    kinds: Sequence[str] = KINDS,
    rules: Iterable[str] = DRAWN_RULES,
) -> TradeOff:
    """Find what error a plant can have for what noise, at two limits of Ms, for PI, PID and PIDA.

    Parameters
    ----------
    process : Process
        The plant.
    ms : sequence of float, optional
        Limits of Ms, each above 1.
    limits : sequence of float, optional
        Of the relative noise gain, see `pidalab.relative_noise_gain`.
    kinds : sequence of str, optional
        Which controllers.
    rules : iterable of str, optional
        Rules by their names, drawn as they come; haalman designs for the least of `ms`.

    Returns
    -------
    TradeOff

    Raises
    ------
    TypeError, ValueError
        For limits out of range, and for a process without any time constant or dead time.

    Notes
    -----
    Each point is the best of short descents from its neighbours, see `pidalab.optimal.curves`: within a line's width of
    what a search of its own finds, in a fraction of the time.

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
    levels = sorted(_check.real("ms", one, above=1.0) for one in ms)
    allowed = sorted(_check.real("limits", one, above=0.0) for one in limits)
    scale = noise_scale(process)
    gains = {limit * scale.gain: limit for limit in allowed}
    wanted = sorted(dict.fromkeys(kinds), key=ORDER.__getitem__)
    found = {}
    if wanted:
        noise: dict[str, Any] = {"noise_gains": list(gains), "sample_time": scale.sample_time}
        found = find_curves(process, ORDER[wanted[-1]], ms=levels, **noise)
    points = [
        TradeOffPoint(kind, level, limit, design.iae, design)
        for level, kind, (gain, limit) in product(levels, wanted, gains.items())
        if (design := found.get((ORDER[kind], level, gain))) is not None
    ]
    middle = list(gains)[len(gains) // 2]
    asked = Requirements(ms=levels[0], noise_gain=middle, sample_time=scale.sample_time)
    horizon = first_horizon(process)
    rows = [measure_row(*one, process, scale.sample_time, horizon) for one in designs(process, asked, rules)]
    rows = [row._replace(noise_gain=row.noise_gain / scale.gain) for row in rows if row.kind in wanted]
    return TradeOff(process, tuple(points), tuple(rows))
