r"""Other methods to simulate a loop with dead time, with one function for each method.

Each function takes a loop, a horizon and a setting (an order, steps per dead time, or a tolerance). It does all
preparations, and returns a task. The task returns times and the response y to a unit step of the set point. Only the
task is timed.

All methods except Padé solve the same delay differential equation for the states of prefilter, controller and process,

.. math:: \dot x = A x + b\,v(t - h) + e, \qquad v = c_v x, \qquad y = c_y x, \qquad x(t) = 0 \text{ for } t \le 0,

where e is the effect of the set point. The equation is derived from the transfer functions, independently of the exact
simulation.
"""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Callable
from functools import reduce
from operator import mul
from typing import NamedTuple

import control
import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm, matrix_balance
from scipy.signal import tf2ss

import pidalab

Array = NDArray[np.float64]
Task = Callable[[], tuple[Array, Array]]

GRID = 500  # points per dead time, for methods that can compute at any time


class DelayEquation(NamedTuple):
    """The delay differential equation at the top of this module."""

    A: Array
    b: Array
    e: Array
    c_v: Array
    c_y: Array
    delay: float


def delay_equation(loop: pidalab.Loop) -> DelayEquation:
    """Set up the equation of a loop whose process and controller are strictly proper."""
    controller, output_filter = loop.blocks["controller"], loop.blocks["output_filter"]
    Af, bf, cf, df = _states(*loop.blocks["prefilter"])
    Ac, bc, cc, dc = _states(*(np.convolve(a, b) for a, b in zip(controller, output_filter, strict=True)))
    Ap, bp, cp, dp = _states(*loop.blocks["process"])
    if dc or dp:
        raise ValueError("process and controller must be strictly proper")
    f, c, p = len(bf), len(bc), len(bp)
    A = block_diag(Af, Ac, Ap)
    A[f : f + c, :f] = np.outer(bc, cf)
    A[f : f + c, f + c :] = -np.outer(bc, cp)
    return DelayEquation(
        A=A,
        b=np.concatenate([np.zeros(f + c), bp]),
        e=np.concatenate([bf, df * bc, np.zeros(p)]),
        c_v=np.concatenate([np.zeros(f), cc, np.zeros(p)]),
        c_y=np.concatenate([np.zeros(f + c), cp]),
        delay=loop.process.delay,
    )


def _states(num: Array, den: Array) -> tuple[Array, Array, Array, float]:
    """Realise num/den with states of similar size. The first state is the output minus its direct part."""
    A, B, C, D = tf2ss(num, den)
    _, (scale, _) = matrix_balance(A.T, permute=False, separate=True)
    scale /= scale[0]
    return A.T * scale / scale[:, None], C[0] / scale, B[:, 0] * scale, D[0, 0]


def grid(loop: pidalab.Loop, horizon: float, per_delay: int = GRID) -> Array:
    """Return uniform times from 0 to the horizon."""
    return np.linspace(0.0, horizon, round(horizon / loop.process.delay * per_delay) + 1)


def exact(loop: pidalab.Loop, horizon: float, setting: None = None, per_delay: int = GRID) -> Task:
    """Return the task of pidalab's exact simulation, which has no setting."""
    t = grid(loop, horizon, per_delay)
    return lambda: (t, pidalab.step_response(loop, t).y)


def pade(loop: pidalab.Loop, horizon: float, order: int, per_delay: int = GRID) -> Task:
    """Return the task of python-control with a Padé approximation of the dead time, in state space."""
    t, closed = grid(loop, horizon, per_delay), control.feedback(pade_chain(loop, order), 1)
    closed *= _system(*loop.blocks["prefilter"])
    return lambda: (t, control.step_response(closed, t).outputs)


def pade_chain(loop: pidalab.Loop, order: int) -> control.StateSpace:
    """Return the open loop of `pade`.

    The states are balanced, since those of python-control overflow at order 20.
    """
    blocks = [loop.blocks[name] for name in ("process", "output_filter", "controller")]
    return reduce(mul, (_system(*ratio) for ratio in (control.pade(loop.process.delay, order), *blocks)))


def _system(num: Array, den: Array) -> control.StateSpace:
    A, b, c, d = _states(np.atleast_1d(num), np.atleast_1d(den))
    return control.ss(A, b[:, None], c[None, :], d)


def hold(loop: pidalab.Loop, horizon: float, per_delay: int) -> Task:
    """Return the task of a first-order method that holds v(t - h) during each step and is exact otherwise."""
    equation, t = delay_equation(loop), grid(loop, horizon, per_delay)

    def task() -> tuple[Array, Array]:
        A, b, e, *_ = equation
        d = b.size
        step = expm(
            np.block([[A, b[:, None], e[:, None]], [np.zeros((2, d + 2))]]) * equation.delay / per_delay
        )
        shares = np.stack([step[:d, d], np.zeros(d), np.zeros(d)])
        return t, _march(equation, step[:d, :d], shares, step[:d, d + 1], per_delay, t.size)

    return task


