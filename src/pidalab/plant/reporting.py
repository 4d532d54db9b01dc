"""Three candidates for one plant, PI, PID and PIDA, side by side: a table, a figure, a page to hand on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pidalab.comparison.judging import DesignRow, html_table, measure_row, one_line, text_table
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

    from pidalab.plant.noise_curves import TradeOff

REPORT_HORIZON = 20.0  # of the first responses, in time scales of the process
REPORT_COLUMNS = {
    "IAE load": "iae_load",
    "worst IAE": "iae_worst",
    "price": "price",
    "peak": "peak",
    "overshoot %": "overshoot",
    "Ms": "ms",
    "worst Ms": "ms_worst",
    "Ms sampled": "ms_sampled",
    "max |CS|": "mks",
    "noise gain": "noise_gain",
    "delay margin": "delay_margin",
}


@dataclass(frozen=True, eq=False, repr=False)
class Report:
    """Rows on one plant, with the same limits.

    Attributes
    ----------
    process : Process
        The plant, or the model of it.
    fit : Fit or None
        Where the model comes from, if that was a record.
    ms : float
        The Ms that was requested.
    rows : tuple of DesignRow
        Each with its design, measures and responses.
    plants : tuple of Process
        Plants within the spread.
    """

    process: Process
    fit: Fit | None
    ms: float
    rows: tuple[DesignRow, ...]
    plants: tuple[Process, ...]

    @property
    def doubts(self) -> tuple[str, ...]:
        """What a user should know, of the record, of the model and of every design."""
        known = (*self.fit.record.doubts, *self.fit.doubts) if self.fit else ()
        kinds: dict[str, list[str]] = {doubt: [] for doubt in known}
        designs = [row for row in self.rows if row.design is not None]
        for row in designs:
            for doubt in row.design.info.get("doubts", ()) if row.design else ():
                kinds.setdefault(doubt, []).append(row.kind)
            if row.reason:
                kinds.setdefault(row.reason, []).append(row.kind)
        # what is true of all is said once
        alike = {0, len(designs)}
        return tuple(
            doubt if len(of) in alike else f"{', '.join(of)}: {doubt}" for doubt, of in kinds.items()
        )

    @property
    def verdict(self) -> str:
        """What each kind buys over the one before it, and what it costs, in a sentence each."""
        able = [row for row in self.rows if row.applies]
        return "\n".join(
            f"{new.kind} against {old.kind}: IAE {new.iae / old.iae:.2f} times, largest gain from noise to u "
            f"{new.mks / old.mks:.2f} times" + self._worst(old, new)
            for old, new in pairwise(able)
        )

    def _worst(self, old: DesignRow, new: DesignRow) -> str:
        return "" if math.isnan(new.ms_worst) else f", worst Ms {new.ms_worst:.2f} after {old.ms_worst:.2f}"

    def __repr__(self) -> str:
        return f"Report({', '.join(row.kind for row in self.rows)}; Ms at most {self.ms:g})"

    def __str__(self) -> str:
        columns = self._columns()
        lines = [f"{self.process!r}: Ms at most {self.ms:g}"]
        lines += text_table(self.rows, {"kind": 5}, columns, 13)
        return "\n".join([*lines, *self.verdict.splitlines(), *(f"doubt: {doubt}" for doubt in self.doubts)])

    def _repr_html_(self) -> str:
        return html_table(self.rows, ("kind",), self._columns())

    def _columns(self) -> dict[str, str]:
        """Columns in which any candidate has a number."""
        return {
            name: x
            for name, x in REPORT_COLUMNS.items()
            if any(not math.isnan(getattr(r, x)) for r in self.rows)
        }

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

    def html(
        self,
        path: str | Path,
        title: str = "PI, PID and PIDA",
        sections: Sequence[tuple[str, str]] | None = None,
    ) -> Path:
        """Write a page that needs no other file.

        Parameters
        ----------
        path : str or pathlib.Path
            Where to.
        title : str, optional
            Its heading.
        sections : sequence of (str, str), optional
            Headings and texts before the table; by default record, model, controllers, verdict and doubts.

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
        return write_files(path.parent, {path.name: self.page(title, sections)}, replace=True)[0]

    def page(
        self,
        title: str = "PI, PID and PIDA",
        sections: Sequence[tuple[str, str]] | None = None,
        traded: TradeOff | None = None,
    ) -> str:
        """Return the page that `html` writes.

        Parameters
        ----------
        title, sections : optional
            As for `html`.
        traded : TradeOff, optional
            The trade-off of the plant, of `pidalab.trade_off`, as a second figure.

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

        shown = self._sections() if sections is None else sections
        return page(title, self._repr_html_(), self.plot(), shown, traded)

    def plot_trade_off(self, traded: TradeOff | None = None) -> Figure:
        """Draw the least IAE over the noise gain at two limits of Ms, for PI, PID and PIDA, with rules as dots.

        Parameters
        ----------
        traded : TradeOff, optional
            By default `pidalab.trade_off` of the process of this report.

        Returns
        -------
        matplotlib.figure.Figure
            A panel for each limit of Ms.

        Raises
        ------
        ValueError
            As from `pidalab.trade_off`, and if no controller keeps the limits.

        Examples
        --------
        >>> import pidalab
        >>> process = pidalab.lags(3, delay=1.0)
        >>> traded = pidalab.trade_off(process, [1.6], noise_gains=[1.0, 3.0], kinds=["PI"])
        >>> len(pidalab.report(process, kinds=("PI",), rule="simc").plot_trade_off(traded).axes)
        1
        """
        from pidalab.plant.noise_curves import trade_off
        from pidalab.plant.page import trade_off_figure

        return trade_off_figure(trade_off(self.process) if traded is None else traded)

    def _sections(self) -> list[tuple[str, str]]:
        found = [("Record", str(self.fit.record))] if self.fit else []
        found.append(("Model", f"{self.process!r}" + (f"\n{self.fit}" if self.fit else "")))
        found += [(row.kind, str(row.design.controller)) for row in self.rows if row.design is not None]
        found += [(f"No {row.kind}", row.reason) for row in self.rows if not row.applies]
        return [("Verdict", self.verdict or "-"), *found, ("Doubts", "\n".join(self.doubts) or "none found")]


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
    """Tune PI, PID and PIDA for one plant with the same limits, and set them side by side.

    Parameters
    ----------
    model : Process, Fit or Record
        The plant, a model fitted to a record, or the record, which is fitted first.
    ms, noise_gain, sample_time, rule, spread, output_filter : optional
        As for `pidalab.tune`.
    kinds : sequence of str, optional
        Which controllers.
    ms_worst : float, optional
        As for `pidalab.tune`.

    Returns
    -------
    Report
        A kind that the rule does not make is a row with its message.

    Raises
    ------
    TypeError, ValueError
        As from `pidalab.tune` and `pidalab.identification.fit`, but for what concerns one kind alone.

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
    rows = []
    for kind in wanted:
        try:
            design = tune(fitted, kind, **options)
        except ValueError as refusal:
            rows.append(DesignRow(rule, kind, reason=one_line(refusal)))
        else:
            rows.append(measure_candidate(design, rule, kind, fitted, sample_time))
    if all(row.design is None for row in rows):
        raise ValueError(rows[0].reason)
    process, known = (fitted.process, fitted) if isinstance(fitted, Fit) else (fitted, None)
    return Report(process, known, ms, tuple(rows), tuple(plants_within(fitted, process, spread)))


# --- judging ----------------------------------------------------------------------------------------------------------

TUNED = ("iae_worst", "price", "ms_worst", "ms_sampled")  # what `tune` has measured of a design already


def measure_candidate(
    design: Design, rule: str, kind: str, model: Process | Fit, sample_time: float | None
) -> DesignRow:
    """Measure a design of `tune` with the model; the worst, and Ms of the digital controller, are in its `info`."""
    process = model.process if isinstance(model, Fit) else model
    row = measure_row(rule, kind, lambda: design, process, sample_time, REPORT_HORIZON * time_scale(process))
    if not row.applies:
        return row
    return row._replace(**{name: design.info.get(name, math.nan) for name in TUNED})
