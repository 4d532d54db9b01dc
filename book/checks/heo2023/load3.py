"""The three printed ITAE values of Example 3 with load, which do not come out: other readings of the experiment."""

import math
from functools import cache
from itertools import product

import control
import numpy as np
import pandas as pd
import pidalab
from pidalab._check import Array
from pidalab.controllers import NonInteractivePIDA
from pidalab.ledger import Ledger
from pidalab.process import Process

from . import schemes
from .examples import METHODS, SPOKEN, first_order, processes, runs, second_order, tuned
from .printed_itae import integral, row, sampled
from .schemes import Experiment, Scheme


@cache
def load_candidates() -> dict[str, list[Array]]:
    """Errors of the three loops of Example 3 with load, in other readings of the experiment, step at t = 0."""
    third = second_order()[3]
    dens = {f"process of Example {k}": process.den for k, process in processes().items()}
    dens |= {
        "(19) without its lag": np.array([9.0, 2.4, 1.0]),
        "(19) with 6s": np.array([9.0, 15.0, 7.0, 1.0]),
        "(19) with s²": np.array([1.0, 3.4, 3.4, 1.0]),
        "second-order model": np.array([third.tau**2, 2 * third.tau * third.damping, 1.0]),
        "first-order model": np.array([first_order()[3].tau, 1.0]),
    }
    found = {}
    scheme = Scheme(step=0.002)
    for (name, den), delay, k, kind, load in product(
        dens.items(), (0.0, 0.2, 0.5), processes(), SPOKEN, (True, False)
    ):
        step = Experiment(Process([1.0], den, delay=delay), load, 60.0, 0.0)
        errors = [schemes.errors(step, tuned()[k, method, kind], scheme)[::25] for method in METHODS]
        where = "at the input" if load else "at the output"
        tuning = f"tunings of Example {k}, {SPOKEN[kind]}"
        found[f"load {where}, {name}, dead time {delay}, {tuning}"] = errors
    parts = {"the lag": control.tf([1.0], [1.0, 1.0]), "the oscillator": control.tf([1.0], [9.0, 2.4, 1.0])}
    for name, rest in parts.items():
        errors = [_load_before(rest, tuned()[3, method, "load"]) for method in METHODS]
        found[f"load before {name} of (19)"] = errors
    return {name: errors for name, errors in found.items() if np.isfinite(errors).all()}


def _load_before(rest: control.TransferFunction, controller: NonInteractivePIDA) -> Array:
    """Error after a load step that reaches the output of (19) through the `rest` of it: that part less its share."""
    t = np.linspace(0, 60, 1201)[:-1]
    loop = pidalab.Loop(processes()[3], controller, prefilter=rest)
    free = pidalab.Process(rest.num[0][0], rest.den[0][0])
    return pidalab.step_response(loop, t).y - pidalab.open_loop_step(free, t).y


def load_values(book: Ledger) -> pd.DataFrame:
    """Example 3 with load: nothing that was tried gives the three values."""
    keys = [(3, method, "load") for method in METHODS]
    printed = np.array([book.printed(row(key)) for key in keys])
    rows: list[tuple[float, float, str]] = []
    starts = np.linspace(0, 20, 41)[:, None]
    for name, errors in load_candidates().items():
        t, sizes = 0.05 * np.arange(errors[0].size), np.abs(errors)
        values = np.array([starts * integral(e, 0.05) + integral(t * e, 0.05) for e in sizes])[:, :, 20:]
        off = np.log(values / printed[:, None, None])
        rows.append((float(np.abs(off).max(axis=0).min()), float(np.ptp(off, axis=0).min()), name))
    size, ratio = min(r[0] for r in rows), min(r[1] for r in rows)
    for key in keys:
        book.check(
            row(key),
            sampled(key),
            note=f"With the settings of the set point; {runs()[key].itae(math.inf):.3g} to infinity from the step. Of "
            f"{len(rows)} other readings (place of the load, process, dead time, tunings), with every step time from 0 "
            f"to 20 and end up to 60 after it, the nearest misses one of the three by "
            f"{100 * (math.exp(size) - 1):.0f} %; with any size of the step their ratios are missed by "
            f"{100 * (math.exp(ratio) - 1):.0f} %.",
        )
    best = sorted(rows)[:5]
    shown = [(f"{100 * (math.exp(a) - 1):.0f} %", f"{100 * (math.exp(b) - 1):.0f} %") for a, b, _ in best]
    names = [name for _, _, name in best]
    return pd.DataFrame(shown, names, ["size 1, misses by", "any size"])