def runge_kutta(loop: pidalab.Loop, horizon: float, per_delay: int) -> Task:
    """Return the task of the classical fourth-order Runge–Kutta method, compiled.

    The dead time is a multiple of the step, so no kink lies inside a step. Delayed values in the middle of a step are
    interpolated by cubic Hermite polynomials. The loop is linear, so a step is a matrix.
    """
    equation, t = delay_equation(loop), grid(loop, horizon, per_delay)

    def task() -> tuple[Array, Array]:
        A, b, e, *_ = equation
        step, one, none = equation.delay / per_delay, np.eye(b.size), np.zeros_like(A)
        R = _runge_kutta_step(A, step, one, none, none, none)
        parts = np.stack(
            [_runge_kutta_step(A, step, none, *(one if i == j else none for j in range(3))) for i in range(3)]
        )
        return t, _march(equation, R, parts @ b, parts.sum(axis=0) @ e, per_delay, t.size)

    return task


def _runge_kutta_step(A: Array, step: float, x: Array, first: Array, middle: Array, last: Array) -> Array:
    """Take one step of x' = A x + forcing, with the forcing at the start, in the middle and at the end."""
    k1 = A @ x + first
    k2 = A @ (x + step / 2 * k1) + middle
    k3 = A @ (x + step / 2 * k2) + middle
    k4 = A @ (x + step * k3) + last
    return x + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def _march(
    equation: DelayEquation, R: Array, shares: Array, constant: Array, each: int, points: int
) -> Array:
    """Take all steps x -> R x + shares.T @ (delayed values at start, middle and end) + constant. Return y."""
    A, b, e, c_v, c_y, delay = equation
    slope = (c_v @ A, c_v @ b, c_v @ e)  # slope of v, for the interpolant
    return march(R, shares, constant, c_v, c_y, slope, delay / each, each, points)


@njit(cache=True)
def march(R, shares, constant, c_v, c_y, slope, step, each, points):  # pragma: no cover
    """Run the compiled loop over the steps of `_march`, with `each` steps in a dead time."""
    d = constant.size
    of_x, of_past, start = slope
    x, new, y = np.zeros(d), np.zeros(d), np.zeros(points)
    v, dv = np.zeros(points), np.zeros(points)
    dv[0] = start
    for k in range(1, points):
        p, q = k - 1 - each, k - each  # indices of the delayed values at both ends of the step
        if p >= 0:
            first, last = v[p], v[q]
            middle = (first + last) / 2 + step / 8 * (dv[p] - dv[q])
        else:
            first = middle = last = 0.0
        for i in range(d):
            total = constant[i] + shares[0, i] * first + shares[1, i] * middle + shares[2, i] * last
            for j in range(d):
                total += R[i, j] * x[j]
            new[i] = total
        x, new = new, x
        dv[k] = start + of_past * last
        for i in range(d):
            v[k] += c_v[i] * x[i]
            dv[k] += of_x[i] * x[i]
            y[k] += c_y[i] * x[i]
    return y


def jitcdde(
    loop: pidalab.Loop, horizon: float, tolerance: float, per_delay: int = GRID, output: bool = True
) -> Task:
    """Return the compiled task of JiTCDDE: adaptive Bogacki–Shampine steps and cubic Hermite interpolation.

    A step of the set point causes kinks that travel round the loop. JiTCDDE's `adjust_diff` corrects the first
    derivative, and its `step_on_discontinuities` puts a step on the first dead time, up to which y is 0. Without
    `output` only the last value is requested.
    """
    from jitcdde import jitcdde, t, y

    A, b, e, c_v, c_y, delay = delay_equation(loop)
    times = grid(loop, horizon, per_delay)

    def combined(row: Array, time: object) -> object:
        return sum(float(row[i]) * y(i, time) for i in np.flatnonzero(row))

    w = combined(c_v, t - delay)
    right = [combined(A[i], t) + float(b[i]) * w + float(e[i]) for i in range(b.size)]
    solver = jitcdde(right, verbose=False, automatic_anchor_helpers=True, delays=[0.0, delay])
    with tempfile.TemporaryDirectory() as elsewhere, contextlib.chdir(elsewhere):
        try:
            # Compile in another folder, since the solver would read the project's pyproject.toml.
            solver.compile_C(simplify=False)
        except SystemExit as reason:
            raise OSError("not compiled; install a C compiler") from reason

    def task() -> tuple[Array, Array]:
        solver.purge_past()
        solver.constant_past(np.zeros(b.size))
        solver.set_integration_parameters(rtol=tolerance, atol=tolerance)
        solver.adjust_diff(1e-8)
        solver.step_on_discontinuities()
        if not output:
            return times[-1:], np.array([solver.integrate(times[-1]) @ c_y])
        states = np.array([solver.integrate(time) for time in times[per_delay + 1 :]])
        return times, np.concatenate([np.zeros(per_delay + 1), states @ c_y])

    return task


def ddeint(loop: pidalab.Loop, horizon: float, per_delay: int) -> Task:
    """Return the task of ddeint: SciPy's VODE between requested points, with linear interpolation of the past.

    Version 0.3 uses the state of the last point as the present state, so its order is 1.
    """
    from ddeint import ddeint

    (A, b, e, c_v, c_y, delay), t = delay_equation(loop), grid(loop, horizon, per_delay)

    def derivative(x, time):
        return A @ x(time) + b * (c_v @ x(time - delay)) + e

    return lambda: (t, ddeint(derivative, lambda time: np.zeros(b.size), t) @ c_y)
