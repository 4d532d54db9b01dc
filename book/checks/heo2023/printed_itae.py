"""The 18 printed ITAE values: what was integrated, how it was simulated, and what does not come out."""

import math
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
import pidalab
from pidalab._check import Array
from pidalab.controllers import NonInteractivePIDA
from pidalab.ledger import Ledger, every, some
from pidalab.process import Process

from . import schemes
from .examples import (
    KINDS,
    METHODS,
    Key,
    experiment,
    listed,
    processes,
    runs,
    tuned,
)
from .schemes import Experiment, Scheme

START = 1.0  # of the steps, found by `windows`
ENDS = {
    (1, "setpoint"): 8,
    (1, "load"): 12,
    (2, "setpoint"): 20,
    (2, "load"): 25,
    (3, "setpoint"): 15,
    (3, "load"): 15,
}
FOUND = Scheme()  # the one of `scheme`
PID_VALUES = [key for key in product(processes(), ("imc", "itae2"), KINDS) if key[::2] != (3, "load")]
PIDA_VALUES = [(k, "proposed", kind) for k, kind in ENDS if (k, kind) != (3, "load")]


def row(key: Key) -> str:
    """Id of a printed value."""
    return f"itae.ex{key[0]}.{key[1]}.{key[2]}"


def plant(k: int, kind: str) -> Process:
    """The process as it seems to have been simulated: for one experiment the dead time of Example 1 is left in it."""
    return pidalab.lags(5, delay=processes()[1].delay) if (k, kind) == (2, "setpoint") else processes()[k]


def sampled(key: Key, controller: NonInteractivePIDA | None = None, scheme: Scheme = FOUND) -> float:
    """ITAE with the settings found, sampled."""
    k, _, kind = key
    step = Experiment(plant(k, kind), kind == "load", ENDS[k, kind], START)
    return schemes.itae(step, controller or tuned()[key], scheme)


def exact(key: Key, controller: NonInteractivePIDA | None = None, process: Process | None = None) -> float:
    """ITAE with the settings found, exact loop."""
    k, _, kind = key
    loop = pidalab.Loop(process or plant(k, kind), controller or tuned()[key])
    t = np.linspace(0, ENDS[k, kind] - START, 4001)
    return KINDS[kind](loop, t).itae(origin=-START)


def _apart(book: Ledger, key: Key, value: float) -> tuple[float, float]:
    """Larger over smaller of a value and its print, and what half a unit of the last place allows."""
    printed = book.printed(row(key))
    return max(value / printed, printed / value), 1 + book.row(row(key)).half_unit / printed


def definition(book: Ledger) -> pd.DataFrame:
    """Integrals to infinity, from the step: not the printed values, but the same order."""
    infinite = {key: run.itae(math.inf) for key, run in runs().items()}
    printed = {key: book.printed(row(key)) for key in infinite}
    misses = {
        f"{experiment(k, kind)}, {METHODS[method]}": _apart(
            book, (k, method, kind), infinite[k, method, kind]
        )
        for k, method, kind in infinite
    }
    nearest = min(abs(infinite[key] / printed[key] - 1) for key in infinite)
    text = f"None does; the nearest of the 18 is {100 * nearest:.2f} % off."
    names: dict[str, Any] = {
        "left_name": "larger over smaller of value and print",
        "right_name": "what rounding allows",
    }
    book.statement("itae.definition", *some(misses, "<="), note=text, **names)
    pairs = {
        f"{experiment(k, kind)}, {METHODS[better]} against {METHODS[worse]}": (
            infinite[k, better, kind],
            infinite[k, worse, kind],
        )
        for k, kind in ENDS
        for better, worse in (("proposed", "itae2"), ("itae2", "imc"))
    }
    values = "; ".join(listed(infinite[k, method, kind] for method in METHODS) for k, kind in ENDS)
    text = f"To infinity from the step, with the processes as printed; IMC, ITAE-2, proposed: {values}."
    book.statement("itae.order", *every(pairs, "<"), note=text)
    rows = {
        experiment(k, kind): {
            METHODS[m]: f"{infinite[k, m, kind]:.2f} ({printed[k, m, kind]:.2f})" for m in METHODS
        }
        for k, kind in ENDS
    }
    return pd.DataFrame(rows).T


