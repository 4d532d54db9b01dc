"""The three examples of heo2023: processes, models, tunings, responses, and Tables 4 to 6."""

from collections.abc import Callable, Iterable
from functools import cache
from itertools import product

import numpy as np
import pandas as pd
import pidalab
from pidalab.controllers import NonInteractivePIDA
from pidalab.ledger import Display, Ledger, every
from pidalab.process import Process
from pidalab.reduction import FirstOrderModel, SecondOrderModel
from pidalab.response import Response
from pidalab.rules import itae

Key = tuple[int, str, str]  # example, method, experiment
METHODS = {"imc": "IMC", "itae2": "ITAE-2", "proposed": "proposed"}
KINDS: dict[str, Callable[..., Response]] = {"setpoint": pidalab.step_response, "load": pidalab.load_response}
SPOKEN = {"setpoint": "set point", "load": "load"}
LETTERS = {"kc": "kc", "taui": "tau_i", "taud": "tau_d", "taua": "tau_a"}
SHAPES = {"tau": "tau", "theta": "delay", "xi": "damping"}
RULES = {
    ("itae2", "setpoint"): itae.pid_setpoint,
    ("itae2", "load"): itae.pid_load,
    ("proposed", "setpoint"): itae.pida_setpoint,
    ("proposed", "load"): itae.pida_load,
}


def experiment(k: int, kind: str) -> str:
    """Name of an experiment, as tables and notes have it."""
    return f"Example {k}, {SPOKEN[kind]}"


def listed(values: Iterable[float], form: str = ".3g") -> str:
    """Numbers as a list in a sentence."""
    *first, last = [f"{value:{form}}" for value in values]
    return f"{', '.join(first)} and {last}" if first else last


def percents(values: Iterable[float]) -> str:
    """Shares as a list of percentages in a sentence."""
    *first, last = [f"{100 * value:.1f}" for value in values]
    return f"{', '.join(first)} and {last} %" if first else f"{last} %"


@cache
def processes() -> dict[int, Process]:
    """The processes (17), (18) and (19)."""
    return {
        1: pidalab.lags(3, delay=0.2),
        2: pidalab.lags(5),
        3: pidalab.Process([1.0], np.polymul([9.0, 2.4, 1.0], [1.0, 1.0]), delay=0.5),
    }


@cache
def first_order() -> dict[int, FirstOrderModel]:
    """Their first-order models, for IMC."""
    return {k: pidalab.reduction.to_fopdt(process) for k, process in processes().items()}


@cache
def second_order() -> dict[int, SecondOrderModel]:
    """Their second-order models, for ITAE-2 and the proposed rule."""
    return {k: pidalab.reduction.to_sopdt(process) for k, process in processes().items()}


@cache
def tuned() -> dict[Key, NonInteractivePIDA]:
    """All 18 controllers of Tables 4 to 6, from the unrounded models."""
    found = {
        (k, method, kind): rule(second_order()[k].process)
        for k, ((method, kind), rule) in product(processes(), RULES.items())
    }
    return found | {
        (k, "imc", kind): itae.imc_pid(first_order()[k].process) for k, kind in product(processes(), KINDS)
    }


def proposed() -> dict[tuple[int, str], NonInteractivePIDA]:
    """The six controllers of the proposed rule."""
    return {(k, kind): C for (k, method, kind), C in tuned().items() if method == "proposed"}


@cache
def runs() -> dict[Key, Response]:
    """Responses of the 18 loops to unit steps, long enough to settle."""
    t = np.linspace(0, 200, 10001)
    return {key: KINDS[key[2]](pidalab.Loop(processes()[key[0]], C), t) for key, C in tuned().items()}


def _beyond(book: Ledger, id: str, value: float) -> float:
    """By how many units of the last place a value lies beyond the limit of rounding."""
    half = book.row(id).half_unit
    return (abs(value - book.printed(id)) - half) / (2 * half)


def _rounded(book: Ledger, k: int, method: str, kind: str) -> NonInteractivePIDA:
    """The tuning that follows from the printed, rounded model."""
    here = f"table{k + 3}.{method}"
    tau, theta = book.printed(f"{here}.tau"), book.printed(f"{here}.theta")
    if method == "imc":
        return itae.imc_pid(pidalab.fopdt(1.0, tau, theta))
    return RULES[method, kind](pidalab.sopdt(1.0, tau, book.printed(f"{here}.xi"), theta))


def _hand_over(book: Ledger, id: str, value: float, from_rounded: float | None = None) -> None:
    """Hand over an entry of Tables 4 to 6; one that misses its print says by how much."""
    beyond = _beyond(book, id, value)
    if beyond <= 0:
        book.check(id, value)
    else:
        note = f"Beyond the limit of rounding by {beyond:.3f} units of the last place."
        if from_rounded is not None:
            note += f" From the printed, rounded model it would be {from_rounded:.5f}."
        book.check(id, value, note=note)


