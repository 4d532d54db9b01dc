"""The compiled loop over samples: a plant, its actuator, and a controller."""

from __future__ import annotations

from typing import Any

import numpy as np

from pidalab._check import Array
from pidalab._compiled import compiled
from pidalab.simulation import operations as op
from pidalab.simulation.sampled_plant import Actuator, Steps
from pidalab.statespace import StateSpace


def stepper(lanes: int) -> Any:
    """Return the compiled function that carries out the operations of a step, in so many loops side by side."""

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
    """Write phi x + gamma w into `new`; in plain loops, for small matrices faster than a library call."""
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
    """Pass a held signal through a discretised block."""
    x, new, out = np.zeros(block.b.size), np.zeros(block.b.size), np.empty(signal.size)
    for k in range(signal.size):
        out[k] = output(block.c, block.d, x, signal[k])
        advanced(block.A, block.b, x, signal[k], new)
        x, new = new, x
    return out


@compiled
def acted(actuator: Actuator, wanted: float, load: float, v: Array, width: Array, at: int) -> float:
    """Write what an actuator makes of a limited signal, with the load, to `v` and `width`; return it, or its mean."""
    if actuator.quantum > 0:
        rounded = actuator.quantum * np.rint(wanted / actuator.quantum)
        u = min(max(rounded, actuator.low), actuator.high)
        v[at] = u + load
        return u
    if actuator.widths > 0:
        span = actuator.high - actuator.low
        share = (wanted - actuator.low) / span
        # after an overflow the share is nan
        parts = int(np.rint(share * actuator.widths)) if 0 <= share <= 1 else 0
        v[at], width[at] = actuator.low + load, parts
        return actuator.low + span * parts / actuator.widths
    v[at] = wanted + load
    return wanted


@compiled
def crossed(plant: Steps, x: Array, x_new: Array, v: Array, width: Array, at: int) -> tuple[Array, Array]:
    """Take the plant across a sample; returns its new state, and the room of the old one."""
    for piece in range(plant.ago.size):
        w = v[at - plant.ago[piece]]
        system = 1 if w > x[0] else 0  # a store that moves towards w does not pass it while w is held
        advanced(plant.phi[piece, system], plant.gamma[piece, system], x, w, x_new)
        x, x_new = x_new, x
        if plant.pulse.shape[1] > 1:
            x += plant.pulse[piece, width[at - plant.ago[piece]]]
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
    """Run the loop; `reference` is the filtered set point. Returns y, u and the integral of y.

    The controller is a block that acts on the error, and the operations of a step. The loop counts from
    rest; `rest` is y_offset and bias of the controller's signals.
    """
    n, before = reference.size, plant.ago[0]
    y_offset, bias = rest
    y, u, area = np.empty(n), np.empty(n), np.empty(n)
    v = np.zeros(n + before)  # input of the plant less its pulses, with its rest before t = 0 in front
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
