"""What goes beyond the paper: the two errors of (32), orders at equal noise, where the rule fails, noisy records."""

from __future__ import annotations

import warnings
from functools import cache
from itertools import product
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pidalab
from matplotlib.figure import Figure
from pidalab import areas
from pidalab.ledger import Ledger
from pidalab.rules import magnitude_optimum as mo

from . import problem
from .names import typeset

TS = problem.SAMPLE_TIME
WISHES = 1.0, 3.0, 10.0, 30.0, 100.0  # noise gains
ORDERS = 1, 2, 3, 4
EXTRA = 0, 1, 2, 3  # n - m


@cache
def cost(wanted: float, m: int, n: int) -> float:
    """Integral of the error after a unit load step on G_P3, at that noise gain."""
    return 1 / problem.exact_noise(3, m, n, wanted).coefficients[0]


@typeset
def orders(book: Ledger) -> pd.DataFrame:
    """Best filter order, IE and M_S by noise gain and order, on G_P3."""
    rows: dict[str, dict[str, str]] = {}
    for wanted in WISHES:
        for m in ORDERS:
            n = min((m + e for e in EXTRA), key=lambda n: cost(wanted, m, n))
            loop = problem.loop(3, problem.exact_noise(3, m, n, wanted))
            rows.setdefault(f"{wanted:g}", {})[f"m = {m}"] = (
                f"{cost(wanted, m, n):.3f}, n = {n}, Ms {pidalab.max_sensitivity(loop)[0]:.2f}"
            )
    return pd.DataFrame(rows).T.rename_axis("noise gain")


def draw_orders() -> Figure:
    """IE after a load step on G_P3 at equal noise: over the noise gain, and over n - m."""
    figure, axes = plt.subplots(1, 2, figsize=(6.4, 3.0), sharey=True)
    for m, mark in zip(ORDERS, "os^D", strict=True):
        best = [min(cost(x, m, m + e) for e in EXTRA) for x in WISHES]
        axes[0].semilogx(WISHES, best, marker=mark, markersize=5, label=f"m = {m}")
        axes[1].plot([cost(10.0, m, m + e) for e in EXTRA], marker=mark, markersize=5)
    axes[0].set(xlabel="noise gain", ylabel="IE after a load step", title="best filter order", ylim=(0, None))
    axes[1].set(xlabel="n − m", title="noise gain 10", xticks=EXTRA)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper left", ncols=4)
    return figure


ODD = {
    "(1.5s + 1)/(s + 1)³": pidalab.Process([1.5, 1.0], np.poly([-1.0] * 3)),
    "exp(−s)/(s + 1)": pidalab.fopdt(1.0, lag=1.0, delay=1.0),
    "exp(−0.2s)/(s + 1)": pidalab.fopdt(1.0, lag=1.0, delay=0.2),
}


@typeset
def failures(book: Ledger) -> pd.DataFrame:
    """M_S with a noise gain of 10 and n = m + 2 on three simple processes, or why there is none."""
    rows: dict[str, dict[str, str]] = {}
    for (name, P), m in product(ODD.items(), ORDERS):
        try:
            C = problem.pid(mo.tune_for_exact_noise(P, m, m + 2, 10.0, TS))
            word = f"Ms = {pidalab.max_sensitivity(pidalab.Loop(P, C))[0]:.2f}"
        except ValueError as reason:
            filtered = areas.with_binomial_filter(areas.from_process(P, 2 * m + 4), 0.1, m + 2)
            word = "unstable" if "unstable" in str(reason) else "refused"
            word += f", K_-1 = {mo.gains(filtered, m)[0]:+.2f}"
        rows.setdefault(name, {})[f"m = {m}"] = word
    return pd.DataFrame(rows)


def draw_zeros() -> Figure:
    """Poles of G_P5 and zeros of the controller, magnitude optimum and Lurang."""
    shown = {"PID$_2^2$": problem.contest(5)["PID_2^2"].coefficients, "Lurang": problem.RIVAL_GAINS[5]}
    poles = np.roots(problem.process(5).den)
    figure, axes = plt.subplots(1, 2, figsize=(6.4, 2.5), sharey=True)
    for ax, (title, K) in zip(axes, shown.items(), strict=True):
        zeros = np.roots(K[::-1])
        ax.plot(poles.real, poles.imag, "x", markersize=10, markeredgewidth=2, label="poles of the process")
        ax.plot(zeros.real, zeros.imag, "o", fillstyle="none", markersize=11, label="zeros of the controller")
        ax.set(title=title, xlabel="real part, 1/s", xlim=(-3.6, 0.2), ylim=(-1.2, 1.2))
    axes[0].set_ylabel("imaginary part")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper left", ncols=2)
    return figure


