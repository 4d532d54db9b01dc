"""Fit a model to a record by output-error least squares, and estimate the uncertainty of the model."""

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
from pidalab.plant.doubts import doubt, with_doubts
from pidalab.plant.fitting import searching, uncertainty
from pidalab.plant.fitting.searching import BETTER, LEVEL, FitData, FitResult, Shape, tried_models
from pidalab.plant.fitting.uncertainty import DRIFTS, noise_of, samples_per_error, unexplained, unsettled
from pidalab.plant.record import Record
from pidalab.plant.record.cleaning import FOLLOWER
from pidalab.process import Process

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FIRST_TRIED, THEN = ("fopdt", "lags", "sopdt", "ipdt"), ("ifopdt", "sopdtz")
MODELS = (*FIRST_TRIED, *THEN, "auto")
SURPLUS = 1.1  # further models are tried if residuals / noise is above this
WORKING_POINT = 0.15  # assumed relative change of the gain at another working point
HIGHER = 0.75  # probability that the gain of a random plant is raised; otherwise it is lowered
# A record is refused if the best identifiable model fits much worse than the best model of all, which may not be
# identifiable. The largest accepted residuals of the identifiable model are UNSETTLED * `near` of the best model. Up to
# the residuals `near`, a model counts as equally good as the best model.
UNSETTLED = 1.05
MOVED = 0.05  # an input moves if it changes by more than this share of its span
MOST_UNEXPLAINED = 0.5  # largest (model error) / (standard deviation of the output)
TRIMMED = 0.95  # share of the random plants that are kept; the least likely are left out
ALONE = "make a step of the input from rest, while nothing else moves the output"


