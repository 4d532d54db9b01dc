"""Tables I to IV of huba2018, from the closed forms of the rule."""

import numpy as np
import pandas as pd
import pidalab
from pidalab.ledger import Display, Ledger, every
from pidalab.rules import mrdp

from .designs import (
    CANCELLED,
    GRID,
    LIMITED,
    ORDERS,
    check_all,
    constants,
    listed,
    servo_integral,
    shortest_filter,
    unit,
)

TAU = ("τ₁", "τ₂", "τ₃", "τ₄")  # names of the derivative times in Table I
DOUBLY_ROUNDED = ("table2.m0.n4", "table3.m1.p1.b0", "table3.m1.p2.b1", "table3.m4.p3.b1", "table3.m4.p5.b4")


def integral(m: int, p: int) -> float:
    """Integral of the error after a set-point step in units of T_d, eq. (15)."""
    return (1 - mrdp.prefilter_weights(m, p)[0]) * constants(m).integral_time


def controllers(book: Ledger) -> Display:
    """Table I: the constants of the controllers."""
    for m in ORDERS:
        one = constants(m)
        times = {f"tau{j}": time for j, time in enumerate(one.derivative_times, start=1)}
        check_all(book, f"table1.m{m}", {"ko": one.gain, "tau_i": one.integral_time, **times})
    return book.table("table1.")


def filters(book: Ledger) -> Display:
    """Table II: the time constant of the filter."""
    ratios = {key: mrdp.filter_ratio(*key) for key in GRID}
    check_all(book, "table2", {f"m{m}.n{n}": ratio for (m, n), ratio in ratios.items()})
    falls = {f"m = {m}, n = {n}": (ratios[m, n + 1], ratios[m, n]) for m, n in GRID if n < 6}
    book.statement(
        "st.step4.order",
        *every(falls, "<"),
        left_name="T_f/T_e with n + 1",
        right_name="n",
        note="By eq. (11), for m from 0 to 4 and n from max(m, 1) to 6.",
    )
    column = [ratios[m, 4] for m in range(4)]
    book.check(
        "table2.m4.n4",
        ratios[4, 4],
        note=f"Eq. (11) with n = m is 1/(m + 2 − √(m + 2)): {ratios[4, 4]:.4f} here, and as printed in the other "
        f"cells of the diagonal. The printed {book.row('table2.m4.n4').printed} is the number of the cell m = 2, n "
        f"= 4. The other cells of the column rise with m: {listed(column, '.4f')}.",
    )
    return book.table("table2.")


def prefilters(book: Ledger) -> Display:
    """Table III: the weights of the prefilter."""
    for m, p in CANCELLED:
        weights = mrdp.prefilter_weights(m, p)
        check_all(book, f"table3.m{m}.p{p}", {f"b{k}": b for k, b in enumerate(weights)})
    one = constants(2)
    book.check(
        "table3.m2.p3.b2",
        mrdp.prefilter_weights(2, 3)[2],
        note=f"Exactly 1, printed without decimals: b_2 = (−1/p_o)³/(τ_i τ_2), with p_o = {one.pole:.0f}, τ_i = "
        f"{one.integral_time:.0f} and τ_2 = 1/{1 / one.derivative_times[1]:.0f}.",
    )
    faster = {f"m = {m}, p = {p}": (integral(m, p + 1), integral(m, p)) for m, p in CANCELLED if p <= m}
    book.statement(
        "st.prefilter.degrees",
        *every(faster, "<"),
        left_name="IAE_s/T_d with p + 1",
        right_name="p",
        note="(1 − b_0)T_i = T_i − p/|s_o|: each cancelled pole takes 1/|s_o| off. " + _slower_with_more(),
    )
    return book.table("table3.")


def _slower_with_more() -> str:
    """Find out whether the settling time falls, too."""
    m, n, te, t = 3, 3, 2.0, np.linspace(0, 100, 10_001)
    times = {
        p: pidalab.step_response(mrdp.tune(unit(), m, n, te, cancelled=p).loop(), t).settling_time()
        for p in (1, m + 1)
    }
    word = "longer" if times[m + 1] > times[1] else "shorter"
    return (
        f"The settling time need not fall: for m = {m}, n = {n} and T_e = {te:g} T_dm it is {times[m + 1]:.1f} T_dm "
        f"with p = {m + 1}, {word} than the {times[1]:.1f} T_dm with p = 1."
    )


