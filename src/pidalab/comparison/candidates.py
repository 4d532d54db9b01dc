"""Rules, each with the model that its authors start from, and the optima: what a comparison is about."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import cached_property, partial
from typing import Any

import numpy as np

from pidalab._check import Array
from pidalab.loop import Loop
from pidalab.process import Process, fopdt
from pidalab.roots import roots
from pidalab.rules import Design

KINDS = ("PI", "PID", "PIDA")
FILTER_SHARE = (
    0.25  # dead time that a filter may add, as a share of the model's, where the rule leaves it to the user
)
RESET_FILTER = 3  # order of the filter of an automatic reset


class _Models:
    """Models of one process, each made when a rule asks for it; what cannot be made raises then."""

    def __init__(self, process: Process) -> None:
        self.process = process

    @cached_property
    def reaction(self) -> Process:
        """Dead time from the steepest tangent, lag up to 63 % of the step response; an integrator stays one."""
        if not self._settles():
            return self.integrator
        if len(self.process.den) == 2 and len(self.process.num) == 1:
            return self.process
        t, y = self._response(self._undelayed, 15 * time_scale(self._undelayed))
        gain, delay = self.process.gain(), self.integrator.delay
        left = y / gain - (1 - math.exp(-1))
        i = int(np.argmax(left >= 0))
        # between the samples along a straight line; a process that jumps may be there at once
        reached = float(np.interp(0.0, left[i - 1 : i + 1], t[i - 1 : i + 1])) if i else 0.0
        return fopdt(gain, reached + self.process.delay - delay, delay)

    @cached_property
    def first_order(self) -> Process:
        from pidalab.reduction import to_fopdt

        # first order or an integrator is its own model
        return self.process if len(self.process.den) == 2 else to_fopdt(self.process).process

    @cached_property
    def second_order(self) -> Process:
        from pidalab.reduction import to_sopdt

        return to_sopdt(self.process).process

    @cached_property
    def third_order(self) -> Process:
        from pidalab.identification import three_point

        if not self._settles():
            raise ValueError("process must be stable: three_point reads a step response that settles")
        return three_point(*self._step).process

    @cached_property
    def integrator(self) -> Process:
        from pidalab.identification import ipdt_tangent

        itself = len(self.process.den) == 2 and self.process.den[-1] == 0
        if not itself and np.any(roots(self.process.den).real > 0):
            raise ValueError("process must not be unstable: the integrator is read off its step response")
        if itself:
            return self.process
        tangent = ipdt_tangent(*self._rise)
        return Process(tangent.num, tangent.den, tangent.delay + self.process.delay)

    @cached_property
    def _step(self) -> tuple[Array, Array]:
        """The step response until it has settled."""
        return self._response(self.process, 15 * time_scale(self.process))

    @cached_property
    def _rise(self) -> tuple[Array, Array]:
        """The beginning of the step response without dead time: the largest lag hardly matters to its slope."""
        lags = np.sort(_lags(self.process))
        small = lags[:-1] if self._settles() else lags
        return self._response(self._undelayed, 10 * float(np.sum(small)) or 15 * time_scale(self._undelayed))

    @cached_property
    def _undelayed(self) -> Process:
        """The process without its dead time, which only shifts what is read off: short lags need a fine grid."""
        return Process(self.process.num, self.process.den)

    @staticmethod
    def _response(process: Process, end: float) -> tuple[Array, Array]:
        from pidalab.simulation.exact import open_loop_step

        t = np.linspace(0.0, end, 8001)
        return t, open_loop_step(process, t).y

    def _settles(self) -> bool:
        return bool(np.all(roots(self.process.den).real < 0))


def time_scale(process: Process) -> float:
    """Time constants and dead time together."""
    return float(np.sum(_lags(process))) + process.delay or 1.0


def _lags(process: Process) -> Array:
    """Time constants of the poles, in any order; an integrator has none."""
    poles = np.abs(roots(process.den).real)
    return 1 / poles[poles > 0]


Candidate = tuple[str, str, Callable[[], Design]]


def judged_rules(process: Process, ms: float, noise_gain: float, sample_time: float) -> Iterator[Candidate]:
    """Every rule and kind, then the optima."""
    models = _Models(process)
    yield from _classical(models)
    yield from _with_sensitivity(models, ms)
    yield from _least_itae(models)
    yield from _by_areas(process, noise_gain, sample_time)
    yield from _multiple_poles(models)
    yield from _best(process, ms, noise_gain, sample_time)


def _on(models: _Models, name: str, tune: Callable[..., Design], *args: Any) -> Callable[[], Design]:
    """Return the call of a rule on the model of that name, which is made with the call."""
    return lambda: tune(getattr(models, name), *args)


def _classical(models: _Models) -> Iterator[Candidate]:
    from pidalab.rules import classical

    for kind in KINDS[:2]:
        yield "simc", kind, _on(models, "process", classical.simc, kind)
        yield "amigo", kind, _on(models, "reaction", classical.amigo, kind)
        yield "lambda", kind, _on(models, "reaction", classical.lambda_tuning, kind)
        yield "Ziegler-Nichols step", kind, _on(models, "integrator", classical.ziegler_nichols_step, kind)
        yield (
            "Ziegler-Nichols ultimate",
            kind,
            _on(models, "process", classical.ziegler_nichols_ultimate, kind),
        )


def _with_sensitivity(models: _Models, ms: float) -> Iterator[Candidate]:
    from pidalab.rules import haalman

    for kind, name in zip(KINDS, ("first_order", "second_order", "third_order"), strict=True):
        yield "haalman", kind, _on(models, name, haalman.tune, ms, kind)


def _least_itae(models: _Models) -> Iterator[Candidate]:
    from pidalab.rules import direct, itae

    yield "imc", "PID", _on(models, "first_order", _imc)
    for test in ("load", "setpoint"):
        for kind in KINDS[1:]:
            yield f"itae {test}", kind, _on(models, "second_order", itae.tune, test, kind)
        yield f"direct {test}", "PIDA", _on(models, "second_order", direct.tune, test)


def _imc(model: Process) -> Design:
    from pidalab.rules import itae

    return Design(model, itae.imc_pid(model), source="heo2023, rows IMC")


def _by_areas(process: Process, noise_gain: float, sample_time: float) -> Iterator[Candidate]:
    for m, kind in enumerate(KINDS):
        yield "magnitude optimum", kind, partial(_by_areas_quiet_enough, process, m, noise_gain, sample_time)


def _by_areas_quiet_enough(process: Process, m: int, noise_gain: float, sample_time: float) -> Design:
    """The filter as short as the sample; longer where that is too loud."""
    from pidalab.rules import magnitude_optimum

    shortest = magnitude_optimum.tune(process, m, m + 1, sample_time)
    if sampled_noise(shortest, process, sample_time)[0] <= noise_gain:
        return shortest
    return magnitude_optimum.tune_for_exact_noise(process, m, m + 1, noise_gain, sample_time)


def _multiple_poles(models: _Models) -> Iterator[Candidate]:
    """Rules for an integrator with dead time, with a filter that adds a quarter of the dead time or more."""
    from pidalab.rules import automatic_reset

    for m, kind in enumerate(KINDS):
        yield "mrdp", kind, _on(models, "integrator", _mrdp, m)
    for name, setting in automatic_reset.SETTINGS.items():
        kind = "PIDA" if setting.ka else "PID" if setting.kd else "PI"
        yield f"automatic reset {name}", kind, _on(models, "integrator", _with_reset, setting)


def _mrdp(model: Process, m: int) -> Design:
    from pidalab.rules import mrdp

    return mrdp.tune(model, m, m + 1, max(FILTER_SHARE, 1.2 * mrdp.smallest_te(m, m + 1)) * model.delay)


def _with_reset(model: Process, setting: Any) -> Design:
    from pidalab.rules import automatic_reset

    return automatic_reset.tune(model, setting, RESET_FILTER, FILTER_SHARE * model.delay / RESET_FILTER)


def _best(process: Process, ms: float, noise_gain: float, sample_time: float) -> Iterator[Candidate]:
    from pidalab import optimal

    for order, kind in enumerate(KINDS):
        yield "optimal", kind, partial(optimal.load, process, order, ms, None, noise_gain, sample_time)


def sampled_noise(design: Design, process: Process, sample_time: float) -> tuple[float, str]:
    """Noise gain of the sampled loop, or NaN and why there is none."""
    from pidalab.simulation.noise import noise_gain

    try:
        return noise_gain(design.loop(process), sample_time), ""
    except ValueError as refusal:
        reason = " ".join(str(refusal).split())
    # a filter faster than the sample: as a PLC would run it
    try:
        digital = Loop(process, design.controller.discretise(sample_time, "backward", design.output_filter))
        return noise_gain(digital, sample_time), "noise gain of backward differences"
    except ValueError:
        return math.nan, f"no noise gain: {reason}"
