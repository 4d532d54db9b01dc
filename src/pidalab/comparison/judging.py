"""Measure the loop of a design and a plant, and format the measures as a text or HTML table."""

from __future__ import annotations

import html
import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from pidalab._text import set_out
from pidalab.loop import Loop
from pidalab.process import Process
from pidalab.relative_noise import noise_scale, sampled_noise
from pidalab.response import Response
from pidalab.robustness.margins import margins, max_control_sensitivity
from pidalab.rules import Design
from pidalab.simulation.exact import load_response, simulate_until_settled, step_response


class DesignRow(NamedTuple):
    """Measures of a design on a plant. A measure that could not be computed is NaN.

    Attributes
    ----------
    rule, kind : str
        Name of the rule, and "PI", "PID" or "PIDA".
    iae_load, iae_setpoint : float
        IAE of unit steps of the load and of the set point.
    ms : float
        Maximum sensitivity.
    mks : float
        Largest gain from noise to u at any frequency.
    noise_gain : float
        Noise gain with sampled white noise.
    tv : float
        Total variation of u after the load step.
    delay_margin : float
        Delay margin, in the unit of time of the plant.
    reason : str
        Reason for a missing design or measure, or a remark on how the noise gain was measured.
    design : Design or None
        The design. None if the rule does not apply or a measurement raised an error. A design with an unstable loop
        is kept.
    peak : float
        Largest deviation of the output after the load step.
    overshoot : float
        Overshoot after the step of the set point, in per cent.
    load, setpoint : Response or None
        Responses to unit steps of the load and of the set point.
    iae_worst, ms_worst : float
        A design can also be tested on plants that differ from the model. `ms_worst` is the largest Ms on these plants.
        For a digital controller, Ms of the sampled loop is used. `iae_worst` is the IAE with the plant that gives
        `ms_worst`.
    price : float
        IAE, divided by the IAE of a design for which `ms_worst` is not limited.
    ms_sampled : float
        Maximum sensitivity of the digital loop with the model.
    relative_noise : float
        Relative noise gain, see `pidalab.relative_noise_gain`.
    """

    rule: str
    kind: str
    iae_load: float = math.nan
    iae_setpoint: float = math.nan
    ms: float = math.nan
    mks: float = math.nan
    noise_gain: float = math.nan
    tv: float = math.nan
    delay_margin: float = math.nan
    reason: str = ""
    design: Design | None = None
    peak: float = math.nan
    overshoot: float = math.nan
    load: Response | None = None
    setpoint: Response | None = None
    iae_worst: float = math.nan
    ms_worst: float = math.nan
    price: float = math.nan
    ms_sampled: float = math.nan
    relative_noise: float = math.nan

    @property
    def applies(self) -> bool:
        """Return True if there is a design and its loop with the plant is stable."""
        return math.isfinite(self.ms)

    @property
    def iae(self) -> float:
        """IAE of the load step."""
        return self.iae_load


def measure_row(
    rule: str,
    kind: str,
    make: Callable[[], Design],
    process: Process,
    sample_time: float | None,
    horizon: float,
) -> DesignRow:
    """Make a design and measure its loop with a process.

    Parameters
    ----------
    rule, kind : str
        Name of the rule, and kind of controller.
    make : callable
        Function that returns the design, or raises ValueError if the rule does not apply.
    process : Process
        The plant.
    sample_time : float or None
        Sample time of the noise. If it is None, the noise gain is not computed.
    horizon : float
        Length of the first simulation. It is doubled until the response has settled.

    Returns
    -------
    DesignRow

    Examples
    --------
    >>> import pidalab
    >>> from pidalab.comparison.judging import measure_row
    >>> process = pidalab.lags(3, delay=1.0)
    >>> design = pidalab.rules.classical.simc(process, "PI")
    >>> row = measure_row("simc", "PI", lambda: design, process, sample_time=0.05, horizon=60.0)
    >>> print(f"{row.iae_load:.2f} {row.ms:.2f}")
    5.36 1.53
    """
    try:
        return _measure_loop(rule, kind, make(), process, sample_time, horizon)
    except (ValueError, ArithmeticError) as refusal:
        return DesignRow(rule, kind, reason=one_line(refusal))


