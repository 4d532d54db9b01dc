"""What huba2024 says of PPM-PIDA, PIDA_1 and PIDA_2 beside each other, and eq. (24) as we read it."""

from __future__ import annotations

from itertools import combinations

import pandas as pd
import pidalab
from pidalab.ledger import Ledger, every, some

from . import figure3, loops
from .tables import tabled

ROUNDING = 1e-9


@tabled
def searched(book: Ledger) -> pd.DataFrame:
    """Sections 2.3 and 2.4: what the text says of PPM-PIDA, beside PIDA_1."""
    P, one = "PPM-PIDA", "PIDA_1"
    smooth = loops.shapes(P)
    book.statement(
        "st.ppm.smooth",
        *every(smooth, "<="),
        convention="settled",
        left_name="excess over the ideal shape",
        right_name="change of the signal",
        note=f"{figure3.STANDARD}. Excess at most {max(e for e, _ in smooth.values()):.4f}; not "
        "zero, see eq25.feasible.y.",
    )
    names = sorted(loops.designs(), key=figure3.known)
    wrong = sum(figure3.iae(a, "load") > figure3.iae(b, "load") for a, b in combinations(names, 2))
    book.statement(
        "st.ppm.reconstruction",
        wrong,
        "==",
        0,
        left_name="pairs of the six controllers that the time and IAE_d rank differently",
        note=f"{figure3.STANDARD}, 300 for PI. The estimate of the load stays within 2 % after "
        + ", ".join(f"{figure3.known(name):.1f} with {name}" for name in names)
        + ".",
    )
    pairs = {
        f"overshoot, {step}": (figure3.overshoot_of(one, step), figure3.overshoot_of(P, step))
        for step in loops.STEPS
    }
    for key, (e, _) in loops.shapes(one).items():
        tail = key.partition(", ")[2]
        pairs[f"excess of {tail}"] = (e, loops.shapes(P)[f"{P}, {tail}"][0])
    book.statement(
        "st.pida1.ppm.shape",
        *every(pairs, "<"),
        left_name="PIDA_1",
        right_name="PPM-PIDA",
        note=f"{figure3.STANDARD}. PIDA_1 and PPM-PIDA: "
        + "; ".join(f"{key} {a:.5f} and {b:.5f}" for key, (a, b) in pairs.items())
        + ".",
    )
    costs = {step: (figure3.iae(one, step), figure3.iae(P, step)) for step in loops.STEPS}
    book.statement(
        "st.pida1.ppm.iae",
        *every(costs, "<"),
        left_name="IAE of PIDA_1",
        right_name="that of PPM-PIDA",
        note=f"{figure3.STANDARD}. "
        + "; ".join(f"{k} {a:.3f} against {b:.3f}" for k, (a, b) in costs.items())
        + ".",
    )
    resets = {name: (loops.series(name).ti, book.printed("fig3.tf")) for name in figure3.SHOWN}
    book.statement(
        "fig3.caption",
        *some(resets, "within", "similar"),
        left_name="T_i",
        right_name="the 0.2 of the caption",
        note="As read. It is T_f, as Section 2.3 has it; T_i is "
        + ", ".join(f"{ti:.2f} with {name}" for name, (ti, _) in resets.items())
        + ". The subscript may be read wrongly.",
    )
    return pd.DataFrame({k: {"PIDA_1": f"{a:.5f}", "PPM-PIDA": f"{b:.5f}"} for k, (a, b) in pairs.items()}).T


@tabled
def robust(book: Ledger) -> pd.DataFrame:
    """Section 2.4: is PIDA_2 the controller for processes that deviate from the model?"""
    worst, margins, costs = {}, {}, {}
    for name in ("PIDA_1", "PIDA_2"):
        own = loops.designs()[name]
        margins[name] = pidalab.margins(own.loop()).dm
        for delay in (0.8, 1.2):
            loop = own.loop(loops.plant(delay))
            r = loops.sampled(loop, "load")
            costs[name, delay] = r.iae()
            worst[name, delay] = loops.excess(r, "load")[1]
    said = "Loop of Paper Fig. 3, dead time 20 % shorter and 20 % longer: "
    book.statement(
        "st.pida2.deviating",
        margins["PIDA_2"],
        ">",
        margins["PIDA_1"],
        left_name="delay margin of PIDA_2",
        right_name="that of PIDA_1",
    )
    book.statement(
        "st.pida2.deviating.iae",
        *every({f"dead time {d}": (costs["PIDA_2", d], costs["PIDA_1", d]) for d in (0.8, 1.2)}, "<"),
        left_name="IAE_d of PIDA_2",
        right_name="that of PIDA_1",
        note=said
        + "; ".join(f"{n} {costs[n, 0.8]:.2f} and {costs[n, 1.2]:.2f}" for n in ("PIDA_1", "PIDA_2"))
        + ".",
    )
    book.statement(
        "st.pida2.deviating.shape",
        *every({f"dead time {d}": (worst["PIDA_2", d], worst["PIDA_1", d]) for d in (0.8, 1.2)}, "<="),
        left_name="TV_1(u_d) of PIDA_2",
        right_name="that of PIDA_1",
        note=said
        + "; ".join(f"{n} {worst[n, 0.8]:.4f} and {worst[n, 1.2]:.4f}" for n in ("PIDA_1", "PIDA_2"))
        + ".",
    )
    return pd.DataFrame(
        {
            name: {
                "delay margin": f"{margins[name]:.3f}",
                "IAE_d, −20 % and +20 %": f"{costs[name, 0.8]:.2f}, {costs[name, 1.2]:.2f}",
                "TV_1(u_d), −20 % and +20 %": f"{worst[name, 0.8]:.4f}, {worst[name, 1.2]:.4f}",
            }
            for name in margins
        }
    ).T


def pulses(book: Ledger) -> None:
    """Eq. (24) as we read it, on a signal that jumps: a proportional loop, whose u is one pulse."""
    loop = pidalab.Loop(loops.plant(), 0.2)
    r = pidalab.simulate_sampled(loop, loops.clock(200.0, 0.01), 1.0, 0.0)
    book.identity(
        "eq24.pulse",
        max(abs(r.tv1("u", final=0.0)), abs(r.tv("u", final=0.0) / 0.4 - 1)),
        ROUNDING,
        note="u of a P controller with the gain 0.2 jumps to 0.2 and comes back to 0: TV(u) is "
        f"{r.tv('u', final=0.0):.4f}, the jump from rest included, and TV_1(u) is zero.",
    )