def swapped_weights(book: Ledger) -> pd.DataFrame:
    """Table III from within: b_0 is proportional to p, and b_1 to p(p − 1)."""
    printed = {(m, p): book.printed(f"table3.m{m}.p{p}.b0") for m, p in CANCELLED}
    first, second = printed[3, 1], book.printed("table3.m3.p3.b1")
    right = mrdp.prefilter_weights(3, 2)
    book.check(
        "table3.m3.p2.b0",
        right[0],
        note="b_0 and b_1 of this row are interchanged. By eq. (14) b_0 is proportional to p: twice the "
        f"{first:.5f} of p = 1 is {2 * first:.5f}, which is printed as b_1.",
    )
    book.check(
        "table3.m3.p2.b1",
        right[1],
        note="b_0 and b_1 of this row are interchanged. By eq. (14) b_1 is proportional to p(p − 1): a third of "
        f"the {second:.5f} of p = 3 is {second / 3:.5f}, which is printed as b_0.",
    )
    each = printed[4, 1]
    others = listed([printed[4, p] / p for p in (3, 4, 5)], ".5f")
    book.check(
        "table3.m4.p2.b0",
        mrdp.prefilter_weights(4, 2)[0],
        note=f"By eq. (14) b_0 is proportional to p: twice the {each:.5f} of p = 1 is {2 * each:.5f}. The printed "
        f"values of p = 3, 4 and 5, divided by p, are {others}. Two of the digits may have been misread.",
    )
    cells = {f"p = {p}": {f"m = {m}": printed.get((m, p), np.nan) / p for m in ORDERS} for p in range(1, 6)}
    return pd.DataFrame(cells).map(lambda x: "–" if np.isnan(x) else f"{x:.6f}")


def integrals(book: Ledger) -> Display:
    """Table IV: the integral of the error."""
    best = [servo_integral(m) for m in ORDERS]
    check_all(book, "table4", {f"m{m}": value for m, value in enumerate(best)})
    falls = {f"m = {m + 1} against m = {m}": (best[m + 1], best[m]) for m in range(4)}
    book.statement(
        "st.table4.decreases",
        *every(falls, "<"),
        left_name="IAE_s/T_d with more",
        right_name="less",
        note=f"{listed(best, '.3f')} for m from 0 to 4. With the printed {book.row('table4.m2').printed} for m = 2 "
        "it falls as well.",
    )
    ti, b0 = book.printed("table1.m2.tau_i"), [book.printed(f"table3.m2.p{p}.b0") for p in (2, 3)]
    book.check(
        "table4.m2",
        best[2],
        note=f"(1 − b_0)τ_i with the printed {ti:.5f} of Table I and the printed {b0[1]:.5f} of Table III (p = 3, "
        f"the largest) is {(1 - b0[1]) * ti:.5f}. The printed 2.00000 is what p = 2 gives, (1 − "
        f"{b0[0]:.5f})·{ti:.0f} = {(1 - b0[0]) * ti:.5f}; the four other values of the table belong to p = m + 1.",
    )
    return book.table("table4.")


def integral_from_print(book: Ledger) -> pd.DataFrame:
    """Table IV from the printed cells of Tables I and III alone."""
    rows = {}
    for m in ORDERS[1:]:
        ti = book.printed(f"table1.m{m}.tau_i")
        b0 = {p: book.printed(f"table3.m{m}.p{p}.b0") for p in (m, m + 1)}
        rows[f"m = {m}"] = {"printed": book.row(f"table4.m{m}").printed} | {
            f"from p = m{name}": f"{(1 - b0[p]) * ti:.4f}" for p, name in ((m, ""), (m + 1, " + 1"))
        }
    return pd.DataFrame(rows).T