def uncertain_areas(seeds: int = 40) -> tuple[dict[float, np.ndarray], dict[float, np.ndarray]]:
    """Relative error of A_0 to A_9 from noisy records of G_P3: root mean square, and as estimated from each."""
    t = np.linspace(0, 30, 1501)
    clean, true = pidalab.open_loop_step(problem.process(3), t).y, problem.plain_areas(3, 10)
    rng, spread, claimed = np.random.default_rng(36), {}, {}
    with warnings.catch_warnings(action="ignore", category=areas.RecordWarning):
        for noise in (1e-4, 1e-3, 1e-2):
            many = [
                areas.from_record(t, 1.0, clean + noise * rng.normal(size=t.size), 10, (0.0, 0.0))
                for _ in range(seeds)
            ]
            spread[noise] = np.sqrt(np.mean([(one.values / true - 1) ** 2 for one in many], axis=0))
            claimed[noise] = np.median([one.uncertainty / true for one in many], axis=0)
    return spread, claimed


def draw_uncertain_areas() -> Figure:
    """Error of the areas from records of G_P3 with noise, and what the record says of it."""
    spread, claimed = uncertain_areas()
    figure, ax = plt.subplots(figsize=(6.4, 3.6))
    for (noise, values), mark in zip(spread.items(), "os^", strict=True):
        (line,) = ax.semilogy(range(10), values, marker=mark, markersize=5, label=f"noise {noise:g}")
        ax.semilogy(range(10), claimed[noise], ":", color=line.get_color(), marker=None)
    for m in (1, 2, 3):
        ax.axvline(2 * m + 3, color="#808080", linewidth=0.8, linestyle="-")
        ax.annotate(f"m = {m}", (2 * m + 3, 2e-6), xytext=(-4, 0), textcoords="offset points", ha="right")
    ax.set(xlabel="k", ylabel="relative error of $A_k$", ylim=(1e-6, 10), xticks=range(10))
    figure.legend(loc="outside upper left", ncols=3)
    return figure


LENGTHS = (15, 0.2), (15, 0.02), (30, 0.2), (30, 0.02), (40, 0.02)  # of records and their steps, s
LEVELS = 0.0, 1e-5, 1e-4, 1e-3, 1e-2  # noise, as a share of the step
SEEDS = 20


@cache
def _aim(m: int) -> tuple[pidalab.HighOrderPID, float]:
    """The controller from the model, for a noise gain of 10 and n = m + 2, and its M_S."""
    C = problem.exact_noise(3, m, m + 2, 10.0)
    return C, pidalab.max_sensitivity(problem.loop(3, C))[0]


def serves(m: int, found: areas.MeasuredAreas) -> bool:
    """Whether a tuning from these areas is stable, with M_S at most 1.2 and K_-1 at least 0.8 times the model's."""
    model, ms = _aim(m)
    try:
        C = problem.pid(mo.tune(found.values, m, m + 2, model.filter_time))
    except ValueError:
        return False
    loop = problem.loop(3, C)
    if C.coefficients[0] < 0.8 * model.coefficients[0] or not pidalab.is_stable(loop):
        return False
    return pidalab.max_sensitivity(loop)[0] <= 1.2 * ms


def supported(length: float, h: float, noise: float) -> tuple[list[int], float]:
    """Good controllers of the records of one kind, for m = 1, 2, 3; and where the settling ends, in the median."""
    t = h * np.arange(round(length / h) + 1)
    clean = pidalab.open_loop_step(problem.process(3), t).y
    draws = [np.random.default_rng(k).normal(size=t.size) for k in range(SEEDS if noise else 1)]
    with warnings.catch_warnings(action="ignore", category=areas.RecordWarning):
        found = [areas.from_record(t, 1.0, clean + noise * draw, 10, (0.0, 0.0)) for draw in draws]
        counts = [sum(serves(m, one) for one in found) for m in (1, 2, 3)]
    return counts, float(np.median([one.span[1] for one in found]))


def study() -> pd.DataFrame:
    """Return the table of `studies/record_orders.py`: one row for each kind of record."""
    return pd.read_csv(Path(__file__).parents[2] / "data" / "record_orders.csv", comment="#")


@typeset
def supported_orders(book: Ledger) -> pd.DataFrame:
    """Show the table of the study, a record to a line, a noise level to a column."""
    rows: dict[str, dict[str, str]] = {}
    for one in study().itertuples():
        row = rows.setdefault(f"{one.length:g} s, every {one.step:g} s", {})
        name = f"noise {one.noise:g}" if one.noise else "none, of 1"
        row[name] = f"{one.pid}, {one.pida}, {one.third}; {one.end:.1f} s"
    return pd.DataFrame(rows).T


@typeset
def recomputed(book: Ledger) -> pd.DataFrame:
    """A tenth of the study once more: which lines is drawn with a fixed seed."""
    table, rows = study(), {}
    for i in sorted(np.random.default_rng(SEEDS).choice(len(table), round(len(table) / 10), replace=False)):
        line = table.iloc[i]
        counts, end = supported(line.length, line.step, line.noise)
        stored = [line.pid, line.pida, line.third]
        if counts != stored or abs(end - line.end) > 1e-6:
            raise AssertionError(
                f"line {i} of record_orders.csv: stored {stored}, {line.end}; found {counts}, {end}"
            )
        name = f"{line.length:g} s, every {line.step:g} s, noise {line.noise:g}"
        rows[name] = {"stored": ", ".join(map(str, map(int, stored))), "again": ", ".join(map(str, counts))}
    return pd.DataFrame(rows).T
