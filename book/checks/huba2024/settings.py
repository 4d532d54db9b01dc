"""Section 2.4 of huba2024: the chain of rounded numbers from (26) to (31)."""

from __future__ import annotations

import numpy as np
import pandas as pd
from pidalab.ledger import CONVENTIONS, Display, Ledger, every
from pidalab.rules import automatic_reset as ar

from . import loops
from .tables import tabled

ROUNDING = 1e-9
NAMES = ("kp", "ti", "td", "kd", "ta2", "ka")


def zero_pair(book: Ledger) -> Display:
    """Eqs. (26) and (27), from the printed coefficients, as they are written."""
    book.check(
        {
            "eq26.ta2": loops.pida().times[1],
            "eq26.td": loops.pida().times[0],
            "eq27.ti": loops.pida().ti,
        }
    )
    root = np.roots([book.printed("eq26.ta2"), book.printed("eq26.td"), 1.0])[0]
    exact = np.roots([*loops.pida().times[::-1], 1.0])[0]
    mixed = [
        np.roots(p)[0].imag
        for p in (
            [book.printed("eq26.ta2"), loops.pida().times[0], 1],
            [loops.pida().times[1], book.printed("eq26.td"), 1],
        )
    ]
    book.check(
        "eq26.re",
        root.real,
        note="From the printed coefficients 0.0484 and 0.4168, as eq. (26) is written. Unrounded it is "
        f"{exact.real:.4f}.",
    )
    book.check(
        "eq26.im",
        abs(root.imag),
        note="From the printed coefficients 0.0484 and 0.4168, as eq. (26) is written. Unrounded it is "
        f"{abs(exact.imag):.4f}; with only one of the two coefficients rounded, "
        f"{abs(mixed[0]):.4f} or {abs(mixed[1]):.4f}.",
    )
    book.check({"eq27.pole": root.real, "eq27.denominator": -root.real})
    short = -1 / book.printed("eq27.pole")
    book.check(
        "eq27.t2", short, note=f"From the printed 4.3058: {short:.5f}. Eqs (30) and (31) continue with 0.232."
    )
    book.statement(
        "eq27.much",
        ar.double_zero().ti,
        "<",
        loops.pida().ti,
        convention="negligible",
        left_name="T_2",
        right_name="T_i",
    )
    book.statement(
        "eq29.bar",
        abs(loops.pida().ka - book.printed("eq30.ka")),
        "<=",
        book.row("eq30.ka").half_unit,
        left_name="distance of K_a of (18) from the number printed in (30)",
        right_name="half a unit of its last place",
        note=f"As read. It is K̄_a, as eq. (31) has it: K_a without bar is {loops.pida().ka:.4f} "
        "of eq. (18). The bar may be "
        "lost in the reading.",
    )
    return book.table("eq26")


def _chain(kp: float, ti: float, short: float) -> dict[str, float]:
    """Eq. (29): the gains that follow when a double zero takes the place of the pair."""
    gain, td, ta2 = kp * short / ti, ti + short, ti * short
    return dict(zip(NAMES, (gain, short, td, gain * td, ta2, gain * ta2), strict=True))


def chained(book: Ledger) -> Display:
    """Eqs. (30) and (31), from the printed numbers that they are written with."""
    kp, ti = book.printed("eq18.kp"), book.printed("eq18.ti")
    short = round(1 / book.printed("eq27.denominator"), 3)  # as (27) prints it
    own = {"eq30": _chain(kp, ti, short), "eq31": _chain(kp, ti, 1.5 * short)}
    for eq, values in own.items():
        book.check({f"{eq}.{name}": value for name, value in values.items()})
    book.check("eq31.t2", 1.5 * book.printed("eq27.t2"))
    higher = {
        name: (getattr(ar.double_zero(1.5), name), getattr(ar.double_zero(), name))
        for name in ("kp", "kd", "ka")
    }
    book.statement("st.gains", *every(higher, ">"), left_name="PIDA_2", right_name="PIDA_1")
    return book.table("eq30")


