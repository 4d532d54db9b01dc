"""Sampled simulations as a script of the authors may have run them: which scheme gives the printed ITAE values."""

from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import NamedTuple

import numpy as np
from numba import njit
from pidalab._check import Array
from pidalab.controllers import NonInteractivePIDA
from pidalab.process import Process
from scipy.signal import cont2discrete

METHODS = ("tustin", "hold", "backward", "forward")
OPERATORS = {  # s as a ratio of polynomials in 1/z, times the sample time
    "tustin": ([2.0, -2.0], [1.0, 1.0]),
    "backward": ([1.0, -1.0], [1.0, 0.0]),
    "forward": ([1.0, -1.0], [0.0, 1.0]),
}


@dataclass(frozen=True)
class Scheme:
    """One way to sample the loop.

    `acceleration` names the methods of its parts: two for the squared filter of (16), s/(Ts + 1) twice; one, and a
    difference, for the filter of (7).
    """

    plant: str = "Euler"
    derivative: str = "tustin"
    acceleration: tuple[str, ...] = ("tustin", "tustin")
    alpha_a: float = 0.025
    integral_first: bool = True  # whether the integral knows the present error when u is formed
    weight_first: bool = True  # whether the weight of a sample is the time at its beginning
    step: float = 0.001

    def __str__(self) -> str:
        filters = "squared" if len(self.acceleration) == 2 else "first order"
        return f"{self.plant} plant, D {self.derivative}, A {filters} {'/'.join(self.acceleration)}, α_a {self.alpha_a}"


class Experiment(NamedTuple):
    """A step of set point or load, by default at t = 1, up to the end of the integral."""

    process: Process
    load: bool
    end: float
    start: float = 1.0


def itae(experiment: Experiment, controller: NonInteractivePIDA, scheme: Scheme) -> float:
    """ITAE of a sampled run, time counted from 0; infinite if the run blows up."""
    error = np.abs(errors(experiment, controller, scheme))
    k = np.arange(error.size) + (0 if scheme.weight_first else 1)
    return float(scheme.step**2 * np.sum(k * error))


def errors(experiment: Experiment, controller: NonInteractivePIDA, scheme: Scheme) -> Array:
    """Control error at every sample of a run; infinite from where it blows up."""
    h, process = scheme.step, experiment.process
    phi, gamma = _plant(process.den / process.den[0], scheme)
    derivative = _difference(scheme.derivative, 0.05 * controller.tau_d, h)
    b, a = np.ones(1), np.ones(1)
    for method in scheme.acceleration:
        part = _difference(method, scheme.alpha_a * controller.tau_a, h)
        b, a = np.convolve(b, part[0]), np.convolve(a, part[1])
    if len(scheme.acceleration) == 1:
        b = np.convolve(b, [1 / h, -1 / h])
    filters = _joined((controller.tau_d * derivative[0], derivative[1]), (controller.tau_a**2 / 2 * b, a))
    gain = process.num[-1] / process.den[0]
    counts = round(process.delay / h), round(experiment.end / h), round(experiment.start / h)
    gains = controller.kc, controller.tau_i
    return _run(phi, gamma * gain, filters, counts, h, experiment.load, gains, scheme.integral_first)


def _plant(den: Array, scheme: Scheme) -> tuple[Array, Array]:
    """Companion form of a plant without zeros, over one sample."""
    n = den.size - 1
    A, b = np.zeros((n, n)), np.zeros(n)
    A[:-1, 1:], A[-1], b[-1] = np.eye(n - 1), -den[:0:-1], 1.0
    if scheme.plant == "Euler":
        return np.eye(n) + scheme.step * A, scheme.step * b
    exact = cont2discrete((A, b[:, None], np.eye(n), np.zeros((n, 1))), scheme.step, "zoh")
    return exact[0].copy(), exact[1][:, 0].copy()


@cache
def _difference(method: str, lag: float, h: float) -> tuple[Array, Array]:
    """Numerator and denominator, in powers of 1/z, of s/(lag s + 1)."""
    if method == "hold":
        pole = np.exp(-h / lag)
        return np.array([1.0, -1.0]) / lag, np.array([1.0, -pole])
    up, down = (np.array(side) for side in OPERATORS[method])
    bottom = lag / h * up + down
    return up / h / bottom[0], bottom / bottom[0]


def _joined(first: tuple[Array, Array], second: tuple[Array, Array]) -> Array:
    """Numerator and denominator, as rows, of the sum of two filters."""
    above, below = np.convolve(first[0], second[1]), np.convolve(second[0], first[1])
    bottom = np.convolve(first[1], second[1])
    rows = np.zeros((2, max(above.size, below.size, bottom.size)))
    rows[0, : above.size] += above
    rows[0, : below.size] += below
    rows[1, : bottom.size] = bottom
    return rows


@njit(cache=True)
def _run(phi, gamma, filters, counts, h, load, gains, integral_first):  # type: ignore[no-untyped-def]
    """March through the loop; `counts` are the samples of the dead time, of the run and before the step."""
    (delay, samples, start), (kc, tau_i) = counts, gains
    record = np.full(samples, np.inf)
    x, new = np.zeros(gamma.size), np.zeros(gamma.size)
    line = np.zeros(delay + 1)  # what waits in the dead time
    memory = np.zeros(filters.shape[1])  # of the filters, in direct form II transposed
    integral = 0.0
    for k in range(samples):
        error = -x[0] + (1.0 if k >= start and not load else 0.0)
        if not abs(error) < 1e9:
            break
        record[k] = error
        if integral_first:
            integral += h * error
        # derivative and acceleration together
        fast = filters[0, 0] * error + memory[0]
        for i in range(memory.size - 1):
            memory[i] = filters[0, i + 1] * error + memory[i + 1] - filters[1, i + 1] * fast
        u = kc * (error + integral / tau_i + fast)
        if not integral_first:
            integral += h * error
        line[k % line.size] = u + (1.0 if k >= start and load else 0.0)
        w = line[(k + 1) % line.size]
        for i in range(x.size):
            new[i] = gamma[i] * w
            for j in range(x.size):
                new[i] += phi[i, j] * x[j]
        x, new = new, x
    return record


def pid_variants() -> list[Scheme]:
    """The schemes tried on the ten values of IMC and ITAE-2: plant, derivative, integral, weight."""
    parts = product(("Euler", "exact"), METHODS, (True, False), (True, False))
    return [
        Scheme(plant, derivative, integral_first=integral, weight_first=weight)
        for plant, derivative, integral, weight in parts
    ]


def pida_variants() -> list[Scheme]:
    """The schemes tried on the five values of the proposed rule: plant, derivative, acceleration, its filter."""
    pairs: list[tuple[str, ...]] = [(one, other) for i, one in enumerate(METHODS) for other in METHODS[i:]]
    single: list[tuple[str, ...]] = [(one,) for one in METHODS]
    parts = product(("Euler", "exact"), METHODS, pairs + single, (0.0125, 0.025, 0.05))
    return [Scheme(*part) for part in parts]
