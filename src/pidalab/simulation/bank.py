"""Parameter sets of a portrait, and the digital controllers and prefilters they make, many at once."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from pidalab._check import Array
from pidalab.controllers import SeriesPIDA
from pidalab.digital.paths import held_gains
from pidalab.digital.program import program
from pidalab.loop import Loop, require_loop
from pidalab.simulation import lanes
from pidalab.simulation.lanes import Controllers
from pidalab.simulation.operations import operations
from pidalab.simulation.sampled_controller import require_fine_enough
from pidalab.simulation.steps import Steps

ALLOWED = {
    "kp": "finite and not 0",
    "kd": "finite",
    "ka": "finite",
    "ti": "finite and above 0",
    "filter_time": "finite and above 0",
}


class Bank(NamedTuple):
    """Parameters and prefilter coefficients, each a number or an array that broadcasts to the shape."""

    shape: tuple[int, ...]
    values: dict[str, Array]  # of `ALLOWED`
    order: int  # of the filter
    num: list[Array]  # of the prefilter, as long as den
    den: list[Array]

    @staticmethod
    def of(loop: Loop, parameters: Mapping[str, ArrayLike], prefilter: tuple[Any, Any] | None) -> Bank:
        """Collect the parameters of a loop and what differs; complain about names, types and shapes."""
        if not hasattr(parameters, "__getitem__") or not hasattr(parameters, "keys"):
            raise TypeError(
                f"parameters must be a mapping or a DataFrame of arrays by name, found {type(parameters).__name__}"
            )
        own = require_series(loop)
        values = {name: np.asarray(getattr(own, name)) for name in ALLOWED}
        # not what iterates: a Series of pandas has its values there
        for name, given in dict(parameters).items():
            if name not in ALLOWED:
                raise ValueError(f"parameters must be among {', '.join(ALLOWED)}, found {name!r}")
            values[name] = _real(f"parameters[{name!r}]", given)
        num, den = ([np.asarray(x) for x in part] for part in loop.blocks["prefilter"])
        if prefilter is not None:
            num, den = _coefficients(loop, prefilter)
        try:
            shape = np.broadcast_shapes(*(x.shape for x in (*values.values(), *num, *den)))
        except ValueError:
            shapes: dict[str, object] = {name: np.shape(values[name]) for name in parameters}
            shapes |= {"prefilter": [x.shape for x in (*num, *den)]} if prefilter is not None else {}
            raise ValueError(
                f"parameters must have shapes that can be broadcast together, found {shapes}"
            ) from None
        if 0 in shape:
            raise ValueError(f"parameters must hold at least one set, found a grid of shape {shape}")
        num = [np.zeros(()) for _ in range(len(den) - len(num))] + num
        return Bank(shape, values, own.filter_order, num, den)

    def require_valid(self, h: float) -> None:
        """Raise for a parameter out of its range, a filter faster than the sample, and a prefilter that is unstable."""
        for name, x in self.values.items():
            bad = ~np.isfinite(x)
            if ALLOWED[name].endswith("above 0"):
                bad |= x <= 0
            elif ALLOWED[name].endswith("not 0"):
                bad |= x == 0
            if np.any(bad):
                i = tuple(int(k) for k in np.argwhere(bad)[0])
                where = f" at index {i[0] if len(i) == 1 else i}" if i else ""
                raise ValueError(f"{name} must be {ALLOWED[name]}, found {x[i]}{where}")
        for name, needed in (("kd", 1), ("ka", 2)):
            if self.order < needed and np.any(self.values[name]):
                raise ValueError(f"{name} needs a filter_order of at least {needed}, found {self.order}")
        if not all(np.all(np.isfinite(x)) for x in (*self.num, *self.den)):
            raise ValueError("prefilter must have finite coefficients, found nan or infinity")
        if np.any(self.den[0] == 0) or np.any(self.den[-1] == 0):
            raise ValueError(
                "prefilter must have a denominator whose first and last coefficients are not 0, found 0"
            )
        if len(self.den) > 1:
            den = np.stack(np.broadcast_arrays(*self.den), axis=-1)
            poles = np.linalg.eigvals(_companion(den / den[..., :1]))
            if np.any(poles.real >= 0):
                raise ValueError(f"prefilter must be stable, found a pole at {poles[poles.real >= 0][0]:.4g}")
        require_fine_enough(h, float(np.min(self.values["filter_time"])) if self.order else math.inf)

    def static_gain(self) -> Array:
        """Return the static gain of the prefilters."""
        return np.asarray(self.num[-1] / self.den[-1])

    def measures(
        self, plant: Steps, limits: tuple[float, float], h: float, r: Array, d: Array, n: Array
    ) -> Array:
        """Run the sets, one-dimensional here, and measure them: shape (measures, sets)."""
        groups = [lanes.run(own, plant, h, r, d, n) for own in controllers(self, limits, h, lanes.LANES)]
        return np.concatenate(groups, axis=1)[:, : math.prod(self.shape)]

    def part(self, part: slice) -> Bank:
        """Return some of the sets, in flat order."""

        def cut(x: Array) -> Array:
            return x if x.ndim == 0 else np.broadcast_to(x, self.shape).flat[part]

        values = {name: cut(x) for name, x in self.values.items()}
        size = (part.stop - part.start,)
        return Bank(size, values, self.order, [cut(x) for x in self.num], [cut(x) for x in self.den])


def require_series(loop: Loop) -> SeriesPIDA:
    """Return the controller whose parameters differ from set to set, or raise."""
    require_loop(loop)
    if not isinstance(loop.controller, SeriesPIDA) or loop.output_filter is not None:
        raise TypeError(f"loop must have a SeriesPIDA and no output filter, found {loop!r}")
    return loop.controller


def _real(name: str, value: ArrayLike) -> Array:
    try:
        array = np.asarray(value)
    except ValueError:
        raise TypeError(f"{name} must be an array of real numbers, found rows of different lengths") from None
    if array.dtype.kind not in "iuf":
        raise TypeError(f"{name} must be an array of real numbers, found {array.dtype}")
    return array.astype(float, copy=False)


def _coefficients(loop: Loop, prefilter: tuple[Any, Any]) -> tuple[list[Array], list[Array]]:
    """Check the prefilters that differ."""
    if loop.prefilter is not None:
        raise ValueError(f"prefilter must be given once: the loop has one already, found {loop.prefilter!r}")
    try:
        # iterating over a transfer function is an error of its own kind
        if not isinstance(prefilter, (tuple, list)):
            raise TypeError
        num, den = prefilter
        num, den = ([_real("prefilter", x) for x in part] for part in (num, den))
    except (TypeError, ValueError):
        raise TypeError(f"prefilter must be two sequences of coefficients, found {prefilter!r}") from None
    if not 0 < len(num) <= len(den):
        raise ValueError(f"prefilter must be proper, found {len(num)} and {len(den)} coefficients")
    return num, den


def _companion(den: Array) -> Array:
    """Return companion matrices of monic polynomials, shape (..., degree + 1)."""
    q = den.shape[-1] - 1
    A = np.zeros((*den.shape[:-1], q, q))
    A[..., 0, :] = -den[..., 1:]
    A[..., 1:, :-1] += np.eye(q - 1)
    return A


def controllers(bank: Bank, limits: tuple[float, float], h: float, width: int) -> Iterator[Controllers]:
    """Discretise the sets, one-dimensional here, for the sample time h, in groups of so many lanes.

    The step is that of a `DigitalController`, exact for held inputs; its numbers differ. The last group is filled up
    with its last set.
    """
    (sets,) = bank.shape
    size = -(-sets // width) * width
    kp, kd, ka, ti, time = (_padded(bank.values[name], sets, size) for name in ALLOWED)
    n = bank.order
    gains = np.stack([kp, kd / time, ka / time**2, *np.zeros((n, size))][: n + 1], axis=-1)
    if n:
        gains = held_gains(gains, np.repeat(time[:, None], n, axis=1), h)
    any_gains = SeriesPIDA(1.0, 0.0, 0.0, ti=1.0, filter_time=1.0, filter_order=n).discretise(
        min(h, 1.0), "zoh", limits=limits
    )
    path = any_gains.paths[0]._replace(gains=(1.0,) * (n + 1))
    made = program(replace(any_gains, paths=(path,)))
    code, places, numbers = operations(made, {**made.states, "started": True})
    table = np.repeat(numbers[:, None], size, axis=1)
    name = path.name.upper()
    table[[places[f"{name}_GAIN_{k}"] for k in range(n + 1)]] = gains.T
    table[places["INTEGRAL_OLD"]] = -np.expm1(-h / ti)
    if n:
        table[places[f"{name}_OLD"]] = -np.expm1(-h / time)
    whole = (table, *_prefilter(bank, sets, size, h))
    # cut into groups that lie together in memory
    for start in range(0, size, width):
        yield Controllers(code, *(np.ascontiguousarray(x[..., start : start + width]) for x in whole))


def _padded(x: Array, sets: int, size: int) -> Array:
    """Repeat a number for all sets, and the last set up to a full group."""
    full = np.broadcast_to(x, (sets,))
    return np.concatenate([full, np.repeat(full[-1:], size - sets)])


def _prefilter(bank: Bank, sets: int, size: int, h: float) -> tuple[Array, Array, Array, Array]:
    """Discretise the prefilters in controllable form, in a time unit of their own; the sets are the last axis."""
    q = len(bank.den) - 1
    # monic denominators, one row for each set
    num = np.stack([_padded(x, sets, size) for x in bank.num], axis=-1)
    den = np.stack([_padded(x, sets, size) for x in bank.den], axis=-1)
    num, den = num / den[:, :1], den / den[:, :1]
    # a unit of time in which s is about 1 at the poles, so that the companion matrix is well scaled
    unit = np.abs(den[:, -1:]) ** (-1 / max(q, 1))
    scale = unit ** np.arange(q + 1)
    num, den = num * scale, den * scale
    # the held input as a further state: one exponential gives both its transition and its influence
    augmented = np.zeros((size, q + 1, q + 1))
    if q:
        augmented[:, :q, :q] = _companion(den)
        augmented[:, 0, q] = 1.0
    transition = expm(augmented * (h / unit)[:, :, None])
    phi, gamma = transition[:, :q, :q], transition[:, :q, q]
    # output: what is left of the numerator when the direct share is taken out
    d = num[:, 0]
    c = num[:, 1:] - d[:, None] * den[:, 1:]
    return tuple(np.moveaxis(x, 0, -1) for x in (phi, gamma, c, d))  # type: ignore[return-value]
