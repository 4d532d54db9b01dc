"""Sections 3 and 4: the model from three points, its levels and formulas, and the second-order models."""

from __future__ import annotations

import math
from itertools import product
from typing import Literal

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pidalab
from matplotlib.figure import Figure
from pidalab import plots
from pidalab.ledger import CONVENTIONS, Ledger, every
from scipy.optimize import brentq

from .work import ORDERS, once, work

HAALMAN = 2 / 3  # gain times dead time of Haalman's rule, as in the textbook that the paper cites
SUNDARESAN = (0.05, 0.353, 0.853)  # levels to which the formulas for L and τ belong
AS_PRINTED = (0.05, 0.35, 0.85)
RATIO = 0.67  # of eq. (5), τ = 0.67 (t_85 - t_35)


def three_points(book: Ledger) -> Figure:
    """Models of both processes, eqs. (4), (5), (7), (12) and (18)."""
    shared = work(book)
    for example, fit in shared.fits.items():
        a3, a2, a1, _ = fit.process.den
        numbers = {"k": fit.gain, "l": fit.apparent_delay, "alpha": fit.alpha, "a3": a3, "a2": a2, "a1": a1}
        book.check({f"{example}.topdt.{key}": value for key, value in numbers.items()})
        book.check(f"{example}.topdt.delay", fit.process.delay)
    book.check("ex1.topdt.tau", shared.fits["ex1"].tau)
    low, high = tau_from_coefficients(book)
    book.check(
        "ex2.topdt.tau",
        shared.fits["ex2"].tau,
        note=f"As read. The printed a3 and a2 of eq. (18) fix τ, since p² + 2τp = a2 and τp² = a3: "
        f"between {low:.4f} and {high:.4f}, whatever was rounded off. The step response gives the same.",
    )
    models = {example: pidalab.open_loop_step(fit.process, shared.t) for example, fit in shared.fits.items()}
    apart = {
        example: float(np.max(np.abs(model.y - shared.records[example].y)))
        for example, model in models.items()
    }
    book.statement(
        "sec4.approximation",
        *every(
            {
                example: (off, CONVENTIONS["similar"].limit * shared.fits[example].gain)
                for example, off in apart.items()
            },
            "<=",
        ),
        left_name="largest distance of the step responses",
        right_name="a tenth of the change",
        note="About the same is within 10 %, the book's convention. The largest distance is "
        f"{100 * apart['ex1']:.2f} % of the change in Example 1 and {100 * apart['ex2']:.2f} % in Example 2.",
    )
    figure, axes = plt.subplots(2, 1, figsize=(6.4, 5.0))
    for ax, (example, fit), end in zip(axes, shared.fits.items(), (15, 25), strict=True):
        plots.signal(ax, {"process": shared.records[example], "model": models[example]}, "y", until=end)
        ax.plot(fit.times, SUNDARESAN, "o", color="black", label="three points", zorder=4)
        ax.set(title=f"$1/(s+1)^{ORDERS[example]}$", ylabel="output y")
    axes[0].legend(loc="lower right")
    return once(figure)


def tau_from_coefficients(book: Ledger) -> tuple[float, float]:
    """Range of τ in Example 2 that the printed a3 and a2 leave: p = sqrt(a3/τ) in p² + 2τp = a2."""
    corners = [
        [book.printed(f"ex2.topdt.{key}") + sign * book.row(f"ex2.topdt.{key}").half_unit for sign in (-1, 1)]
        for key in ("a3", "a2")
    ]
    roots = [
        brentq(lambda tau, a3=a3, a2=a2: a3 / tau + 2 * math.sqrt(a3 * tau) - a2, 2.0, 4.0)
        for a3, a2 in product(*corners)
    ]
    return min(roots), max(roots)


def levels(book: Ledger) -> pd.DataFrame:
    """Levels at which the printed L, τ and α of Example 1 were read off, and the models of other readings."""
    shared = work(book)
    lowest, highest = {}, {}
    for level, times in times_from_print(book).items():
        # A time is the first sample at or above its level, so the level was passed up to one sample earlier.
        ends = [min(times) - 0.01, max(times)]
        low, high = 100 * np.interp(ends, shared.t, shared.records["ex1"].y)
        lowest[level], highest[level] = float(low), float(high)
        book.check(
            f"sec3.level{level}",
            (low + high) / 2,
            note=f"The printed L, τ and α of Example 1, put back into eq. (5), were read off between {low:.2f} % and "
            f"{high:.2f} %; computed is the middle of that range.",
        )
    book.statement(
        "sec3.levels.exact",
        *every({f"{level} %": (lowest[level], int(level)) for level in ("35", "85")}, "<="),
        left_name="lowest level that the print allows",
        right_name="printed level",
        note=f"The printed L and τ of Example 1 were read off above {lowest['35']:.2f} % and above "
        f"{lowest['85']:.2f} %. The formulas are older than the method and belong to 35.3 % and 85.3 %.",
    )
    return _readings(book)


def times_from_print(book: Ledger) -> dict[str, list[float]]:
    """Solve eq. (5) for the three times, at all corners of what the printed L, τ and α leave."""
    corners = [
        [book.printed(f"ex1.topdt.{key}") + sign * book.row(f"ex1.topdt.{key}").half_unit for sign in (-1, 1)]
        for key in ("l", "tau", "alpha")
    ]
    times: dict[str, list[float]] = {"5": [], "35": [], "85": []}
    for L, tau, alpha in product(*corners):
        t35 = (L + 0.29 * tau / RATIO) / (1.3 - 0.29)
        times["35"].append(t35)
        times["85"].append(t35 + tau / RATIO)
        times["5"].append(brentq(lambda t5, L=L, tau=tau, alpha=alpha: share(t5, L, tau) - alpha, 0.1, 5.0))
    return times


