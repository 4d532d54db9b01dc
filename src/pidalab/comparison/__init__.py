"""Every rule of the library on one process, and how far each stays from the best.

A rule gets the model that its authors start from: the process itself, its reduction of first or second order, the three
points of its step response, or an integrator with dead time. All are judged on the process itself.
"""

from __future__ import annotations

import html
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pidalab import _check
from pidalab._check import Array
from pidalab.comparison.fairness import at_equal_terms
from pidalab.loop import Loop
from pidalab.process import Process, require_gain
from pidalab.rules import Design
from pidalab.rules._sampled import sampled_noise
from pidalab.rules.registry import KINDS, RULES, Limits, Rule, find
from pidalab.rules.starting_models import StartingModels, time_scale

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MARKS = {"PI": "o", "PID": "s", "PIDA": "D"}
PERIODS = 12.0  # ultimate periods of a first response
HEAD = ("rule", "kind", "IAE load", "IAE set pt", "Ms", "max |CS|", "noise gain", "TV(u) load", "delay m.")


class Row(NamedTuple):
    """One rule on the process; a measure that could not be had is NaN, and `reason` says why."""

    rule: str
    kind: str
    iae_load: float
    iae_setpoint: float
    ms: float
    mks: float
    noise_gain: float
    tv: float
    delay_margin: float
    reason: str
    design: Design | None

    @property
    def applies(self) -> bool:
        """Whether there is a design and its loop with the process is stable."""
        return math.isfinite(self.ms)


@dataclass(frozen=True)
class Comparison:
    """Result of `compare`: one row for each rule and kind, then the optima.

    Attributes
    ----------
    process : Process
        What all were judged on.
    ms, noise_gain, sample_time : float
        The limits of the optima.
    rows : tuple of Row
        ``rule``, ``kind``; ``iae_load`` and ``iae_setpoint`` of unit steps; ``ms``; ``mks``, the largest gain from
        noise to u; ``noise_gain`` of the sampled loop; ``tv``, total variation of u after the load step;
        ``delay_margin``; ``reason``, why the rule does not apply or a measure is missing; ``design``.
    """

    process: Process
    ms: float
    noise_gain: float
    sample_time: float
    rows: tuple[Row, ...]

    def keeps(self, row: Row) -> bool:
        """Whether a row keeps both limits, to 0.1 %.

        Parameters
        ----------
        row : Row
            Of this comparison.

        Returns
        -------
        bool
            False also where the noise gain is not known.

        Examples
        --------
        >>> import pidalab
        >>> from pidalab.comparison import Row
        >>> row = Row("mine", "PI", 4.0, 5.0, 1.5, 1.0, 0.5, 1.1, 5.0, "", None)
        >>> table = pidalab.Comparison(pidalab.lags(3), ms=1.6, noise_gain=10.0, sample_time=0.01, rows=(row,))
        >>> table.keeps(row)
        True
        """
        return row.ms <= self.ms * 1.001 and row.noise_gain <= self.noise_gain * 1.001

    def __str__(self) -> str:
        lines = [f"{self.process!r}: limits Ms = {self.ms:g}, noise gain = {self.noise_gain:g}", _line(HEAD)]
        for row in self.rows:
            lines.append(
                f"{_line(_cells(row))}  {self._note(row)}".rstrip()
                if row.applies
                else f"{row.rule:27}{row.kind:5} {row.reason}"
            )
        return "\n".join(lines)

    def _note(self, row: Row) -> str:
        return "; ".join(filter(None, ("keeps both limits" * self.keeps(row), row.reason)))

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{html.escape(name)}</th>" for name in (*HEAD, "note"))
        body = []
        for row in self.rows:
            cells = "".join(f"<td>{html.escape(cell)}</td>" for cell in (*_cells(row), self._note(row)))
            body.append(f"<tr>{cells}</tr>")
        return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(body)}</tbody></table>"

    def plot(self) -> Figure:
        """Draw the IAE of a load step for every stable row, filled where both limits are kept.

        Returns
        -------
        matplotlib.figure.Figure
            One panel, the best at the top.

        Examples
        --------
        >>> import pidalab
        >>> from pidalab.comparison import Row
        >>> row = Row("mine", "PI", 4.0, 5.0, 1.5, 1.0, 0.5, 1.1, 5.0, "", None)
        >>> table = pidalab.Comparison(pidalab.lags(3), ms=1.6, noise_gain=10.0, sample_time=0.01, rows=(row,))
        >>> table.plot().axes[0].get_xlabel()
        'IAE of a unit load step (y × time)'
        """
        import matplotlib.pyplot as plt

        shown = sorted((row for row in self.rows if row.applies), key=lambda row: -row.iae_load)
        figure, ax = plt.subplots(figsize=(6.4, 1.2 + 0.22 * len(shown)), layout="constrained")
        for kind, colour in zip(KINDS, ("C0", "C1", "C2"), strict=True):
            for kept in (True, False):
                places = [i for i, row in enumerate(shown) if row.kind == kind and self.keeps(row) is kept]
                label = f"{kind}, {'keeps both limits' if kept else 'does not'}"
                face = colour if kept else "none"
                iae = [shown[i].iae_load for i in places]
                if places:
                    ax.plot(iae, places, MARKS[kind], color=colour, markerfacecolor=face, label=label)
        ax.set_yticks(range(len(shown)), [f"{row.rule} {row.kind}" for row in shown], fontsize=9)
        ax.set(xscale="log", xlabel="IAE of a unit load step (y × time)")
        ax.grid(alpha=0.3)
        figure.legend(loc="outside upper left", ncols=2, fontsize=9)
        return figure