@cache
def misfits(book: Ledger) -> tuple[Array, Array, dict[str, Array]]:
    """Step times, ends after the step, and how far the values of IMC and ITAE-2 are missed with both; exact loops."""
    starts, t = np.linspace(0, 3, 61), np.linspace(0, 40, 4001)
    experiments = {experiment(k, kind): (processes()[k], k, kind) for k, kind in ENDS}
    experiments["Example 2 with dead time 0.2, set point"] = (plant(2, "setpoint"), 2, "setpoint")
    missed = {}
    for name, (process, k, kind) in experiments.items():
        both = []
        for method in ("imc", "itae2"):
            run = KINDS[kind](pidalab.Loop(process, tuned()[k, method, kind]), t)
            value = starts[:, None] * integral(np.abs(run.e), 0.01) + integral(run.t * np.abs(run.e), 0.01)
            both.append(np.abs(value / book.printed(row((k, method, kind))) - 1))
        missed[name] = np.max(both, axis=0)[:, ::20]
    return starts, t[::20], missed


def integral(f: Array, h: float) -> Array:
    """Integral up to each sample, by trapezoids."""
    return h * np.concatenate([[0.0], np.cumsum((f[1:] + f[:-1]) / 2)])


def _ends(name: str) -> tuple[int, float]:
    """Row of the maps that has the step time found, and the end found, for an experiment of `misfits`."""
    kind = "load" if name.endswith("load") else "setpoint"
    return round(START / 0.05), ENDS[int(name[8]), kind]


def windows(book: Ledger) -> pd.DataFrame:
    """For each experiment the pair of step time and end that fits IMC and ITAE-2 best."""
    starts, after, missed = misfits(book)
    rows = {}
    for name, wrong in missed.items():
        i, j = np.unravel_index(np.argmin(wrong), wrong.shape)
        at, end = _ends(name)
        rows[name] = {
            "best step at": f"{starts[i]:.2f}",
            "best end": f"{starts[i] + after[j]:.1f}",
            "misfit there": f"{wrong[i, j]:.2%}",
            "settings used": f"{START:g} and {end:g}",
            "misfit": f"{wrong[at, np.argmin(np.abs(after + START - end))]:.2%}",
        }
    return pd.DataFrame(rows).T


def scheme(book: Ledger) -> pd.DataFrame:
    """Ten of the values, to the printed digits, by one scheme of sampling."""
    for key in PID_VALUES:
        note = f"Step at t = {START:g}, time from 0, end at t = {ENDS[key[0], key[2]]}: found, not printed. "
        if key[::2] == (2, "setpoint"):
            note += "Dead time 0.2 added to eq. (18), see itae.ex2.plant. "
        note += (
            f"Sampled every {FOUND.step} (Euler plant, Tustin filter); the exact loop gives {exact(key):.4f}."
        )
        book.check(row(key), sampled(key), note=note)
    rows = []
    for tried in schemes.pid_variants():
        off = [abs(sampled(key, scheme=tried) - book.printed(row(key))) for key in PID_VALUES]
        rows.append(
            {
                "plant": tried.plant,
                "derivative filter": tried.derivative,
                "present error in the integral": "yes" if tried.integral_first else "no",
                "weight at": "start" if tried.weight_first else "end",
                "of 10": sum(
                    x <= book.row(row(key)).half_unit for x, key in zip(off, PID_VALUES, strict=True)
                ),
                "largest miss": f"{max(off):.3f}",
            }
        )
    table = pd.DataFrame(rows).sort_values("of 10", ascending=False, kind="stable")
    return table.head(8).reset_index(drop=True)


