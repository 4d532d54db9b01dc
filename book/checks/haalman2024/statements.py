"""What section 4 says in words: better, faster, kicks, noise and effort."""

from __future__ import annotations

from functools import cache

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pidalab
from matplotlib.figure import Figure
from pidalab import plots
from pidalab.ledger import Ledger, every

from .work import CASES, EXPERIMENTS, KINDS, ORDERS, PAIRS, SIGNIFICANT, Case, Work, once, said, sigma, work

EARLY = 1e-3  # a time in which no signal of these loops moves far, unless it jumps


def comparisons(book: Ledger) -> pd.DataFrame:
    """IAE without noise, exact and to the end: PIDA against PID, and one Ms against the other."""
    shared = work(book)
    iae = shared.iae
    for test in EXPERIMENTS:
        saved = [100 * (1 - iae[pida, test] / iae[pid, test]) for pida, pid in PAIRS.values()]
        book.statement(
            f"st.better.{test}",
            *every({name: (iae[pida, test], iae[pid, test]) for name, (pida, pid) in PAIRS.items()}, "<"),
            left_name="IAE of the PIDA",
            right_name="IAE of the PID",
            note=f"Without noise, exact, integrated until settled: lower by {min(saved):.0f} to {max(saved):.0f} %. At "
            "the gains of the paper, which do not give both loops the same Ms on the process, nor the same noise.",
        )
        tighter = {
            f"{example}, {kind.upper()}": (
                iae[Case(example, kind, 2.0), test],
                iae[Case(example, kind, 1.4), test],
            )
            for example in ORDERS
            for kind in KINDS
        }
        book.statement(
            f"st.knob.{test}",
            *every(tighter, "<"),
            left_name="IAE at Ms 2.0",
            right_name="IAE at Ms 1.4",
            note="Without noise, exact, integrated until settled."
            + (_horizons_differ(book) if test == "setpoint" else ""),
        )
    rows = {
        case.label: [iae[case, "setpoint"], iae[case, "load"], shared.used[case].ti / shared.used[case].kp]
        for case in CASES
    }
    return pd.DataFrame(rows, index=["IAE, set point", "IAE, load", "ti/kp"]).T.map("{:.6f}".format)


def _horizons_differ(book: Ledger) -> str:
    first, second = (Case("ex2", "pida", ms) for ms in (1.4, 2.0))
    a, b = (book.row(f"{case.row}.iae.setpoint").printed for case in (first, second))
    return (
        f" The printed values of the PIDA in Example 2 rise, from {a} to {b}, because their horizons differ, "
        f"{first.horizon:g} and {second.horizon:g}."
    )


@cache
def effort_of(shared: Work, case: Case) -> dict[str, float]:
    """Largest control signals and standard deviations of a loop, without and with the noise of the paper."""
    t = np.linspace(0, 60, 60001)
    set_point, load = (pidalab.simulate(shared.loops[case], t, **step) for step in EXPERIMENTS.values())
    noisy = shared.noisy(case, "load")
    until = noisy[0].t <= case.horizon
    bare = shared.loop(case, on="process", filtered=False)
    return {
        "peak of y, set point": float(set_point.y.max()),
        "peak of y, load": float(np.abs(load.y).max()),
        "largest u, set point": float(np.abs(set_point.u).max()),
        "largest u, load": float(np.abs(load.u).max()),
        "with noise": float(np.mean([np.abs(run.u[until]).max() for run in noisy])),
        "variation of u, load": load.tv("u"),
        "variation with noise": float(np.mean([run.tv("u", case.horizon) for run in noisy])),
        "σ(u)": shared.spread[case],
        "σ(u) without F": sigma(bare),
    }


