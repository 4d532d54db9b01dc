"""Checks of arguments. If a check fails, it raises an error that names the argument and the value found."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# float() accepts some of these types, but they are not numbers.
NO_NUMBERS = (str, bytes, bool, np.bool_, np.datetime64, np.timedelta64)

LARGEST = 1e150  # the square of this number does not overflow
BLOCK = 4096  # number of values that are checked together
INDICES = np.arange(BLOCK)
HIGHEST = 400  # highest order of a lag, filter or expansion; polynomials of higher order overflow


def real(
    name: str, value: Any, *, above: float = -math.inf, at_least: float = -math.inf, at_most: float = math.inf
) -> float:
    """Return `value` as a finite float within bounds."""
    try:
        if isinstance(value, NO_NUMBERS):
            raise TypeError
        number = float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be a real number, found {value!r}") from None
    except OverflowError:
        raise ValueError(f"{name} must be finite, found a number beyond double precision") from None
    finite = math.isfinite(number)
    if finite and above < number and at_least <= number <= at_most:
        return number
    bounds = (("above", above), ("at least", at_least), ("at most", at_most))
    allowed = ["finite"] * (not finite) + [f"{word} {x:g}" for word, x in bounds if math.isfinite(x)]
    raise ValueError(f"{name} must be {' and '.join(allowed)}, found {value!r}")


def integer(name: str, value: Any, *, at_least: int, at_most: float = math.inf) -> int:
    """Return `value` as an int from `at_least` to `at_most`."""
    number = real(name, value)
    if not number.is_integer() or number < at_least:
        raise ValueError(f"{name} must be a whole number, at least {at_least}, found {value!r}")
    if number > at_most:
        raise ValueError(f"{name} must be at most {at_most}, found {value!r}")
    return int(value)


def order(name: str, value: Any, *, at_least: int) -> int:
    """Return `value` as the order of a lag, filter or expansion."""
    return integer(name, value, at_least=at_least, at_most=HIGHEST)


def choice(name: str, value: Any, allowed: Iterable[str | None]) -> None:
    """Raise unless `value` is one of the allowed values."""
    if not isinstance(value, str | None) or value not in allowed:
        *others, last = map(repr, allowed)
        raise ValueError(f"{name} must be {', '.join(others)} or {last}, found {value!r}")


def carrier(value: Any, kind: type) -> str:
    """Return a hint such as ``; pass its .process`` if an attribute of `value` has the type `kind`. Else return ""."""
    for name in ("process", "model", "controller"):
        if isinstance(getattr(value, name, None), kind):
            return f"; pass its .{name}"
    return ""


def _require_plain(name: str, value: Any, what: str) -> None:
    """Raise if `value` is an array with a unit of time, or with masked values, which a conversion would lose."""
    kind = getattr(value, "dtype", None)
    if isinstance(kind, np.dtype) and kind.kind in "mM":
        raise TypeError(
            f"{name} must be {what}, found {kind}, which has a unit; divide time differences by np.timedelta64(1, 's')"
        )
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise ValueError(f"{name} must be {what}, found masked values; fill them first, or leave them out")


def _copied(name: str, value: ArrayLike, kind: type, others: str, what: str) -> Any:
    """Return a copy of `value` as an array of type `kind`. Raise if its `dtype.kind` is one of the letters `others`."""
    if type(value) is np.ndarray and value.dtype == kind:
        return value.copy()
    _require_plain(name, value, what)
    try:
        array = np.array(value)
        if array.dtype.kind in others:
            raise TypeError
        return array.astype(kind, copy=False)
    except (TypeError, ValueError, OverflowError):
        shown = repr(value)
        shown = shown if len(shown) < 80 else f"{type(value).__name__} {shown[:60]}..."
        raise TypeError(f"{name} must be {what}, found {shown}") from None


def _real_array(name: str, value: ArrayLike) -> Array:
    """Return a copy as a float array of any shape. Raise if there are imaginary parts."""
    return _copied(name, value, float, "cUSOmM", "an array of real numbers")


def array(name: str, value: ArrayLike) -> Array:
    """Return `value` as a finite, non-empty float array of any shape."""
    return _finite(name, _real_array(name, value))


def _finite(name: str, values: Array) -> Array:
    """Return an array unchanged, or raise if it is empty or not finite."""
    if not values.size:
        raise ValueError(f"{name} must hold at least one number, found shape {values.shape}")
    if not all_finite(values):
        where = tuple(np.argwhere(~np.isfinite(values))[0].tolist())
        at = f" at index {where[0] if len(where) == 1 else where}" if where else ""
        raise ValueError(f"{name} must be finite, found {values[where]}{at}")
    return values


def all_finite(values: Array) -> bool:
    """Return True if all numbers are finite. If the sum is finite, this is known without a temporary array."""
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(np.add.reduce(values, axis=None)) or np.isfinite(values).all())


def complex_array(name: str, value: ArrayLike) -> Any:
    """Return `value` as finite complex numbers of any shape. Raise for text."""
    array = _copied(name, value, complex, "USOmM", "complex numbers")
    finite = np.isfinite(array)
    if not finite.all():
        raise ValueError(f"{name} must be finite, found {array[~finite].flat[0]}")
    return array


def vector(name: str, value: ArrayLike, *, minimum_length: int = 1) -> Array:
    """Return `value` as a finite one-dimensional float array."""
    return _one_dimensional(name, _real_array(name, value), minimum_length)


def _one_dimensional(name: str, values: Array, minimum_length: int = 1) -> Array:
    """Return `values` unchanged, or raise if they are not one-dimensional, not finite, or too few."""
    if values.ndim != 1 or values.size < minimum_length:
        raise ValueError(
            f"{name} must be one-dimensional with at least {minimum_length} value(s), found shape {values.shape}"
        )
    return _finite(name, values)


def polynomial(name: str, value: ArrayLike) -> Array:
    """Return descending coefficients without leading zeros. Return ``[0.]`` for the zero polynomial."""
    array = _real_array(name, value)
    array = _one_dimensional(name, array if array.ndim else array.reshape(1))
    if not array[0]:
        array = np.trim_zeros(array, "f")
    return array if array.size else np.zeros(1)


def proper(what: str, num: Array, den: Array) -> None:
    """Raise unless num/den is a proper rational function."""
    if not den.any():
        raise ValueError(f"{what}: den must not be the zero polynomial")
    if len(num) > len(den):
        raise ValueError(
            f"{what} must be proper, found degrees {len(num) - 1} of num and {len(den) - 1} of den; "
            f"add a filter of order {len(num) - len(den)} or more"
        )


def uniform_time(name: str, value: ArrayLike) -> Array:
    """Return a uniform time grid that starts at 0."""
    t = vector(name, value, minimum_length=2)
    if t[0] != 0.0:
        raise ValueError(f"{name} must start at 0, found {t[0]:g}; subtract this from all times")
    step = float(t[-1]) / (t.size - 1)
    if step <= 0:
        raise ValueError(f"{name} must increase, found a last value of {t[-1]:g}")
    # Check block by block, since large temporary arrays would take longer than the arithmetic.
    for start in range(0, t.size, BLOCK):
        block = t[start : start + BLOCK]
        grid = step * (start + INDICES[: block.size])
        off = np.abs(block - grid)
        # Rounding errors of times in single precision grow with time. So the tolerance of the second test grows, too.
        if off.max() > 1e-6 * step:
            far = np.flatnonzero(off > 1e-6 * (step + grid))
            if far.size:
                i = int(far[0])
                raise ValueError(
                    f"{name} must be uniform with step {step:g}, found {block[i]:.12g} at index {start + i} instead of "
                    f"{grid[i]:.12g}; resample first, for instance with np.interp"
                )
    return t


def signal(name: str, value: ArrayLike, size: int) -> Array:
    """Return a held signal of `size` samples. If `value` is a number, the array stores it only once."""
    array = np.zeros(()) if isinstance(value, (int, float)) else _real_array(name, value)
    if array.ndim == 0:
        return np.broadcast_to(real(name, value), size)
    if array.shape != (size,):
        raise ValueError(f"{name} must be a number or as long as t ({size}), found shape {array.shape}")
    return _finite(name, array)


def is_constant(signal: Array) -> bool:
    """Return True if a held signal is constant. An array with stride 0 stores one number and needs no comparison."""
    return signal.strides == (0,) or bool((signal[1:] == signal[:-1]).all())


def signals(t: ArrayLike, **given: ArrayLike) -> tuple[Array, ...]:
    """Return uniform times that start at 0, and the named signals as held signals at these times."""
    times = uniform_time("t", t)
    return times, *(signal(name, value, times.size) for name, value in given.items())


def squarable(name: str, array: Array) -> None:
    """Raise if the largest magnitude is finite, but its square could overflow. NaN is ignored."""
    largest = float(np.nanmax(np.abs(array), initial=0.0))
    if LARGEST < largest < math.inf:
        raise ValueError(f"{name} must be below {LARGEST:g}, found {largest:g}")


def pair(name: str, what: str, value: Any) -> tuple[float, float]:
    """Return two numbers as floats. `what` is their meaning in the error message."""
    try:  # infinite floats and NaN are allowed here
        first, second = (float(x) if isinstance(x, (float, np.floating)) else real(name, x) for x in value)
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be two numbers, {what}, found {value!r}") from None
    return first, second


def limits(value: Any) -> tuple[float, float]:
    """Return lower and upper limit as floats, possibly infinite. Raise unless lower < upper."""
    low, high = pair("limits", "lower and upper", value)
    if not low < high:
        raise ValueError(f"limits must be (lower, upper) with lower < upper, found {value!r}")
    return low, high
