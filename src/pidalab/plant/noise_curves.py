"""The trade-off of one plant: the least IAE for each limit of noise, and where rules lie beside it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

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
    ms, noise_gain : float
        The limits.
    iae : float
        Of a unit step of the load.
    design : Design
        As of `pidalab.optimal.curves.find_curves`.
    """

    kind: str
    ms: float
    noise_gain: float
    iae: float
    design: Design


@dataclass(frozen=True)
class TradeOff:
    """Result of `trade_off`; `plot_trade_off` of a report draws it.

    Attributes
    ----------
    process : Process
        The plant.
    sample_time : float
        Of the noise.
    points : tuple of TradeOffPoint
        The curves: by Ms, by kind, from the least noise to the most. Where no controller keeps both limits, there is
        none.
    rules : tuple of DesignRow
        Rules as they come; one that does not apply says why.
    """

    process: Process
    sample_time: float
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
        >>> found = pidalab.trade_off(pidalab.lags(3, delay=1.0), [1.6], noise_gains=[1.0, 3.0], kinds=["PI"], rules=[])
        >>> [f"{point.iae:.2f}" for point in found.curve("PI", 1.6)]
        ['4.60', '4.60']
        """
        return [point for point in self.points if (point.kind, point.ms) == (kind, ms)]

    def __str__(self) -> str:
        kinds = list(dict.fromkeys(point.kind for point in self.points))
        found = {(point.ms, point.noise_gain, point.kind): point.iae for point in self.points}
        lines = [
            f"{self.process!r}: least IAE of a load step",
            set_out(["Ms", "noise gain", *kinds], [8, 12, *[10] * len(kinds)]),
        ]
        for ms, noise in dict.fromkeys((point.ms, point.noise_gain) for point in self.points):
            cells = [f"{found[ms, noise, kind]:.4g}" if (ms, noise, kind) in found else "-" for kind in kinds]
            lines.append(set_out([f"{ms:g}", f"{noise:.4g}", *cells], [8, 12, *[10] * len(kinds)]))
        return "\n".join(lines)


def trade_off(
    process: Process,
    ms: Sequence[float] = (1.4, 2.0),
    *,
    noise_gains: Sequence[float] | None = None,
    sample_time: float | None = None,
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
    noise_gains : sequence of float, optional
        Limits of the standard deviation of u per unit of that of white measurement noise; by default from a tenth to
        three times the ultimate gain.
    sample_time : float, optional
        Of that noise; by default a hundredth of the ultimate period.
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
        For limits out of range, and where a process that no gain makes oscillate leaves the noise or its sample time
        open.

    Notes
    -----
    Each point is the best of short descents from its neighbours, see `pidalab.optimal.curves`: within a line's width of
    what a search of its own finds, in a fraction of the time.

    Examples
    --------
    >>> import pidalab
    >>> print(pidalab.trade_off(pidalab.lags(3, delay=1.0), [1.6], noise_gains=[1.0, 3.0], kinds=["PI"], rules=[]))
    Process(num=[1], den=[1, 3, 3, 1], delay=1): least IAE of a load step
    Ms        noise gain        PI
    1.6                1     4.596
    1.6                3     4.596
    """
    from pidalab.optimal.curves import find_curves

    require_no_zero_at_origin("process", process)
    for kind in kinds:
        _check.choice("kinds", kind, KINDS)
    levels = sorted(_check.real("ms", one, above=1.0) for one in ms)
    limits, sample_time = _noise(process, noise_gains, sample_time)
    wanted = sorted(dict.fromkeys(kinds), key=ORDER.__getitem__)
    found = {}
    if wanted:
        found = find_curves(
            process, ORDER[wanted[-1]], ms=levels, noise_gains=limits, sample_time=sample_time
        )
    places = [(k, m, n) for m in levels for k in wanted for n in limits]
    points = [
        TradeOffPoint(*place, design.iae, design)
        for place in places
        if (design := found.get((ORDER[place[0]], *place[1:]))) is not None
    ]
    asked = Requirements(ms=levels[0], noise_gain=limits[len(limits) // 2], sample_time=sample_time)
    horizon = first_horizon(process)
    rows = [measure_row(*one, process, sample_time, horizon) for one in designs(process, asked, rules)]
    return TradeOff(process, sample_time, tuple(points), tuple(row for row in rows if row.kind in wanted))


def _noise(
    process: Process, noise_gains: Sequence[float] | None, sample_time: float | None
) -> tuple[list[float], float]:
    """Limits of noise in ascending order, and its sample time, in ultimate gains and periods where none are given."""
    if noise_gains is None or sample_time is None:
        scale = noise_scale(process)
        noise_gains = [share * scale.gain for share in NOISE_SHARES] if noise_gains is None else noise_gains
        sample_time = scale.sample_time if sample_time is None else sample_time
    limits = sorted(_check.real("noise_gains", one, above=0.0) for one in noise_gains)
    return limits, _check.real("sample_time", sample_time, above=0.0)
