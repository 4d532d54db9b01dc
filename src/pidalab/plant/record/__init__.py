"""Store a record of a plant. Find the steps of its input, the rest level, the noise and *doubts* (reservations)."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pidalab import _check
from pidalab._check import Array
from pidalab.plant.doubts import doubt, with_doubts
from pidalab.plant.record import cleaning
from pidalab.plant.record.cleaning import MOVING, Step, column
from pidalab.plant.record.reading import read_columns

LONG_INTERVAL = 5.0  # a sampling interval longer than this number of median intervals is a gap
FEW_LEVELS = 20  # a doubt is given if y has at most this number of different values
LONG = 0.1  # a doubt is given if a moving input stays at its largest or least value for more than this share of samples
SAME_PERIOD = 0.01  # largest accepted relative difference between `period` and the file's sampling interval
TIMES = re.compile(r"\W*(t|time|zeit|sec|seconds|min|clock|date|stamp|timestamp)(?![a-z])", re.IGNORECASE)
RAMP_SAMPLES = 5  # a doubt is given if the input takes more samples than this to change between two levels


class Noise(NamedTuple):
    """Measurement noise.

    Attributes
    ----------
    deviation : float
        Standard deviation, in the unit of y.
    correlation : float
        Correlation of neighbouring samples, after subtraction of a line if the output drifts. It is 0 for white noise
        and near 1 for a slow disturbance.
    samples : int
        Number of samples before the first change of the input, or 0 if there are fewer than 8. If it is 0, the
        deviation is computed from second differences of all samples.
    """

    deviation: float
    correlation: float
    samples: int


@dataclass(frozen=True, eq=False, init=False)
class Record:
    """Times, input and output of a plant. The data are cleaned, and `doubts` says how.

    Samples with a missing value are left out, and times are sorted. If several samples have the same time, their
    outputs are averaged and the last of their inputs is used. A time counter that restarts is continued. Nothing is
    smoothed or resampled.

    Parameters
    ----------
    t : array_like, shape (n,)
        Times in any unit and order, not necessarily at uniform intervals. All results are in the same unit of time.
    u : array_like, shape (n,)
        Input of the plant (such as a valve or heater), held from each sample to the next.
    y : array_like, shape (n,)
        Measured output.
    u_before : float, optional
        Input at which the plant was at rest before the record. Give it if the record begins with the step. By default
        it is the input of the earliest sample.
    outliers : {"drop", "keep"}, optional
        Treatment of outliers. These are outputs that are far from their neighbours, or that suddenly stay at exactly
        one value, as at the end of a sensor's range. "drop" leaves these samples out. "keep" uses them. By default a
        doubt lists them, and `identification.fit` refuses the record.
    rows : array_like, shape (n,), optional
        Row numbers of the samples in their file. Doubts and errors cite these numbers.

    Attributes
    ----------
    u_before : float
    steps : tuple of Step
        Changes of the input from one steady level to another. Empty if the input moves all the time.
    experiment : str
        The kind of experiment, in words.
    rest : float
        Output at rest, before the first change of the input.
    noise : Noise
    at_rest : bool
        True if the plant was at rest when the input first moved. This is assumed if the record begins with a step or
        `u_before` is given.
    outlier_note : str
        List of outliers. Empty if there are none, or if `outliers` is given.
    doubts : tuple of str
        Reservations about the record.
    time_unit, date : str
        Unit of the times, such as "s", and date of the first sample. Empty if the file does not contain them.

    Raises
    ------
    ValueError
        If there are fewer than 20 usable samples; if arrays differ in length; if the input or the output never changes;
        if the input is a clock or a copy of the output; or if the time goes back in more than 5 % of the samples.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> t = np.arange(0.0, 60.0, 0.5)
    >>> y = 20.0 + 10.0 * (1 - np.exp(-np.maximum(t - 13.0, 0.0) / 5.0))
    >>> record = pidalab.Record(t, np.where(t < 10.0, 40.0, 45.0), y)
    >>> record.steps
    (Step(time=10.0, before=40.0, after=45.0),)
    >>> print(record)
    120 samples over 59.5, every 0.5
    input: step from 40 to 45 at 10
    output: at rest 20 before the step, standard deviation of the noise 0
    """

    t: Array
    u: Array
    y: Array
    u_before: float
    steps: tuple[Step, ...]
    experiment: str
    rest: float
    noise: Noise
    at_rest: bool
    outlier_note: str
    doubts: tuple[str, ...]
    time_unit: str
    date: str

    def __init__(
        self,
        t: ArrayLike,
        u: ArrayLike,
        y: ArrayLike,
        *,
        u_before: float | None = None,
        outliers: Literal["drop", "keep"] | None = None,
        rows: ArrayLike | None = None,
    ) -> None:
        given = column("t", t), column("u", u), column("y", y)
        if len(sizes := {values.size for values in given}) > 1:
            raise ValueError(f"t, u and y must have one length, found {', '.join(map(str, sorted(sizes)))}")
        if outliers is not None:
            _check.choice("outliers", outliers, ("drop", "keep"))
        doubts: list[str] = []
        word, numbers = ("sample", np.arange(given[0].size)) if rows is None else ("row", np.asarray(rows))
        where = [f"{word} {k}" for k in numbers]
        if outliers == "drop":
            doubts += cleaning.drop_outliers(given[2], where)
        ramp = u_before is not None
        times, inputs, outputs, earlier, kept = cleaning.cleaned(*given, where, ramp, doubts)
        note = "" if outliers else cleaning.outlier_note(outputs, [where[k] for k in kept])
        before = earlier if u_before is None else _check.real("u_before", u_before)
        _check.squarable("u_before", np.array([before]))
        if np.ptp(inputs) == 0 and before == inputs[0]:
            raise ValueError(
                f"u never changes: it is {before:g} in every sample. If the input changed just before the first "
                "sample, give its earlier value as u_before (--u-before)"
            )
        steps = cleaning.find_steps(times, inputs, before)
        moved = int(np.argmax(np.abs(inputs - before) > 0.02 * np.ptp(np.append(inputs, before))))
        start = steps[0].time if steps else times[moved]
        rest, noise, resting = _at_rest(times[times < start], outputs[times < start], outputs, doubts)
        at_rest = resting or u_before is not None or (bool(steps) and noise.samples == 0)
        experiment = cleaning.name_experiment(steps, times, inputs, outputs)
        vars(self).update(t=times, u=inputs, y=outputs, u_before=before, steps=steps, experiment=experiment)
        vars(self).update(rest=rest, noise=noise, at_rest=at_rest, outlier_note=note, time_unit="", date="")
        vars(self).update(doubts=(*doubts, *filter(None, [note]), *self._more_doubts()))

    @classmethod
    def read_csv(
        cls,
        path: str | Path,
        *,
        time: str | int | None = None,
        u: str | int | None = None,
        y: str | int | None = None,
        delimiter: str | None = None,
        period: float | None = None,
        skip: int = 0,
        u_before: float | None = None,
        outliers: Literal["drop", "keep"] | None = None,
        run: int | None = None,
    ) -> Record:
        """Read a record from a delimited text file, such as an export of a process historian.

        The file may contain a row of units, per cent signs, brackets, thousands separators, and text after the last
        row of numbers. Doubts list what was assumed, converted or left out.

        Parameters
        ----------
        path : str or pathlib.Path
            The file.
        time, u, y : str or int, optional
            Names in the header, or column numbers, counted from 0. By default the columns named "time", "u" and "y",
            or else the first three. Times may be numbers, dates or times of day. Dates and times of day are converted
            to seconds.
        delimiter : str, optional
            Text between the columns. By default it is detected.
        period : float, optional
            For a file without times: time between its rows, in any unit. All results are in this unit of time.
        skip : int, optional
            Lines to leave out at the beginning of the file.
        u_before, outliers : optional
            As for `Record`.
        run : int, optional
            Number of the run to read, from 1, if the file contains several runs. Each restart of the time begins a run.

        Returns
        -------
        Record

        Raises
        ------
        ValueError
            If a column is missing, if time, u and y are not different columns, if an entry is not a number (the message
            names its row), or if `period` contradicts the times of the file.

        Examples
        --------
        >>> import pidalab, tempfile, pathlib
        >>> rows = [f"{k},{40 if k < 10 else 47},{20 + max(0, k - 12)}" for k in range(40)]
        >>> path = pathlib.Path(tempfile.mkdtemp(), "step.csv")
        >>> _ = path.write_text("\\n".join(["time,valve,level", *rows]))
        >>> pidalab.Record.read_csv(path, u="valve", y="level").steps
        (Step(time=10.0, before=40.0, after=47.0),)
        """
        path = Path(path)
        wanted = {"time": time, "u": u, "y": y}
        if period is not None:
            period = _check.real("period", period, above=0.0)
            del wanted["time"]
        skip = _check.integer("skip", skip, at_least=0)
        found = read_columns(path, wanted, delimiter, skip)
        names = [name or place for name, place in zip(found.names, found.places, strict=True)]
        said = ", ".join(f"{role} = {name!r}" for role, name in zip(wanted, names, strict=True))
        if len(set(found.places)) < len(wanted):
            raise ValueError(
                f"{path.name}: time, u and y must be different columns, found {said}: name each "
                "column (--time, --u, --y). Without the plant's input no model can be fitted"
            )
        doubts, rows, times, part = [*found.doubts], found.rows, found.values[0], slice(None)
        if period is not None:
            times = period * (rows - rows[0])
            doubts += _compared(period, found.places, path, {"time": time}, delimiter, skip)
        try:
            if run is not None:
                starts = [*cleaning.run_starts(times), times.size]
                run = _check.integer("run", run, at_least=1, at_most=len(starts) - 1)
                part = slice(starts[run - 1], starts[run])
            record = cls(
                *(x[part] for x in (times, *found.values[-2:])),
                u_before=u_before,
                outliers=outliers,
                rows=rows[part],
            )
        except ValueError as refusal:
            raise ValueError(f"{path.name} ({said}): {refusal}") from None
        vars(record).update(doubts=(*doubts, *record.doubts), time_unit=found.time_unit, date=found.date)
        return record

    @property
    def sampling(self) -> float:
        """Median interval between samples."""
        return float(np.median(np.diff(self.t)))

    @property
    def step(self) -> Step:
        """The only change of the input.

        Raises
        ------
        ValueError
            If the input does not change, or changes several times.
        """
        if not self.steps:
            raise ValueError("the input has no step between steady levels; use fit, which needs no step")
        if len(self.steps) > 1:
            found = cleaning.list_steps(self.steps)
            raise ValueError(f"the input changes again after the step: {found}; keep only the first step")
        return self.steps[0]

    def uniform(self) -> tuple[Array, Array, Array]:
        """Return times, input and output on a uniform grid. The first step of the input is at a grid point.

        Returns
        -------
        t, u, y : ndarray, shape (n,)
            Times that start at 0 and are one median interval apart, the held input, and the interpolated output. The
            input is constant until its first step.

        Examples
        --------
        >>> import numpy as np, pidalab
        >>> t = 100 + np.delete(np.arange(0.0, 30.0), [3, 7])
        >>> t, u, y = pidalab.Record(t, np.where(t < 110, 0.0, 2.0), np.where(t < 112, 1.0, 5.0)).uniform()
        >>> t[:3].tolist(), t.size, u[9:11].tolist()
        ([0.0, 1.0, 2.0], 30, [0.0, 2.0])
        """
        h, anchor = self.sampling, self.steps[0].time if self.steps else float(self.t[0])
        before, after = (int(float(span) / h + 1e-6) for span in (anchor - self.t[0], self.t[-1] - anchor))
        grid = anchor + h * np.arange(-before, after + 1)
        u = self.u[np.searchsorted(self.t, grid + 1e-6 * h, side="right") - 1]
        if self.steps:
            u[:before] = self.steps[0].before
        y: Array = np.interp(grid, self.t, self.y)
        return h * np.arange(grid.size, dtype=float), u, y

    def after_step(self) -> tuple[Array, Array]:
        """Return times since the step, and the output as the response to a unit step from rest.

        Returns
        -------
        t, y : ndarray
            Uniform times from 0 on, about one median interval apart, and the interpolated response.

        Raises
        ------
        ValueError
            If the record has no step, or if the input changes again after the step.

        Examples
        --------
        >>> import numpy as np, pidalab
        >>> t = np.arange(0.0, 30.0)
        >>> record = pidalab.Record(t, np.where(t < 5, 0.0, 2.0), 5 - 4 * np.exp(-np.maximum(t - 5, 0) / 3))
        >>> record.after_step()[1][:3].round(2).tolist()
        [0.0, 0.57, 0.97]
        """
        first = self.step
        span = self.t[-1] - first.time
        t = np.linspace(0.0, span, max(2, round(span / self.sampling) + 1))
        return t, (np.interp(first.time + t, self.t, self.y) - self.rest) / (first.after - first.before)

    def _more_doubts(self) -> list[str]:
        found = []
        levels, intervals = np.unique(self.y), np.diff(self.t)
        if levels.size <= FEW_LEVELS:
            found.append(doubt("levels", count=levels.size, apart=np.min(np.diff(levels))))
        gaps = np.flatnonzero(intervals > LONG_INTERVAL * np.median(intervals))
        if gaps.size:
            k = gaps[np.argmax(intervals[gaps])]
            found.append(doubt("gaps", count=gaps.size, longest=intervals[k], start=self.t[k]))
        apart = 0.5 * float(np.min(np.diff([s.time for s in self.steps]), initial=np.inf))
        for step in self.steps:
            near = slice(*np.searchsorted(self.t, [step.time - apart, step.time + apart]))
            share = np.abs((self.u[near] - step.before) / (step.after - step.before) - 0.5)
            slow = self.t[near][share < 0.4]
            if slow.size > RAMP_SAMPLES:
                found.append(doubt("slow input", time=np.ptp(slow), before=step.before, after=step.after))
        for end in (self.u.max(), self.u.min()) if self.experiment == MOVING else ():
            away = np.flatnonzero(np.abs(self.u - end) > 1e-3 * np.ptp(self.u))
            longest = int(np.diff(away, prepend=-1, append=self.u.size).max()) - 1
            if longest > max(RAMP_SAMPLES, LONG * self.u.size):
                word = "largest" if end > self.u.min() else "least"
                found.append(doubt("at an end", end=end, word=word, count=longest))
        if not self.steps:
            found.append(doubt("no step", experiment=self.experiment))
        else:
            tail = self.y[-max(3, self.y.size // 10) :]
            first, last = np.array_split(tail, 2)
            moved, whole = abs(last.mean() - first.mean()), np.ptp(self.y)
            if moved > max(0.02 * whole, 3 * self.noise.deviation / np.sqrt(first.size)):
                found.append(doubt("moving at the end"))
        return found

    def __str__(self) -> str:
        return with_doubts(self.described(), self.doubts)

    def described(self) -> str:
        """Return the text of ``print`` without the doubts.

        Returns
        -------
        str

        Examples
        --------
        >>> import numpy as np, pidalab
        >>> t = np.linspace(0.0, 20.0, 201)
        >>> response = pidalab.open_loop_step(pidalab.fopdt(2.0, 3.0, 1.0), t)
        >>> record = pidalab.Record(t - 1.0, np.where(t < 1.0, 0.0, 1.0), np.interp(t - 1.0, t, response.y))
        >>> record.described().splitlines()[0]
        '201 samples over 20, every 0.1'
        """
        moves = f"{self.experiment}, moves between {self.u.min():.6g} and {self.u.max():.6g}"
        noise = self.noise
        correlation = f", correlation {noise.correlation:.2f}" if noise.deviation else ""
        return (
            f"{self.t.size} samples over {np.ptp(self.t):.6g}, every {self.sampling:.4g}\n"
            f"input: {cleaning.list_steps(self.steps) if len(self.steps) == 1 else moves}\n"
            f"output: at rest {self.rest:.6g} before the step, standard deviation of the noise {noise.deviation:.3g}"
            f"{correlation}"
        )

    def __repr__(self) -> str:
        return f"Record({self.t.size} samples from {self.t[0]:.6g} to {self.t[-1]:.6g})"


def _compared(period: float, taken: tuple[int, ...], *source: Any) -> list[str]:
    """Raise if `period` contradicts the times of the file. Return a doubt if the column of times has sample numbers."""
    try:
        clock = read_columns(*source)
    except ValueError:
        return []  # the file has no column of times
    steps, name = np.diff(clock.values[0]), clock.names[0] or clock.places[0]
    interval = float(np.median(steps)) if steps.size and clock.places[0] not in taken else np.nan
    if not interval > 0 or np.any(steps < 0) or abs(interval / period - 1) < SAME_PERIOD:
        return []
    if np.all(steps == 1) and not TIMES.match(clock.names[0]):
        return [doubt("counted", name=name, period=period)]
    raise ValueError(
        f"period = {period:g} contradicts the file's own times in column {name!r}, which are {interval:.4g} apart: "
        "leave out period (--period), or delete this column"
    )


def _at_rest(t: Array, y: Array, whole: Array, doubts: list[str]) -> tuple[float, Noise, bool]:
    """Return level and noise of y before the first change of u, and True if this part of y is known to be at rest."""
    rounding = _quantum(whole) / np.sqrt(12)
    if y.size < 8:
        # A smooth response almost vanishes from second differences, but the noise does not.
        deviation = float(np.median(np.abs(np.diff(whole, 2))) / 0.6745 / np.sqrt(6))
        doubts.append(doubt("few before", count=y.size))
        return float(np.median(y if y.size else whole[0])), Noise(max(deviation, rounding), 0.0, 0), False
    residual = y - y.mean()
    deviation = float(residual.std(ddof=1))
    line = np.polynomial.Polynomial.fit(t, y, 1)
    drift = abs(float(line(t[[0, -1]]) @ [-1.0, 1.0]))
    drifting = bool(deviation) and drift > 2 * deviation and drift > 0.02 * np.ptp(whole)
    if drifting:
        doubts.append(doubt("drifting", drift=drift))
        residual, deviation = y - line(t), float(np.diff(y, 2).std()) / np.sqrt(6)
    correlation = float(residual[1:] @ residual[:-1] / (residual @ residual)) if deviation else 0.0
    return float(y.mean()), Noise(max(deviation, rounding), correlation, y.size), not drifting


def _quantum(y: Array) -> float:
    """Return the least distance between two values of a rounded signal, or 0 if the signal is not rounded."""
    levels = np.unique(y)
    return float(np.min(np.diff(levels))) if 3 * levels.size < y.size else 0.0


__all__ = ["Noise", "Record", "Step"]