def compare(
    process: Process,
    ms: float = 1.6,
    noise_gain: float = 10.0,
    sample_time: float = 0.01,
    rules: Iterable[str] | None = None,
) -> Comparison:
    """Judge every rule of the library on a process, beside the best PI, PID and PIDA.

    Parameters
    ----------
    process : Process
        The plant.
    ms : float, optional
        Largest maximum sensitivity of the optima, above 1; haalman and the optima use it, other rules do not know it.
    noise_gain : float, optional
        Largest standard deviation of u per unit of that of white measurement noise; the magnitude optimum and the
        optima use it.
    sample_time : float, optional
        Sample time of that noise, above 0.
    rules : iterable of str, optional
        Names of the registry, `pidalab.rules.registry`, and "optimal". By default the optima and all rules but those of
        Chien, Hrones and Reswick; the entry of a rule says whether it is compared by default.

    Returns
    -------
    Comparison
        A rule that does not apply is a row with its message.

    Raises
    ------
    TypeError, ValueError
        For something else than a process, and limits out of range.

    Examples
    --------
    >>> import pidalab
    >>> table = pidalab.compare(pidalab.ipdt(0.1, delay=1.0), noise_gain=10.0, sample_time=0.05)
    >>> print(min((row for row in table.rows if table.keeps(row)), key=lambda row: row.iae_load).kind)
    PIDA
    """
    require_gain("process", process)
    ms = _check.real("ms", ms, above=1.0)
    noise_gain = _check.real("noise_gain", noise_gain, above=0.0)
    sample_time = _check.real("sample_time", sample_time, above=0.0)
    limits = Limits(ms, noise_gain, sample_time)
    rows = [judged(*candidate, process, sample_time) for candidate in designs(process, limits, rules)]
    return Comparison(process, ms, noise_gain, sample_time, tuple(rows))