class NoPredictionError(ValueError):
    """A model predicts the hold-out data no better than their mean does."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A model fitted to a record, with its uncertainty and residuals.

    Attributes
    ----------
    process : Process
        The model.
    model : str
        Kind of the model: "fopdt", "sopdt", "lags", "ipdt", "ifopdt" or "sopdtz".
    parameters, uncertainty : mapping of str to float
        Values and their standard uncertainties. The uncertainties follow from the sensitivities of the output and from
        the size and correlation of the residuals. In closed loop they are multiplied by 1.3 if the residuals are white
        noise, and by 7 otherwise.
    residuals : ndarray, shape (n,)
        Recorded minus simulated output, at the times of the record. (If there are more than 4000 samples, neighbouring
        samples are averaged. If the input changes more than 60 times, the record is resampled.)
    deviation : float
        Root mean square of the residuals, in the unit of y.
    noise : float
        Standard deviation of the noise. It is the largest of three estimates: from the output at rest, from the
        residuals (the root mean square of their second differences, divided by sqrt(6)), and from the rounding of the
        output.
    reason : str
        A sentence that says why this model was chosen.
    record : Record
        The record.
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
        """Return random plants that the record does not rule out.

        The parameters are drawn from their joint uncertainty around several models. One is the fitted model. The others
        have a further lag, since a record hardly distinguishes a short lag from dead time. Twelve lengths of this lag
        are tried. Of the lengths that increase the residuals by at most 3 %, the median and the longest are used. If
        the fitted model has equal lags, "sopdt" models with a further lag are used too. Around each model, the least
        likely 5 % of the plants are left out.

        A record shows a change of the input only at the next sample, so the true dead time may be longer than the
        fitted one. Therefore the dead time of each plant is increased by a random part of the interval between the
        samples before and after a change. (An input that changes more than 60 times is assumed to change exactly at the
        samples.)

        Parameters
        ----------
        count : int, optional
            Number of plants.
        seed : int, optional
            Seed of the random numbers.

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
        count = _check.integer("count", count, at_least=0)
        values = np.delete(self._found.values, LEVEL)
        models = [(self._found.shape, values), *self._rivals]
        # Draw logarithms, so that times stay positive. Draw the dead time as a share of the sum of all times.
        scale = np.abs(values)
        scale[-1] = np.sum(np.abs(values[1:])) or 1.0
        covariance = self._covariance / np.outer(scale, scale)
        independent = self._data.t.size / samples_per_error(self._found.residuals) / self._times**2
        tolerance = 1.0 + float(chdtri(values.size, 1 - TRIMMED)) / independent
        limits = [tolerance * self._squares(shape, centre) for shape, centre in models]
        rng = np.random.default_rng(seed)
        plants: list[Process] = []
        shrunk = 1.0
        while len(plants) < count:
            draws = rng.multivariate_normal(np.zeros(values.size), covariance * shrunk**2, size=2 * count)
            for draw in draws:
                turn = len(plants) % len(models)
                shape, centre = models[turn]
                # A draw for equal lags has no entry for the damping, so the damping of the model is kept.
                if centre.size > draw.size:
                    draw = np.insert(draw, draw.size - 1, 0.0)
                drawn = centre * np.exp(np.clip(draw, -2.0, 2.0))
                drawn[-1] = centre[-1] + draw[-1] * scale[-1]
                if len(plants) == count or drawn[-1] < 0 or self._squares(shape, drawn) > limits[turn]:
                    continue
                earlier = rng.uniform(0.0, self._data.unseen)
                plants.append(shape.process(drawn[0], drawn[1:-1].tolist(), float(drawn[-1]) + earlier))
            # If parameters are strongly correlated, few draws have a sum of squared residuals below the limit. Then
            # draw closer to the model.
            shrunk *= 0.8
        return plants

    def plants(self, count: int = 21) -> list[Process]:
        """Return the model and random plants for a robust design.

        The random plants are those of `spread`, with changed gains, since a record shows the gain at one working point
        only. Each gain is raised by 15 % with a probability of three quarters, and lowered by 15 % otherwise. Raising
        is more probable, since a sticking valve makes the fitted gain too low.

        Parameters
        ----------
        count : int, optional
            Number of plants, including the model.

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
        higher = np.random.default_rng(0).random(count - 1) < HIGHER
        gains = np.where(higher, 1 + WORKING_POINT, 1 - WORKING_POINT)
        drawn = zip(self.spread(count - 1), gains, strict=True)
        return [self.process, *(Process(plant.num * gain, plant.den, plant.delay) for plant, gain in drawn)]

    def _squares(self, shape: Shape, values: Array) -> float:
        """Return the sum of squared residuals with these values, and with level, initial state and load fitted."""
        basis = self._data.basis(shape, values[1:].tolist())
        left = self._data.y - values[0] * basis[:, 0]
        left = left - basis[:, 1:] @ np.linalg.lstsq(basis[:, 1:], left, rcond=None)[0]
        return float(left @ left)

    @cached_property
    def _rivals(self) -> tuple[tuple[Shape, Array], ...]:
        return searching.rivals(self._data, self._found)

    @property
    def nrmse(self) -> float:
        """Goodness of fit: 1 - `deviation` / (standard deviation of y)."""
        return 1.0 - self.deviation / float(np.std(self._data.y))

    @cached_property
    def holdout(self) -> float:
        """NRMSE of the hold-out data, predicted by a model that was fitted to the other data.

        The hold-out data are the last third of the record. If the input does not move in this third, the hold-out data
        begin at the last change of the input. The result is nan if no model can be fitted to the other data, as with a
        single step of the input, or if the output hardly moves in the hold-out data.
        """
        data = self._data
        level = np.cumsum(data.changes)
        moved = np.abs(level - level[-1]) > MOVED * np.ptp(np.append(level, 0.0))
        last = float(data.change_times[int(np.flatnonzero(moved)[-1]) + 1 if moved.any() else 0])
        cut = min(data.t[0] + 2 / 3 * np.ptp(data.t), last - 1e-9 * np.ptp(data.t))
        if data.loaded and cut < data.t[0] + 0.5 * np.ptp(data.t):
            return math.nan  # the part before the hold-out data is too short to separate load and input
        early = data.until(cut)
        moves = np.ptp(np.append(np.cumsum(early.changes), 0.0))
        if moves <= MOVED * np.ptp(np.append(level, 0.0)) or early.t.size < 20:
            return math.nan
        shape, late = self._found.shape, data.t > cut
        fitted = searching.refined(early, shape, self._found.values[2:].tolist(), float(np.ptp(early.t)))
        p = fitted.values[2:].tolist()
        if not fitted.converged or np.std(data.y[late]) < max(3 * self.noise, 0.1 * float(np.std(data.y))):
            return math.nan
        whole = data._replace(load=fitted.data.load)
        error = (data.y - whole.basis(shape, p) @ searching.projected(fitted.data, shape, p)[1])[late]
        return 1.0 - float(np.sqrt(np.mean(error**2)) / np.std(data.y[late]))

    @property
    def model_error(self) -> float:
        """Square root of ``deviation**2 - noise**2``, or 0 if the noise is larger."""
        return math.sqrt(max(0.0, self.deviation**2 - self.noise**2))

    @property
    def incomplete(self) -> bool:
        """True if the residuals are more than twice the noise."""
        return self.deviation > 2 * self.noise

    @property
    def doubts(self) -> tuple[str, ...]:
        """Reservations about the model. Reservations about the record are in `record.doubts`."""
        doubts = []
        if self.incomplete:
            share = 100 * self.model_error / float(np.ptp(self._data.y))
            doubts.append(doubt("model error", error=self.model_error, noise=self.noise, share=share))
        if self._times > 2:
            doubts.append(doubt("closed loop", times=self._times))
        if self._data.free:
            doubts.append(doubt("initial state"))
        if self.holdout < self.nrmse - 0.2:
            doubts.append(doubt("hold-out", holdout=self.holdout))
        return tuple(doubts)

    def plot(self, ax: Axes) -> None:
        """Draw recorded and simulated output, and below them the residuals with a band of ±2 times the noise.

        Parameters
        ----------
        ax : matplotlib.axes.Axes
            Axes to draw into.

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
        return with_doubts(self.described(), self.doubts)

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
        sigma, holdout = self.uncertainty, f"{self.holdout:.3f} on the hold-out data"
        values = ", ".join(f"{name} = {x:.4g} ± {sigma[name]:.2g}" for name, x in self.parameters.items())
        return (
            f"{self.model}: {values}\n"
            f"residuals {self.deviation:.3g} (root mean square): noise {self.noise:.3g}, "
            f"error of the model {self.model_error:.3g}\n"
            f"NRMSE {self.nrmse:.3f}, {'no hold-out data' if math.isnan(self.holdout) else holdout}\n{self.reason}"
        )


