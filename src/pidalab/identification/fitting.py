"""A model from a record: output-error least squares, with the uncertainty that the record leaves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from pidalab import _check
from pidalab._check import Array
from pidalab.identification.searching import BETTER, LEVEL, Data, Found, prepared, rivals, search
from pidalab.identification.shapes import FIRST, INTEGRATOR, MOST_LAGS, SECOND, Shape, equal_lags
from pidalab.process import Process
from pidalab.record import Record

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MODELS = ("fopdt", "sopdt", "lags", "ipdt", "auto")
BLIND = (
    1e7  # condition number of the parameters' sensitivities, scaled, above which the input tells too little
)


@dataclass(frozen=True, eq=False)
class Fit:
    """A model fitted to a record, how sure it is, and what is left over.

    Attributes
    ----------
    process : Process
        The model.
    model : str
        Its kind: "fopdt", "sopdt", "lags" or "ipdt".
    parameters, uncertainty : mapping of str to float
        Values, and their standard uncertainties: from the sensitivity of the output to each, the size of the residuals
        and how long these stay correlated.
    residuals : ndarray, shape (n,)
        Recorded less simulated output, at the record's own times or, for a long record, at averaged ones.
    deviation : float
        Root mean square of the residuals, in the unit of y.
    noise : float
        Standard deviation of the noise at rest; a good model leaves no more.
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
    _data: Data
    _found: Found

    def spread(self, count: int = 20, seed: int = 0) -> list[Process]:
        """Return plants that the record does not rule out: other parameters, and a lag that the model does not have.

        They are drawn from the joint uncertainty of the parameters, around the model and, in turn, around models with a
        further lag, fitted anew: the longest whose residuals are not 3 % larger, and one of a middle length. What such
        a lag does to a record a little dead time does nearly as well; what it does to a loop can be quite different.
        Beside equal lags stand two unequal ones with a further lag as well.

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
        scale[-1] = sum(values[1:]) or 1.0
        rng = np.random.default_rng(seed)
        draws = rng.multivariate_normal(
            np.zeros(values.size), self._covariance / np.outer(scale, scale), size=count
        )
        earlier = rng.uniform(0.0, self._data.unseen, size=count)
        plants = []
        for k, draw in enumerate(draws):
            shape, centre = models[k % len(models)]
            if centre.size > draw.size:  # beside equal lags: unequal ones, whose damping no draw knows
                draw = np.insert(draw, draw.size - 1, 0.0)
            drawn = centre * np.exp(np.clip(draw, -2.0, 2.0))
            drawn[-1] = max(0.0, centre[-1] + draw[-1] * scale[-1]) + earlier[k]
            plants.append(shape.process(drawn[0], drawn[1:-1].tolist(), float(drawn[-1])))
        return plants

    @cached_property
    def _rivals(self) -> tuple[tuple[Shape, Array], ...]:
        return rivals(self._data, self._found)

    def plot(self, ax: Axes) -> None:
        """Draw recorded and simulated output.

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
        ax.set(xlabel="time", ylabel="output")
        ax.legend()

    def __str__(self) -> str:
        values = ", ".join(
            f"{name} = {value:.4g} ± {self.uncertainty[name]:.2g}" for name, value in self.parameters.items()
        )
        return (
            f"{self.model}: {values}\nresiduals {self.deviation:.3g} (root mean square), "
            f"noise at rest {self.noise:.3g}\n{self.reason}"
        )