def designs(
    process: Process, limits: Limits, rules: Iterable[str] | None = None
) -> Iterator[tuple[str, str, Callable[[], Design]]]:
    """Yield name, kind and the call that designs, for every rule, then for the optima.

    Parameters
    ----------
    process : Process
        The plant.
    limits : Limits
        As for `compare`, with all three numbers.
    rules : iterable of str, optional
        As for `compare`.

    Yields
    ------
    tuple
        The call raises ValueError where the rule does not apply.

    Examples
    --------
    >>> import pidalab
    >>> from pidalab.comparison import designs
    >>> from pidalab.rules.registry import Limits
    >>> [(rule, kind) for rule, kind, _ in designs(pidalab.lags(3), Limits(1.6), ["simc"])]
    [('simc', 'PI'), ('simc', 'PID')]
    """
    from pidalab import optimal

    names = (
        [name for name, rule in RULES.items() if rule.compared] + ["optimal"]
        if rules is None
        else list(rules)
    )
    entries = [find(name, "optimal") for name in names if name != "optimal"]
    models = StartingModels(process)

    def design(rule: Rule, kind: str) -> Design:
        return rule.tune(getattr(models, rule.models[kind]), kind, *limits)

    for rule in entries:
        for kind in rule.kinds:
            yield rule.name, kind, partial(design, rule, kind)
    if "optimal" in names:
        ms, noise_gain, sample_time = limits
        for order, kind in enumerate(KINDS):
            search = partial(optimal.load, process, order, ms, None, noise_gain, sample_time)
            yield "optimal", kind, search


def judged(rule: str, kind: str, make: Callable[[], Design], process: Process, sample_time: float) -> Row:
    """Make a design and measure its loop with the process.

    Parameters
    ----------
    rule, kind : str
        Names of the row.
    make : callable
        Returns the design, or raises ValueError where the rule does not apply.
    process : Process
        The plant.
    sample_time : float
        Sample time of the noise.

    Returns
    -------
    Row
        Its reason says what could not be had.

    Examples
    --------
    >>> import pidalab
    >>> from pidalab.comparison import judged
    >>> process = pidalab.lags(3, delay=1.0)
    >>> row = judged("simc", "PI", lambda: pidalab.rules.classical.simc(process, "PI"), process, sample_time=0.05)
    >>> print(f"{row.iae_load:.2f} {row.ms:.2f}")
    5.36 1.53
    """
    try:
        return _measured(rule, kind, make(), process, sample_time)
    except (ValueError, ArithmeticError) as refusal:
        return _without(rule, kind, str(refusal))


# --- judging ----------------------------------------------------------------------------------------------------------


def _measured(rule: str, kind: str, design: Design, process: Process, sample_time: float) -> Row:
    """Measure the loop of a design with the process itself."""
    from pidalab.robustness.control import max_control_sensitivity
    from pidalab.robustness.margins import margins
    from pidalab.simulation.exact import load_response, step_response
    from pidalab.simulation.settling import settled

    loop = design.loop(process)
    found = margins(loop)
    if not found.stable:
        return _without(rule, kind, "the loop with the process is unstable", design)
    horizon = _first_horizon(process)
    load, setpoint = (settled(simulate, loop, horizon) for simulate in (load_response, step_response))
    noise, reason = sampled_noise(loop, sample_time)
    mks = max_control_sensitivity(loop)[0]
    iae, iae_setpoint = (response.iae(horizon=math.inf) for response in (load, setpoint))
    return Row(rule, kind, iae, iae_setpoint, found.ms, mks, noise, load.tv("u"), found.dm, reason, design)


def _first_horizon(process: Process) -> float:
    """The end of the first response that is tried: the pace of a good loop, which may be far from the plant's own."""
    from pidalab.reduction import ultimate_frequency

    try:
        return PERIODS * 2 * math.pi / ultimate_frequency(process)
    except ValueError:  # no gain makes it oscillate
        return 20.0 * time_scale(process)


def _without(rule: str, kind: str, reason: str, design: Design | None = None) -> Row:
    nan = math.nan
    return Row(rule, kind, nan, nan, nan, nan, nan, nan, nan, " ".join(reason.split()), design)


def _cells(row: Row) -> tuple[str, ...]:
    numbers = (row.iae_load, row.iae_setpoint, row.ms, row.mks, row.noise_gain, row.tv, row.delay_margin)
    return row.rule, row.kind, *("-" if math.isnan(x) else f"{x:.4g}" for x in numbers)


def _line(cells: tuple[str, ...]) -> str:
    rule, kind, *numbers = cells
    return f"{rule:27}{kind:5}" + "".join(f"{number:>11}" for number in numbers)