def rounding(book: Ledger) -> pd.DataFrame:
    """Five cells that miss their print by a hair: rounded to one place more first, they are ties."""
    rows = {}
    for id in DOUBLY_ROUNDED:
        table, *cell = id.split(".")
        orders = [int(name[1:]) for name in cell]
        value = (
            mrdp.filter_ratio(*orders)
            if table == "table2"
            else mrdp.prefilter_weights(*orders[:2])[orders[2]]
        )
        row = book.row(id)
        places = len(row.printed.partition(".")[2])
        beyond = (abs(value - float(row.printed)) - row.half_unit) / (2 * row.half_unit)
        tie = f"{value:.{places + 1}f}"
        book.check(
            id,
            value,
            note=f"{value:.7f} lies beyond the limit of rounding by {beyond:.2f} units. Rounded to {places + 1} "
            f"places first, it is {'a tie, ' if tie.endswith('5') else ''}{tie}.",
        )
        rows[id] = {"printed": row.printed, "exact": f"{value:.7f}", "with one place more": tie}
    return pd.DataFrame(rows).T


def reached(book: Ledger) -> pd.DataFrame:
    """Table IV as an integral of the absolute error: which values a loop reaches."""
    bound = unit().delay  # nothing answers before the dead time is over, and until then the error is 1
    book.statement(
        "st.table4.iae.ideal",
        servo_integral(4),
        ">=",
        bound,
        left_name="Table IV, m = 4",
        right_name="IAE of the error before y moves",
        note="In the loop without filter the error is 1 for one T_d, so its absolute integral is at least T_d. The "
        "value of the table is an integral of the error with its sign.",
    )
    found = {m: _least_ratio(m) for m in (0, 1, 2, 3, 4)}
    cases = {f"m = {m}": (ratio - 1, 1.0) for m, (ratio, _, _, _) in found.items()}
    said = "; ".join(
        f"m = {m}: by {100 * max(one[0] - 1, 0.0):.2f} %, n = {one[1]}" for m, one in found.items()
    )
    book.statement(
        "st.table4.iae",
        *every(cases, "<=", "identical"),
        left_name="least excess of IAE_s",
        right_name="eq. (15)",
        note=f"The least excess of the IAE over eq. (15) among the stable loops tried, {said}. For m = 0 and 1 it "
        f"tends to 0 with T_e; for m = 2 the least is at a finite one, {found[2][2]:.2f} T_dm.",
    )
    names = ["IAE / IE", "n", "Tₑ, dead times", "tried"]
    table = pd.DataFrame({f"m = {m}": dict(zip(names, one, strict=True)) for m, one in found.items()}).T
    return table.astype({"n": int, "tried": int}).round({"IAE / IE": 4, "Tₑ, dead times": 3})


def _least_ratio(m: int) -> tuple[float, int, float, int]:
    """Search n up to 6 and a geometric grid of T_e for the loop whose IAE is nearest to its IE."""
    tried = []
    for n in [n for order, n in GRID if order == m]:
        low = 1.05 * shortest_filter(m, n) if (m, n) in LIMITED else 0.01
        for te in np.geomspace(low, 2.0, 12):
            d = mrdp.tune(unit(), m, n, float(te))
            step = pidalab.step_response(d.loop(), np.linspace(0, 40 * (1 + te), 2001))
            tried.append((step.iae() / d.ie, n, float(te)))
    best = min(tried, key=lambda one: (round(one[0], 7), *one[1:]))  # no choice between equals by rounding
    return *best, len(tried)


def glance(book: Ledger) -> pd.DataFrame:
    """Tables I and IV: the printed digits where they come out, both numbers where they do not."""
    rows: dict[str, dict[str, str]] = {}
    for m in ORDERS:
        one = constants(m)
        cells = {"Kₒ": (f"table1.m{m}.ko", one.gain), "τᵢ": (f"table1.m{m}.tau_i", one.integral_time)}
        cells |= {TAU[j - 1]: (f"table1.m{m}.tau{j}", x) for j, x in enumerate(one.derivative_times, start=1)}
        cells["IAEₛ"] = (f"table4.m{m}", servo_integral(m))
        rows[f"m = {m}"] = {name: _cell(book, *cell) for name, cell in cells.items()}
    return pd.DataFrame(rows).fillna("–").loc[["Kₒ", "τᵢ", *TAU, "IAEₛ"]]


def _cell(book: Ledger, id: str, value: float) -> str:
    """Show a computed number to the printed digits, and what is printed where that is something else."""
    row = book.row(id)
    text = f"{value:.{len(row.printed.partition('.')[2])}f}"
    return (
        text if abs(value - float(row.printed)) <= row.half_unit * 1.1 else f"{text}, printed {row.printed}"
    )