def fit(record: Record, model: str = "auto", *, load: bool = False) -> Fit:
    """Fit a simple model with dead time to a record, in open or in closed loop.

    Parameters
    ----------
    record : Record
        Record with an input that moves enough: in one step, in several steps, or in closed loop after a change of the
        set point.
    model : {"auto", "fopdt", "sopdt", "lags", "ipdt", "ifopdt", "sopdtz"}, optional
        "fopdt" has one lag, "sopdt" two poles (real or complex), "lags" two to eight equal lags, "ipdt" an integrator,
        "ifopdt" an integrator and a lag, and "sopdtz" two poles and a zero. Every model has a dead time. "auto" chooses
        the simplest identifiable model whose residuals are at most 3 % above those of the best identifiable model.
        Without `load`, "auto" also tries "ifopdt" and "sopdtz" if the best of the other models is not identifiable, or
        if the residuals of this model are above 1.1 times the noise.
    load : bool, optional
        If true, also fit size and time of a step of the load. This allows records of a loop at a constant set point.

    Returns
    -------
    Fit

    Raises
    ------
    TypeError
        If `record` is not a Record.
    ValueError
        If `model` is unknown, the record has outliers, the input follows the output, the output does not respond or
        only drifts, parameters are not identifiable, or the gain contradicts the feedback in the record. The message
        names an experiment that would help.

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
            f"{record.outlier_note}; drop these outputs: outliers='drop' (--outliers drop), or keep them with 'keep'"
        )
    if record.experiment == FOLLOWER and not load:
        raise ValueError(
            f"no model can be fitted to this input: {FOLLOWER}; step the input by hand, or move the set point"
        )
    data = searching.loaded(searching.prepared(record)) if load else searching.prepared(record)
    if not load and uncertainty.drifts(data):
        raise ValueError(DRIFTS)
    tried, failed = tried_models(data, FIRST_TRIED if model == "auto" else (model,))
    if model == "auto" and not load and not _explained(record, data, tried):
        more, failed = tried_models(data, THEN)
        tried += [candidate for candidate in more if not unsettled(data, candidate)]
    if not tried:
        raise ValueError(f"{failed}; make a larger step of the input, from rest")
    first = min(tried, key=lambda candidate: candidate.cost)
    # Many models and times of the load are tried, so the best combination explains some noise by chance. Therefore
    # require that this combination explains enough of the output.
    if load and unexplained(data, first):
        raise ValueError(DRIFTS)
    settled = [candidate for candidate in tried if not unsettled(data, candidate)]
    settled.sort(key=lambda candidate: candidate.cost)
    if not settled or settled[0].deviation > UNSETTLED * first.near:
        raise ValueError(unsettled(data, first))
    if model != "auto":
        return _result(record, data, settled[0], f"{model} was requested.")
    chosen, reason = _choice(tried, settled)
    try:
        return _result(record, data, chosen, reason)
    except NoPredictionError:
        for other in settled:
            if other.shape.name != chosen.shape.name:
                with suppress(ValueError):
                    why = f"{chosen.shape.name} fits better, but does not predict the hold-out data."
                    return _result(record, data, other, why)
        raise


def _explained(record: Record, data: FitData, tried: Sequence[FitResult]) -> bool:
    """Return True if the best model is identifiable and its residuals are at most `SURPLUS` times the noise."""
    if not tried:
        return False
    best = min(tried, key=lambda candidate: candidate.cost)
    return not unsettled(data, best) and best.deviation <= SURPLUS * noise_of(record, data, best)


def _choice(tried: Sequence[FitResult], settled: Sequence[FitResult]) -> tuple[FitResult, str]:
    """Return the simplest candidate with residuals up to `settled[0].near`, and the reason for the choice."""
    near = [candidate for candidate in settled if candidate.deviation <= settled[0].near]
    chosen = min(near, key=lambda candidate: (candidate.values.size, candidate.cost))
    least: dict[str, float] = {}
    for candidate in sorted(tried, key=lambda candidate: candidate.deviation):
        least.setdefault(candidate.shape.name, candidate.deviation)
    residuals = ", ".join(f"{name} {value:.3g}" for name, value in least.items())
    lost = sorted({*least} - {candidate.shape.name for candidate in settled})
    return chosen, (
        f"{chosen.shape.name} is the simplest within {100 * BETTER:.0f} % of the least residual ({residuals})"
        + (f"; not identifiable from this record: {', '.join(lost)}." if lost else ".")
    )


def _result(record: Record, data: FitData, result: FitResult, reason: str) -> Fit:
    names = ["gain", *result.shape.parameters, "delay"]
    times = uncertainty.closed_loop_factor(record, result)
    # Leave out the level, and the parameters of the initial state and the load, which come last.
    keep = np.delete(np.arange(len(result.shape.parameters) + 3), LEVEL)
    covariance = times**2 * uncertainty.covariance(result)[np.ix_(keep, keep)]
    parameters = dict(zip(names, result.values[keep].tolist(), strict=True))
    sigma = dict(zip(names, np.sqrt(np.diag(covariance)).tolist(), strict=True))
    process = result.shape.process(parameters["gain"], result.values[2:-1].tolist(), parameters["delay"])
    noise = noise_of(record, data, result)
    if refusal := unexplained(data, result) or uncertainty.runs_away(record, data, result):
        raise ValueError(refusal)
    if result.deviation**2 - noise**2 > (MOST_UNEXPLAINED * float(np.std(data.y))) ** 2:
        raise ValueError(
            f"{result.shape.name} does not describe this plant: the standard deviation is {result.deviation:.3g} for "
            f"its residuals, {np.std(data.y):.3g} for the output and {noise:.3g} for the noise; {ALONE}"
        )
    fitted = Fit(
        process=process,
        model=result.shape.name,
        parameters=MappingProxyType(parameters),
        uncertainty=MappingProxyType(sigma),
        residuals=result.residuals,
        deviation=result.deviation,
        noise=noise,
        reason=reason,
        record=record,
        _covariance=covariance,
        _data=result.data,
        _found=result,
        _times=times,
    )
    if fitted.holdout <= 0:
        raise NoPredictionError(
            f"{result.shape.name} does not describe this plant: it predicts the hold-out data, the end of the record, "
            f"no better than their mean does (NRMSE {fitted.holdout:.2f}); {ALONE}"
        )
    return fitted
