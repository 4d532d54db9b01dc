r"""Roots of a polynomial from its coefficients, including multiple roots.

The eigenvalues of a companion matrix scatter an n-fold root over a circle. For 30 equal lags, for example, the computed
time constants differ by a factor of two. Therefore neighbouring roots are replaced by one multiple root, which
Gauss-Newton steps fit to the coefficients. The multiple root is accepted if its polynomial agrees with the coefficients
to rounding, or at least as well as the polynomial of the scattered roots.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pidalab._check import Array

# Roots whose relative distance is below one of these values are tried as one multiple root.
RADII = (1e-6, 1e-3, 0.02, 0.1, 0.3, 0.6)
# A difference of coefficients, relative to their size, counts as rounding if it is below SAME_COEFFICIENTS * degree.
SAME_COEFFICIENTS = 1e-14
ALLOWED = 1e-10  # largest difference of the coefficients, relative to their size, for accepted roots
TRUSTED_DEGREE = 8  # up to this degree, well separated eigenvalues are accepted directly
MULTIPLE_BEYOND = 40  # above this degree, at most half of the roots may be distinct
HIGHEST_DEGREE = 400
ON_AXIS = 1e-13  # a real part below this share of the modulus is taken for rounding and set to 0


def roots(polynomial: ArrayLike) -> Any:
    """Return the roots of a real polynomial in descending powers, sorted by modulus.

    Of a conjugate pair, the root in the upper half-plane is first. Leading zeros are ignored.

    Raises
    ------
    ValueError
        If the degree is above 400, or if no roots are found whose polynomial equals the given polynomial to ten digits.
    """
    coefficients = np.asarray(polynomial, dtype=float)
    if not (coefficients.size and coefficients[0]):
        coefficients = np.trim_zeros(coefficients, "f")
    return _roots(coefficients.tobytes())


@lru_cache(maxsize=4096)
def _roots(raw: bytes) -> Any:
    coefficients = np.frombuffer(raw)
    kept = np.trim_zeros(coefficients, "b")
    at_zero = np.zeros(coefficients.size - kept.size, dtype=complex)
    values = np.concatenate([at_zero, _of_nonzero(kept)])
    values.setflags(write=False)
    return values


def _of_nonzero(coefficients: Array) -> Any:
    """Return the roots of a polynomial whose last coefficient is not 0."""
    degree = coefficients.size - 1
    if degree < 1:
        return np.zeros(0, dtype=complex)
    if degree > HIGHEST_DEGREE:
        raise ValueError(f"the degree of a polynomial must be at most {HIGHEST_DEGREE}, found {degree}")
    with np.errstate(all="ignore"):
        monic = coefficients / coefficients[0]
        # Scale s by a power of 2, so that the first and the last coefficient are about equal.
        scale = 2.0 ** np.round(np.log2(abs(monic[-1])) / degree)
        scaled = monic / scale ** np.arange(degree + 1.0)
    if not (np.all(np.isfinite(scaled)) and np.array_equal(scaled == 0, coefficients == 0)):
        raise ValueError(
            f"the coefficients {coefficients[:4]}... differ too much in size to compute their roots"
        )
    if degree == 1:
        return np.array([-scale * scaled[1]], dtype=complex)
    size = _sizes(scaled)
    # The second coefficient is minus the sum of the roots. If all roots are equal, this coefficient gives them without
    # loss of digits.
    single = np.full(1, -scaled[1] / degree, dtype=complex)
    if degree > 2 and _difference(scaled, single, np.full(1, degree), size) <= SAME_COEFFICIENTS * degree:
        return np.repeat(single, degree) * scale
    if degree == 2:
        return _in_pairs(_of_quadratic(scaled) * scale)
    scattered = np.roots(scaled)
    # The computed copies of an n-fold root differ from the root by about eps^(1/n). This limits the search radius.
    scatter = 8 * np.finfo(float).eps ** (1 / degree)
    apart = np.abs(scattered[:, None] - scattered[None, :]) + 9.0 * np.eye(degree) * np.abs(scattered)
    if degree <= TRUSTED_DEGREE and np.min(apart / np.abs(scattered)) > scatter:
        return _in_pairs(scattered * scale)
    best, least = scattered, _difference(scaled, scattered, np.ones(degree), size)
    for radius in RADII:
        if radius > scatter and radius != RADII[0]:
            break
        merged, times = _merged(scattered, radius)
        if merged.size < degree:
            merged, off = _polished(scaled, merged, times, size)
            if off <= max(least, SAME_COEFFICIENTS * degree):
                best, least = np.repeat(merged, times.astype(int)), off
    if degree > MULTIPLE_BEYOND and np.unique(best).size > degree // 2:
        # The coefficients may agree, but rounding would spoil a response computed from so many distinct roots.
        least = 1.0
    if not least <= ALLOWED:
        raise ValueError(
            f"the roots of a polynomial of degree {degree} are lost in rounding: the polynomial of the computed roots "
            f"differs by {least:.1g}; take fewer lags, or another model"
        )
    return _in_pairs(best * scale)


def _of_quadratic(scaled: Array) -> Any:
    """Return the roots of s^2 + b s + c, without cancellation."""
    half_sum, inside = -0.5 * scaled[1], 0.25 * scaled[1] ** 2 - scaled[2]
    if inside < 0:
        return np.array([complex(half_sum, np.sqrt(-inside)), complex(half_sum, -np.sqrt(-inside))])
    large = half_sum + np.copysign(np.sqrt(inside), half_sum)
    return np.array([large, scaled[2] / large], dtype=complex)


def _difference(scaled: Array, values: Any, times: Array, size: Array) -> float:
    """Return max of ``abs(product - scaled) / size``, where `product` is the polynomial of the roots."""
    product = np.ones(1, dtype=complex)
    for root, multiplicity in zip(values, times, strict=True):
        for _ in range(int(multiplicity)):
            product = np.convolve(product, [1.0, -root])
    return float(np.max(np.abs(product - scaled) / size))


def _sizes(scaled: Array) -> Array:
    """Return typical sizes of coefficients, from the lowest concave curve above their logarithms (Newton polygon)."""
    # A coefficient whose terms cancel may lie far below the curve, and a difference relative to this coefficient would
    # be meaningless.
    k = np.flatnonzero(scaled)
    corners: list[tuple[int, float]] = []
    for point in zip(k.tolist(), np.log(np.abs(scaled[k])).tolist(), strict=True):
        while len(corners) > 1 and _below(corners[-2], corners[-1], point):
            corners.pop()
        corners.append(point)
    x, y = zip(*corners, strict=True)
    return np.exp(np.interp(np.arange(scaled.size), x, y))


def _below(first: tuple[int, float], middle: tuple[int, float], last: tuple[int, float]) -> bool:
    return (middle[1] - first[1]) * (last[0] - first[0]) <= (last[1] - first[1]) * (middle[0] - first[0])


def _merged(scattered: Any, radius: float) -> tuple[Any, Array]:
    """Join roots whose relative distance is at most `radius`. Keep conjugate pairs. Return means and multiplicities."""
    is_near = np.abs(scattered[:, None] - scattered[None, :]) <= radius * np.abs(scattered)[:, None]
    reach = is_near | is_near.T
    for _ in range(int(np.ceil(np.log2(scattered.size))) + 1):
        reach = reach @ reach
    groups = np.unique(reach, axis=0)
    means = np.array([scattered[group].mean() for group in groups])
    conjugate = np.array([np.array_equal(reach[np.argmin(np.abs(scattered - scattered[group][0].conj()))], group)
                          for group in groups])  # fmt: skip
    return np.where(conjugate, means.real, means), groups.sum(axis=1).astype(float)


def _polished(scaled: Array, values: Any, times: Array, size: Array) -> tuple[Any, float]:
    """Refine multiple roots by Gauss-Newton steps on the coefficients. Return roots and remaining difference."""
    real, best, least = values.imag == 0, values, _difference(scaled, values, times, size)
    weight = 1 / size[1:]
    # The fit is well conditioned, because the multiplicities are known.
    for _ in range(8):
        if least <= SAME_COEFFICIENTS * scaled.size:
            break
        product = np.poly(np.repeat(values, times.astype(int)))
        slopes = np.stack(
            [-m * np.polydiv(product, [1.0, -z])[0] for z, m in zip(values, times, strict=True)], axis=1
        )
        step = np.linalg.lstsq(slopes * weight[:, None], (scaled - product)[1:] * weight, rcond=None)[0]
        values = values + step
        values = np.where(real, values.real, values)
        off = _difference(scaled, values, times, size)
        if not off < least:
            break
        best, least = values, off
    return best, least


def _in_pairs(values: Any) -> Any:
    """Sort roots by modulus, with complex roots as exact pairs."""
    values = np.where(np.abs(values.real) <= ON_AXIS * np.abs(values), 1j * values.imag, values)
    upper = values[values.imag > 0]
    single = values[values.imag == 0].real
    order = np.argsort(np.concatenate([np.abs(single), np.abs(upper)]), kind="stable")
    parts = [[complex(z)] for z in single] + [[z, z.conjugate()] for z in upper]
    return np.array([z for i in order for z in parts[i]], dtype=complex)


def quadratic_roots(c0: Array, c1: Array, c2: Array) -> Array:
    """Return both roots of c0 + c1 s + c2 s^2 without cancellation. A root that is infinite or complex becomes 0."""
    with np.errstate(all="ignore"):
        q = -0.5 * (c1 + np.copysign(np.sqrt(c1**2 - 4 * c2 * c0), c1))
        return np.nan_to_num(np.stack([q / c2, c0 / q]), nan=0.0, posinf=0.0, neginf=0.0)


def border(holds: Callable[[float], bool], inside: float, outside: float, share: float = 1e-7) -> float:
    """Find the border between values at which a condition is true and values at which it is false, by bisection.

    Parameters
    ----------
    holds : callable
        The condition.
    inside, outside : float
        A value at which the condition is true, and a value at which it is false.
    share : float, optional
        Final distance of the two values, relative to the larger value.

    Returns
    -------
    float
        The border. The condition is true at this value.

    Examples
    --------
    >>> from pidalab.roots import border
    >>> border(lambda x: x * x > 2, inside=2.0, outside=1.0)
    1.414214
    """
    while abs(inside - outside) > share * max(abs(inside), abs(outside)):
        middle = 0.5 * (inside + outside)
        if holds(middle):
            inside = middle
        else:
            outside = middle
    return inside
