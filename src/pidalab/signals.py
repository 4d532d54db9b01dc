"""Signals of experiments on a loop, with checks that the samples resolve them."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from operator import methodcaller
from typing import Any, ClassVar, Self

import numpy as np

from pidalab import _check
from pidalab._check import Array

Curve = tuple[Array, Array, Array]
REFINEMENT = 4  # each finer grid has this number of steps in one step of the previous grid
SETTLED_SHARE = 1e-6  # in the last tenth of a settled record, |e| is at most this share of its maximum
BLOCK = 8192  # number of sample intervals that are integrated together; they fit into the cache
FEWEST_JUDGED = 20  # a record with fewer samples is not tested for divergence or resolution
FINEST_GRID = 150_000  # largest number of samples of a finer grid
INTEGRALS = ("iae", "ise", "itae")
SAME_SHARE = 2e-4  # two grids agree if a measure differs by at most this share
DOUBT_SHARE = 1e-3  # a larger estimated relative error of a measure causes a warning


@dataclass(frozen=True, eq=False)
class Signals:
    """Signals of one experiment (see `pidalab.Response`)."""

    t: Array
    r: Array
    d: Array
    n: Array
    y: Array
    u: Array
    area: Any = None
    held: Any = 0.0
    final: float | None = None

    _finer: ClassVar[Any] = None  # function that returns the experiment on a grid `REFINEMENT` times finer
    _speed: ClassVar[Any] = None  # function that returns the modulus of the fastest pole of the loop
    _exact: ClassVar[bool] = False  # True if the caller or a simulation gave `area`, the integral of y

    def __post_init__(self) -> None:
        fields = vars(self)
        fields["t"] = _check.uniform_time("t", self.t)
        for name in ("r", "d", "n", "y", "u", "held"):
            fields[name] = _check.signal(name, fields[name], self.t.size)
        if self.final is not None:
            fields["final"] = _check.real("final", self.final)
        fields["_exact"] = self.area is not None
        if self.area is None:
            steps = 0.5 * self.step * (self.y[1:] + self.y[:-1])
            fields["area"] = np.concatenate([[0.0], np.cumsum(steps)])
        else:
            fields["area"] = _check.signal("area", self.area, self.t.size)

    @classmethod
    def _of_engine(
        cls,
        finer: Callable[[], Self] | None,
        speed: Callable[[], float] | None,
        **signals: Array,
    ) -> Self:
        """Make a record from checked arrays of all fields except `held` and `final`."""
        response = cls.__new__(cls)
        held = np.broadcast_to(0.0, signals["t"].size)
        vars(response).update(signals, held=held, final=None, _finer=finer, _speed=speed, _exact=True)
        return response

    def _derived(self, finer: Callable[[], Self] | None, **changes: Any) -> Self:
        """Return a record with changed fields, which keeps `_speed` and `_exact`."""
        response = replace(self, **changes)
        vars(response).update(_finer=self._finer and finer, _speed=self._speed, _exact=self._exact)
        return response

    def _refined(self) -> Self:
        """Return the same experiment on a finer grid, which is simulated only once."""
        fields = vars(self)
        if "_next" not in fields:
            fields["_next"] = fields["_finer"]()
        return fields["_next"]

    def _thinned(self) -> Self | None:
        """Return a record of every second sample, or None if a held signal varies, or if `t.size` is even or small."""
        if self.t.size % 2 == 0 or self.t.size < FEWEST_JUDGED:
            return None
        if not all(map(_check.is_constant, (self.r, self.d, self.n, self.held))):
            return None
        names = ("t", "r", "d", "n", "y", "u", "area")
        thinned = type(self)._of_engine(None, None, **{name: getattr(self, name)[::2] for name in names})
        vars(thinned).update(held=self.held[::2], final=self.final)
        return thinned

    def _settle(
        self,
        name: str,
        measure: Callable[[Any], float],
        signal: str = "y",
        missed: Callable[[Any], float] | None = None,
        least: float = 0.0,
    ) -> float:
        """Return a measure that does not change on a finer grid, or warn with an estimate of its error.

        `measure` computes the measure of a record without warnings. `missed` estimates how much the samples of a record
        underestimate extremes. A difference between grids is divided by the larger of the measure and `least`.

        Notes
        -----
        Grids are compared in succession: every second sample, all samples, and finer grids. Two grids agree if the
        measure differs by at most `SAME_SHARE`. The number of successive agreements that is required depends on the
        measure:

        * If the samples resolve the fastest pole, an integral needs one agreement. An extreme needs one agreement and a
          small `missed`. A time needs three agreements.
        * Otherwise an integral needs two agreements, since two grids can agree by chance. Other measures need a finer
          grid.

        If the first finer grid agrees with the record, the value of the record is returned.
        """
        value = measure(self)
        if self._finer is None and (not self._exact or signal == "u" or self.n.any()):
            return value
        integral, thinned = name in INTEGRALS, self._thinned()

        def size() -> float:
            return max(abs(value), least, 1e-300)

        doubt = math.inf if thinned is None else abs(measure(thinned) - value) / size()
        if self._finer is None:
            if thinned is not None:
                # Both grids may contain the sample of an extreme and thus agree, so compare the integral of e^2 as
                # well.
                square, other = self._integral_of_square(), thinned._integral_of_square()
                doubt = max(doubt, abs(other - square) / max(square, 1e-300))
                if doubt > 3 * DOUBT_SHARE:
                    _warn(name, doubt / 3, self)
            return value
        agreements, record, first = 0, self, value
        while True:
            agreements = agreements + 1 if doubt <= SAME_SHARE else 0
            resolved = self._speed is None or self._speed() * record.step <= 1.0
            inside = missed(record) / size() if missed else 0.0
            enough = 1 if resolved and (integral or missed) else 2 if integral or missed else 3
            if agreements >= enough and (resolved or integral) and inside <= SAME_SHARE:
                return first if record in (self, vars(self).get("_next")) else value
            if record.t.size * REFINEMENT > FINEST_GRID:
                break
            try:
                record = record._refined()
            except ValueError:  # the engine refuses so many samples
                break
            other, value = value, measure(record)
            doubt = abs(other - value) / size()
        # The error of the last grid is at most a third of the difference between the last two grids.
        if (doubt := max(doubt / 3, inside / 1.2)) > DOUBT_SHARE:
            _warn(name, doubt, record)
        return value

    def __repr__(self) -> str:
        return f"Response({self.t.size} samples, t = 0 to {self.t[-1]:g})"

    @property
    def step(self) -> float:
        """Sample time."""
        return float(self.t[-1] / (self.t.size - 1))

    @property
    def e(self) -> Array:
        """Control error r - y, shape (k,)."""
        return self.r - self.y

    def measured(self) -> Self:
        """Return the experiment as a recorder at the sensor would measure it, with y + n instead of y.

        Returns
        -------
        Response
            Response with n = 0. The added noise is held between samples.

        Examples
        --------
        >>> from pidalab import Response
        >>> record = Response(t=[0.0, 1.0, 2.0], r=1.0, d=0.0, n=[0.1, -0.1, 0.1], y=1.0, u=0.0)
        >>> print(f"{record.iae():.3f} {record.measured().iae():.3f}")
        0.000 0.200
        """
        noise_area = self.step * np.concatenate([[0.0], np.cumsum(self.n[:-1])])
        return self._derived(
            partial(apply_to_finer, self, methodcaller("measured")),
            y=self.y + self.n,
            n=np.zeros_like(self.n),
            area=self.area + noise_area,
            held=self.held + self.n,
        )

    def against(self, reference: Self) -> Self:
        """Return the experiment with the error relative to another response, such as a desired response.

        Parameters
        ----------
        reference : Response
            Response at the same times, whose output replaces the set point. For example, `open_loop_step` of a
            prefilter gives the filtered set point.

        Returns
        -------
        Response
            Response with set point 0 and output ``self.y - reference.y``. So its error is ``reference.y - self.y``.

        Raises
        ------
        ValueError
            If the times differ.

        Examples
        --------
        >>> import numpy as np, pidalab
        >>> t = np.linspace(0.0, 20.0, 2001)
        >>> wanted = pidalab.open_loop_step(pidalab.lags(2), t)
        >>> loop = pidalab.Loop(pidalab.ipdt(1.0, delay=0.0), 1.0)
        >>> print(f"{pidalab.step_response(loop, t).against(wanted).ie():.4f}")
        -1.0000
        """
        if not np.array_equal(self.t, reference.t):
            raise ValueError(f"reference must have the same times, found {reference!r} for {self!r}")
        return self._derived(
            partial(_finer_difference, self, reference) if reference._finer else None,
            r=np.zeros_like(self.r),
            y=self.y - reference.y,
            area=self.area - reference.area,
            held=self.held - reference.held,
            final=None,
        )

    def between(self, start: float, stop: float) -> Self:
        """Return a section of the record as a separate experiment, such as one of several set-point steps.

        Time begins at `start`. Set point, load and control signal become relative to their values just before `start`,
        and y becomes relative to the set point before `start`. So the control error does not change. If the loop has
        settled before `start`, every measure is the same as after a step from rest.

        Parameters
        ----------
        start, stop : float
            Beginning and end, rounded to the nearest samples. `stop` may be one sample after the end of the record. The
            section then ends with the last sample.

        Returns
        -------
        Response
            The section. A jump of set point, load or noise at `stop` is not included.

        Raises
        ------
        ValueError
            If the times are not in order or not in the record.

        Examples
        --------
        >>> import numpy as np, pidalab
        >>> t = 0.1 * np.arange(401)
        >>> r = pidalab.simulate(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), 0.5), t, np.where(t < 20, 1.0, 3.0))
        >>> second = r.between(20.0, 40.0)
        >>> print(f"{second.overshoot():.2f} % {second.settling_time(0.05):.2f} {second.tv():.3f}")
        4.05 % 3.36 2.084
        """
        first, last = self._samples(start, stop)
        last = min(last, self.t.size - 1)
        if last == first:
            raise ValueError(f"start and stop must be at least a sample apart, found {start!r} and {stop!r}")
        span = slice(first, last + 1)
        before = {name: getattr(self, name)[first - 1] if first else 0.0 for name in "rdu"} | {"n": 0.0}
        # A held signal may jump at `stop`. Its value just before the jump belongs to the section.
        signals: dict[str, Any] = {}
        for name, level in before.items():
            held = getattr(self, name)
            signals[name] = np.append(held[first:last], held[last - 1]) - level
        t = self.t[span] - self.t[first]
        return self._derived(
            partial(apply_to_finer, self, methodcaller("between", first * self.step, last * self.step)),
            t=t,
            **signals,
            y=self.y[span] - before["r"],
            area=self.area[span] - self.area[first] - before["r"] * t,
            held=self.held[span],
            final=None,
        )

    def _samples(self, start: float, stop: float) -> tuple[int, int]:
        """Return the samples nearest to two times, which must be in order and in the record."""
        start, stop = _check.real("start", start), _check.real("stop", stop)
        first, last = round(start / self.step), round(stop / self.step)
        if not 0 <= first < last <= self.t.size:
            raise ValueError(
                f"start and stop must be in order and from 0 to {self.t[-1]:g}, found {start:g} and {stop:g}"
            )
        return first, last

    def _require_integrable(self, horizon: float | None) -> float | None:
        """Return a checked horizon, or None for the end of the record. Raise if the record is too short or diverges."""
        if horizon is None:
            self._require_bounded("the error", self.e)
            return None
        if horizon == math.inf:
            self._require_settled()
            return None
        return self._horizon(horizon)

    def _horizon(self, horizon: float | None) -> float:
        """Return a finite horizon, by default the end of the record."""
        if horizon is None:
            return float(self.t[-1])
        horizon = _check.real("horizon", horizon, above=0.0)
        if horizon > self.t[-1] * (1 + 1e-12):
            raise ValueError(f"horizon must be within the record (up to {self.t[-1]:g}), found {horizon:g}")
        return horizon

    def _require_settled(self) -> None:
        tail, largest = np.max(np.abs(self.e[-max(2, self.t.size // 10) :])), np.max(np.abs(self.e))
        if tail > SETTLED_SHARE * largest:
            raise ValueError(
                f"horizon=inf needs a settled record: the error in the last tenth must be at most "
                f"{SETTLED_SHARE * largest:.3g}, found {tail:.3g}; simulate longer or give a finite horizon"
            )

    def _require_bounded(self, name: str, signal: Array, measure: str = "this measure") -> None:
        """Raise if a signal still grows at the end, since its measure would depend on the length of the record.

        The test begins at the first change of the signal or at the last change of set point or load, whichever is
        later. Set point and load are ignored if they change at more than a share 1/`FEWEST_JUDGED` of the samples. If
        fewer than `FEWEST_JUDGED` samples remain, nothing is tested.
        """
        if not self._grows(signal, 0):
            return
        start = int(np.argmax(signal != signal[0])) - 1
        changes = np.flatnonzero((np.diff(self.r) != 0) | (np.diff(self.d) != 0))
        if 0 < changes.size <= self.t.size // FEWEST_JUDGED:
            start = max(start, int(changes[-1]))
        start = max(start, 0)
        if self._grows(signal, start):
            late, early = self._movements(signal, start)
            raise ValueError(
                f"{measure} needs a response that does not diverge: {name} moves by {late:.3g} in the last tenth "
                f"and only by {early:.3g} before; give a horizon, or simulate a stable loop for longer"
            )

    def _grows(self, signal: Array, start: int) -> bool:
        late, early = self._movements(signal, start)
        return self.t.size - start >= FEWEST_JUDGED and late > early

    @staticmethod
    def _movements(signal: Array, start: int) -> tuple[float, float]:
        """Return the range of the last tenth of ``signal[start:]``, and the range of the samples before it."""
        moving = signal[start:]
        tenth = max(2, moving.size // 10)
        return float(np.ptp(moving[-tenth:])), float(np.ptp(moving[: moving.size - tenth + 1]))

    def _pieces(self, horizon: float | None, block: int = BLOCK) -> Iterator[tuple[Curve, Array, Array]]:
        """Yield parabolas e(s) = c0 + c1 s + c2 s^2 on 0 <= s <= end for all sample intervals, block by block.

        Here s is the time since the last sample, divided by the sample time. The end is 1, or less in an interval that
        the horizon cuts off. Each item is (c0, c1, c2), the ends, and the times at s = 0.
        """
        horizon = self._horizon(horizon)
        for begin in range(0, self.t.size - 1, block):
            samples = slice(begin, begin + block + 1)
            y, held, area = self.y[samples], self.held[samples], self.area[samples]
            start = self.t[samples][:-1]
            set_point = self.r[samples][:-1]
            first, last = set_point - y[:-1], set_point - y[1:] + np.diff(held)
            curve = 3 * (first + last - 2 * (set_point - np.diff(area) / self.step))
            yield (
                (first, last - first - curve, curve),
                np.clip((horizon - start) / self.step, 0.0, 1.0),
                start,
            )

    def _integral_of_square(self, horizon: float | None = None) -> float:
        """Integrate the square of the error without warnings."""
        total = 0.0
        for (c0, c1, c2), s, _ in self._pieces(horizon):
            square = c0**2 + s * (
                c0 * c1 + s * ((c1**2 + 2 * c0 * c2) / 3 + s * (c1 * c2 / 2 + s * c2**2 / 5))
            )
            total += self.step * np.sum(s * square)
        return float(total)


def apply_to_finer(record: Any, change: Callable[[Any], Any]) -> Any:
    """Apply a change to the same experiment on a finer grid."""
    return change(record._refined())


def _finer_difference(record: Any, reference: Any) -> Any:
    return record._refined().against(reference._refined())


def _warn(measure: str, doubt: float, record: Signals) -> None:
    warnings.warn(
        f"{measure} is uncertain by about {100 * doubt:.2g} % with a step of {record.step:.3g}; take a smaller step",
        RuntimeWarning,
        stacklevel=4,
    )
