"""A plant across a sample interval, behind an actuator that holds, or that switches within the sample."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from pidalab import _check
from pidalab._check import Array
from pidalab.plants import AsymmetricPlant
from pidalab.process import Process, rational
from pidalab.robustness.in_z import require_later_answer
from pidalab.statespace import StateSpace, held, pieces, realise


class PlantStates(NamedTuple):
    """Two systems that share a state: number 1 holds while the first state rises towards w, number 0 otherwise.

    A linear plant is the same twice.
    """

    A: Array  # (2, n, n)
    b: Array  # (2, n)
    c: Array  # (n,)
    d: float
    delay: float


class Steps(NamedTuple):
    """The plant across a sample interval, piece by piece, each for both of its systems."""

    phi: Array  # (pieces, 2, n, n)
    gamma: Array  # (pieces, 2, n)
    ago: Array  # (pieces,), how many samples ago the input of the piece was set
    pulse: Array  # (pieces, widths, n), what a pulse from the lower to the upper limit adds to the state
    c: Array  # (n,)
    d: float


class Actuator(NamedTuple):
    """What becomes of the signal that the controller wants."""

    low: float
    high: float
    quantum: float  # 0 for none
    widths: int  # number of pulse widths above 0; 0 for an actuator that holds


def plant_states(plant: Process | AsymmetricPlant) -> PlantStates:
    """Realise a plant; its last state is the running integral of its output."""
    if isinstance(plant, Process):
        one = realise(plant.num, plant.den)
        systems, c, d = [(one.A, one.b)] * 2, one.c, one.d
    else:
        main, direct = (realise(*rational(name, getattr(plant, name))) for name in ("main", "direct"))
        systems = [_with_store(main, direct, time) for time in (plant.fall, plant.rise)]
        c, d = np.concatenate([[main.d], main.c, direct.c]), direct.d
    # one more state: the running integral of c x + d w
    with_integral = [
        np.block([[A, np.zeros((b.size, 1))], [c[None, :], np.zeros((1, 1))]]) for A, b in systems
    ]
    inputs = [np.append(b, d) for _, b in systems]
    return PlantStates(np.stack(with_integral), np.stack(inputs), np.append(c, 0.0), d, plant.delay)


def _with_store(main: StateSpace, direct: StateSpace, time: float) -> tuple[Array, Array]:
    """Put the store in front of the main path, and the other path beside it."""
    A = block_diag(-1 / time, main.A, direct.A)
    A[1 : 1 + main.b.size, 0] = main.b
    return A, np.concatenate([[1 / time], np.zeros(main.b.size), direct.b])


def plant_steps(plant: Process | AsymmetricPlant, h: float, actuator: Actuator) -> Steps:
    """Discretise the plant over the one or two pieces of a sample interval in which its delayed input is constant."""
    if not isinstance(plant, (Process, AsymmetricPlant)):
        hint = _check.carrier(plant, Process)
        raise TypeError(f"plant must be a Process or an AsymmetricPlant, found {type(plant).__name__}{hint}")
    states = plant_states(plant)
    require_later_answer(plant, states.d, h)
    if actuator.widths and (states.d or isinstance(plant, AsymmetricPlant)):
        raise ValueError(f"pulse_widths needs a linear plant without direct feedthrough, found {plant!r}")
    # across each piece of the sample, for both systems of the plant
    own = pieces(plant.delay, h)
    across = [[held(A, b, piece.time) for A, b in zip(states.A, states.b, strict=True)] for piece in own]
    return Steps(
        phi=np.array([[phi for phi, _ in both] for both in across]),
        gamma=np.array([[gamma for _, gamma in both] for both in across]),
        ago=np.array([piece.ago for piece in own]),
        pulse=np.array([_pulses(states, piece.time, piece.since, h, actuator) for piece in own]),
        c=states.c,
        d=states.d,
    )


def _pulses(states: PlantStates, time: float, since: float, h: float, actuator: Actuator) -> Array:
    """Return what pulses of each width add to the state over a piece that begins `since` after the pulse."""
    A, b, widths = states.A[0], states.b[0], actuator.widths
    added = np.zeros((widths + 1, b.size))
    if not widths:
        return added
    # how long each pulse is on within the piece; what an input of 1 makes of all of it, and of one part of a sample
    on = np.clip(h * np.arange(widths + 1) / widths - since, 0.0, time)
    whole = held(A, b, time)[1]
    phi, gamma = held(A, b, h / widths)
    # a pulse adds the whole piece less the rest after it; the rest grows by one part from each pulse to the shorter one
    after = None
    for width in range(widths, 0, -1):
        if 0 < on[width] < time:
            after = held(A, b, time - on[width])[1] if after is None else phi @ after + gamma
            added[width] = whole - after
        elif on[width] > 0:
            added[width] = whole
    return (actuator.high - actuator.low) * added