def effort(book: Ledger) -> pd.DataFrame:
    """Control effort and noise of the eight loops, and what the paper says about them."""
    shared = work(book)
    of = {case: effort_of(shared, case) for case in CASES}
    pida, pid = Case("ex1", "pida", 1.4), Case("ex1", "pid", 1.4)
    fast = Case("ex1", "pida", 2.0)
    factors = [of[a]["largest u, set point"] / of[b]["largest u, set point"] for a, b in PAIRS.values()]
    book.statement(
        "st.more.control",
        of[pida]["largest u, set point"],
        ">",
        of[pid]["largest u, set point"],
        left_name="largest u of the PIDA",
        right_name="largest u of the PID",
        note=f"After a set-point step, without noise. In the four comparisons the factor is {min(factors):.1f} to "
        f"{max(factors):.1f}.",
    )
    quiet, noisy = ("largest u, load", "variation of u, load"), ("with noise", "variation with noise")
    for row, (key, variation) in {"st.load.control": quiet, "st.load.control.noise": noisy}.items():
        book.statement(
            row,
            of[pida][key],
            "<",
            of[pid][key] / (1 - SIGNIFICANT),
            left_name="largest magnitude of u of the PIDA",
            right_name="what is significantly more than the PID's",
            note=f"Largest |u| {of[pida][key]:.3f} and {of[pid][key]:.3f}. {said(of[pida][key], of[pid][key])} "
            f"Total variation of u {of[pida][variation]:.4f} and {of[pid][variation]:.4f}.",
        )
    for row, key in {"st.aggressive.control": "largest u, set point", "st.noise.control": "σ(u)"}.items():
        book.statement(
            row,
            of[fast][key],
            ">",
            of[pida][key],
            left_name=f"{key}, Ms 2.0",
            right_name="Ms 1.4",
            note=f"By a factor of {of[fast][key] / of[pida][key]:.1f}.",
        )
    _filtering(book, of)
    return pd.DataFrame({case.label: of[case] for case in CASES}).map("{:.4g}".format)


def _filtering(book: Ledger, of: dict[Case, dict[str, float]]) -> None:
    """The output filter against noise: effective, essential, reasonable."""
    with_f = {case: (of[case]["σ(u) without F"], of[case]["σ(u)"]) for case in CASES}
    rows = {
        "st.noise.effective": [case for case in CASES if case.example == "ex1" and case.kind == "pida"],
        "st.pid.filter": [case for case in CASES if case.kind == "pid"],
        "st.ex2.noise": [case for case in CASES if case.example == "ex2" and case.kind == "pida"],
    }
    for row, cases in rows.items():
        factors = [of[case]["σ(u) without F"] / of[case]["σ(u)"] for case in cases]
        book.statement(
            row,
            *every({case.label: with_f[case] for case in cases}, ">", "much"),
            left_name="standard deviation of u without F",
            right_name="with F",
            note=f"Read as: F lowers the noise in u much. The factor is {min(factors):.1f} to {max(factors):.1f}.",
        )
    times = {name: of[a]["σ(u)"] / of[b]["σ(u)"] for name, (a, b) in PAIRS.items()}
    book.note(
        "st.noise.reasonable",
        "What is reasonable depends on the actuator. Under the paper's noise u of the PIDA has a standard deviation of "
        f"{of[Case('ex1', 'pida', 1.4)]['σ(u)']:.2f}, the PID's of {of[Case('ex1', 'pid', 1.4)]['σ(u)']:.2f}; in the "
        f"four comparisons the PIDA's is {min(times.values()):.1f} to {max(times.values()):.1f} times as large.",
    )
    first, second = Case("ex2", "pida", 1.4), Case("ex2", "pid", 1.4)
    book.note(
        "st.ex2.control",
        "What is reasonable depends on the actuator. Largest u after a set-point step "
        f"{of[first]['largest u, set point']:.2f} against {of[second]['largest u, set point']:.2f}, after a load step "
        f"{of[first]['largest u, load']:.3f} against {of[second]['largest u, load']:.3f}, without noise.",
    )


