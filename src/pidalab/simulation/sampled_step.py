"""Compiled simulation of a plant, its actuator and a controller, sample by sample."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import block_diag

from pidalab import _check
from pidalab._check import Array
from pidalab._compiled import compiled
from pidalab.process import AsymmetricPlant, Process, rational
from pidalab.robustness.in_z import require_later_answer
from pidalab.simulation import operations as op
from pidalab.statespace import StateSpace, held, pieces, realise


class PlantStates(NamedTuple):
    """Two linear systems with the same state.

    System 1 applies while the first state rises towards the delayed input w. Otherwise system 0 applies. For a linear
    plant both systems are equal.
    """

    A: Array  # (2, n, n)
    b: Array  # (2, n)
    c: Array  # (n,)
    d: float
    delay: float


class Steps(NamedTuple):
    """Transitions of both systems of a plant over the pieces of a sample interval."""

    phi: Array  # (pieces, 2, n, n)
    gamma: Array  # (pieces, 2, n)
    lag_samples: Array  # (pieces,), age in samples of the input that acts during the piece
    pulse: Array  # (pieces, widths + 1, n), what a pulse from the lower to the upper limit adds to the state
    c: Array  # (n,)
    d: float


class Actuator(NamedTuple):
    """Limits, resolution and pulse widths of an actuator."""

    low: float
    high: float
    quantum: float  # 0 for unlimited resolution
    widths: int  # number of pulse widths, not counting the width 0; 0 for an actuator that holds its output


def plant_states(plant: Process | AsymmetricPlant) -> PlantStates:
    """Realise a plant. The last state is the running integral of the output."""
    if isinstance(plant, Process):
        system = realise(plant.num, plant.den)
        systems, c, d = [(system.A, system.b)] * 2, system.c, system.d
    else:
        main, direct = (realise(*rational(name, getattr(plant, name))) for name in ("main", "direct"))
        systems = [_with_store(main, direct, time) for time in (plant.fall, plant.rise)]
        c, d = np.concatenate([[main.d], main.c, direct.c]), direct.d
    with_integral = [
        np.block([[A, np.zeros((b.size, 1))], [c[None, :], np.zeros((1, 1))]]) for A, b in systems
    ]
    inputs = [np.append(b, d) for _, b in systems]
    return PlantStates(np.stack(with_integral), np.stack(inputs), np.append(c, 0.0), d, plant.delay)


def _with_store(main: StateSpace, direct: StateSpace, time: float) -> tuple[Array, Array]:
    """Put the store (the first lag) in series before the main path, and the direct path in parallel with both."""
    A = block_diag(-1 / time, main.A, direct.A)
    A[1 : 1 + main.b.size, 0] = main.b
    return A, np.concatenate([[1 / time], np.zeros(main.b.size), direct.b])


def plant_steps(plant: Process | AsymmetricPlant, h: float, actuator: Actuator) -> Steps:
    """Discretise the plant. The delayed input is constant over one or two pieces of a sample interval."""
    if not isinstance(plant, (Process, AsymmetricPlant)):
        hint = _check.carrier(plant, Process)
        raise TypeError(f"plant must be a Process or an AsymmetricPlant, found {type(plant).__name__}{hint}")
    states = plant_states(plant)
    require_later_answer(plant, states.d, h)
    if actuator.widths and (states.d or isinstance(plant, AsymmetricPlant)):
        raise ValueError(f"pulse_widths needs a linear plant without direct feedthrough, found {plant!r}")
    parts = pieces(plant.delay, h)
    across = [[held(A, b, piece.time) for A, b in zip(states.A, states.b, strict=True)] for piece in parts]
    return Steps(
        phi=np.array([[phi for phi, _ in both] for both in across]),
        gamma=np.array([[gamma for _, gamma in both] for both in across]),
        lag_samples=np.array([piece.lag_samples for piece in parts]),
        pulse=np.array([_pulses(states, piece.time, piece.offset, h, actuator) for piece in parts]),
        c=states.c,
        d=states.d,
    )


def _pulses(states: PlantStates, time: float, offset: float, h: float, actuator: Actuator) -> Array:
    """Return what a pulse of each width adds to the state over a piece. The pulse begins `offset` before the piece."""
    A, b, widths = states.A[0], states.b[0], actuator.widths
    added = np.zeros((widths + 1, b.size))
    if not widths:
        return added
    # `on` is the time within the piece for which each pulse is on. `over_piece` is the effect of an input of 1 over the
    # whole piece. `phi` and `gamma` advance the state by h / widths.
    on = np.clip(h * np.arange(widths + 1) / widths - offset, 0.0, time)
    over_piece = held(A, b, time)[1]
    phi, gamma = held(A, b, h / widths)
    # The effect of a pulse is `over_piece` minus the effect of an input of 1 over the time after the pulse. This
    # time grows by h / widths from one width to the next shorter one.
    after = None
    for width in range(widths, 0, -1):
        if 0 < on[width] < time:
            after = held(A, b, time - on[width])[1] if after is None else phi @ after + gamma
            added[width] = over_piece - after
        elif on[width] > 0:
            added[width] = over_piece
    return (actuator.high - actuator.low) * added


def stepper(lanes: int) -> Any:
    """Return the compiled function that executes the operations of a step for `lanes` loops in parallel."""

    def step(code: np.ndarray, numbers: Array) -> None:
        for k in range(code.shape[0]):
            kind, out, left, right = code[k, 0], code[k, 1], code[k, 2], code[k, 3]
            if kind == op.MULTIPLY:
                for i in range(lanes):
                    numbers[out, i] = numbers[left, i] * numbers[right, i]
            elif kind == op.ADD:
                for i in range(lanes):
                    numbers[out, i] = numbers[left, i] + numbers[right, i]
            elif kind == op.SUBTRACT:
                for i in range(lanes):
                    numbers[out, i] = numbers[left, i] - numbers[right, i]
            elif kind == op.COPY:
                for i in range(lanes):
                    numbers[out, i] = numbers[left, i]
            elif kind == op.LESS:
                for i in range(lanes):
                    numbers[out, i] = 1.0 if numbers[left, i] < numbers[right, i] else 0.0
            elif kind == op.GREATER:
                for i in range(lanes):
                    numbers[out, i] = 1.0 if numbers[left, i] > numbers[right, i] else 0.0
            elif kind == op.CHOOSE:
                for i in range(lanes):
                    numbers[out, i] = numbers[left, i] if numbers[right, i] != 0.0 else numbers[out, i]

    return compiled(step)


step_one = stepper(1)


@compiled
def advanced(phi: Array, gamma: Array, x: Array, w: float, new: Array) -> None:
    """Write phi x + gamma w into `new`."""
    for i in range(x.size):
        total = gamma[i] * w
        for j in range(x.size):
            total += phi[i, j] * x[j]
        new[i] = total


@compiled
def output(c: Array, d: float, x: Array, w: float) -> float:
    """Return c x + d w."""
    total = d * w
    for i in range(x.size):
        total += c[i] * x[i]
    return total


@compiled
def filtered(block: StateSpace, signal: Array) -> Array:
    """Filter a held signal by a discretised block."""
    x, new, out = np.zeros(block.b.size), np.zeros(block.b.size), np.empty(signal.size)
    for k in range(signal.size):
        out[k] = output(block.c, block.d, x, signal[k])
        advanced(block.A, block.b, x, signal[k], new)
        x, new = new, x
    return out


@compiled
def acted(actuator: Actuator, wanted: float, load: float, v: Array, width: Array, at: int) -> float:
    """Write the plant input to `v`, and the width of a pulse to `width`. Return the mean output of the actuator."""
    if actuator.quantum > 0:
        rounded = actuator.quantum * np.rint(wanted / actuator.quantum)
        u = min(max(rounded, actuator.low), actuator.high)
        v[at] = u + load
        return u
    if actuator.widths > 0:
        span = actuator.high - actuator.low
        share = (wanted - actuator.low) / span
        # The share is NaN if the control signal has overflowed.
        parts = int(np.rint(share * actuator.widths)) if 0 <= share <= 1 else 0
        v[at], width[at] = actuator.low + load, parts
        return actuator.low + span * parts / actuator.widths
    v[at] = wanted + load
    return wanted


@compiled
def crossed(plant: Steps, x: Array, x_new: Array, v: Array, width: Array, at: int) -> tuple[Array, Array]:
    """Advance the plant by a sample. Return the new state, then the old array for reuse."""
    for piece in range(plant.lag_samples.size):
        w = v[at - plant.lag_samples[piece]]
        # Within the piece, x[0] does not cross the constant w. So the same system applies to the whole piece.
        system = 1 if w > x[0] else 0
        advanced(plant.phi[piece, system], plant.gamma[piece, system], x, w, x_new)
        x, x_new = x_new, x
        if plant.pulse.shape[1] > 1:
            x += plant.pulse[piece, width[at - plant.lag_samples[piece]]]
    return x, x_new


@compiled
def run(
    code: np.ndarray,
    numbers: Array,
    block: StateSpace,
    rest: tuple[float, float],
    plant: Steps,
    actuator: Actuator,
    fineness: float,
    reference: Array,
    load: Array,
    noise: Array,
) -> tuple[Array, Array, Array]:
    """Run the loop for a filtered set point. Return y, u and the integral of y, relative to the state of rest.

    The controller consists of a block that acts on the error, and the operations of a step. `rest` holds the
    measurement at rest (`y_offset`) and the control signal at rest (`bias`).

    Notes
    -----
    At the beginning of sample k, `x` is the state of the plant at t_k and `z` is the state of the block. The input that
    is set at t_k is entry `before + k` of `v` and `width`. The first `before` entries belong to times before t = 0. The
    input that acts in a piece is entry `before + k - lag_samples`.
    """
    n, before = reference.size, plant.lag_samples[0]
    y_offset, bias = rest
    y, u, area = np.empty(n), np.empty(n), np.empty(n)
    v = np.zeros(n + before)  # input of the plant without its pulses
    width = np.zeros(n + before, np.intp)
    x, x_new = np.zeros(plant.c.size), np.zeros(plant.c.size)
    z, z_new = np.zeros(block.b.size), np.zeros(block.b.size)
    for k in range(n):
        y[k] = output(plant.c, plant.d, x, v[k])
        area[k] = x[-1]
        measured = y[k] + noise[k]
        if fineness > 0:
            measured = fineness * np.rint(measured / fineness)
        numbers[op.SETPOINT, 0] = y_offset + reference[k]
        numbers[op.MEASUREMENT, 0] = y_offset + measured
        error = numbers[op.SETPOINT, 0] - numbers[op.MEASUREMENT, 0]
        numbers[op.SUMMED, 0] = output(block.c, block.d, z, error)
        advanced(block.A, block.b, z, error, z_new)
        z, z_new = z_new, z
        step_one(code, numbers)
        wanted = numbers[op.CONTROL, 0] - bias
        u[k] = acted(actuator, wanted, load[k], v, width, k + before)
        x, x_new = crossed(plant, x, x_new, v, width, k + before)
    return y, u, area
