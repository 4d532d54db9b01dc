"""State-space form of plants for simulation with a held input, and a plant that is faster upwards than downwards."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import block_diag, expm, matrix_balance

from pidalab import _check
from pidalab._check import Array
from pidalab.process import Process, rational
from pidalab.simulation.realisation import GAP, Block


class StateSpace(NamedTuple):
    """Realisation x' = A x + b w, y = c x + d w."""

    A: Array  # (n, n)
    b: Array  # (n,)
    c: Array  # (n,)
    d: float


class PlantStates(NamedTuple):
    """Two systems that share a state: number 1 holds while the first state rises towards w, number 0 otherwise.

    A linear plant is the same twice.
    """

    A: Array  # (2, n, n)
    b: Array  # (2, n)
    c: Array  # (n,)
    d: float
    delay: float


def _parallel(num: Array, den: Array) -> tuple[tuple[Array, ...], tuple[Array, ...], tuple[Array, ...], float]:
    """Split a proper rational function into parallel blocks (all A, b, c) by speed of the poles, and a direct part."""
    speeds = np.sort(np.abs(np.roots(den)))
    block = Block(num, den, np.array([np.sqrt(a * b) for a, b in pairwise(speeds) if b > GAP * a]))
    A, b, c = zip(*block.fractions, strict=True)
    return A, b, c, float(block.direct)


def realise(num: Array, den: Array) -> StateSpace:
    """Realise a proper rational function."""
    A, b, c, direct = _parallel(num, den)
    return StateSpace(block_diag(*A), np.concatenate(b), np.concatenate(c), direct)


def digital(num: Array, den: Array, h: float) -> StateSpace:
    """Discretise a proper rational function for an input that is held for h at a time."""
    A, b, c, direct = _parallel(num, den)
    phi, gamma = zip(*(held(*block, h) for block in zip(A, b, strict=True)), strict=True)
    return StateSpace(block_diag(*phi), np.concatenate(gamma), np.concatenate(c), direct)


def held(A: Array, b: Array, duration: float) -> tuple[Array, Array]:
    """Return (phi, gamma) with x(t + duration) = phi x(t) + gamma w for an input w that is held."""
    n = b.size
    augmented = np.zeros((n + 1, n + 1))
    augmented[:n, :n], augmented[:n, n] = A, b
    balanced, (scale, _) = matrix_balance(augmented, permute=False, separate=True)
    transition = expm(balanced * duration) * scale[:, None] / scale
    phi, gamma = transition[:n, :n], transition[:n, n]
    if n and np.min(np.abs(np.linalg.eigvals(A))) * duration > 1.0:
        # Of a fast filter only the static gain is left after a while, and this form of it keeps its digits.
        gamma = np.linalg.solve(A, phi @ b - b)
    return phi, gamma


@dataclass(frozen=True)
class AsymmetricPlant:
    r"""A plant whose store fills at another speed than it empties.

    .. math:: T(w, x)\,\dot x = w - x, \quad T = T_{rise} \text{ where } w > x, \text{ otherwise } T_{fall};
              \qquad y = G(s)\,x + D(s)\,w; \qquad w(t) = v(t - L)

    with v the input of the process. At rest x = w, so that the static gain is one and the same; and a shift of all
    signals to another state of rest changes nothing.

    Parameters
    ----------
    main : control.TransferFunction
        G, from the store to the output; proper.
    rise, fall : float
        Time constants of the store, above 0.
    direct : control.TransferFunction or float, optional
        D, the path past the store; proper.
    delay : float, optional
        Dead time L, not negative.

    Raises
    ------
    TypeError, ValueError
        For paths that are not proper, time constants that are not positive, a negative dead time.

    Examples
    --------
    >>> import control, pidalab
    >>> plant = pidalab.AsymmetricPlant(control.tf([2.0], [5.0, 1.0]), rise=1.0, fall=3.0)
    >>> plant.rising, plant.falling
    (Process(num=[2], den=[5, 6, 1], delay=0), Process(num=[2], den=[15, 8, 1], delay=0))
    """

    main: Any
    rise: float
    fall: float
    direct: Any = 0.0
    delay: float = 0.0

    def __post_init__(self) -> None:
        for name in ("main", "direct"):
            rational(name, getattr(self, name))
        for name in ("rise", "fall"):
            object.__setattr__(self, name, _check.real(name, getattr(self, name), above=0.0))
        object.__setattr__(self, "delay", _check.real("delay", self.delay, at_least=0.0))

    @property
    def rising(self) -> Process:
        """The linear process that the plant is while its store fills."""
        return self._linear(self.rise)

    @property
    def falling(self) -> Process:
        """The linear process that the plant is while its store empties."""
        return self._linear(self.fall)

    def _linear(self, time: float) -> Process:
        (main, under), (past, below) = rational("main", self.main), rational("direct", self.direct)
        under = np.convolve(under, [time, 1.0])
        extra, rest = np.polydiv(under, below) if under.size >= below.size else (np.ones(1), under)
        if np.max(np.abs(rest)) < 1e-12 * np.max(np.abs(under)):  # one denominator divides the other: no need for both
            return Process(np.polyadd(main, np.convolve(past, extra)), under, self.delay)
        num = np.polyadd(np.convolve(main, below), np.convolve(past, under))
        return Process(num, np.convolve(under, below), self.delay)


def plant_states(plant: Process | AsymmetricPlant) -> PlantStates:
    """Realise a plant; its last state is the running integral of its output."""
    if isinstance(plant, Process):
        one = realise(plant.num, plant.den)
        systems, c, d = [(one.A, one.b)] * 2, one.c, one.d
    else:
        main, direct = (realise(*rational(name, getattr(plant, name))) for name in ("main", "direct"))
        systems = [_with_store(main, direct, time) for time in (plant.fall, plant.rise)]
        c, d = np.concatenate([[main.d], main.c, direct.c]), direct.d
    A = np.stack([np.block([[A, np.zeros((b.size, 1))], [c[None, :], np.zeros((1, 1))]]) for A, b in systems])
    b = np.stack([np.append(b, d) for _, b in systems])
    return PlantStates(A, b, np.append(c, 0.0), d, plant.delay)


def _with_store(main: StateSpace, direct: StateSpace, time: float) -> tuple[Array, Array]:
    """Put the store in front of the main path, and the other path beside it."""
    A = block_diag(-1 / time, main.A, direct.A)
    A[1 : 1 + main.b.size, 0] = main.b
    return A, np.concatenate([[1 / time], np.zeros(main.b.size), direct.b])
