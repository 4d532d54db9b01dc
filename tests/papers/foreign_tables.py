"""Compute printed numbers of other sources, listed in ``tables_of_others.toml``, with the library."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import reduce
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import control
import numpy as np

import pidalab
from paperledger import derive
from pidalab.robustness.axis import DIFFERENCE
from pidalab.robustness.in_z import axis_of
from pidalab.rules import classical

FILE = Path(__file__).with_name("tables_of_others.toml")
AGREEING = ("reproduced", "last-digit", "rounded input", "within tolerance", "holds")
SAMPLES = 36_000  # of a step response; multiples of 1/9 of the horizon are among them
UNFILTERED = 1e4  # derivative time / filter time if the source has no filter
RULES = {
    one.__name__: one
    for one in (classical.ziegler_nichols_step, classical.chien_hrones_reswick, classical.amigo)
}

Answers = dict[str, float]
Table = dict[str, Any]


class Row(NamedTuple):
    """A printed number and its answer."""

    source: str
    where: str
    answer: str
    printed: str
    computed: float
    verdict: str  # of the numbers
    stored: str  # verdict in the file


def rows() -> list[Row]:
    """Answer every question."""
    data = tomllib.loads(FILE.read_text(encoding="utf-8"))
    return [row for table in data["table"] for row in _answered(table, data)]


def _answered(table: Table, data: dict[str, Any]) -> Iterator[Row]:
    named = table.get("plant")
    plant = _plant(data["plants"][named] if isinstance(named, str) else named, table.get("gain", 1.0))
    ask, controller = QUESTIONS[table["question"]], table.get("controller")
    answers = ask(plant, _controller(controller) if controller else None, table)
    nearby: list[Answers] = []
    for answer, printed in table["printed"].items():
        value = float(answers[answer])
        verdict = _verdict(printed, value)
        if verdict == "differs" and controller:
            nearby = nearby or [ask(plant, corner, table) for corner in _rounded(controller)]
            verdict = _by_rounding(printed, [value, *(float(corner[answer]) for corner in nearby)])
        if verdict == "differs" and "tolerance" in table:
            verdict = _by_tolerance(printed, value, table["tolerance"])
        stored = table.get("verdicts", {}).get(answer, "holds" if ">" in printed else "reproduced")
        yield Row(table["source"], table["where"], answer, printed, value, verdict, stored)


# --- verdicts ---------------------------------------------------------------------------------------------------------


def _verdict(printed: str, value: float) -> str:
    """Return the verdict from the printed digits alone, as in a ledger."""
    if printed.startswith(">="):
        return "holds" if value >= float(printed[2:]) else "fails"
    if not math.isfinite(value):
        return "differs"
    return derive(printed.rstrip("."), f"{value:.17g}") or "differs"


def _by_rounding(printed: str, values: list[float]) -> str:
    """Return the verdict if the printed number lies between the answers for gains that round to the printed gains."""
    half = _half_unit(printed)
    return "rounded input" if min(values) - half <= float(printed) <= max(values) + half else "differs"


def _by_tolerance(printed: str, value: float, tolerance: str) -> str:
    """Return the verdict within the tolerance that the source states."""
    size, *of_it = tolerance.split()
    width = float(size) * (abs(float(printed)) if of_it else 1.0)
    return "within tolerance" if abs(value - float(printed)) <= width else "differs"


def _half_unit(text: str) -> float:
    """Return half a unit of the last written place."""
    digits, _, power = text.lower().partition("e")
    return 0.5 * 10.0 ** (int(power or 0) - len(digits.partition(".")[2]))


# --- plants and controllers -------------------------------------------------------------------------------------------


def _polynomial(factors: Any) -> Any:
    """Return the coefficients of a polynomial, given by them or by its factors."""
    nested = isinstance(factors[0], list)
    return reduce(np.convolve, factors, np.ones(1)) if nested else np.array(factors, dtype=float)


def _plant(given: dict[str, Any] | None, gain: float) -> pidalab.Process | None:
    if given is None:
        return None
    if "a" in given:
        states = control.ss(*(given[name] for name in "abcd"))
        return pidalab.Process.from_control(gain * control.tf(states))
    num, den = _polynomial(given["num"]), _polynomial(given["den"])
    return pidalab.Process(gain * given.get("gain", 1.0) * num, den, given.get("delay", 0.0))


def _controller(given: dict[str, list[Any]]) -> control.TransferFunction:
    """Return a controller from printed numbers (strings) or exact numbers."""
    if "num" in given:
        return control.tf([float(c) for c in given["num"]], [float(c) for c in given["den"]])
    ((form, texts),) = given.items()
    first, second, *more = (float(text) for text in texts)
    if form == "parallel":  # ki, kp, kd and the time of the derivative's filter
        kd, tf = more or (0.0, 0.0)
        num, den = [second * tf + kd, second + first * tf, first], [tf, 1.0, 0.0]
    elif form == "standard":  # kp and ti
        num, den = [first * second, first], [second, 0.0]
    else:  # series: kc, tau_i, tau_d
        td = more[0] if more else 0.0
        num, den = (
            first * np.convolve([second, 1.0], [td, 1.0]),
            np.convolve([second, 0.0], [td / UNFILTERED, 1.0]),
        )
    return control.tf(np.trim_zeros(num, "f"), np.trim_zeros(den, "f"))


def _rounded(given: dict[str, list[Any]]) -> Iterator[control.TransferFunction]:
    """Yield the extreme controllers whose numbers round to the printed numbers."""
    choices = [
        [float(x) + sign * _half_unit(x) for sign in (-1, 1)] if isinstance(x, str) else [x]
        for numbers in given.values()
        for x in numbers
    ]
    for chosen in product(*choices):
        left = iter(chosen)
        yield _controller({name: [next(left) for _ in numbers] for name, numbers in given.items()})


def _loop(plant: Any, controller: Any, table: Table) -> pidalab.Loop:
    if "sample" in table:
        controller = pidalab.HighOrderPID([0.0, 1.0], 1e-9, 1).discretise(table["sample"])
    return pidalab.Loop(plant, 1.0 if controller is None else controller)


# --- questions --------------------------------------------------------------------------------------------------------


def margins(plant: Any, controller: Any, table: Table) -> Answers:
    """Return margins by the names of `pidalab.Margins`, and in the units of other programs."""
    loop = _loop(plant, controller, table)
    result = pidalab.margins(loop)
    a = result.disk
    high = (2 + a) / (2 - a) if a < 2 else math.inf  # largest gain in the disk
    answers = {name: value for name, value in vars(result).items() if isinstance(value, float)}
    answers |= {"distance": 1 / result.ms, "disk_gain": high, "disk_gain_low": 1 / high}
    answers |= {
        "disk_gain_db": 20 * math.log10(high),
        "disk_phase": math.degrees(2 * math.atan(a / 2)),
    }
    return answers | ({"wdisk": axis_of(loop).peak(DIFFERENCE)[1]} if "wdisk" in table["printed"] else {})


def crossovers(plant: Any, controller: Any, table: Table) -> Answers:
    """Return all crossovers in ascending order, with pm_k at wgc_k, and L_k and gm_k at wpc_k."""
    loop = _loop(plant, controller, table)
    answers: Answers = {}
    for k, w in enumerate(pidalab.gain_crossovers(loop), 1):
        answers |= {f"wgc_{k}": w, f"pm_{k}": float(np.degrees(np.angle(-loop.L(1j * w))))}
    for k, w in enumerate(pidalab.phase_crossovers(loop), 1):
        size = abs(loop.L(1j * w))
        answers |= {f"wpc_{k}": w, f"L_{k}": -size, f"gm_{k}": 1 / size}
    return answers


def step(plant: Any, controller: Any, table: Table) -> Answers:
    """Return measures of the open-loop step response, and values at shares of the horizon."""
    horizon = float(table["horizon"])
    response = pidalab.open_loop_step(plant, np.linspace(0.0, horizon, SAMPLES + 1))
    answers: Answers = {}
    for name in table["printed"]:
        if name.startswith("y("):
            answers[name] = response.y[round(Fraction(name[2:-1]) / Fraction(horizon) * SAMPLES)]
        elif name == "settling_time_half_percent":
            answers[name] = response.settling_time(0.005)
        else:
            answers[name] = abs(getattr(response, name)())
    return answers


def bandwidth(plant: Any, controller: Any, table: Table) -> Answers:
    """Return the bandwidth of the closed loop."""
    return {"bandwidth": pidalab.bandwidth(_loop(plant, controller, table))}


def reaction_rule(plant: Any, controller: Any, table: Table) -> Answers:
    """Return the settings of a rule for a lag with dead time, and its coefficients."""
    tuned = RULES[table["rule"]](plant, kind=table["kind"], **table.get("options", {})).controller
    gain, lag, delay = plant.gain(), plant.den[0] / plant.den[1], plant.delay
    answers = {"kp": tuned.kp, "ti": tuned.ti, "td": tuned.td, "kp K L/T": tuned.kp * gain * delay / lag}
    answers |= {"ti/L": tuned.ti / delay, "ti/T": tuned.ti / lag, "td/L": tuned.td / delay}
    return answers | ({"L/td": delay / tuned.td} if tuned.td else {})


def ultimate_rule(plant: Any, controller: Any, table: Table) -> Answers:
    """Return the coefficients of Ziegler and Nichols' second rule."""
    design = classical.ziegler_nichols_ultimate(plant, table["kind"])
    tuned, gain, period = design.controller, design.ultimate_gain, design.ultimate_period
    parts = {"Ku/kp": gain / tuned.kp, "Pu/ti": period / tuned.ti}
    parts |= {"Pu/td": period / tuned.td} if tuned.td else {}
    turned = {"/".join(reversed(name.split("/"))): 1 / value for name, value in parts.items()}
    return parts | turned | {f"20 {name}": 20 * value for name, value in parts.items()}


def simc(plant: Any, controller: Any, table: Table) -> Answers:
    """Return the settings of SIMC in series form, without a filter."""
    tuned = classical.simc(plant, table["kind"]).controller
    root = math.sqrt(max(1 - 4 * tuned.td / tuned.ti, 0.0))
    longer, shorter = tuned.ti * (1 + root) / 2, tuned.ti * (1 - root) / 2
    return {"kc": tuned.kp * longer / tuned.ti, "tau_i": longer, "tau_d": shorter}


QUESTIONS: dict[str, Callable[[Any, Any, Table], Answers]] = {
    one.__name__: one for one in (margins, crossovers, step, bandwidth, reaction_rule, ultimate_rule, simc)
}