def share(t5: float, L: float, tau: float) -> float:
    """Return α of eq. (5): the share of the apparent dead time that is true dead time."""
    return 0.598 + 0.4799 * t5 / L - 0.41 * (tau / t5) ** 0.6


def _readings(book: Ledger) -> pd.DataFrame:
    """L, α and τ of Example 1 with other levels and with interpolated times."""
    shared, rows = work(book), {}
    crossings: tuple[Literal["interpolated", "sampled"], ...] = ("interpolated", "sampled")
    for used, crossing in product((AS_PRINTED, SUNDARESAN), crossings):
        fit = pidalab.identification.three_point(
            shared.t, shared.records["ex1"].y, levels=used, crossing=crossing
        )
        name = " / ".join(f"{100 * level:g}" for level in used) + f" %, {crossing}"
        rows[name] = [fit.apparent_delay, fit.alpha, fit.tau]
    rows["printed"] = [book.printed(f"ex1.topdt.{key}") for key in ("l", "alpha", "tau")]
    return pd.DataFrame(rows, index=["L", "α", "τ"]).T.map("{:.3f}".format)


def formulas(book: Ledger) -> pd.DataFrame:
    """Eq. (7) against eq. (4), Haalman's phase margin, and how long the dead times are."""
    shared = work(book)
    book.identity(
        "sec3.eq7",
        max(_residual(*point) for point in product((0.5, 1.0, 2.0, 7.0), (0.05, 0.4, 0.95), (0.1, 1.0, 3.0))),
        1e-9,
        note="Largest relative difference between the coefficients of eq. (7) and those of eq. (4) multiplied out, "
        "over 36 sets of L, α and τ.",
    )
    margin = pidalab.margins(pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), HAALMAN))
    book.check("sec3.haalman.pm", margin.pm, note=f"This loop has Ms = {margin.ms:.3f}.")
    apparent = {
        example: (fit.apparent_delay, fit.tau / CONVENTIONS["much"].limit)
        for example, fit in shared.fits.items()
    }
    true = {example: fit.process.delay / fit.tau for example, fit in shared.fits.items()}
    book.statement(
        "sec1.delay.long",
        *every(apparent, ">"),
        left_name="apparent dead time L",
        right_name="half of τ",
        note="Much smaller is at most half, the book's convention. The dead time of the model, αL, is "
        f"{true['ex1']:.2f} τ in Example 1 and {true['ex2']:.2f} τ in Example 2.",
    )
    rows = {
        f"{example}, {ORDERS[example]} lags": [fit.apparent_delay / fit.tau, true[example]]
        for example, fit in shared.fits.items()
    }
    return pd.DataFrame(rows, index=["L/τ", "αL/τ"]).T.map("{:.2f}".format)


def _residual(L: float, alpha: float, tau: float) -> float:
    """Largest relative difference between eq. (7) and the denominator of eq. (4) multiplied out."""
    half = alpha / 2 - 0.5
    printed = [L**2 * tau * half**2, L**2 * half**2 - 2 * L * tau * half, tau - 2 * L * half]
    model = pidalab.identification.ThreePointModel(1.0, L, alpha, tau, (0.1, 0.2, 0.3)).process
    return float(np.max(np.abs(np.array(printed) / model.den[:3] - 1)))


def second_order(book: Ledger) -> pd.DataFrame:
    """What the printed second-order models (14) and (20) betray of a method that the paper does not give."""
    shared, rows = work(book), {}
    for example, record in shared.records.items():
        a2, a1, delay = (book.printed(f"{example}.sopdt.{key}") for key in ("a2", "a1", "delay"))
        # Mean residence time of the sampled record: rectangles at the right ends of the samples.
        residence = float(np.sum(1.0 - record.y[1:])) * record.step
        book.check(
            f"{example}.sopdt.a1",
            residence - delay,
            note=f"The sum of the lags is the mean residence time of the record, {residence:.3f} as a sum over samples "
            f"of {record.step:g}, minus the printed dead time.",
        )
        slow, fast = _lags(a2, a1)
        edge = _lags(a2 + book.row(f"{example}.sopdt.a2").half_unit, a1)
        for key in ("a2", "delay"):
            book.note(
                f"{example}.sopdt.{key}",
                "The formulas of the second-order identification (Veronesi et al. 2024) are not in the paper, and one "
                "relation is not enough for two numbers; the printed model is taken as given. Its lags are "
                f"{slow:.3f} and {fast:.3f}; at the upper end of what rounds to the printed a2 they are the round "
                f"{edge[0]:.4f} and {edge[1]:.4f}.",
            )
        # Two relations that such a method could use, and does not.
        level = 100 * float(np.interp(delay, shared.t, record.y))
        second = a2 + a1 * delay + delay**2 / 2, shared.processes[example].den[-3]
        rows[example] = [residence, delay, residence - delay, a1, slow, fast, level, *second]
    columns = ["residence time", "dead time", "difference", "printed a1", "lag", "lag"]
    columns += ["% reached at the dead time", "second moment", "of the process"]
    return pd.DataFrame(rows, index=columns).T.map("{:.4g}".format)


def _lags(a2: float, a1: float) -> tuple[float, float]:
    """Return the two lags of a2 s² + a1 s + 1, the larger one first."""
    root = math.sqrt(a1**2 - 4 * a2)
    return (a1 + root) / 2, (a1 - root) / 2