def _measure_loop(
    rule: str, kind: str, design: Design, process: Process, sample_time: float | None, horizon: float
) -> DesignRow:
    loop = design.loop(process)
    loop_margins = margins(loop)
    if not loop_margins.stable:
        return DesignRow(rule, kind, reason="the loop with the process is unstable", design=design)
    load, setpoint = (
        simulate_until_settled(simulate, loop, horizon) for simulate in (load_response, step_response)
    )
    noise, relative, reason = _noise(loop, sample_time)
    return DesignRow(
        rule,
        kind,
        iae_load=load.iae(horizon=math.inf),
        iae_setpoint=setpoint.iae(horizon=math.inf),
        ms=loop_margins.ms,
        mks=max_control_sensitivity(loop)[0],
        noise_gain=noise,
        tv=load.tv("u"),
        delay_margin=loop_margins.dm,
        reason=reason,
        design=design,
        peak=abs(load.peak()),
        overshoot=setpoint.overshoot(),
        load=load,
        setpoint=setpoint,
        relative_noise=relative,
    )


def _noise(loop: Loop, sample_time: float | None) -> tuple[float, float, str]:
    """Return noise gain, relative noise gain, and a remark on the noise."""
    noise, reason = (math.nan, "") if sample_time is None else sampled_noise(loop, sample_time)
    try:
        scale = noise_scale(loop.process)
    except ValueError:  # The plant has no time scale.
        return noise, math.nan, reason
    if sample_time == scale.sample_time:
        return noise, noise / scale.gain, reason
    relative, why = sampled_noise(loop, scale.sample_time)
    return noise, relative / scale.gain, reason or why


def one_line(refusal: object) -> str:
    """Return a message without line breaks."""
    return " ".join(str(refusal).split())


# --- tables -----------------------------------------------------------------------------------------------------------

Notes = Callable[[DesignRow], str]


def text_table(
    rows: Sequence[DesignRow],
    names: Mapping[str, int],
    columns: Mapping[str, str],
    width: int,
    notes: Notes = lambda row: "",
) -> list[str]:
    """Return the heading and the rows of a table as lines of text.

    `names` maps the attributes in the left columns to their widths in characters. `columns` maps the headings of the
    other columns to attributes. These columns have at least `width` characters.
    """
    widths = [*names.values(), *(max(width, len(heading) + 2) for heading in columns)]
    left = [name if len(names) > 1 else "" for name in names]
    lines = [set_out([*left, *columns], widths, len(names))]
    for row in rows:
        labels = [getattr(row, name) for name in names]
        cells, note = (_cells(row, columns), notes(row)) if row.applies else ([], row.reason)
        line = set_out([*labels, *cells], widths, len(names))
        if note:
            line = f"{line:<{sum(widths[: len(names) + len(cells)])}}  {note}"
        lines.append(line)
    return lines


def html_table(
    rows: Sequence[DesignRow], names: Sequence[str], columns: Mapping[str, str], notes: Notes = lambda row: ""
) -> str:
    """Return the rows as an HTML table, with a column of notes if any row has a note."""
    noted = any(map(notes, rows))
    heads = [*names, *columns, *(["note"] * noted)]
    body = []
    for row in rows:
        left = "".join(f"<td>{html.escape(getattr(row, name))}</td>" for name in names)
        cells = [*_cells(row, columns), *([notes(row)] * noted)] if row.applies else [row.reason]
        span = "" if row.applies else f" colspan='{len(heads) - len(names)}'"
        body.append(f"<tr>{left}{''.join(f'<td{span}>{html.escape(cell)}</td>' for cell in cells)}</tr>")
    head = "".join(f"<th scope='col'>{html.escape(name)}</th>" for name in heads)
    return f"<table class='dataframe'><thead><tr>{head}</tr></thead><tbody>{''.join(body)}</tbody></table>"


def _cells(row: DesignRow, columns: Mapping[str, str]) -> list[str]:
    numbers = [getattr(row, name) for name in columns.values()]
    return ["-" if math.isnan(x) else f"{x:.4g}" for x in numbers]
