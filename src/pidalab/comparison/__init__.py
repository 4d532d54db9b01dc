"""Compare every rule of the library with the optima on one process.

Each rule gets the kind of model for which it was made (see `pidalab.rules.registry`). All designs are evaluated with
the process itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial

from pidalab._text import KINDS
from pidalab.comparison.fairness import at_equal_terms
from pidalab.comparison.judging import DesignRow, html_table, measure_row, text_table
from pidalab.process import Process, require_no_zero_at_origin
from pidalab.relative_noise import noise_scale
from pidalab.requirements import Requirements
from pidalab.rules import Design
from pidalab.rules.models import StartingModels, time_scale
from pidalab.rules.registry import RULES, Rule, find

PERIODS = 12.0  # length of the first simulation, in ultimate periods of the plant (see `first_horizon`)
RELATIVE_NOISE_GAIN = 1.5  # default limit of the relative noise gain
COMPARISON_COLUMNS = {
    "IAE load": "iae_load",
    "IAE set pt": "iae_setpoint",
    "Ms": "ms",
    "relative noise gain": "relative_noise",
    "TV(u) load": "tv",
    "delay m.": "delay_margin",
}
TEXT_WIDTHS = {"rule": 27, "kind": 5}


@dataclass(frozen=True)
class Comparison:
    """Result of `compare`, with one row for each rule and kind of controller, followed by the optima.

    Attributes
    ----------
    process : Process
        The plant.
    ms, noise_gain, sample_time : float
        Limits of Ms and noise gain (in units of u per unit of y) for the optima, and the sample time of the noise.
    rows : tuple of DesignRow
        Measured designs.
    """

    process: Process
    ms: float
    noise_gain: float
    sample_time: float
    rows: tuple[DesignRow, ...]

    def keeps(self, row: DesignRow) -> bool:
        """Return True if a row keeps the limits of Ms and noise gain, with a tolerance of 0.1 %.

        Parameters
        ----------
        row : DesignRow
            Row of this comparison.

        Returns
        -------
        bool
            False if a limit is exceeded, or if Ms or the noise gain is NaN.

        Examples
        --------
        >>> import pidalab
        >>> from pidalab.comparison import DesignRow
        >>> row = DesignRow("mine", "PI", 4.0, 5.0, 1.5, 1.0, 0.5, 1.1, 5.0, "", None)
        >>> table = pidalab.Comparison(pidalab.lags(3), ms=1.6, noise_gain=10.0, sample_time=0.01, rows=(row,))
        >>> table.keeps(row)
        True
        """
        return row.ms <= self.ms * 1.001 and row.noise_gain <= self.noise_gain * 1.001

    def __str__(self) -> str:
        noise = f"noise gain = {self.noise_gain:.4g}, with a sample every {self.sample_time:.4g}"
        head = f"{self.process!r}: limits Ms = {self.ms:g}, {noise}"
        return "\n".join([head, *text_table(self.rows, TEXT_WIDTHS, COMPARISON_COLUMNS, 11, self._note)])

    def _note(self, row: DesignRow) -> str:
        return "; ".join(filter(None, ("keeps both limits" * self.keeps(row), row.reason)))

    def _repr_html_(self) -> str:
        return html_table(self.rows, tuple(TEXT_WIDTHS), COMPARISON_COLUMNS, self._note)


def compare(
    process: Process,
    *,
    ms: float = 1.6,
    noise_gain: float | None = None,
    sample_time: float | None = None,
    rules: Iterable[str] | None = None,
) -> Comparison:
    """Compare every rule of the library with the optimal PI, PID and PIDA on a process.

    Parameters
    ----------
    process : Process
        The plant.
    ms : float, optional
        Limit of Ms, above 1, for the optima and the rule haalman. Other rules ignore it.
    noise_gain : float, optional
        Limit of the noise gain, in units of u per unit of y, for the optima and the magnitude optimum. By default 1.5
        times the ``gain`` of `pidalab.noise_scale`.
    sample_time : float, optional
        Sample time of the noise, above 0. By default the ``sample_time`` of `pidalab.noise_scale`. It does not affect
        the relative noise gain in the table.
    rules : iterable of str, optional
        Names from `pidalab.rules.registry`, or "optimal". By default the optima and all rules except improved simc and
        the rules of Chien, Hrones and Reswick.

    Returns
    -------
    Comparison
        If a rule does not apply, its row contains the error message.

    Raises
    ------
    TypeError, ValueError
        If `process` is not a process, if a limit is out of range, or if the name of a rule is unknown.

    Examples
    --------
    >>> import pidalab
    >>> table = pidalab.compare(pidalab.ipdt(0.1, delay=1.0))
    >>> print(min((row for row in table.rows if table.keeps(row)), key=lambda row: row.iae_load).kind)
    PIDA
    """
    require_no_zero_at_origin("process", process)
    if noise_gain is None or sample_time is None:
        scale = noise_scale(process)
        noise_gain = RELATIVE_NOISE_GAIN * scale.gain if noise_gain is None else noise_gain
        sample_time = scale.sample_time if sample_time is None else sample_time
    limits = Requirements(ms=ms, noise_gain=noise_gain, sample_time=sample_time)
    horizon = first_horizon(process)
    rows = [measure_row(*design, process, sample_time, horizon) for design in designs(process, limits, rules)]
    return Comparison(process, limits.ms, noise_gain, sample_time, tuple(rows))


def designs(
    process: Process, requirements: Requirements, rules: Iterable[str] | None = None
) -> Iterator[tuple[str, str, Callable[[], Design]]]:
    """Yield a name, a kind and a design function for each kind of each rule, and then for each optimum.

    Parameters
    ----------
    process : Process
        The plant.
    requirements : Requirements
        Limits for the rules and the optima: Ms, and the noise gain with its sample time.
    rules : iterable of str, optional
        As for `compare`.

    Yields
    ------
    tuple
        Name, kind, and a function that returns the design or raises ValueError if the rule does not apply.

    Examples
    --------
    >>> import pidalab
    >>> from pidalab.comparison import designs
    >>> from pidalab.requirements import Requirements
    >>> [(rule, kind) for rule, kind, _ in designs(pidalab.lags(3), Requirements(ms=1.6), ["simc"])]
    [('simc', 'PI'), ('simc', 'PID')]
    """
    from pidalab import optimal

    usual = [name for name, rule in RULES.items() if rule.compared]
    names = [*usual, "optimal"] if rules is None else list(rules)
    entries = [find(name, "optimal") for name in names if name != "optimal"]
    models = StartingModels(process)

    def design(rule: Rule, kind: str) -> Design:
        return rule.tune(getattr(models, rule.models[kind]), kind, requirements)

    for rule in entries:
        for kind in rule.kinds:
            yield rule.name, kind, partial(design, rule, kind)
    if "optimal" in names:
        for order, kind in enumerate(KINDS):
            yield "optimal", kind, partial(optimal.least_iae, process, order, requirements)


def first_horizon(process: Process) -> float:
    """Return the length of the first simulation, estimated from the time scale of the plant."""
    try:
        return PERIODS * noise_scale(process).period
    except ValueError:
        return PERIODS * time_scale(process)
