"""The set-point responses of Figs 2 and 3 of huba2018: monotonic or not, and what their integrals depend on."""

import numpy as np
import pandas as pd
import pidalab
from pidalab.ledger import Ledger, every
from pidalab.rules import mrdp

from .designs import (
    GRID,
    GROWTH,
    LIMITED,
    ORDERS,
    listed,
    noise_in_u,
    ruled,
    ruled_step,
    shortest_filter,
    span,
    unit,
)

BY_M = {m: [n for order, n in GRID if order == m] for m in ORDERS}


def label(q: float, m: int, n: int) -> str:
    """Name a loop of Figs 2 and 3."""
    return f"q = {q:g}, m = {m}, n = {n}"


def ruled_loops(book: Ledger) -> pd.DataFrame:
    """Eq. (16): the filters of Figs 2 and 3 against the shortest ones that the loops bear."""
    for q, name in GROWTH.items():
        cases = {f"m = {m}, n = {n}": (ruled(q, m, n).te, shortest_filter(m, n)) for m, n in LIMITED}
        unstable = sum(pidalab.unstable_poles(ruled(q, m, n).loop()) for m, n in GRID)
        book.statement(
            f"st.rule16.{name}",
            *every(cases, ">"),
            left_name="T_e",
            right_name="the shortest stable one, both in T_dm",
            note=f"For m from 2 to 4 and n from m to 6; {unstable} unstable poles are counted in all loops with m "
            "from 0 to 4 together. T_dm is not in the text; 1 is assumed.",
        )
    constant = {
        f"m = 4, n = {n}": (pidalab.unstable_poles(mrdp.tune(unit(), 4, n, 0.25).loop()), 1) for n in BY_M[4]
    }
    near = shortest_filter(3, 6)
    book.statement(
        "st.rule16.needed",
        *every(constant, ">="),
        left_name="unstable poles with T_e = 0.25 T_dm",
        right_name="one",
        note=f"For m from 0 to 3 these loops are still stable, hardly so for m = 3, n = 6, where {near:.4f} T_dm is "
        "the limit.",
    )
    limits = {f"m = {m}": span([shortest_filter(m, n) for n in BY_M[m]], ".3f") for m in (2, 3, 4)}
    rows = {f"q = {q:g}": {f"m = {m}": f"{0.25 * q**m:.3f}" for m in (2, 3, 4)} for q in (1.0, *GROWTH)}
    return pd.DataFrame(rows | {"shortest, by n": limits})


def overshoots(book: Ledger) -> pd.DataFrame:
    """Sec. III: the overshoot without prefilter, and what the prefilter leaves of it."""
    t = np.linspace(0, 60, 3001)
    over, bare = {}, {}
    for q in GROWTH:
        for m, n in GRID:
            over[q, m, n] = ruled_step(q, m, n).overshoot()
            bare[q, m, n] = pidalab.step_response(
                pidalab.Loop(unit(), ruled(q, m, n).controller), t
            ).overshoot()
    most = {m: max(value for (q, order, _), value in over.items() if order == m and q == 1.5) for m in ORDERS}
    book.statement(
        "st.prefilter.monotonic",
        *every(
            {label(*key): (value / 100, 1.0) for key, value in over.items() if key[0] == 1.5}, "<=", "settled"
        ),
        left_name="overshoot",
        right_name="step",
        note="Settings of Fig. 2, with T_dm = 1, p = m + 1 and every n up to 6. The largest overshoot for m from 0 "
        f"to 4 is {listed(list(most.values()), '.2g')} %, most of it with n = m; none of the responses is strictly "
        f"monotonic (least overshoot {min(over[key] for key in over if key[0] == 1.5):.2g} %). The design is exact "
        "for the loop without filter; the filter splits the multiple pole, and the cancellation becomes "
        "approximate.",
    )
    book.statement(
        "st.overshoot.1dof",
        *every({label(*key): (value / 100, 1.0) for key, value in bare.items()}, ">", "settled"),
        left_name="overshoot without prefilter",
        right_name="step",
        note=f"Settings of Figs 2 and 3 with T_dm = 1: {span(list(bare.values()), '.0f')} %.",
    )
    book.statement(
        "st.overshoot.removed",
        *every({label(*key): (value / 100, 1.0) for key, value in over.items()}, "<=", "settled"),
        left_name="overshoot with prefilter",
        right_name="step",
        note="Settings of Figs 2 and 3 with T_dm = 1 and p = m + 1. It remains below the settling band for m up to "
        f"{_highest_clean(over)} with every n; what is left is at most {max(over[k] / bare[k] for k in over):.2f} "
        "of the overshoot without prefilter.",
    )
    rows = {
        label(q, m, n): {"without prefilter, %": bare[q, m, n], "with, %": over[q, m, n]}
        for q, m, n in over
        if n in (max(m, 1), 6)
    }
    return pd.DataFrame(rows).T.round(2)