def kicks(book: Ledger) -> Figure:
    """The first moments of the control signal after a set-point step."""
    shared = work(book)
    moved = {case: _moved(shared, case) for case in CASES}
    book.statement(
        "st.no.jump",
        *every({case.label: pair for case, pair in moved.items()}, "<", "negligible"),
        left_name=f"variation of u until {EARLY:g} after the step",
        right_name="that without F",
        note="Without the output filter u would move by "
        f"{moved[Case('ex1', 'pida', 2.0)][1]:.0f} in that time, in the PIDA loop of Example 1 with Ms 2.0.",
    )
    t = np.linspace(0, 60, 60001)
    u = {case: pidalab.step_response(loop, t).u for case, loop in shared.loops.items()}
    kp = {case: C.kp for case, C in shared.used.items()}
    peaks = {case: float(u[case].max()) for case in CASES}
    slow, fast = (Case("ex1", "pida", ms) for ms in (1.4, 2.0))
    book.statement(
        "st.no.kick",
        *every({case.label: (peaks[case], kp[case]) for case in CASES}, "<="),
        left_name="largest u",
        right_name="kp",
        note="This reading is ours; the paper itself speaks of a higher maximum of u. In Example 1 u of the PIDA peaks "
        f"at {peaks[slow]:.1f} for Ms = 1.4 and at {peaks[fast]:.1f} for 2.0, {peaks[slow] / kp[slow]:.0f} and "
        f"{peaks[fast] / kp[fast]:.0f} times kp: the filter turns the jump into a short, high peak.",
    )
    return kick_figure(book)


def _moved(shared: Work, case: Case) -> tuple[float, float]:
    """Variation of u right after a set-point step, with and without the output filter; a jump counts."""
    t = np.linspace(0, EARLY, 2)
    full, bare = (shared.loop(case, on="process", filtered=filtered) for filtered in (True, False))
    return pidalab.step_response(full, t).tv("u"), pidalab.step_response(bare, t).tv("u")


def kick_figure(book: Ledger) -> Figure:
    """Control signals of Example 1 in the first moments after a set-point step."""
    shared = work(book)
    figure, ax = plt.subplots(figsize=(6.4, 2.6))
    fine = np.linspace(0, 0.6, 3001)
    order = [Case("ex1", kind, ms) for ms in (2.0, 1.4) for kind in KINDS]
    early = {
        f"{case.kind.upper()}, $M_s = {case.ms}$": pidalab.step_response(shared.loops[case], fine)
        for case in order
    }
    plots.signal(ax, early, "u", until=0.6)
    ax.set(ylabel="control u")
    figure.legend(loc="outside upper left", ncols=2)
    return once(figure)


def paper_figure(book: Ledger, number: int) -> Figure:
    """Paper Figs 2 to 5: both loops of one pair, exact lines over one noisy run each."""
    shared, pair = work(book), list(PAIRS.values())[number - 2]
    clean, noisy = {}, {}
    for case in pair:
        runs = {test: shared.noisy(case, test)[0] for test in EXPERIMENTS}
        noisy[case.kind.upper()] = runs
        clean[case.kind.upper()] = {
            test: pidalab.simulate(shared.loops[case], shared.t, **step) for test, step in EXPERIMENTS.items()
        }
    return once(
        plots.comparison(clean, noisy, pair[0].horizon, u_until=4 if pair[0].example == "ex1" else 15)
    )


def eight_loops(book: Ledger) -> Figure:
    """Outputs of the eight loops without noise: set-point step at 0, load step halfway."""
    figure, axes = plt.subplots(2, 2, figsize=(6.4, 4.2), sharey=True)
    for ax, pair in zip(axes.flat, PAIRS.values(), strict=True):
        first = pair[0]
        t = np.linspace(0, 30 if first.example == "ex1" else 100, 1501)
        load = np.where(t >= t[-1] / 2, 1.0, 0.0)
        runs = {case.kind.upper(): pidalab.simulate(work(book).loops[case], t, 1.0, load) for case in pair}
        plots.signal(ax, runs, "y")
        ax.set_title(f"{ORDERS[first.example]} lags, $M_s = {first.ms}$")
    for ax in axes[:, 0]:
        ax.set_ylabel("output y")
    for ax in axes[0]:
        ax.set_xlabel("")
    axes[0, 0].legend(loc="lower right")
    return once(figure)
