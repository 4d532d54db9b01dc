"""Section 2.2 and 4 of huba2024 without limits: prefilters, eqs. (20) to (22), and more derivatives."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pidalab
from pidalab.ledger import CONVENTIONS, Ledger, every
from pidalab.rules import automatic_reset as ar, mrdp

from . import loops
from .tables import tabled

ROUNDING = 1e-9


@tabled
def prefilters(book: Ledger) -> pd.DataFrame:
    """Eqs. (20) to (22): the loop without, with, and with a faster prefilter."""
    peaks = {}
    for name in loops.MRDP:
        loop = pidalab.Loop(loops.plant(), loops.designs()[name].controller)
        response = pidalab.step_response(loop, np.linspace(0, 100, 10001))
        peaks[name] = (1 + response.overshoot() / 100, 1.0)
    book.statement(
        "st.overshoot.1dof",
        *every(peaks, ">", "clearly"),
        left_name="highest y",
        right_name="set point",
        note="No limits, loop of Paper Fig. 3, exact engine: overshoot "
        + ", ".join(f"{100 * (top - 1):.0f} % with {name}" for name, (top, _) in peaks.items())
        + ".",
    )
    quick, more = {}, {}
    for name in ("MRDP-PIDA", "PIDA_1", "PIDA_2"):
        for case, bounds in (
            ("without limits", loops.FREE),
            ("limits of Paper Fig. 3", loops.limits("setpoint")),
        ):
            runs = [
                loops.sampled(loops.design(ar.SETTINGS[name], cancelled=c).loop(), "setpoint", bounds)
                for c in (0, 1)
            ]
            quick[f"{name}, {case}"] = (runs[1].iae(), runs[0].iae())
            if bounds != loops.FREE:
                over = [loops.beyond(r, "setpoint") for r in runs]
                more[name] = (over[0], over[1] + CONVENTIONS["identical"].limit)
    book.statement(
        "eq22.accelerate",
        *every(quick, "<"),
        left_name="IAE with (22)",
        right_name="with (21)",
        note="IAE with (22) and with (21): "
        + "; ".join(f"{k} {a:.2f} and {b:.2f}" for k, (a, b) in quick.items())
        + ".",
    )
    book.statement(
        "eq21.robust",
        *every(more, "<="),
        left_name="overshoot with (21)",
        right_name="that with (22) and a line's width",
    )
    fast = loops.design(loops.pida(), cancelled=1)
    zero = complex(fast.prefilter.zeros()[0]) * fast.delay
    gains = mrdp.constants(2).numerator
    left = zero**2 * np.exp(zero) + np.polyval(gains, zero)
    book.identity(
        "eq22.cancel",
        abs(left) / float(np.polyval(np.abs(gains), abs(zero))),
        ROUNDING,
        note="The zero of the prefilter is a pole of the loop without filter. T_d/2 is T_0 for m = 2 only; for PI and "
        f"PID it would be {loops.pi().lag:.4f} T_d and {loops.pid().lag:.4f} T_d.",
    )
    return pd.DataFrame(
        {k: {"IAE, (21)": f"{b:.3f}", "IAE, (22)": f"{a:.3f}"} for k, (a, b) in quick.items()}
    ).T


@tabled
def more_derivatives(book: Ledger) -> pd.DataFrame:
    """Section 4: more derivatives with Q_4, as what the paper says they bring: speed and robustness."""
    table, ies, peaks, least = {}, {}, {}, {}
    for m in range(5):
        total, numerator = loops.designs()["PI"].delay, mrdp.constants(m).numerator
        gains = [c * total ** (j - 2) for j, c in enumerate(numerator[::-1])]
        own = pidalab.HighOrderPID(gains, filter_time=0.2, filter_order=4)
        found = pidalab.margins(pidalab.Loop(loops.plant(), own))
        ies[m], peaks[m], least[m] = 1 / gains[0], found.ms, min(numerator)
        table[f"m = {m}"] = {"M_s": f"{found.ms:.3f}", "IE of a load": f"{ies[m]:.2f}"}
    book.statement(
        "discussion.higher", *every({f"m = {m}": (least[m], 0) for m in (3, 4)}, ">"), left_name="least gain"
    )
    pairs = {f"m = {m}": (m, m - 1) for m in range(1, 5)}
    said = "Multiple-pole gains for T_d = 1.8 in the loop of Paper Fig. 3 without limits, m from 0 to 4: "
    book.statement(
        "discussion.higher.speed",
        *every({k: (ies[a], ies[b]) for k, (a, b) in pairs.items()}, "<"),
        left_name="IE of a unit load",
        right_name="that with one derivative fewer",
        note=said + "IE of a unit load " + ", ".join(f"{x:.2f}" for x in ies.values()) + ".",
    )
    book.statement(
        "discussion.higher.robust",
        *every({k: (peaks[a], peaks[b]) for k, (a, b) in pairs.items()}, "<"),
        left_name="M_s",
        right_name="that with one derivative fewer",
        note=said
        + "M_s "
        + ", ".join(f"{x:.2f}" for x in peaks.values())
        + ". Robustness may be meant in another sense.",
    )
    return pd.DataFrame(table).T
