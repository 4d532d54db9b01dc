"""Parameter sets of a portrait, and the digital controllers and prefilters they stand for, many at once."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm
from scipy.special import gammainc

from pidalab._check import Array
from pidalab.controllers import SeriesPIDA
from pidalab.loop import Loop, require_loop
from pidalab.simulation import lanes
from pidalab.simulation.lanes import Controllers
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
        for name, given in dict(
            parameters
        ).items():  # not what iterates: a Series of pandas has its values there
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
        groups = [lanes.run(own, plant, *limits, h, r, d, n) for own in controllers(self, h, lanes.LANES)]
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
        if not isinstance(
            prefilter, (tuple, list)
        ):  # iterating over a transfer function is an error of its own kind
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


def controllers(bank: Bank, h: float, width: int) -> Iterator[Controllers]:
    r"""Discretise the sets, one-dimensional here, for the sample time h, in groups of so many lanes.

    The filter is a chain of equal lags. Its transition is :math:`e^{-\tau} e^{\tau N}` with N one below the diagonal
    and :math:`\tau = h/T_f`. In the basis of the vectors :math:`M^k e_1`, :math:`M = (e^{\tau N} - 1)/\tau`, it is
    :math:`e^{-\tau}(1 + \tau N)`, which takes the fewest operations; the change of basis is made of Stirling numbers.

    The last group is filled up with its last set.
    """
    (sets,) = bank.shape
    size = -(-sets // width) * width
    kp, kd, ka, ti, time = (_padded(bank.values[name], sets, size) for name in ALLOWED)
    n, tau = bank.order, h / time
    direct, reading = _readings(kp, kd, ka, time, n)
    # what a held input of 1 makes of the states in a sample: state j of a chain of lags is an incomplete gamma function
    filling = gammainc(np.arange(n)[:, None] + 1, tau)
    # the same input and output in the basis in which the transition takes the fewest operations
    into, back = _change_of_basis(tau, n)
    gamma, c = np.zeros_like(filling), np.zeros_like(filling)
    for j in range(n):
        gamma += back[:, j] * filling[j]
        c += into[j] * reading[j]
    # transition of a state, and what it hands on to the next; share of the control signal that the reset takes up
    stay, move = np.exp(-tau), tau * np.exp(-tau)
    new = -np.expm1(-h / ti)
    whole = (stay, move, gamma, c, direct, new, *_prefilter(bank, sets, size, h))
    # cut into groups that lie together in memory
    for start in range(0, size, width):
        yield Controllers(*(np.ascontiguousarray(x[..., start : start + width]) for x in whole))


def _readings(kp: Array, kd: Array, ka: Array, time: Array, n: int) -> tuple[Array, Array]:
    """Return what kp + kd s + ka s^2 behind the chain of lags takes from its input, (sets,), and states, (n, sets).

    Each lag has s x_n = (x_{n-1} - x_n)/T_f: derivatives of the output are differences of the last states, and of the
    input where there are too few.
    """
    # kd s: x_n from x_{n-1}; ka s^2: from x_{n-2}, too
    of_last = kp - kd / time + ka / time**2
    of_next = kd / time - 2 * ka / time**2
    of_third = ka / time**2
    if n == 0:
        return kp, np.zeros((0, time.size))
    if n == 1:
        return kd / time, (kp - kd / time)[None, :]
    rows = np.zeros((n + 1, time.size))  # the input first, then the states
    rows[n] = of_last
    rows[n - 1] = of_next
    rows[n - 2] = of_third
    return rows[0], rows[1:]


def _change_of_basis(tau: Array, n: int) -> tuple[Array, Array]:
    """Return the matrix of the vectors M^k e_1 and its inverse, (n, n, sets): powers of (e^tx - 1)/t, log(1 + tx)/t."""
    # Stirling numbers of the second kind (powers of e^x - 1) and, with signs, of the first (of log(1 + x))
    second, first = np.eye(n), np.eye(n)
    for j in range(1, n):
        for k in range(1, n):
            second[j, k] = second[j - 1, k - 1] + k * second[j - 1, k]
            first[j, k] = first[j - 1, k - 1] - (j - 1) * first[j - 1, k]
    # coefficient of x^j in the k-th power, with x in units of 1/tau
    into, back = np.zeros((n, n, tau.size)), np.zeros((n, n, tau.size))
    for j in range(n):
        for k in range(j + 1):
            scaled = tau ** (j - k) * math.factorial(k) / math.factorial(j)
            into[j, k] = second[j, k] * scaled
            back[j, k] = first[j, k] * scaled
    return into, back


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
