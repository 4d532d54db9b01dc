"""What the sections share: processes, models, designs and loops of the paper, each computed once for a ledger."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache, cached_property, partial
from itertools import product
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import pidalab
from matplotlib.figure import Figure
from numpy.typing import NDArray
from pidalab.ledger import CONVENTIONS, Ledger
from pidalab.rules import haalman
from scipy.optimize import minimize_scalar

Array = NDArray[np.float64]

SAMPLE = 0.01  # of the records, and the time for which a value of the noise is held
AMPLITUDE = 0.1  # of the noise, sec. 4
RECORDS = 20  # of noise; each number under noise is a mean over them
ORDERS = {"ex1": 4, "ex2": 8}  # of the two processes 1/(s + 1)^order, eqs. (11) and (17)
KINDS = ("pida", "pid")
PAPER_M = 10.0  # filter ratio of the acceleration, in the paper's unit of time
EXPERIMENTS = {"setpoint": {"setpoint": 1.0}, "load": {"load": 1.0}}


class Case(NamedTuple):
    """One of the eight loops: example, controller and the maximum sensitivity asked for."""

    example: str
    kind: str
    ms: float

    @property
    def row(self) -> str:
        """Start of the ids of its rows."""
        return f"{self.example}.{self.kind}.ms{10 * self.ms:.0f}"

    @property
    def label(self) -> str:
        """Its name in a table."""
        return f"{self.example}, {self.kind.upper()}, Ms {self.ms}"

    @property
    def horizon(self) -> float:
        """Where the printed IAE of this loop ends; the section on horizons shows it."""
        return 20.0 if self.example == "ex1" else (40.0 if self.ms < 2 else 60.0)


CASES = tuple(Case(*key) for key in product(ORDERS, KINDS, (1.4, 2.0)))
PAIRS = {
    f"{example}, Ms {ms}": (Case(example, "pida", ms), Case(example, "pid", ms))
    for example, ms in product(ORDERS, (1.4, 2.0))
}


class Work:
    """The numbers that more than one section needs."""

    def __init__(self, book: Ledger) -> None:
        self.printed = book.printed
        self.t = np.linspace(0, 60, 6001)
        self.processes = {example: pidalab.lags(order) for example, order in ORDERS.items()}

    @cached_property
    def records(self) -> dict[str, pidalab.Response]:
        """Open-loop step responses of the processes."""
        return {
            example: pidalab.open_loop_step(process, self.t) for example, process in self.processes.items()
        }

    @cached_property
    def fits(self) -> dict[str, pidalab.identification.ThreePointModel]:
        """Third-order models through three samples of the records."""
        return {
            example: pidalab.identification.three_point(self.t, record.y, crossing="sampled")
            for example, record in self.records.items()
        }

    @cached_property
    def models(self) -> dict[tuple[str, str], pidalab.Process]:
        """Model of each rule: the fitted one for PIDA, the printed one of eqs. (14) and (20) for PID."""
        found = {(example, "pida"): fit.process for example, fit in self.fits.items()}
        for example in ORDERS:
            a2, a1, delay = (self.printed(f"{example}.sopdt.{key}") for key in ("a2", "a1", "delay"))
            found[example, "pid"] = pidalab.Process([1.0], [a2, a1, 1.0], delay)
        return found

    def model(self, case: Case) -> pidalab.Process:
        """Model that a loop was designed on."""
        return self.models[case.example, case.kind]

    @cached_property
    def designs(self) -> dict[Case, pidalab.PIDA]:
        """Controllers with the exact gain for Ms."""
        rules: dict[str, Callable[..., pidalab.PIDA]] = {
            "pida": partial(haalman.pida, m=PAPER_M),
            "pid": haalman.pid,
        }
        return {case: rules[case.kind](self.model(case), case.ms) for case in CASES}

    @cached_property
    def used(self) -> dict[Case, pidalab.PIDA]:
        """Controllers with the printed gain, which the later numbers of the paper stand on."""
        return {case: replace(C, kp=self.printed(f"{case.row}.kp")) for case, C in self.designs.items()}

    @cached_property
    def filters(self) -> dict[Case, haalman.OutputFilter]:
        """Output filters of eq. (9), from the printed gain."""
        return {case: haalman.output_filter(self.model(case), C) for case, C in self.used.items()}

    @cached_property
    def loops(self) -> dict[Case, pidalab.Loop]:
        """The loops that the paper simulates: true process, printed gain, output filter."""
        return {case: self.loop(case, on="process", filtered=True) for case in CASES}

    def loop(self, case: Case, on: str, filtered: bool) -> pidalab.Loop:
        """Loop of the printed gain on the model or on the process, with or without the output filter."""
        plant = self.model(case) if on == "model" else self.processes[case.example]
        block = self.filters[case].transfer_function() if filtered else None
        return pidalab.Loop(plant, self.used[case], block)

    @cached_property
    def iae(self) -> dict[tuple[Case, str], float]:
        """Noise-free IAE of each experiment, integrated until the loop has settled."""
        t = np.linspace(0, 240, 24001)
        return {
            (case, test): pidalab.simulate(loop, t, **step).iae(math.inf)
            for case, loop in self.loops.items()
            for test, step in EXPERIMENTS.items()
        }

    def noisy(
        self, case: Case, test: str, amplitude: float = AMPLITUDE, hold: float = SAMPLE
    ) -> list[pidalab.Response]:
        """Responses of a loop to the noise of the paper, one for each record."""
        return _noisy(self, case, test, amplitude, hold)

    @cached_property
    def spread(self) -> dict[Case, float]:
        """Standard deviation of the control signal under the noise of the paper, at rest."""
        return {case: sigma(loop) for case, loop in self.loops.items()}


@cache
def work(book: Ledger) -> Work:
    """Return the shared numbers of a ledger."""
    return Work(book)


@cache
def _noisy(shared: Work, case: Case, test: str, amplitude: float, hold: float) -> list[pidalab.Response]:
    noise = [pidalab.uniform_noise(shared.t, amplitude, seed, hold) for seed in range(RECORDS)]
    return pidalab.simulate_ensemble(shared.loops[case], shared.t, noise, **EXPERIMENTS[test])


def once(figure: Figure) -> Figure:
    """Close a figure, so that a notebook shows it as a cell's result only, not once more."""
    plt.close(figure)
    return figure