def fit(record: Record, model: str = "auto") -> Fit:
    """Fit a simple model with dead time to a record, in open or in closed loop.

    Parameters
    ----------
    record : Record
        Any input that moves enough: one step is enough, several or a closed loop's set-point change serve too.
    model : {"auto", "fopdt", "sopdt", "lags", "ipdt"}, optional
        One lag, two poles with damping, up to eight equal lags, an integrator, each with dead time; "auto" takes the
        simplest that no other one beats by more than 3 % in the residuals.

    Returns
    -------
    Fit

    Raises
    ------
    TypeError
        If `record` is not a Record.
    ValueError
        For another word as `model`, an input that does not tell the parameters apart, an output that does not answer.

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
    data = prepared(record)
    if model != "auto":
        best = min((search(data, shape) for shape in _candidates(model)), key=lambda found: found.cost)
        return _result(record, data, best, f"{model} was asked for.")
    tried = [
        search(data, shape) for name in ("fopdt", "lags", "sopdt", "ipdt") for shape in _candidates(name)
    ]
    chosen, reason = _choice(tried)
    return _result(record, data, chosen, reason)


def _candidates(model: str) -> list[Shape]:
    if model == "lags":
        return [equal_lags(order) for order in range(2, MOST_LAGS + 1)]
    return [{"fopdt": FIRST, "sopdt": SECOND, "ipdt": INTEGRATOR}[model]]


def _choice(tried: Sequence[Found]) -> tuple[Found, str]:
    """Return the simplest candidate close to the best, and why."""
    best = min(tried, key=lambda found: found.cost)
    near = [found for found in tried if found.deviation <= best.near]
    chosen = min(near, key=lambda found: (found.values.size, found.cost))
    kind = chosen.shape.name
    others: dict[str, float] = {}
    for found in tried:
        name = found.shape.name
        others[name] = min(others.get(name, np.inf), found.deviation)
    said = ", ".join(
        f"{name} {value:.3g}" for name, value in sorted(others.items(), key=lambda item: item[1])
    )
    return chosen, f"{kind} is the simplest within {100 * BETTER:.0f} % of the least residual ({said})."


def _result(record: Record, data: Data, found: Found, reason: str) -> Fit:
    names = ("gain", "level", *found.shape.parameters, "delay")
    if found.values[0] == 0 or not np.all(np.isfinite(found.values)):
        raise ValueError("the output does not answer to the input: no gain can be found")
    answer = float(np.ptp(found.jacobian[:, 0] * found.values[0]))
    if answer < 3 * found.deviation:
        raise ValueError(
            f"the output answers by {answer:.3g}, not clearly above what is left over ({found.deviation:.3g}): "
            f"the step is too small against the noise, or something else moved the output (level {found.values[1]:.4g})"
        )
    # sensitivities scaled to the change that each parameter makes
    scaled = found.jacobian / np.linalg.norm(found.jacobian, axis=0)
    if not np.all(np.isfinite(scaled)) or np.linalg.cond(scaled) > BLIND:
        raise ValueError(
            f"the input tells too little to fit {found.shape.name}: its parameters cannot be told apart "
            "(in closed loop, move the set point more; in open loop, step the input)"
        )
    covariance = _covariance(found)
    sigma = np.sqrt(np.diag(covariance))
    parameters = dict(zip(names, found.values.tolist(), strict=True))
    uncertainty = dict(zip(names, sigma.tolist(), strict=True))
    del parameters["level"], uncertainty["level"]
    process = found.shape.process(parameters["gain"], found.values[2:-1].tolist(), parameters["delay"])
    keep = np.delete(np.arange(len(names)), LEVEL)
    return Fit(
        process=process,
        model=found.shape.name,
        parameters=MappingProxyType(parameters),
        uncertainty=MappingProxyType(uncertainty),
        residuals=found.residuals,
        deviation=found.deviation,
        noise=record.noise.deviation,
        reason=reason,
        record=record,
        _covariance=covariance[np.ix_(keep, keep)],
        _data=data,
        _found=found,
    )


def _covariance(found: Found) -> Array:
    """Covariance of the parameters: that of white residuals, times how many samples share one error."""
    r, J = found.residuals, found.jacobian
    freedom = max(1, r.size - J.shape[1])
    variance = float(r @ r) / freedom
    if variance == 0.0:
        return np.zeros((J.shape[1], J.shape[1]))
    # correlation time of the residuals in samples, up to where the correlation first falls to zero
    spectrum = np.abs(np.fft.rfft(r, 2 * r.size)) ** 2
    correlation = np.fft.irfft(spectrum)[: r.size]
    correlation = correlation / correlation[0]
    end = int(np.argmax(correlation <= 0)) or r.size
    together = 1.0 + 2.0 * float(correlation[1:end].sum())
    scale = np.linalg.norm(J, axis=0)
    inverse = np.linalg.pinv((J / scale).T @ (J / scale), hermitian=True)
    return np.asarray(variance * together * inverse / np.outer(scale, scale))