def _highest_clean(over: dict[tuple[float, int, int], float]) -> int:
    """Largest m up to which no response overshoots by more than 2 %."""
    return min(m for (_, m, _), value in over.items() if value > 2) - 1


def filter_orders(book: Ledger) -> pd.DataFrame:
    """Sec. III: whether the integral of the error depends on the order of the filter."""
    iae = {(q, m, n): ruled_step(q, m, n).iae() for q in GROWTH for m, n in GRID}
    ie = {key: ruled(*key).ie for key in iae}
    calm = {m: [_calm_step(m, te, n) for n in BY_M[m]] for m, te in ((0, 0.001), (1, 0.003))}
    assert all(run.overshoot() < 1e-4 for runs in calm.values() for run in runs), "no longer monotonic"
    spread = {f"m = {m}": np.ptp([run.iae() for run in runs]) for m, runs in calm.items()}
    book.statement(
        "st.iae.order",
        *every({name: (float(value), 1.0) for name, value in spread.items()}, "<=", "identical"),
        left_name="spread of IAE_s over n",
        right_name="T_dm",
        digits=3,
        note="m = 0 with T_e = 0.001 T_dm and m = 1 with T_e = 0.003 T_dm, n from 1 to 6: the overshoot is below "
        "0.0001 %. The spread is a difference of nearly equal numbers, so it is kept to few digits.",
    )
    excess = {q: [100 * max(iae[q, m, n] / ie[q, m, n] - 1 for n in BY_M[m]) for m in ORDERS] for q in GROWTH}
    book.statement(
        "st.iae.order.all",
        *every({label(*key): (iae[key] / ie[key] - 1, 1.0) for key in iae}, "<=", "identical"),
        left_name="excess of IAE_s over eq. (15)",
        right_name="eq. (15)",
        note="All loops of Figs 2 and 3 (T_dm = 1). The IE is that of eq. (15) for every n; the IAE exceeds it, as "
        f"the error changes its sign: for m from 0 to 4 by up to {listed(excess[1.5], '.2g')} % with q = 1.5 and by "
        f"up to {listed(excess[2.0], '.2g')} % with q = 2.",
    )
    rows = {
        label(q, m, n): {
            "Tₑ": ruled(q, m, n).te,
            "IE, eq. (15)": ie[q, m, n],
            "IE, simulated": ruled_step(q, m, n).ie(),
            "IAE": iae[q, m, n],
            "IAE / IE − 1, %": 100 * (iae[q, m, n] / ie[q, m, n] - 1),
        }
        for q, m, n in iae
        if n in (max(m, 1), 6)
    }
    return pd.DataFrame(rows).T.round(5)


def _calm_step(m: int, te: float, n: int) -> pidalab.Response:
    """Set-point step with a filter so short that nothing overshoots."""
    return pidalab.step_response(mrdp.tune(unit(), m, n, te).loop(), np.linspace(0, 40, 8001))


def sign_of_error(book: Ledger) -> pd.DataFrame:
    """Eq. (15): where the error keeps its sign, so that IAE and IE are the same."""
    ideal = {
        "m = 0, no filter": mrdp.tune(unit(), 0, 0, 0.0),
        "m = 1, n = 1, Tₑ = 0.001": mrdp.tune(unit(), 1, 1, 1e-3),
        "m = 1, n = 1, Tₑ = 0.001, p = 1": mrdp.tune(unit(), 1, 1, 1e-3, cancelled=1),
    }
    t = np.linspace(0, 40, 20_001)
    steps = {name: pidalab.step_response(d.loop(), t) for name, d in ideal.items()}
    apart = {name: steps[name].iae() / d.ie - 1 for name, d in ideal.items()}
    book.statement(
        "eq15.sign",
        *every({name: (value, 1.0) for name, value in apart.items()}, "<=", "identical"),
        left_name="excess of IAE_s over eq. (15)",
        right_name="eq. (15)",
        digits=1,
        note="Without filter for m = 0, and for m = 1 in the limit of a short T_e; the excess is kept to few "
        "digits, as most of it is what the record of 40 T_dm leaves out. For m of 2 and more the loop without "
        "filter is unstable.",
    )
    rows = {
        name: {
            "IE": d.ie,
            "IAE": steps[name].iae(),
            "excess": "below 1e-7" if abs(apart[name]) < 1e-7 else f"{apart[name]:.0e}",
        }
        for name, d in ideal.items()
    }
    return pd.DataFrame(rows).T