def sigma(loop: pidalab.Loop) -> float:
    """Standard deviation of u under uniform noise of the paper's amplitude and sample; no random number takes part."""
    return AMPLITUDE / math.sqrt(3) * pidalab.noise_gain(loop, SAMPLE)


SIGNIFICANT = CONVENTIONS["clearly"].limit  # share of the larger number


def said(left: float, right: float) -> str:
    """What the convention of *significant* says of two numbers, for a note."""
    return f"Significant is at least {SIGNIFICANT:.0%}."


def ms_of(loop: pidalab.Loop) -> float:
    """Maximum sensitivity of a loop."""
    return pidalab.max_sensitivity(loop)[0]


def gain_needed(unit: pidalab.Loop, ms: float, w: Array) -> Array:
    """Smallest gain at which |S| reaches ms at the frequency w; `unit` has gain 1. Infinite where none does."""
    L = unit.L(1j * w)
    # |1 + k L| = 1/ms is a quadratic equation for k.
    a, b, c = np.abs(L) ** 2, L.real, 1 - 1 / ms**2
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    return np.where((b * b >= a * c) & (b < 0), (-b - root) / a, np.inf)


def gain_at_ms(unit: pidalab.Loop, ms: float) -> float:
    """Smallest gain at which the loop reaches ms; `unit` is the loop with gain 1."""
    x = np.linspace(-3.0, 3.0, 3001)  # logarithm of the frequency
    near = x[int(np.argmin(gain_needed(unit, ms, 10**x)))]
    found = minimize_scalar(
        lambda x: float(gain_needed(unit, ms, np.array([10**x]))[0]),
        bounds=(near - 0.002, near + 0.002),
        method="bounded",
        options={"xatol": 1e-10},
    )
    return float(found.fun)


def loop_at_ms(
    process: pidalab.Process, controller: pidalab.PIDA, ms: float, F: haalman.OutputFilter | None = None
) -> pidalab.Loop:
    """Loop with the smallest gain that reaches ms, its filter included: the promise kept on the loop as it is."""
    block = F.transfer_function() if F else None
    kp = gain_at_ms(pidalab.Loop(process, replace(controller, kp=1.0), block), ms)
    return pidalab.Loop(process, replace(controller, kp=kp), block)
