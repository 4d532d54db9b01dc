"""Compare PI, PID and PIDA for one plant: a table, a figure and a page."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pidalab._text import set_out
from pidalab.comparison.judging import DesignRow, measure_row, one_line
from pidalab.plant.doubts import with_doubts
from pidalab.plant.fitting import Fit, fit
from pidalab.plant.record import Record
from pidalab.plant.tuning import plants_within, tune
from pidalab.plant.writing import write_files
from pidalab.process import Process
from pidalab.rules import Design
from pidalab.rules.models import time_scale
from pidalab.rules.registry import ORDER

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SAFE = 2.001  # a design is called safe if its largest Ms with any plant is at most this
# Simulations have this length, in time scales of the process, or more if the loop settles later.
REPORT_HORIZON = 20.0
MEASURES = {  # for each measure of a row, its name in tables and its meaning
    "ms": ("Ms", "maximum sensitivity: by how much the loop amplifies disturbances at worst"),
    "ms_sampled": ("Ms sampled", "the same for the loop with the digital controller"),
    "ms_worst": ("worst Ms", "the largest Ms with any plant that the model allows"),
    "delay_margin": ("delay margin", "additional dead time at which the loop becomes unstable"),
    "iae_load": ("IAE load", "integral of the absolute error after a unit step of the load"),
    "iae_worst": ("worst IAE", "IAE load with the plant that has the worst Ms"),
    "price": ("price", "IAE divided by the IAE of a design for the model alone: the cost of robustness"),
    "peak": ("peak", "largest error after the step of the load"),
    "overshoot": ("overshoot %", "after a step of the set point"),
    "mks": ("max |CS|", "largest gain from measurement noise to u, over all frequencies"),
    "relative_noise": (
        "relative noise gain",
        "standard deviation of u, divided by that of the noise and by the ultimate gain",
    ),
}
REPORT_COLUMNS = {name: x for x, (name, _) in MEASURES.items()}
TUNED = ("iae_worst", "price", "ms_worst", "ms_sampled")  # `tune` provides these measures


@dataclass(frozen=True, eq=False, repr=False)
class Report:
    """Candidate controllers for one plant, tuned with the same limits.

    Attributes
    ----------
    process : Process
        The plant or its model.
    fit : Fit or None
        The fit, if the model comes from a record.
    ms : float
        The requested Ms.
    rows : tuple of DesignRow
        The candidates with designs, measures and responses.
    plants : tuple of Process
        Further plants within the uncertainty of the model.
    """

    process: Process
    fit: Fit | None
    ms: float
    rows: tuple[DesignRow, ...]
    plants: tuple[Process, ...]

    @property
    def doubts(self) -> tuple[str, ...]:
        """Reservations about record, model and designs. A doubt about only the PI and PID begins with "PI, PID: "."""
        known = (*self.fit.record.doubts, *self.fit.doubts) if self.fit else ()
        kinds: dict[str, list[str]] = {doubt: [] for doubt in known}
        designs = [(row, row.design) for row in self.rows if row.design is not None]
        for row, design in designs:
            incomplete = row.reason and (not row.applies or math.isnan(row.relative_noise))
            for doubt in (*design.info.get("doubts", ()), *([row.reason] if incomplete else [])):
                kinds.setdefault(doubt, []).append(row.kind)
        common = {0, len(designs)}
        named = ("" if len(names) in common else f"{', '.join(names)}: " for names in kinds.values())
        return tuple(name + doubt for name, doubt in zip(named, kinds, strict=True))

    @property
    def verdict(self) -> str:
        """Comparison of each kind with the preceding kind: IAE, noise gain and worst Ms."""
        return "\n".join(
            f"{new.kind} against {old.kind}: IAE {new.iae / old.iae:.2f} times, relative noise gain "
            f"{new.relative_noise / old.relative_noise:.2f} times"
            + ("" if math.isnan(new.ms_worst) else f", worst Ms {new.ms_worst:.2f} vs {old.ms_worst:.2f}")
            for old, new in pairwise(row for row in self.rows if row.applies)
        )

    @property
    def safety(self) -> str:
        """For each kind, a sentence on the safety of the loop."""
        return "\n".join(f"{row.kind}: {self._safe(row)}" for row in self.rows)

    def _safe(self, row: DesignRow) -> str:
        if not row.applies:
            return f"no controller, since {row.reason}"
        model = f"Ms {row.ms:.2f} with the model"
        if not self.plants:
            return f"{model}; other plants were not considered (give a spread)"
        unsafe = "not safe" if math.isinf(row.ms_worst) else "close to instability"
        word = "safe" if row.ms_worst <= SAFE else unsafe
        return f"{word}, worst Ms {row.ms_worst:.2f} with {len(self.plants)} plants that the model allows, {model}"

    def __repr__(self) -> str:
        return f"Report({', '.join(row.kind for row in self.rows)}; Ms at most {self.ms:g})"

    def __str__(self) -> str:
        lines = [f"{self.process!r}: Ms at most {self.ms:g}", *self.safety.splitlines()]
        kinds, *table = self.table()
        lines += [set_out(row[:-1], (20, *[11] * (len(kinds) - 2))) for row in (kinds, *table)]
        return with_doubts("\n".join([*lines, *self.verdict.splitlines()]), self.doubts)

    def _repr_html_(self) -> str:
        head, *rows = ([html.escape(cell) for cell in row] for row in self.table())
        lines = ["<tr>" + "".join(f"<th>{cell}</th>" for cell in head) + "</tr>"]
        lines += ["<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows]
        reasons = (f"<p>{html.escape(f'{row.kind}: {row.reason}')}</p>" for row in self.rows if row.reason)
        return "<table>" + "\n".join(lines) + "</table>" + "".join(reasons)

    def table(self) -> list[list[str]]:
        """Return a table of measures. Each row has a name, a value for each kind, and the meaning.

        Returns
        -------
        list of list of str

        Examples
        --------
        >>> import pidalab
        >>> pidalab.report(pidalab.lags(3, delay=1.0), kinds=("PI",), rule="simc").table()[1][:2]
        ['Ms', '1.527']
        """
        lines = [["", *(row.kind for row in self.rows), ""]]
        for x, (name, meaning) in MEASURES.items():
            values = [getattr(row, x) for row in self.rows]
            if not all(map(math.isnan, values)):
                lines.append([name, *("-" if math.isnan(v) else f"{v:.4g}" for v in values), meaning])
        return lines

    def plot(self) -> Figure:
        """Draw load and set-point responses with their control signals, the gain from noise to u, and Nyquist curves.

        Returns
        -------
        matplotlib.figure.Figure
            Six panels.

        Raises
        ------
        ValueError
            If there is no candidate to draw.

        Examples
        --------
        >>> import pidalab
        >>> report = pidalab.report(pidalab.lags(3, delay=1.0), kinds=("PI",), rule="simc")
        >>> len(report.plot().axes)
        6
        """
        from pidalab.plant.page import figure

        return figure(self.process, self.ms, self.rows, self.plants)

    def html(self, path: str | Path, title: str = "PI, PID and PIDA") -> Path:
        """Write a page that needs no other file.

        Parameters
        ----------
        path : str or pathlib.Path
            File to write.
        title : str, optional
            Heading of the page.

        Returns
        -------
        pathlib.Path
            The file.

        Examples
        --------
        >>> import pathlib, pidalab, tempfile
        >>> report = pidalab.report(pidalab.lags(3, delay=1.0), kinds=("PI",), rule="simc")
        >>> "<svg" in report.html(pathlib.Path(tempfile.mkdtemp(), "report.html")).read_text(encoding="utf-8")
        True
        """
        path = Path(path)
        return write_files(path.parent, {path.name: self.page(title)}, replace=True)[0]

    def page(self, title: str, *sections: Sequence[tuple[str, str]]) -> str:
        """Return the page that `html` writes.

        Parameters
        ----------
        title : str
            Heading of the page.
        *sections : sequence of (str, str), optional
            Two lists of headings and texts. By default those that the method `sections` returns.

        Returns
        -------
        str

        Examples
        --------
        >>> import pidalab
        >>> report = pidalab.report(pidalab.lags(3, delay=1.0), kinds=("PI",), rule="simc")
        >>> report.page("Level").count("<h1>Level</h1>")
        1
        """
        from pidalab.plant.page import page

        first, last = sections or self.sections()
        return page(title, self._repr_html_(), self.plot(), first, last)

    def sections(self) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
        """Return two lists of headings and texts: `first` is shown before the figure, and `last` is folded below it.

        Returns
        -------
        first, last : list of pair of str

        Examples
        --------
        >>> import pidalab
        >>> report = pidalab.report(pidalab.lags(3, delay=1.0), kinds=("PI",), rule="simc")
        >>> [head for head, text in report.sections()[0]]
        ['Safe?', 'PI', 'Doubts']
        """
        first = [("Safe?", self.safety)]
        first += [(row.kind, str(row.design.controller)) for row in self.rows if row.design is not None]
        if self.verdict:
            first.append(("Gains and costs of each kind", self.verdict))
        first.append(("Doubts", "\n".join(self.doubts) or "none found"))
        last = [("Model", f"{self.process!r}" + (f"\n{self.fit}" if self.fit else ""))]
        return first, last + ([("Record", str(self.fit.record))] if self.fit else [])


def report(
    model: Process | Fit | Record,
    *,
    ms: float = 1.6,
    noise_gain: float | None = None,
    sample_time: float | None = None,
    rule: str = "optimal",
    spread: float | None = None,
    output_filter: Any = None,
    kinds: Sequence[str] = ("PI", "PID", "PIDA"),
    ms_worst: float = 2.0,
) -> Report:
    """Tune PI, PID and PIDA for one plant with the same limits, and compare them.

    Parameters
    ----------
    model : Process, Fit or Record
        The plant, a fit of a record, or the record.
    ms, noise_gain, sample_time, rule, spread, output_filter : optional
        As for `pidalab.tune`.
    kinds : sequence of str, optional
        Kinds of controllers.
    ms_worst : float, optional
        As for `pidalab.tune`.

    Returns
    -------
    Report
        Candidates in the order of `kinds`. If a kind cannot be tuned, its row contains the error message.

    Raises
    ------
    TypeError, ValueError
        As for `pidalab.identification.fit` and `pidalab.tune`. A ValueError of `tune` is raised only if no kind can be
        tuned.

    Examples
    --------
    >>> import pidalab
    >>> report = pidalab.report(pidalab.lags(3, delay=1.0), rule="simc")
    >>> print(report.rows[0].kind, report.rows[1].iae < report.rows[0].iae, report.rows[2].reason)
    PI True kind must be 'PI' or 'PID' for the rule 'simc', found 'PIDA'
    """
    wanted = [kinds] if isinstance(kinds, str) else list(kinds)
    if not wanted or not all(isinstance(kind, str) and kind in ORDER for kind in wanted):
        raise ValueError(f"kinds must be some of 'PI', 'PID' and 'PIDA', found {kinds!r}")
    fitted = fit(model) if isinstance(model, Record) else model
    options: dict[str, Any] = {"ms": ms, "noise_gain": noise_gain, "sample_time": sample_time, "rule": rule}
    options |= {"spread": spread, "output_filter": output_filter, "ms_worst": ms_worst}
    rows = [tuned_row(rule, kind, fitted, fitted, **options) for kind in wanted]
    if all(row.design is None for row in rows):
        raise ValueError(rows[0].reason)
    process, known = (fitted.process, fitted) if isinstance(fitted, Fit) else (fitted, None)
    return Report(process, known, ms, tuple(rows), tuple(plants_within(fitted, process, spread)))


def tuned_row(name: str, kind: str, plant: Process | Fit, model: Process | Fit, **options: Any) -> DesignRow:
    """Tune a controller for `plant`, and measure it with `model`. If `tune` fails, the row has the error message."""
    try:
        design = tune(plant, kind, **options)
    except ValueError as refusal:
        return DesignRow(name, kind, reason=one_line(refusal))
    return measure_candidate(design, name, kind, model)


def measure_candidate(design: Design, rule: str, kind: str, model: Process | Fit) -> DesignRow:
    """Measure a design in a loop with the model."""
    process = model.process if isinstance(model, Fit) else model
    row = measure_row(rule, kind, lambda: design, process, None, REPORT_HORIZON * time_scale(process))
    return row._replace(**{name: design.info.get(name, math.nan) for name in TUNED}) if row.applies else row
