"""Three candidates for one plant, PI, PID and PIDA, side by side: a table, a figure, a page to hand on."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab.identification import Fit, fit
from pidalab.loop import Loop
from pidalab.process import Process
from pidalab.record import Record
from pidalab.response import Response
from pidalab.rules import Design
from pidalab.rules._sampled import sampled_noise
from pidalab.rules.registry import ORDER
from pidalab.rules.starting_models import time_scale
from pidalab.tuning import plants_within, tune

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Candidate(NamedTuple):
    """One kind of controller on the plant; a measure that could not be had is NaN, and `reason` says why.

    Attributes
    ----------
    kind : str
        "PI", "PID" or "PIDA".
    iae, iae_worst : float
        IAE of a unit load step, with the model and the worst within the spread.
    price : float
        How many times the IAE is that of the design without a limit for the worst Ms.
    peak : float
        Largest deviation of the output after that step.
    overshoot : float
        After a step of the set point, in per cent.
    ms, ms_worst, ms_sampled : float
        Maximum sensitivity with the model, the worst within the spread (of the digital loop, if there is one), and that
        of the digital loop with the model.
    mks : float
        Largest gain from noise to u over all frequencies.
    noise_gain : float
        Standard deviation of u per unit of that of white, sampled noise.
    delay_margin : float
    reason : str
        Why there is no design, or why a measure is missing.
    design : Design or None
    load, setpoint : Response or None
        Responses to unit steps.
    """

    kind: str
    iae: float = math.nan
    iae_worst: float = math.nan
    price: float = math.nan
    peak: float = math.nan
    overshoot: float = math.nan
    ms: float = math.nan
    ms_worst: float = math.nan
    ms_sampled: float = math.nan
    mks: float = math.nan
    noise_gain: float = math.nan
    delay_margin: float = math.nan
    reason: str = ""
    design: Design | None = None
    load: Response | None = None
    setpoint: Response | None = None

    @property
    def applies(self) -> bool:
        """Whether there is a design and its loop with the model is stable."""
        return math.isfinite(self.ms)


COLUMNS = {
    "IAE load": "iae",
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
    """Candidates on one plant, with the same limits.

    Attributes
    ----------
    process : Process
        The plant, or the model of it.
    fit : Fit or None
        Where the model comes from, if that was a record.
    ms : float
        The Ms that was asked for.
    rows : tuple of Candidate
        Each with its design, measures and responses.
    plants : tuple of Process
        Plants within the spread.
    """

    process: Process
    fit: Fit | None
    ms: float
    rows: tuple[Candidate, ...]
    plants: tuple[Process, ...]

    @property
    def doubts(self) -> tuple[str, ...]:
        """What a user should know, of the record and of every design."""
        kinds: dict[str, list[str]] = {doubt: [] for doubt in (self.fit.record.doubts if self.fit else ())}
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

    def _worst(self, old: Candidate, new: Candidate) -> str:
        return "" if math.isnan(new.ms_worst) else f", worst Ms {new.ms_worst:.2f} after {old.ms_worst:.2f}"

    def __repr__(self) -> str:
        return f"Report({', '.join(row.kind for row in self.rows)}; Ms at most {self.ms:g})"

    def __str__(self) -> str:
        names = self._columns()
        lines = [
            f"{self.process!r}: Ms at most {self.ms:g}",
            f"{'':5}" + "".join(f"{name:>13}" for name in names),
        ]
        for row in self.rows:
            cells = "".join(f"{cell:>13}" for cell in _cells(row, names))
            lines.append(f"{row.kind:5}{cells if row.applies else '  ' + row.reason}")
        return "\n".join([*lines, *self.verdict.splitlines(), *(f"doubt: {doubt}" for doubt in self.doubts)])

    def _repr_html_(self) -> str:
        names = self._columns()
        head = "".join(f"<th scope='col'>{html.escape(name)}</th>" for name in ("kind", *names))
        body = []
        for row in self.rows:
            cells = _cells(row, names) if row.applies else [row.reason]
            span = "" if row.applies else f" colspan='{len(names)}'"
            inner = "".join(f"<td{span}>{html.escape(cell)}</td>" for cell in cells)
            body.append(f"<tr><td>{row.kind}</td>{inner}</tr>")
        return (
            f"<table class='dataframe'><thead><tr>{head}</tr></thead><tbody>{''.join(body)}</tbody></table>"
        )

    def _columns(self) -> list[str]:
        """Names of the columns in which any candidate has a number."""
        return [name for name, x in COLUMNS.items() if any(not math.isnan(getattr(r, x)) for r in self.rows)]

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
        from pidalab.reporting.page import figure

        return figure(self)

    def svg(self) -> str:
        """Write the figure as SVG, for a page.

        Returns
        -------
        str
            An ``svg`` element.

        Examples
        --------
        >>> import pidalab
        >>> pidalab.report(pidalab.lags(3, delay=1.0), kinds=("PI",), rule="simc").svg()[:4]
        '<svg'
        """
        from pidalab.reporting.page import svg

        return svg(self)

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
        from pidalab.reporting.page import page

        text = page(self, title, self._sections() if sections is None else sections)
        Path(path).write_text(text, encoding="utf-8")
        return Path(path)

    def _sections(self) -> list[tuple[str, str]]:
        found = [("Record", str(self.fit.record))] if self.fit else []
        found.append(("Model", f"{self.process!r}" + (f"\n{self.fit}" if self.fit else "")))
        found += [(row.kind, str(row.design.controller)) for row in self.rows if row.design is not None]
        found += [(f"No {row.kind}", row.reason) for row in self.rows if not row.applies]
        return [("Verdict", self.verdict or "-"), *found, ("Doubts", "\n".join(self.doubts) or "none found")]


def report(
    model: Process | Fit | Record,
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
    rows = []
    for kind in wanted:
        try:
            design = tune(fitted, kind, ms, noise_gain, sample_time, rule, spread, output_filter, ms_worst)
        except ValueError as refusal:
            rows.append(Candidate(kind, reason=" ".join(str(refusal).split())))
        else:
            rows.append(judged(design, kind, fitted, sample_time))
    if all(row.design is None for row in rows):
        raise ValueError(rows[0].reason)
    return gathered(fitted, ms, rows, spread)


def gathered(model: Process | Fit, ms: float, rows: Sequence[Candidate], spread: float | None) -> Report:
    """Return the report about candidates that have been judged."""
    process, fitted = (model.process, model) if isinstance(model, Fit) else (model, None)
    return Report(process, fitted, ms, tuple(rows), tuple(plants_within(model, process, spread)))


# --- judging ----------------------------------------------------------------------------------------------------------


def judged(design: Design, kind: str, model: Process | Fit, sample_time: float | None) -> Candidate:
    """Measure a design of `tune` with the model."""
    from pidalab.robustness.margins import margins
    from pidalab.simulation.exact import load_response, step_response
    from pidalab.simulation.settling import settled

    process = model.process if isinstance(model, Fit) else model
    loop = design.loop(process)
    found = margins(loop)
    if not found.stable:
        return Candidate(kind, reason="the loop with the model is unstable", design=design)
    load, setpoint = (
        settled(run, loop, 20.0 * time_scale(process)) for run in (load_response, step_response)
    )
    measured = {
        name: design.info.get(name, math.nan)
        for name in ("iae", "iae_worst", "price", "ms", "ms_worst", "mks")
    }
    noise, reason = math.nan, ""
    if sample_time is not None:
        noise, reason = sampled_noise(loop, sample_time)
        measured["ms_sampled"], lacking = _sampled(design, process, sample_time)
        reason = "; ".join(filter(None, (reason, lacking)))
    return Candidate(
        kind,
        **measured,
        peak=abs(load.peak()),
        overshoot=setpoint.overshoot(),
        noise_gain=noise,
        delay_margin=found.dm,
        reason=reason,
        design=design,
        load=load,
        setpoint=setpoint,
    )


def _sampled(design: Design, process: Process, sample_time: float) -> tuple[float, str]:
    """Ms of the loop with backward differences, or why there is none."""
    from pidalab.robustness.margins import margins

    try:
        digital = design.controller.discretise(sample_time, "backward", design.output_filter)
        found = margins(Loop(process, digital))
    except ValueError as refusal:
        return math.nan, f"no sampled Ms: {' '.join(str(refusal).split())}"
    return (found.ms, "") if found.stable else (math.inf, "the sampled loop is unstable: sample faster")


def _cells(row: Candidate, names: Sequence[str]) -> list[str]:
    numbers = [getattr(row, COLUMNS[name]) for name in names]
    return ["-" if math.isnan(x) else f"{x:.4g}" for x in numbers]