def _table(book: Ledger, k: int) -> Display:
    """Hand over a table of models and tunings; the two gains that need a proof are left to `errata.gains`."""
    here = f"table{k + 3}"
    for method in METHODS:
        model = (first_order() if method == "imc" else second_order())[k]
        for name, attribute in list(SHAPES.items())[: 2 if method == "imc" else 3]:
            _hand_over(book, f"{here}.{method}.{name}", getattr(model, attribute))
    for (example, method, kind), C in tuned().items():
        names = [name for name in LETTERS if name != "taua" or method == "proposed"] if example == k else []
        for name in names:
            id = f"{here}.{method}.{kind}.{name}"
            if (method, kind, name) != ("itae2", "setpoint", "kc") or k == 3:
                again = getattr(_rounded(book, k, method, kind), LETTERS[name])
                _hand_over(book, id, getattr(C, LETTERS[name]), again)
    return book.table(f"{here}.")


def table4(book: Ledger) -> Display:
    """Example 1."""
    return _table(book, 1)


def table5(book: Ledger) -> Display:
    """Example 2."""
    return _table(book, 2)


def table6(book: Ledger) -> Display:
    """Example 3."""
    return _table(book, 3)


def measured() -> pd.DataFrame:
    """Rise, overshoot and settling of the set-point steps; peak, its time and undershoot after the load steps."""
    rows = {}
    for k, (method, name) in product(processes(), METHODS.items()):
        servo, load = (runs()[k, method, kind] for kind in KINDS)
        rows[f"Example {k}, {name}"] = {
            "rise time": f"{servo.rise_time():.2f}",
            "overshoot, %": f"{servo.overshoot():.1f}",
            "settling, 2 %": f"{servo.settling_time():.1f}",
            "u(0+)": f"{servo.u[0]:.0f}",
            "load peak": f"{load.y.max():.3f}",
            "at": f"{load.t[load.y.argmax()]:.2f}",
            "undershoot": f"{max(0.0, -load.y.min()):.3f}",
            "settling": f"{load.t[np.abs(load.y) > 0.02 * load.y.max()].max():.1f}",
        }
    return pd.DataFrame(rows).T


def _rivals(measure: Callable[[Response], float], kind: str) -> dict[str, tuple[float, float]]:
    """A measure of the proposed loops beside that of each rival."""
    return {
        f"Example {k}, {METHODS[method]}": (
            measure(runs()[k, "proposed", kind]),
            measure(runs()[k, method, kind]),
        )
        for k, method in product(processes(), ("imc", "itae2"))
    }


def _all(measure: Callable[[Response], float], kind: str, form: str) -> str:
    """A measure in all examples, for a note."""
    values = [[f"{measure(runs()[k, method, kind]):{form}}" for method in METHODS] for k in processes()]
    return "; ".join(", ".join(row) for row in values)


def responses(book: Ledger) -> pd.DataFrame:
    """Paper Figs 2 to 4: what the text says about them, and their measures."""
    rise, over, settle = Response.rise_time, Response.overshoot, Response.settling_time
    who = "IMC, ITAE-2, proposed"
    text = f"{who}: {_all(rise, 'setpoint', '.2f')}."
    book.statement("st.servo.rise", *every(_rivals(rise, "setpoint"), "<"), note=text)
    delayed = {
        method: pidalab.step_response(
            pidalab.Loop(pidalab.lags(5, delay=0.2), tuned()[2, method, "setpoint"]),
            np.linspace(0, 100, 5001),
        ).overshoot()
        for method in METHODS
    }
    text = (
        f"{who}, in per cent: {_all(over, 'setpoint', '.1f')}. In Example 2 that of ITAE-2 is smaller, also with a "
        f"dead time of 0.2 added ({', '.join(f'{value:.1f}' for value in delayed.values())})."
    )
    book.statement("st.servo.overshoot", *every(_rivals(over, "setpoint"), "<"), note=text)
    bands = {
        f"{name}, to {100 * band:g} %": pair
        for band in (0.02, 0.05, 0.01)
        for name, pair in _rivals(lambda run, band=band: run.settling_time(band), "setpoint").items()  # type: ignore[misc]
    }
    text = f"To 2 %, {who}: {_all(settle, 'setpoint', '.1f')}."
    book.statement("st.servo.settling", *every(bands, "<"), note=text)
    peaks = _rivals(lambda run: float(run.y.max()), "load")
    text = f"{who}: {_all(lambda run: float(run.y.max()), 'load', '.3f')}."
    book.statement("st.load.peak", *every(peaks, "<", convention="much"), note=text)
    book.statement("st.load.smaller", *every(peaks, "<"), note=text)
    return measured()
