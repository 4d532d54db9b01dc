"""Where the print, as read, does not agree with itself: proofs from the paper's own tables, continuity, simulation."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pidalab
from pidalab.ledger import Ledger, some
from pidalab.reduction import SecondOrderModel
from pidalab.rules import itae

from .examples import KINDS, LETTERS, METHODS, RULES, SHAPES, processes, second_order, tuned
from .printed_itae import row, sampled
from .table1 import unit


def gains(book: Ledger) -> pd.DataFrame:
    """Two gains of ITAE-2 that do not follow from Table 2; the printed ITAE decides."""
    rows = {}
    for k in processes():
        for method in ("itae2", "proposed"):
            key, id = (k, method, "setpoint"), f"table{k + 3}.{method}.setpoint.kc"
            C = tuned()[key]
            ours, theirs = sampled(key), sampled(key, replace(C, kc=book.printed(id)))
            rows[f"Example {k}, {METHODS[method]}"] = {
                "gain, printed": f"{book.row(id).printed}",
                "gain, Table 2": f"{C.kc:.3f}",
                "ITAE, printed": f"{book.row(row(key)).printed}",
                "with the printed gain": f"{theirs:.3f}",
                "with Table 2": f"{ours:.3f}",
            }
            if method == "itae2" and k < 3:
                text = (
                    f"The formula of Table 2 gives k_c of Example 3 and of all three proposed tunings; here it gives "
                    f"{C.kc:.4f}. The printed ITAE is {book.row(row(key)).printed}: sampled as all ITAE values of IMC "
                    f"and ITAE-2, the gain of the formula gives {ours:.3f} and the printed one {theirs:.3f}. "
                )
                text += (
                    "One digit, a 2 for a 9, so perhaps of the reading."
                    if k == 2
                    else "Two digits differ, so hardly of the reading."
                )
                book.check(id, C.kc, note=text)
    return pd.DataFrame(rows).T


def _as_read(m: SecondOrderModel) -> dict[str, float]:
    """Derivative and integral times of ITAE-2 by the formulas as read, of Table 2 (set point) and 3 (load)."""
    r, xi, tau = m.delay / m.tau, m.damping, m.tau
    plus, minus = (
        -1.9
        + 1.576 * r**-0.53
        + (1 - math.exp(sign * xi / (-0.15 + 0.939 * r**-1.121))) * (1.45 + 0.969 * r**-1.171)
        for sign in (1, -1)
    )
    integral = 1 - math.exp(xi / (0.15 + 0.33 * r))
    return {
        "table2.taud.inverse": tau * (1 - math.exp(-(r**1.06) * xi / 0.87)) * (0.55 + 1.683 * r**-1.09),
        "table3.taui.sign": tau
        * (-0.975 + 0.91 * (r - 1.845) ** 2 + integral * (5.25 - 0.88 * (r - 2.8) ** 2)),
        "table3.taud.sign": tau * plus,
        "table3.taud.inverse": tau * minus,
    }


MEANING = {  # name, experiment, column of Tables 4 to 6, what becomes right
    "table2.taud.inverse": ("Table 2, τ_d", "setpoint", "taud", "It gives τ_n/τ_d: inverted"),
    "table3.taui.sign": (
        "Table 3, τ_i with +",
        "load",
        "taui",
        "A minus sign is missing, perhaps in the reading: with it",
    ),
    "table3.taud.sign": (
        "Table 3, τ_d with +",
        "load",
        "taud",
        "A minus sign is missing, perhaps in the reading: with it, inverted",
    ),
    "table3.taud.inverse": (
        "Table 3, τ_d with −",
        "load",
        "taud",
        "The sign mended, it still gives τ_n/τ_d: inverted",
    ),
}


def formulas(book: Ledger) -> pd.DataFrame:
    """The formulas of Tables 2 and 3 as read, against the ITAE-2 tunings of the examples."""
    read = {k: _as_read(m) for k, m in second_order().items()}
    rows = {}
    for id, (name, kind, letter, mended) in MEANING.items():
        cases = {}
        for k in processes():
            if (id, k) == ("table3.taui.sign", 1):  # there the other branch holds
                continue
            shown, ours = (
                book.row(f"table{k + 3}.itae2.{kind}.{letter}"),
                getattr(tuned()[k, "itae2", kind], LETTERS[letter]),
            )
            cases[f"Example {k}"] = abs(read[k][id] - float(shown.printed)), shown.half_unit
            rows[f"Example {k}, {name}"] = {
                "printed": shown.printed,
                "formula as read": f"{read[k][id]:.3f}",
                "corrected": f"{ours:.3f}",
            }
        seen = [line for line in rows if line.endswith(name)]
        text = f"{mended} it gives {', '.join(rows[line]['corrected'] for line in seen)} in {', '.join(cases)}, where "
        text += (
            f"{', '.join(rows[line]['printed'] for line in seen)} is printed and the formula as read gives "
        )
        text += f"{', '.join(rows[line]['formula as read'] for line in seen)}."
        names: dict[str, Any] = {"left_name": "distance from the print", "right_name": "half a unit"}
        book.statement(id, *some(cases, "<="), note=text, **names)
    return pd.DataFrame(rows).T


def switches(book: Ledger) -> pd.DataFrame:
    """Where the formulas of Tables 2 and 3 change: by continuity."""
    ratio = np.array([0.1, 0.3, 0.5, 0.7, 0.9, 1.2, 1.6, 2.0])
    parts = -0.67 + 0.297 * ratio**-2.001, -0.365 + 0.26 * (ratio - 1.4) ** 2
    apart = np.abs(parts[0] - parts[1])
    low_side, high_side = (itae.pid_load(unit(1.0, x)).kc for x in (0.9 - 1e-9, 0.9 + 1e-9))
    right, low = _load_gain(0.3, 2.0), _load_gain(0.3, 2.0, by_damping=True)
    text = (
        f"It changes at θ_n/τ_n = 0.9: there the formulas differ by {high_side - low_side:.4f}; at ξ_n = 0.9 "
        f"k_n k_c would jump by up to {apart.max():.1f}. For ξ_n = 0.3 and θ_n/τ_n = 2 it would be {low:.3f}, below 0; "
        f"with the switch at a ratio of 0.9 it is {right:.3f}. The examples take the same branch either way."
    )
    names: dict[str, Any] = {"left_name": "largest jump at ξ_n = 0.9", "right_name": "jump at θ_n/τ_n = 0.9"}
    book.statement("table3.kc.switch", apart.max(), "<=", abs(high_side - low_side), note=text, **names)
    below, above = (itae.pid_setpoint(unit(1.0, x)) for x in (1.0, 1.0 + 1e-9))
    line = (1.768 + 0.329 * 1.0) * 1.0
    text = (
        f"The fifth line gives τ_d, this one continues that of τ_i: at θ_n/τ_n = 1 and ξ_n = 1 it is {line:.3f}, "
        f"τ_i is {below.tau_i:.3f} and τ_d {above.tau_d:.3f}. The left side may be an error of the reading."
    )
    names = {"left_name": "distance from τ_d", "right_name": "from τ_i"}
    book.statement(
        "table2.taui.left", abs(line - above.tau_d), "<", abs(line - below.tau_i), note=text, **names
    )
    book.note(
        "table1.misplaced",
        "Beside a line of the first half, which then would have no formula for ξ_m up to 1 and long dead time; the "
        "second half would have no condition at all. It belongs to the second half, as the library reads it.",
    )
    return pd.DataFrame(parts, ["first formula", "second formula"], ratio).round(3)


def _load_gain(damping: float, ratio: float, by_damping: bool = False) -> float:
    """k_n k_c of Table 3, switched at a ratio of 0.9 or, as read, at a damping of 0.9."""
    if not by_damping:
        return itae.pid_load(unit(damping, ratio)).kc
    return 2.189 * damping * ratio**-0.766 - 0.67 + 0.297 * ratio**-2.001


def text(book: Ledger) -> pd.DataFrame:
    """Slips in the text: what they would mean for Examples 1 to 3."""
    rows = {}
    misses: dict[str, dict[str, tuple[float, float]]] = {"eq9.taun": {}, "eq12.taua": {}}
    for k, m in second_order().items():
        f_d = itae.factors(m.process).f_d
        for kind in KINDS:
            C, here = tuned()[k, "proposed", kind], f"table{k + 3}.proposed.{kind}"
            wrong = {"eq9.taun": (m.tau + 0.5 * m.delay * f_d, "taui"), "eq12.taua": (C.tau_d * f_d, "taua")}
            for id, (value, letter) in wrong.items():
                shown = book.row(f"{here}.{letter}")
                misses[id][f"Example {k}, {kind}"] = abs(value - float(shown.printed)), shown.half_unit
                rows[f"Example {k}, {kind}, {'τ_i' if letter == 'taui' else 'τ_a'}"] = {
                    "printed": shown.printed,
                    "as the text has it": f"{value:.3f}",
                }
    names: dict[str, Any] = {"left_name": "distance from the print", "right_name": "half a unit"}
    note = "Eq. (9) has the same expression as τ_n, the time constant of the new model; with it the tunings come out."
    book.statement("eq9.taun", *some(misses["eq9.taun"], "<="), note=note, **names)
    note = "In three places. Step 5 has τ_d f_a, f_a would have no role otherwise, and Tables 4 to 6 follow from f_a."
    book.statement("eq12.taua", *some(misses["eq12.taua"], "<="), note=note, **names)
    book.note(
        "eq6.taup",
        "Eqs (5) to (7), (14) and (16) have τ_i in the same places, and in (13) it divides the integral.",
    )
    return pd.DataFrame(rows).T


def readings(book: Ledger) -> None:
    """Rows that are settled by reading."""
    book.note("st.intro.parallel", "A survey of the literature, not a computation.")
    book.note("st.intro.optimisation", "A survey of the literature, not a computation.")
    book.note("eq16.same", "Term by term the same, with τ_p read as τ_i.")
    used = "An input of the tunings, used as printed but for what the errata say."
    book.note("table1.inputs", f"{used} The optimal data that it was fitted to were not published.")
    for id in ("table2.inputs", "table3.inputs"):
        book.note(id, f"{used} It comes from the paper's reference 11.")


def rounding(book: Ledger) -> pd.DataFrame:
    """How many frequencies the reduction used, and how precisely the models were carried on."""
    trials = {
        f"{points} frequencies": {k: pidalab.reduction.to_sopdt(P, points) for k, P in processes().items()}
        for points in (5, 8, 9, 10, 11, 12, 20, 100)
    }
    trials["10, then rounded"] = {
        k: m._replace(**{name: round(getattr(m, name), 3) for name in SHAPES.values()})
        for k, m in second_order().items()
    }
    rows = {}
    for trial, models in trials.items():
        agree = {"of 9 parameters": 0, "of 42 tunings": 0}
        for k, model in models.items():
            for name, attribute in SHAPES.items():
                agree["of 9 parameters"] += _same(
                    book, f"table{k + 3}.itae2.{name}", getattr(model, attribute)
                )
            for (method, kind), rule in RULES.items():
                C = rule(model.process)
                for name in LETTERS if method == "proposed" else ("kc", "taui", "taud"):
                    id = f"table{k + 3}.{method}.{kind}.{name}"
                    agree["of 42 tunings"] += _same(book, id, getattr(C, LETTERS[name]))
        rows[trial] = agree
    return pd.DataFrame(rows).T


def _same(book: Ledger, id: str, value: float) -> bool:
    """Whether a value rounds to a print."""
    return abs(value - book.printed(id)) <= book.row(id).half_unit
