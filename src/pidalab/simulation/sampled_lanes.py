"""Simulate many sampled loops in parallel, and compute their measures during the simulation.

The loops have the same plant, limits and inputs but different controllers. Each variable is a row of `LANES` numbers.
Each loop has one place in every row, its lane. Every operation acts on whole rows, which compiles to vector
instructions. The result in a lane does not depend on the other lanes.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab._compiled import compiled, inlined
from pidalab.simulation import operations as op
from pidalab.simulation.sampled_step import Steps, stepper

LANES = 128
SIXTH, THIRD = 1.0 / 6.0, 1.0 / 3.0
# A change of sign of the control error e within a sample is ignored if |e| at both ends is at most NEGLIGIBLE times the
# largest |e|. The area of the other sign is then subtracted from IAE and ITAE instead of added. So IAE is too small by
# at most 2e-13 times the largest |e| times the duration. For ITAE this bound is multiplied by the duration.
NEGLIGIBLE = 1e-13

MEASURES = ("ie", "iae", "ise", "itae", "tv_y", "tv_u", "y_min", "y_max", "u_min", "u_max", "y_end", "u_end")
IE, IAE, ISE, ITAE, TV_Y, TV_U, Y_MIN, Y_MAX, U_MIN, U_MAX, Y_END, U_END = range(len(MEASURES))


class Controllers(NamedTuple):
    """Digital controllers and prefilters, one of each in every lane. All execute the same step on different numbers."""

    code: np.ndarray  # the code of `Operations`
    numbers: Array  # (places, LANES)
    prefilter_phi: Array  # (q, q, LANES)
    prefilter_gamma: Array  # (q, LANES)
    prefilter_c: Array  # (q, LANES)
    prefilter_d: Array  # (LANES,)


step_all = stepper(LANES)


@compiled
def run(bank: Controllers, plant: Steps, h: float, reference: Array, load: Array, noise: Array) -> Array:
    """Run the loops of all lanes and return their measures, shape (measures, LANES).

    Notes
    -----
    At the beginning of sample k, `x` holds the states of all plants at t_k, and `f` the states of the prefilters.
    `past` is a ring buffer with the plant inputs of one dead time, and `slot` is the place of the present input. The
    measures of an interval are computed at its end, from the values at both ends and the exact integral of y between
    them.
    """
    states = plant.c.size
    # With a set point of 0 at all times, the prefilter stays at rest.
    degree = bank.prefilter_gamma.shape[0] if reference.any() else 0
    size = plant.lag_samples[0] + 1
    past = np.zeros((size, LANES))
    slot = 0
    x, x_new = np.zeros((states, LANES)), np.zeros((states, LANES))
    f, f_new = np.zeros((degree, LANES)), np.zeros((degree, LANES))
    numbers = bank.numbers
    setpoint, measurement, control = numbers[op.SETPOINT], numbers[op.MEASUREMENT], numbers[op.CONTROL]
    y, y_old = np.zeros(LANES), np.zeros(LANES)
    area_old, u_old = np.zeros(LANES), np.zeros(LANES)
    curve, plain = np.zeros(LANES), np.zeros(LANES)
    largest, mixed = np.zeros(LANES), np.zeros(LANES, np.intp)
    m = np.zeros((len(MEASURES), LANES))
    for k in range(reference.size):
        # The direct part of the plant reads the oldest input, which has passed the dead time.
        after = slot + 1 if slot + 1 < size else 0
        y[:] = 0.0
        _add_scaled(plant.c, x, y)
        if plant.d != 0:
            for i in range(LANES):
                y[i] += plant.d * past[after, i]
        # The last state of the plant is the running integral of y.
        area = x[states - 1]
        if k:
            _integrate(
                m, curve, plain, mixed, largest, y_old, y, area_old, area, reference[k - 1], h, h * (k - 1)
            )
        _follow(m[TV_Y], m[Y_MIN], m[Y_MAX], y, y_old)
        area_old[:] = area

        _scale(bank.prefilter_d, reference[k], setpoint)
        if degree:
            _add_products(bank.prefilter_c, f, setpoint)
            for row in range(degree):
                _scale(bank.prefilter_gamma[row], reference[k], f_new[row])
                _add_products(bank.prefilter_phi[row], f, f_new[row])
            f, f_new = f_new, f
        for i in range(LANES):
            measurement[i] = y[i] + noise[k]
        step_all(bank.code, numbers)
        u = past[slot]
        u[:] = control
        _follow(m[TV_U], m[U_MIN], m[U_MAX], u, u_old)
        u += load[k]
        for piece in range(plant.lag_samples.size):
            place = slot - plant.lag_samples[piece]
            v = past[place + size if place < 0 else place]
            for row in range(states):
                _scale(v, plant.gamma[piece, 0, row], x_new[row])
                _add_scaled(plant.phi[piece, 0, row], x, x_new[row])
            x, x_new = x_new, x
        slot = after
    m[Y_END], m[U_END] = y_old, u_old
    m[: ITAE + 1] *= h
    return m


@inlined
def _scale(row: Array, factor: float, out: Array) -> None:
    """Write a multiple of a row into `out`."""
    for i in range(LANES):
        out[i] = factor * row[i]


@inlined
def _add_scaled(factors: Array, rows: Array, out: Array) -> None:
    """Add rows to `out`, each multiplied by a number that all lanes share."""
    for row in range(factors.size):
        factor, source = factors[row], rows[row]
        if factor != 0:
            for i in range(LANES):
                out[i] += factor * source[i]


@inlined
def _add_products(factors: Array, rows: Array, out: Array) -> None:
    """Add rows to `out`, multiplied element by element by rows of factors."""
    for row in range(factors.shape[0]):
        factor, source = factors[row], rows[row]
        for i in range(LANES):
            out[i] += factor[i] * source[i]


@inlined
def _follow(variation: Array, least: Array, most: Array, value: Array, old: Array) -> None:
    """Update total variation and extremes with a new value."""
    for i in range(LANES):
        variation[i] += abs(value[i] - old[i])
    for i in range(LANES):
        least[i] = min(least[i], value[i])
    for i in range(LANES):
        most[i] = max(most[i], value[i])
    for i in range(LANES):
        old[i] = value[i]


@inlined
def _integrate(
    m: Array,
    curve: Array,
    plain: Array,
    mixed: Any,
    largest: Array,
    y_old: Array,
    y: Array,
    area_old: Array,
    area: Array,
    r: float,
    h: float,
    start: float,
) -> None:
    """Add the integrals of the error over a sample, divided by h. The error is a parabola, as in `Response`."""
    # Compute curvature and mean of the parabola that has the exact end values and the exact area.
    for i in range(LANES):
        curve[i] = 3.0 * (r - y_old[i] + r - y[i]) - 6.0 * (r - (area[i] - area_old[i]) / h)
    for i in range(LANES):
        plain[i] = 0.5 * (r - y_old[i] + r - y[i]) - SIXTH * curve[i]
    # Integrate e, |e| and t |e| as if e kept its sign.
    for i in range(LANES):
        m[IE, i] += plain[i]
    for i in range(LANES):
        m[IAE, i] += abs(plain[i])
    for i in range(LANES):
        first, last = r - y_old[i], r - y[i]
        m[ITAE, i] += abs(start * plain[i] + h * (SIXTH * (first + 2.0 * last) - 0.5 * SIXTH * curve[i]))
    for i in range(LANES):
        first, last = r - y_old[i], r - y[i]
        bent = curve[i] * (0.2 * curve[i] - first - last)
        m[ISE, i] += SIXTH * (2.0 * (first * first + first * last + last * last) + bent)
    # The parabola differs from its chord by at most |curve|/4. So e can change its sign only if its end values have
    # opposite signs, or if one end value is within |curve|/4 of 0.
    for i in range(LANES):
        largest[i] = max(largest[i], max(abs(r - y_old[i]), abs(r - y[i])))
    for i in range(LANES):
        first, last = r - y_old[i], r - y[i]
        near = abs(first + last) - abs(first - last) <= 0.5 * abs(curve[i])
        mixed[i] = near & (max(abs(first), abs(last)) > NEGLIGIBLE * largest[i])
    # In the lanes where e may change its sign, correct the integrals of |e| and t |e|.
    some = 0
    for i in range(LANES):
        some += mixed[i]
    for i in range(LANES if some else 0):
        if mixed[i]:
            first, last = r - y_old[i], r - y[i]
            more, weighted = _beyond(first, last - first - curve[i], curve[i], h, start)
            m[IAE, i] += more
            m[ITAE, i] += weighted


@compiled
def _beyond(c0: float, c1: float, c2: float, h: float, start: float) -> tuple[float, float]:
    """Return the amounts by which sign changes of e = c0 + c1 s + c2 s^2 increase two integrals over 0 <= s <= 1.

    The integrands are ``|e|`` and ``(start + h s) |e|``.
    """
    # Find the roots between 0 and 1 in ascending order, without cancellation.
    cuts = np.array([0.0, 0.0, 0.0, 1.0])
    square = c1 * c1 - 4 * c2 * c0
    if square >= 0:
        q = -0.5 * (c1 + math.copysign(math.sqrt(square), c1))
        cuts[1] = min(max(q / c2, 0.0), 1.0) if c2 != 0 else 0.0
        cuts[2] = min(max(c0 / q, 0.0), 1.0) if q != 0 else 0.0
        if cuts[1] > cuts[2]:
            cuts[1], cuts[2] = cuts[2], cuts[1]
    # Sum the areas between the roots, once with their sign and once without.
    plain, weighted = 0.0, 0.0
    plain_sum, weighted_sum = 0.0, 0.0
    before, before_rising = 0.0, 0.0
    for s in cuts[1:]:
        area = s * (c0 + s * (0.5 * c1 + s * THIRD * c2))
        moment = s * s * (0.5 * c0 + s * (THIRD * c1 + 0.25 * s * c2))
        part = area - before
        part_weighted = start * part + h * (moment - before_rising)
        plain += abs(part)
        weighted += abs(part_weighted)
        plain_sum += part
        weighted_sum += part_weighted
        before, before_rising = area, moment
    return plain - abs(plain_sum), weighted - abs(weighted_sum)