def accelerated(book: Ledger) -> pd.DataFrame:
    """Secs I and V.B: whether more derivatives make the transients faster."""
    same = {m: mrdp.tune(unit(), m, m + 1, te=0.5) for m in ORDERS}
    t = np.linspace(0, 60, 6001)
    iae = {m: pidalab.step_response(d.loop(), t).iae() for m, d in same.items()}
    book.statement(
        "st.accelerate.m",
        *every({f"m = {m + 1}": (iae[m + 1], iae[m]) for m in range(4)}, "<"),
        left_name="IAE_s with m",
        right_name="m − 1, in T_dm",
        note=f"T_e = 0.5 T_dm, n = m + 1: {listed(list(iae.values()), '.3f')} T_dm for m from 0 to 4.",
    )
    fastest = {q: {m: ruled(q, m, max(m, 1)).ie for m in ORDERS} for q in GROWTH}
    book.statement(
        "st.accelerate.rule16",
        *every({f"q = {q:g}": (by_m[4], min(by_m.values())) for q, by_m in fastest.items()}, "<="),
        left_name="IAE_s of eq. (15) with m = 4",
        right_name="the least one",
        note="T_e from eq. (16) with T_dm = 1. Eq. (15) gives for m from 0 to 4 "
        + "; ".join(f"{listed(list(fastest[q].values()))} for q = {q:g}" for q in GROWTH)
        + ": the growing T_e spends more than the last derivatives bring.",
    )
    table = {"Tₑ = 0.5": iae} | {f"eq. (15), q = {q:g}": fastest[q] for q in GROWTH}
    return pd.DataFrame(table).rename_axis("m").round(4)


def strictly_proper(book: Ledger) -> pd.DataFrame:
    """Sec. II.B: what one more order of the filter does to the noise in u."""
    loops = {(m, n): ruled(1.5, m, n).loop() for m in ORDERS[1:] for n in (m, m + 1)}
    deviation = {key: noise_in_u(loop) for key, loop in loops.items()}
    twice = {key: noise_in_u(loop, 500 * np.pi) for key, loop in loops.items()}
    book.statement(
        "eq7.noise",
        *every({f"m = {m}": (deviation[m, m + 1], deviation[m, m]) for m in ORDERS[1:]}, "<", "clearly"),
        left_name="noise in u with n = m + 1",
        right_name="n = m",
        note="Loops of Fig. 2 with T_dm = 1, white noise of unit deviation and 250 samples in a dead time: the "
        "standard deviation of u falls to "
        f"{listed([100 * deviation[m, m + 1] / deviation[m, m] for m in ORDERS[1:]], '.0f')} % for m = 1, 2, 3, 4.",
    )
    rows = {
        f"m = {m}, n = {n}": {"noise in u": deviation[m, n], "with 500 samples": twice[m, n]}
        for m, n in deviation
    }
    return pd.DataFrame(rows).T.round(3)


def proper(book: Ledger) -> pd.DataFrame:
    """Secs II.A and II.B: the gain of the controller at high frequency, without and with its filter."""
    slopes, first, rows = {}, {}, {}
    for m, n in GRID:
        d = mrdp.tune(unit(), m, n, te=0.5)
        w = np.array([1.0, 2.0]) * 100.0 / d.filter_time
        gain = np.abs(pidalab.Loop(d.model, d.controller).block("controller", 1j * w))
        bare = gain * np.abs(1 + 1j * w * d.filter_time) ** n
        slopes[m, n] = float(np.log2(bare[1] / bare[0]))
        jump = pidalab.step_response(pidalab.Loop(d.model, d.controller), np.linspace(0, 1e-3, 3)).u[0]
        highest = d.kc * (d.td[-1] if m else 1.0) / d.filter_time**m  # the limit of C(s) for n = m
        first[m, n] = jump / highest
        rows[m, n] = {"growth without filter": slopes[m, n], "u(0+), of its limit for n = m": first[m, n]}
    book.statement(
        "eq2.improper",
        *every({f"m = {m}": (slopes[m, n], 0) for m, n in GRID if m == n}, ">"),
        left_name="exponent of the growth of the gain with frequency",
        right_name="a proper controller",
        note="Between 100 and 200 times 1/T_f, with T_e = 0.5 T_dm.",
    )
    worst = max(abs(value - (1 if n == m else 0)) for (m, n), value in first.items())
    book.identity(
        "eq7.proper",
        worst,
        note="The first value of u after a set-point step without prefilter is finite: K_Dm/T_f^m for n = m, and 0 "
        "for n > m; simulated for m from 0 to 4 and n up to 6.",
    )
    return (
        pd.DataFrame({f"m = {m}, n = {n}": row for (m, n), row in rows.items() if n <= m + 1}).T.round(4)
        + 0.0
    )
