"""State-space form of a loop that is cut at its dead time.

A derivative filter a hundred thousand times faster than the plant computes s^2 y as a difference of nearly equal
states, divided by 1e-10: in double precision nothing is left. So the states are sorted by speed into groups, and groups
of different speed are decoupled exactly: what a fast block makes of a slow signal is then a row over the slow states
(the block's transfer function, evaluated at their matrix), and only its own fast transient stays a state.

Within a group the states are a chain, pole by pole: see `pidalab.simulation.chains`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab._compiled import compiled
from pidalab.loop import Loop, require_well_posed
from pidalab.roots import roots
from pidalab.simulation.chains import fractions
from pidalab.simulation.decoupling import decoupling, past_of

GAP = 10.0  # poles whose speeds differ by more than this factor go to different groups,
LOUD = 100.0  # but for those where the gain of the loop is still above this
RANGE = 1e290  # size of a coefficient beyond which, or below its inverse, digits are lost,
GAINS = 1e150  # and of one over the leading coefficient, as a gain


Ratio = tuple[Array, float, Any]  # numerator, leading coefficient of the denominator, poles by modulus


class Cut(NamedTuple):
    """The loop opened at the dead time, driven by w(t) = v(t - delay), the delayed process input.

    x' = A x + b w,  v = c_v x + d_v w,  outputs = C x + d w, from x(0) = x0; the step inputs are states too. Time is
    counted in `unit`.
    """

    A: Array  # (d, d)
    b: Array  # (d,)
    c_v: Array  # (d,)
    d_v: float
    C: Array  # (3, d), rows: y, running integral of y, u
    d: Array  # (3,)
    x0: Array  # (d, inputs), the state just after a unit step on each input
    unit: float


def cut_at_delay(loop: Loop, inputs: str) -> Cut:
    """Open the loop at its dead time; `inputs` names the step inputs to keep, out of "r", "d", "n"."""
    require_well_posed(loop)
    process, prefilter = _factored(*loop.blocks["process"]), _factored(*loop.blocks["prefilter"])
    control = _product(_factored(*loop.blocks["controller"]), _factored(*loop.blocks["output_filter"]))
    codes = np.array(["rdn".index(name) for name in inputs])
    cut = Cut(*_assembled(*process, *control, *prefilter, codes, loop.process.delay))
    if not np.isfinite(cut.unit):
        raise ValueError("the coefficients of the loop lie too far apart: they leave the range of numbers")
    return cut


def _factored(num: Array, den: Array) -> Ratio:
    """Return numerator, leading coefficient of the denominator and poles."""
    return (
        np.array(num, order="C"),
        float(den[0]),
        np.array(roots(den)),
    )  # copies: code is compiled for one kind of array


def _product(first: Ratio, second: Ratio) -> Ratio:
    """Return two blocks in series as one; nothing is cancelled."""
    if second[2].size == 0 and second[0].size == 1:
        return first[0] * second[0][0], first[1] * second[1], first[2]
    poles = np.concatenate([first[2], second[2]])
    return (
        np.convolve(first[0], second[0]),
        first[1] * second[1],
        poles[np.argsort(np.abs(poles), kind="stable")],
    )


@compiled
def _size(num, lead, poles, s):
    """Return the absolute value of a block."""
    value = 0.0j
    for coefficient in num:
        value = value * s + coefficient
    size = abs(value / lead)
    for pole in poles:
        size /= abs(s - pole)
    return size


@compiled
def _groups(poles, speeds):
    """Group of each pole: the number of gaps between sorted speeds that lie below it."""
    group = np.zeros(poles.size, dtype=np.int64)
    for i in range(speeds.size - 1):
        if speeds[i + 1] > GAP * speeds[i]:
            edge = np.sqrt(speeds[i] * speeds[i + 1])
            for j in range(poles.size):
                if abs(poles[j]) > edge:
                    group[j] += 1
    return group


@compiled
def _in_unit(num, lead, poles, unit):
    """Numerator and poles in another unit of time, and whether all digits are left; the leading coefficient stays."""
    scaled, faster, whole = np.empty(num.size), np.empty(poles.size, dtype=np.complex128), True
    for k in range(num.size):
        scaled[k] = num[k] * unit ** (poles.size - num.size + 1.0 + k)
        size = abs(scaled[k])
        if num[k] != 0.0 and not (1 / RANGE < size < RANGE and 1 / GAINS < size / abs(lead) < GAINS):
            whole = False
    for k in range(poles.size):
        faster[k] = poles[k] * unit
    return scaled, faster, whole


@compiled
def _through(A, b, x0, group, count, num, lead, poles, speeds, source, direct):
    """Append a block that is driven by a signal (a row over the states, and a share of w); return its output."""
    n, of_pole = poles.size, _groups(poles, speeds)
    own_A, own_b = fractions(num, lead, poles, of_pole)
    out = np.zeros(b.size)
    for i in range(n):
        for j in range(n):
            A[count + i, count + j] = own_A[i, j]
        b[count + i] = own_b[i] * direct
        group[count + i] = of_pole[i]
    for g in range(b.size + 1):
        # the states of this group so far, what the signal reads of them and how they run on their own
        old, m = np.empty(count, dtype=np.int64), 0
        for i in range(count):
            if group[i] == g:
                old[m] = i
                m += 1
        row, own_old = np.zeros(m), np.zeros((m, m))
        driven = False
        for i in range(m):
            row[i] = source[old[i]]
            driven = driven or row[i] != 0.0
            for j in range(m):
                own_old[i, j] = A[old[i], old[j]]
        if not driven:
            continue
        slow = 0
        while slow < n and of_pole[slow] <= g:
            slow += 1
        past = past_of(num, lead, poles, slow, own_A, own_b, row, own_old)
        for i in range(m):
            out[old[i]] = past[i]
        lo = 0
        while lo < n:
            hi = lo
            while hi < n and of_pole[hi] == of_pole[lo]:
                hi += 1
            if of_pole[lo] == g:  # of one speed: the old states drive the new ones
                for i in range(lo, hi):
                    for j in range(m):
                        A[count + i, old[j]] = own_b[i] * row[j]
            else:
                X = decoupling(poles[lo:hi], own_A[lo:hi, lo:hi], own_b[lo:hi], row, own_old)
                for j in range(m):
                    if of_pole[lo] < g:
                        out[old[j]] += X[hi - lo - 1, j]
                    for i in range(lo, hi):
                        b[count + i] -= X[i - lo, j] * b[old[j]]
                        for k in range(x0.shape[1]):
                            x0[count + i, k] -= X[i - lo, j] * x0[old[j], k]
            lo = hi
    for i in range(n):
        if i == n - 1 or of_pole[i + 1] != of_pole[i]:
            out[count + i] = 1.0
    return out, direct * num[0] / lead if num.size == n + 1 else 0.0


@compiled
def _assembled(p_num, p_lead, p_poles, c_num, c_lead, c_poles, f_num, f_lead, f_poles, inputs, delay):
    """Put process, integral of its output, prefilter and controller one behind the other."""
    zero = np.zeros(1, dtype=np.complex128)
    speeds, count = np.zeros(p_poles.size + c_poles.size + f_poles.size + 1), 0
    for poles in (p_poles, c_poles, f_poles):
        for pole in poles:
            speeds[count] = abs(pole)
            count += 1
    # count time in the mean speed of the poles
    logs, moving = 0.0, 0
    for speed in speeds:
        if speed > 0.0:
            logs, moving = logs - np.log(speed), moving + 1
    unit = np.exp(logs / moving) if moving > 0 else delay if delay > 0.0 else 1.0
    p_num, p_poles, p_whole = _in_unit(p_num, p_lead, p_poles, unit)
    c_num, c_poles, c_whole = _in_unit(c_num, c_lead, c_poles, unit)
    f_num, f_poles, f_whole = _in_unit(f_num, f_lead, f_poles, unit)
    for i in range(speeds.size):
        speeds[i] *= unit
    if not (p_whole and c_whole and f_whole):
        unit = np.inf
    # to a loop far faster than some poles these are all integrators: apart, they would be differences of large numbers
    slow = 0.0
    for speed in speeds:
        s = speed * np.sqrt(1j)
        if _size(p_num, p_lead, p_poles, s) * _size(c_num, c_lead, c_poles, s) > LOUD:
            slow = max(slow, speed)
    # in order, each moved down to its place
    for i in range(speeds.size):
        speeds[i] = max(speeds[i], slow)
        k = i
        while k > 0 and speeds[k - 1] > speeds[k]:
            speeds[k - 1], speeds[k] = speeds[k], speeds[k - 1]
            k -= 1
    size = speeds.size + inputs.size
    A, b, x0 = np.zeros((size, size)), np.zeros(size), np.zeros((size, inputs.size))
    group = np.zeros(size, dtype=np.int64)
    # the constants behind the step inputs are states of the slowest group
    r, d, n = np.zeros(size), np.zeros(size), np.zeros(size)
    for i in range(inputs.size):
        x0[i, i] = 1.0
        row = r if inputs[i] == 0 else d if inputs[i] == 1 else n
        row[i] = 1.0
    count = inputs.size
    none, one = np.zeros(size), np.ones(1)

    y, y_direct = _through(A, b, x0, group, count, p_num, p_lead, p_poles, speeds, none, 1.0)
    count += p_poles.size
    area, area_direct = _through(A, b, x0, group, count, one, 1.0, zero, speeds, y, y_direct)
    count += 1
    error, error_direct = _through(A, b, x0, group, count, f_num, f_lead, f_poles, speeds, r, 0.0)
    count += f_poles.size
    for i in range(size):  # the filtered set point less the measurement
        error[i] -= y[i] + n[i]
    error_direct -= y_direct
    u, u_direct = _through(A, b, x0, group, count, c_num, c_lead, c_poles, speeds, error, error_direct)

    v, C, direct = np.zeros(size), np.zeros((3, size)), np.array([y_direct, area_direct, u_direct])
    for i in range(size):
        C[0, i], C[1, i], C[2, i] = y[i], area[i], u[i]
        v[i] = u[i] + d[i]
    if delay == 0.0:  # close the loop at once: w = v
        for j in range(size):
            w = v[j] / (1.0 - u_direct)
            for i in range(size):
                A[i, j] += b[i] * w
            for i in range(3):
                C[i, j] += direct[i] * w
        return A, none, none, 0.0, C, np.zeros(3), x0, unit
    return A, b, v, u_direct, C, direct, x0, unit