def dead_time(book: Ledger) -> pd.DataFrame:
    """Example 2 with the set point: the process as printed does not give the values."""
    plain, left, rows = processes()[2], plant(2, "setpoint"), {}
    cases = {}
    for method in METHODS:
        key = (2, method, "setpoint")
        printed = book.printed(row(key))
        as_printed = schemes.itae(Experiment(plain, False, ENDS[2, "setpoint"]), tuned()[key], FOUND)
        rows[METHODS[method]] = {
            "printed": printed,
            "with (18)": as_printed,
            "with dead time 0.2": sampled(key),
        }
        if method != "proposed":
            cases[METHODS[method]] = _apart(book, key, as_printed)
    table = pd.DataFrame(rows).T
    text = (
        f"IMC, ITAE-2, proposed: with (18) as printed {listed(table['with (18)'], '.2f')}; with the dead time "
        f"{left.delay} of Example 1 {listed(table['with dead time 0.2'], '.2f')}. Perhaps it was left in there."
    )
    names: dict[str, Any] = {
        "left_name": "larger over smaller of value and print",
        "right_name": "what rounding allows",
    }
    book.statement("itae.ex2.plant", *every(cases, "<="), note=text, **names)
    return table.map("{:.2f}".format)


@cache
def proposed_misses(book: Ledger) -> dict[Scheme, tuple[float, ...]]:
    """Relative deviation of the five proposed values by each scheme that was tried."""
    printed = [book.printed(row(key)) for key in PIDA_VALUES]
    return {
        tried: tuple(
            sampled(key, scheme=tried) / print_ - 1 for key, print_ in zip(PIDA_VALUES, printed, strict=True)
        )
        for tried in schemes.pida_variants()
    }


def nearer_by_eq7(book: Ledger) -> int:
    """How many of the five values the first-order filter of (7) meets better than the squared one, sampled alike."""
    first, squared = (proposed_misses(book)[x] for x in (Scheme(acceleration=("tustin",)), FOUND))
    return sum(abs(a) < abs(b) for a, b in zip(first, squared, strict=True))


def proposed_values(book: Ledger) -> pd.DataFrame:
    """The five values of the proposed rule, which no scheme gives to the printed digits."""
    misses = proposed_misses(book)
    ranked = sorted(misses, key=lambda tried: max(map(abs, misses[tried])))
    hits = {
        tried: sum(
            abs(miss) * book.printed(row(key)) <= book.row(row(key)).half_unit
            for miss, key in zip(misses[tried], PIDA_VALUES, strict=True)
        )
        for tried in misses
    }
    nearest = ranked[0]
    for i, key in enumerate(PIDA_VALUES):
        book.check(
            row(key),
            sampled(key),
            note=f"Settings and scheme that give the ten values of IMC and ITAE-2. The exact loop gives "
            f"{exact(key):.4f}. Of {len(misses)} schemes tried on the five proposed values none gives more than "
            f"{max(hits.values())} of them to the printed digits; the nearest ({nearest}) misses this one by "
            f"{100 * misses[nearest][i]:+.2f} %.",
        )
    shown = [*ranked[:6], FOUND, Scheme(acceleration=("tustin",))]
    names = [experiment(k, kind) for k, _, kind in PIDA_VALUES]
    rows = {str(tried): dict(zip(names, misses[tried], strict=True)) for tried in shown}
    return (100 * pd.DataFrame(rows).T).map("{:+.2f} %".format)


MARKS = {"reproduced": "", "last-digit": "°", "differs": "†"}
NAMES = {"gain": "kc", "integral": "taui", "derivative": "taud", "acceleration": "taua"}


def glance(book: Ledger) -> pd.DataFrame:
    """The proposed rule in Tables 4 to 6 and in sec. 3: printed / computed, and a mark if the two do not agree."""
    rows = {}
    for k, kind in ENDS:
        C, key = tuned()[k, "proposed", kind], (k, "proposed", kind)
        ids = [f"table{k + 3}.proposed.{kind}.{letter}" for letter in NAMES.values()] + [row(key)]
        values = [C.kc, C.tau_i, C.tau_d, C.tau_a, sampled(key)]
        shown = [_beside(book, id, value) for id, value in zip(ids, values, strict=True)]
        rows[experiment(k, kind).replace("Example", "Ex.")] = dict(zip([*NAMES, "ITAE"], shown, strict=True))
    return pd.DataFrame(rows).T


def _beside(book: Ledger, id: str, value: float) -> str:
    """A printed number, the computed one with one digit more, and a mark unless they agree."""
    printed = book.row(id).printed
    computed = f"{value:.{len(printed.partition('.')[2]) + 1}f}"
    return f"{printed} / {computed}{MARKS[book.row(id).verdict]}"