@tabled
def roundings(book: Ledger) -> pd.DataFrame:
    """How many of the twelve numbers of (30) and (31) are missed if an input is not rounded."""
    kp, ti, short = book.printed("eq18.kp"), book.printed("eq18.ti"), book.printed("eq27.t2")
    inputs = {
        "all as printed": (kp, ti, short),
        "K_p unrounded": (loops.pida().kp, ti, short),
        "T_i unrounded": (kp, loops.pida().ti, short),
        "T_2 = 1/4.3058": (kp, ti, 1 / book.printed("eq27.denominator")),
        "all unrounded": (loops.pida().kp, loops.pida().ti, ar.double_zero().ti),
    }
    rows = {}
    for name, (gain, slow, fast) in inputs.items():
        missed = []
        for eq, ratio in (("eq30", 1.0), ("eq31", 1.5)):
            for key, value in _chain(gain, slow, ratio * fast).items():
                row = book.row(f"{eq}.{key}")
                if abs(value - book.printed(f"{eq}.{key}")) > row.half_unit * (1 + 1e-9):
                    missed.append(f"({eq[2:]}) {key}")
        rows[name] = {"missed, of 12": len(missed), "which": ", ".join(missed) or "–"}
    return pd.DataFrame(rows).T


def identities(book: Ledger) -> Display:
    """Eqs. (28) and (29) for the library's family of double zeros."""
    ratios = (0.7, 1.0, 1.5)
    book.identity("eq28.identity", max(_residuals(ratio)[0] for ratio in ratios), ROUNDING)
    book.identity("eq29.relations", max(_residuals(ratio)[1] for ratio in ratios), ROUNDING)
    return book.table("eq28")


def _residuals(ratio: float) -> tuple[float, float]:
    """How far the second and the third expression of (28) are from the first."""
    rng = np.random.default_rng(2024)
    s = rng.normal(size=20) + 1j * rng.normal(size=20)
    old, new, short = loops.pida(), ar.double_zero(ratio), ratio * ar.TAU_2
    left = old.kp * (1 + short * s) ** 2 * (1 + old.ti * s) / (old.ti * s)
    middle = new.kp * (1 + short * s) * (1 + old.ti * s) * (1 + short * s) / (short * s)
    last = (new.kp + new.kd * s + new.ka * s**2) * (1 + new.ti * s) / (new.ti * s)
    return float(np.max(np.abs(middle / left - 1))), float(np.max(np.abs(last / left - 1)))


@tabled
def same_linear_loop(book: Ledger) -> pd.DataFrame:
    """Section 2.4: the double zero hardly changes the linear loop."""
    w = np.geomspace(1e-3, 1e3, 20001)
    before, after = (loops.designs()[name].loop().L(1j * w) for name in ("MRDP-PIDA", "PIDA_1"))
    ratio = np.abs(after / before)
    y0, y1 = (loops.run(name, "load", linear=True).y for name in ("MRDP-PIDA", "PIDA_1"))
    moved = {
        "loop gain": float(np.max(np.abs(ratio - 1))),
        "load response": float(np.max(np.abs(y1 - y0)) / np.max(y0)),
    }
    slow = w < float(w[np.flatnonzero(np.abs(before) > 1)[-1]])
    book.statement(
        "st.linear.same",
        *every({name: (x, CONVENTIONS["clearly"].limit) for name, x in moved.items()}, "<"),
        left_name="largest relative change",
        right_name="what the book calls significant",
        note=f"MRDP-PIDA to PIDA_1, loop of Paper Fig. 3 without limits: the loop gain changes by at most "
        f"{100 * moved['loop gain']:.0f} %, at ω = {w[np.argmax(np.abs(ratio - 1))]:.1f}, and by "
        f"{100 * np.max(np.abs(ratio[slow] - 1)):.1f} % up to the crossover; the load response by "
        f"{100 * moved['load response']:.0f} % of its peak.",
    )
    return pd.DataFrame({"largest change": {name: f"{x:.1%}" for name, x in moved.items()}})
