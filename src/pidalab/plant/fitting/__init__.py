"""A model from a record: output-error least squares, with the uncertainty that the record leaves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri

from pidalab import _check
from pidalab._check import Array
from pidalab.plant.doubts import doubt
from pidalab.plant.fitting.searching import (
    BETTER,
    LEVEL,
    FitData,
    FitResult,
    Shape,
    loaded,
    prepared,
    projected,
    refined,
    rivals,
    tried_models,
)
from pidalab.plant.fitting.uncertainty import (
    DRIFTS,
    closed_loop_factor,
    covariance,
    drifts,
    noise_of,
    samples_per_error,
    unexplained,
    unsettled,
)
from pidalab.plant.record import Record
from pidalab.plant.record.cleaning import FOLLOWER
from pidalab.process import Process

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FIRST_TRIED, THEN = ("fopdt", "lags", "sopdt", "ipdt"), ("ifopdt", "sopdtz")
MODELS = (*FIRST_TRIED, *THEN, "auto")
SURPLUS = 1.1  # of residuals over noise, from which more models are tried
WORKING_POINT = 0.15  # share by which the gain may be higher or lower than in a record, whatever that settles
HIGHER = 0.75  # share of the plants whose gain is higher
UNSETTLED = 1.05  # times the least residual: a model that the record settles serves up to there
MOVED = 0.05  # share of its span by which the input moves, if it does
MOST_UNEXPLAINED = 0.5  # share of the movement of the output that no model may leave beyond noise
TRIMMED = 0.95  # probability with which the likelihood of the true plant is above that of the plants left out


class NoPredictionError(ValueError):
    """A model predicts the hold-out data no better than their mean does."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A model fitted to a record, how sure it is, and what is left over.

    Attributes
    ----------
    process : Process
        The model.
    model : str
        Its kind: "fopdt", "sopdt", "lags", "ipdt", "ifopdt" or "sopdtz".
    parameters, uncertainty : mapping of str to float
        Values, and their standard uncertainties: from the sensitivity of the output to each, the size of the residuals
        and how long these stay correlated.
    residuals : ndarray, shape (n,)
        Recorded less simulated output, at the record's own times or, for a long record, at averaged ones.
    deviation : float
        Root mean square of the residuals, in the unit of y.
    noise : float
        Standard deviation of the noise: the largest of that at rest, of what in the residuals changes from sample to
        sample (root mean square of their second differences by the root of 6), and of rounding. A good model leaves no
        more; what it leaves beyond is `model_error`.
    reason : str
        Why this model, in a sentence.
    record : Record
        What was fitted.
    """

    process: Process
    model: str
    parameters: Mapping[str, float]
    uncertainty: Mapping[str, float]
    residuals: Array
    deviation: float
    noise: float
    reason: str
    record: Record
    _covariance: Array
    _data: FitData
    _found: FitResult
    _times: float

    def spread(self, count: int = 20, seed: int = 0) -> list[Process]:
        """Return plants that the record does not rule out: other parameters, and a lag that the model does not have.

        They are drawn from the joint uncertainty of the parameters, around the model and, in turn, around models with a
        further lag, fitted anew: the longest whose residuals are not 3 % larger, and one of a middle length. What such
        a lag does to a record a little dead time does nearly as well; what it does to a loop can be quite different.
        Left out are those with which the record is less likely than with 95 % of the plants around the same model.
        For equal lags, two unequal ones with a further lag are among these models as well.

        All have more dead time than was fitted, by up to the interval in which the input changed: a record shows a
        change at the sample after it, and does not say when it was. (An input that moves at every sample is taken to
        be written at the samples.)

        Parameters
        ----------
        count : int, optional
            How many.
        seed : int, optional
            Of the random numbers.

        Returns
        -------
        list of Process

        Examples
        --------
        >>> import numpy as np, pidalab
        >>> t = np.arange(0.0, 60.0)
        >>> y = 2.0 * (1 - np.exp(-np.maximum(t - 13, 0) / 5)) + np.random.default_rng(0).normal(0, 0.02, t.size)
        >>> fitted = pidalab.identification.fit(pidalab.Record(t, np.where(t < 10, 0.0, 1.0), y), "fopdt")
        >>> len(fitted.spread(5))
        5
        """
        count = _check.integer("count", count, at_least=1)
        values = np.delete(self._found.values, LEVEL)
        models = [(self._found.shape, values), *self._rivals]
        # drawn as logarithms, so that a time stays positive; the dead time as a share of all times
        scale = np.abs(values)
        scale[-1] = np.sum(np.abs(values[1:])) or 1.0
        covariance = self._covariance / np.outer(scale, scale)
        # samples, if each had an error of its own
        worth = self._data.t.size / samples_per_error(self._found.residuals) / self._times**2
        room = 1.0 + float(chdtri(values.size, 1 - TRIMMED)) / worth
        limits = [room * self._squares(shape, centre) for shape, centre in models]
        rng = np.random.default_rng(seed)
        plants: list[Process] = []
        shrunk = 1.0
        while len(plants) < count:
            for draw in rng.multivariate_normal(
                np.zeros(values.size), covariance * shrunk**2, size=2 * count
            ):
                turn = len(plants) % len(models)
                shape, centre = models[turn]
                if centre.size > draw.size:  # beside equal lags: unequal ones, whose damping no draw knows
                    draw = np.insert(draw, draw.size - 1, 0.0)
                drawn = centre * np.exp(np.clip(draw, -2.0, 2.0))
                drawn[-1] = centre[-1] + draw[-1] * scale[-1]
                if len(plants) == count or drawn[-1] < 0 or self._squares(shape, drawn) > limits[turn]:
                    continue
                earlier = rng.uniform(0.0, self._data.unseen)
                plants.append(shape.process(drawn[0], drawn[1:-1].tolist(), float(drawn[-1]) + earlier))
            shrunk *= 0.8  # of a long and bent valley few draws lie inside
        return plants

    def plants(self, count: int = 21) -> list[Process]:
        """Return the model and, after it, plants that the record allows: a family to design for.

        They are those of `spread`, most of them with a gain that is 15 % higher, the others 15 % lower. A record shows
        the gain of one working point only, and a valve that sticks moves less than it is told to.

        Parameters
        ----------
        count : int, optional
            How many, the model included.

        Returns
        -------
        list of Process

        Examples
        --------
        >>> import numpy as np, pidalab
        >>> t = np.arange(0.0, 60.0)
        >>> y = 2.0 * (1 - np.exp(-np.maximum(t - 13, 0) / 5)) + np.random.default_rng(0).normal(0, 0.02, t.size)
        >>> fitted = pidalab.identification.fit(pidalab.Record(t, np.where(t < 10, 0.0, 1.0), y), "fopdt")
        >>> fitted.plants(5)[0] == fitted.process
        True
        """
        count = _check.integer("count", count, at_least=1)
        if count == 1:
            return [self.process]
        higher = np.random.default_rng(0).random(count - 1) < HIGHER
        gains = np.where(higher, 1 + WORKING_POINT, 1 - WORKING_POINT)
        drawn = zip(self.spread(count - 1), gains, strict=True)
        return [self.process, *(Process(plant.num * gain, plant.den, plant.delay) for plant, gain in drawn)]

    def _squares(self, shape: Shape, values: Array) -> float:
        """Sum of the squared residuals of a model, level and initial state solved for."""
        basis = self._data.basis(shape, values[1:].tolist())
        left = self._data.y - values[0] * basis[:, 0]
        left = left - basis[:, 1:] @ np.linalg.lstsq(basis[:, 1:], left, rcond=None)[0]
        return float(left @ left)

    @cached_property
    def _rivals(self) -> tuple[tuple[Shape, Array], ...]:
        return rivals(self._data, self._found)

    @property
    def nrmse(self) -> float:
        """One less the residuals' share of the output's movement: 1 for a model that leaves nothing."""
        return 1.0 - self.deviation / float(np.std(self._data.y))

    @cached_property
    def holdout(self) -> float:
        """The same for the end of the record, predicted by a fit of the rest; nan where nothing moves at the end.

        The end is the last third or, if the input does not move in it, what follows the last change; there is none if
        the input moves only once, or the output no more than noise.
        """
        data = self._data
        level = np.cumsum(data.changes)
        moved = np.abs(level - level[-1]) > MOVED * np.ptp(np.append(level, 0.0))
        last = float(data.change_times[int(np.flatnonzero(moved)[-1]) + 1 if moved.any() else 0])
        cut = min(data.t[0] + 2 / 3 * np.ptp(data.t), last - 1e-9 * np.ptp(data.t))
        if data.loaded and cut < data.t[0] + 0.5 * np.ptp(data.t):
            return math.nan  # so short a part does not tell the load from the input
        early = data.until(cut)
        seen = np.append(np.cumsum(early.changes), 0.0)
        if np.ptp(seen) <= MOVED * np.ptp(np.append(level, 0.0)) or early.t.size < 20:
            return math.nan
        shape = self._found.shape
        found = refined(early, shape, self._found.values[2:].tolist(), float(np.ptp(early.t)))
        p = found.values[2:].tolist()
        late = data.t > cut
        if not found.converged or np.std(data.y[late]) < max(3 * self.noise, 0.1 * float(np.std(data.y))):
            return math.nan
        whole = data._replace(load=found.data.load)  # the load where the early part has it
        error = (data.y - whole.basis(shape, p) @ projected(found.data, shape, p)[1])[late]
        return 1.0 - float(np.sqrt(np.mean(error**2)) / np.std(data.y[late]))

    @property
    def model_error(self) -> float:
        """Root mean square of what the model leaves beyond noise."""
        return math.sqrt(max(0.0, self.deviation**2 - self.noise**2))

    @property
    def incomplete(self) -> bool:
        """Whether the model leaves more than twice the noise."""
        return self.deviation > 2 * self.noise

    @property
    def doubts(self) -> tuple[str, ...]:
        """What a reader should know of the model; `record` has its own."""
        found = []
        if self.incomplete:
            share = 100 * self.model_error / float(np.ptp(self._data.y))
            found.append(doubt("model error", error=self.model_error, noise=self.noise, share=share))
        if self._times > 2:
            found.append(doubt("closed loop", times=self._times))
        if self._data.free:
            found.append(doubt("initial state"))
        if self.holdout < self.nrmse - 0.2:
            found.append(doubt("hold-out", holdout=self.holdout))
        return tuple(found)

    def plot(self, ax: Axes) -> None:
        """Draw recorded and simulated output and, below them, the residuals in a band of twice the noise.

        Parameters
        ----------
        ax : matplotlib.axes.Axes
            Where.

        Examples
        --------
        >>> import numpy as np, pidalab
        >>> import matplotlib.pyplot as plt
        >>> t = np.arange(0.0, 60.0)
        >>> y = 2.0 * (1 - np.exp(-np.maximum(t - 13, 0) / 5))
        >>> figure, ax = plt.subplots()
        >>> pidalab.identification.fit(pidalab.Record(t, np.where(t < 10, 0.0, 1.0), y), "fopdt").plot(ax)
        >>> plt.close(figure)
        """
        simulated = np.interp(self._data.t, self.record.t, self.record.y) - self.residuals
        ax.plot(self.record.t, self.record.y, ".", color="0.6", markersize=3, label="record")
        ax.plot(self._data.t, simulated, label=self.model)
        below = float(self.record.y.min()) - 2 * max(float(np.max(np.abs(self.residuals))), self.noise)
        ax.axhspan(below - 2 * self.noise, below + 2 * self.noise, color="0.6", alpha=0.3, linewidth=0)
        ax.plot(self._data.t, below + self.residuals, color="0.4", linewidth=0.8, label="residual, shifted")
        ax.set(xlabel="time", ylabel="output")
        ax.legend()

    def __str__(self) -> str:
        return "\n".join([self.described(), *(f"doubt: {said}" for said in self.doubts)])

    def described(self) -> str:
        """Return the text of ``print`` without the doubts.

        Returns
        -------
        str

        Examples
        --------
        >>> import numpy as np, pidalab
        >>> t = np.linspace(-2.0, 20.0, 221)
        >>> y = 2.0 * (1 - np.exp(-np.maximum(t - 1.0, 0.0) / 3.0))
        >>> fit = pidalab.identification.fit(pidalab.Record(t, np.where(t < 0.0, 0.0, 1.0), y), "fopdt")
        >>> fit.described().split(":")[0]
        'fopdt'
        """
        values = ", ".join(
            f"{name} = {value:.4g} ± {self.uncertainty[name]:.2g}" for name, value in self.parameters.items()
        )
        holdout = (
            "no hold-out data" if math.isnan(self.holdout) else f"{self.holdout:.3f} on the hold-out data"
        )
        lines = [
            f"{self.model}: {values}",
            f"residuals {self.deviation:.3g} (root mean square): noise {self.noise:.3g}, "
            f"error of the model {self.model_error:.3g}",
            f"NRMSE {self.nrmse:.3f}, {holdout}",
            self.reason,
        ]
        return "\n".join(lines)


def fit(record: Record, model: str = "auto", *, load: bool = False) -> Fit:
    """Fit a simple model with dead time to a record, in open or in closed loop.

    Parameters
    ----------
    record : Record
        Any input that moves enough: one step is enough, several or a closed loop's set-point change serve too.
    model : {"auto", "fopdt", "sopdt", "lags", "ipdt", "ifopdt", "sopdtz"}, optional
        One lag, two poles with damping, up to eight equal lags, an integrator, an integrator with a lag, two poles and
        a zero, each with dead time; "auto" takes the simplest that no other one beats by more than 3 % in the
        residuals, of those that the record settles. It tries the last two where the others leave more than noise and
        no load is fitted.
    load : bool, optional
        Whether a step of the load, of a size and at a time that are found with the model, moved the output as well. So
        a loop at a constant set point shows its plant, too.

    Returns
    -------
    Fit

    Raises
    ------
    TypeError
        If `record` is not a Record.
    ValueError
        For another word as `model`, a record with outliers, an input that follows the output, an output that does not
        answer or only drifts, and parameters that the record does not settle, such as the sign of the gain; it says
        which experiment would.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> t = np.arange(0.0, 80.0, 0.5)
    >>> u = np.where(t < 10.0, 40.0, 47.0)
    >>> y = 300.0 + 7.0 * 2.3 * (1 - np.exp(-np.maximum(t - 15.0, 0.0) / 12.0))
    >>> fitted = pidalab.identification.fit(pidalab.Record(t, u, y))
    >>> fitted.model, {name: round(value, 6) for name, value in fitted.parameters.items()}
    ('fopdt', {'gain': 2.3, 'lag': 12.0, 'delay': 5.0})
    """
    if not isinstance(record, Record):
        raise TypeError(
            f"record must be a pidalab.Record, found {type(record).__name__}; write Record(t, u, y)"
        )
    _check.choice("model", model, MODELS)
    if record.outlier_note:
        raise ValueError(
            f"{record.outlier_note}; leave it out with outliers='drop' (--outliers drop), or keep it with 'keep'"
        )
    if record.experiment == FOLLOWER and not load:
        raise ValueError(
            f"the input tells nothing of the plant: {FOLLOWER}; step the input by hand, or move the set point"
        )
    data = loaded(prepared(record)) if load else prepared(record)
    if not load and drifts(data):
        raise ValueError(DRIFTS)
    tried, failed = tried_models(data, FIRST_TRIED if model == "auto" else (model,))
    if model == "auto" and not load and not _explained(record, data, tried):
        more, failed = tried_models(data, THEN)
        tried += [found for found in more if not unsettled(data, found)]
    if not tried:
        raise ValueError(f"{failed}; step the input further, from rest")
    if load and unexplained(data, min(tried, key=lambda found: found.cost)):
        raise ValueError(DRIFTS)  # so many times and models would explain some noise, too
    if model != "auto":
        best = min(tried, key=lambda found: found.cost)
        _require_settled(data, best)
        return _result(record, data, best, f"{model} was requested.")
    chosen, reason = _choice(data, tried)
    try:
        return _result(record, data, chosen, reason)
    except NoPredictionError:
        settled = [found for found in tried if not unsettled(data, found)]
        for other in sorted(settled, key=lambda found: found.cost):
            if other.shape.name != chosen.shape.name:
                with suppress(ValueError):
                    why = f"{chosen.shape.name} fits better, and does not predict the hold-out data."
                    return _result(record, data, other, why)
        raise


def _explained(record: Record, data: FitData, tried: Sequence[FitResult]) -> bool:
    """Whether the best model is settled, and leaves noise."""
    if not tried:
        return False
    best = min(tried, key=lambda found: found.cost)
    return not unsettled(data, best) and best.deviation <= SURPLUS * noise_of(record, data, best)


def _choice(data: FitData, tried: Sequence[FitResult]) -> tuple[FitResult, str]:
    """Return the simplest candidate close to the best of those that the record settles, and why."""
    first = min(tried, key=lambda found: found.cost)
    settled = [found for found in tried if not unsettled(data, found)]
    best = min(settled, key=lambda found: found.cost, default=first)
    if not settled or best.deviation > UNSETTLED * first.near:
        _require_settled(data, first)
    near = [found for found in settled if found.deviation <= best.near]
    chosen = min(near, key=lambda found: (found.values.size, found.cost))
    others: dict[str, float] = {}
    for found in tried:
        name = found.shape.name
        others[name] = min(others.get(name, np.inf), found.deviation)
    said = ", ".join(
        f"{name} {value:.3g}" for name, value in sorted(others.items(), key=lambda item: item[1])
    )
    lost = sorted({found.shape.name for found in tried} - {found.shape.name for found in settled})
    return chosen, (
        f"{chosen.shape.name} is the simplest within {100 * BETTER:.0f} % of the least residual ({said})"
        + (f"; not identifiable from this record: {', '.join(lost)}." if lost else ".")
    )


def _require_settled(data: FitData, found: FitResult) -> None:
    refusal = unsettled(data, found)
    if refusal:
        raise ValueError(refusal)


def _result(record: Record, data: FitData, found: FitResult, reason: str) -> Fit:
    names = ("gain", "level", *found.shape.parameters, "delay")
    times = closed_loop_factor(record, found)
    spread = times**2 * covariance(found)
    sigma = np.sqrt(np.diag(spread))
    parameters = dict(zip(names, found.values.tolist(), strict=True))
    uncertainty = dict(zip(names, sigma.tolist(), strict=False))  # beyond these: of the initial state
    del parameters["level"], uncertainty["level"]
    process = found.shape.process(parameters["gain"], found.values[2:-1].tolist(), parameters["delay"])
    keep = np.delete(np.arange(len(names)), LEVEL)
    noise = noise_of(record, data, found)
    if refusal := unexplained(data, found):
        raise ValueError(refusal)
    if found.deviation**2 - noise**2 > (MOST_UNEXPLAINED * float(np.std(data.y))) ** 2:
        raise ValueError(
            f"{found.shape.name} does not describe this plant: it leaves {found.deviation:.3g} of an output that moves "
            f"by {np.std(data.y):.3g} (standard deviation), and its noise is {noise:.3g}; step the input by itself, "
            "from rest, with nothing else moving the output"
        )
    fitted = Fit(
        process=process,
        model=found.shape.name,
        parameters=MappingProxyType(parameters),
        uncertainty=MappingProxyType(uncertainty),
        residuals=found.residuals,
        deviation=found.deviation,
        noise=noise,
        reason=reason,
        record=record,
        _covariance=spread[np.ix_(keep, keep)],
        _data=found.data,
        _found=found,
        _times=times,
    )
    if fitted.holdout <= 0:
        raise NoPredictionError(
            f"{found.shape.name} does not describe this plant: it predicts the hold-out data, the end of the record, "
            f"no better than their mean does (NRMSE {fitted.holdout:.2f}); step the input by itself, from rest, with "
            "nothing else moving the output"
        )
    return fitted
