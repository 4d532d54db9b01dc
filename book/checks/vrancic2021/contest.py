"""Section 5: the magnitude optimum against three other methods."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pidalab
from matplotlib.figure import Figure
from pidalab import plots
from pidalab.ledger import Ledger
from pidalab.rules import magnitude_optimum as mo

from . import problem
from .names import typeset
from .rounding import entry

PREFILTER = 0.01  # T_FR that the ISE needs, see `hidden.prefilter`, s
ENDS = {5: (4.0, 4.0), 6: (4.0, 4.0), 7: (20.0, 40.0)}  # of the two ISE, s after the step
SHORT = {
    "PID_2^2": "pid22",
    "PID_3^3": "pid33",
    "Lurang": "lurang",
    "Jung": "jung",
    "Puangdownreong": "puang",
}
SAMPLES = 40001


def servo_ise(
    g: int, controller: Any, time: float = PREFILTER, end: float = 4.0, samples: int = SAMPLES
) -> float:
    """ISE of r_f - y after a unit step of the set point."""
    t = np.linspace(0, end, samples)
    run = pidalab.step_response(problem.loop(g, controller, time), t)
    wanted = pidalab.open_loop_step(pidalab.lags(2, lag=time), t)
    assert run.area is not None
    assert wanted.area is not None
    return replace(run, r=np.zeros_like(t), y=run.y - wanted.y, area=run.area - wanted.area).ise()


@cache
def ises(g: int) -> dict[str, dict[str, float]]:
    """Both ISE of each controller on G_P5, G_P6 or G_P7."""
    servo_end, load_end = ENDS[g]
    t = np.linspace(0, load_end, SAMPLES)
    return {
        name: {
            "tracking": servo_ise(g, C, end=servo_end),
            "load": pidalab.load_response(problem.loop(g, C), t).ise(),
        }
        for name, C in problem.contest(g).items()
    }


@cache
def responses(g: int) -> dict[str, dict[str, pidalab.Response]]:
    """Set-point and load steps of each controller on G_P5, G_P6 or G_P7."""
    t = np.linspace(0, 12, 24001)
    return {
        name: {
            "setpoint": pidalab.step_response(problem.loop(g, C, PREFILTER), t),
            "load": pidalab.load_response(problem.loop(g, C), t),
        }
        for name, C in problem.contest(g).items()
    }


@cache
def noise_gain(g: int, name: str) -> float:
    """Expected noise gain with the sample time of Section 3; Section 5 states none."""
    return pidalab.noise_gain(problem.loop(g, problem.contest(g)[name]), problem.SAMPLE_TIME)


@cache
def facts(g: int, name: str) -> dict[str, float]:
    """By what a controller is judged."""
    run, ise = responses(g)[name], ises(g)[name]
    return {
        "rise time": run["setpoint"].rise_time(),
        "ISE": ise["tracking"],
        "overshoot, %": round(run["setpoint"].overshoot(), 3),
        "peak, load": run["load"].peak(),
        "ISE, load": ise["load"],
        "settling, load": run["load"].settling_time(),
        "noise gain": noise_gain(g, name),
    }


def gains(book: Ledger) -> None:
    """The gains of (41), (44) and (48), and the gain of G_P6 that (44) implies."""
    for g, eq in ((5, "eq41"), (6, "eq44")):
        for m in (2, 3):
            K = problem.contest(g)[f"PID_{m}^{m}"].coefficients
            named = {f"{eq}.m{m}.{k}": value for k, value in zip(problem.GAINS, K, strict=False)}
            if g == 5 and m == 3:
                book.check("eq41.m3.k1", named.pop("eq41.m3.k1"), note=_eq41_note(book))
            for id, value in named.items():
                entry(book, id, value)
    book.check({f"eq48.m2.{k}": K for k, K in zip(problem.GAINS, problem.gains_48(), strict=False)})
    implied = implied_gain(book)
    book.check(
        "gp6.gain",
        implied[0],
        note=f"From the nine gains of (44): each, with its rounding, confines K_PR, all together to "
        f"{implied[1]:.6f} to {implied[2]:.6f}, of which this is the middle. 1/18 = {1 / 18:.6f} lies inside; 0.0556 "
        f"{'does too' if implied[1] <= 0.0556 <= implied[2] else 'does not'}.",
    )


def implied_gain(book: Ledger) -> tuple[float, float, float]:
    """K_PR that the printed gains of (44) imply: middle, least and largest. All gains go as 1/K_PR."""
    low, high = [], []
    for m in (2, 3):
        unit = problem.pid(mo.tune(pidalab.Process([18.0], problem.process(6).den), m, m, 0.005))
        for k, K in zip(problem.GAINS, unit.coefficients, strict=False):
            id = f"eq44.m{m}.{k}"
            low.append(K / (book.printed(id) + book.row(id).half_unit))
            high.append(K / (book.printed(id) - book.row(id).half_unit))
    return 0.5 * (max(low) + min(high)), max(low), min(high)


def lines_of_14(book: Ledger) -> dict[str, float]:
    """K_1 of PID_3^3 in (41) from the other printed gains and the second and third line of (14)."""
    from pidalab import areas

    filtered = areas.with_binomial_filter(problem.plain_areas(5, 10), 0.01, 3)
    K = np.array([book.printed(f"eq41.m3.{k}") for k in problem.GAINS[:5]])
    found = {"printed": K[2]}
    for r, name in ((1, "second line"), (2, "third line")):
        row = np.array(
            [(-1) ** (c + 1) * filtered[2 * r + 1 - c] if c <= 2 * r + 1 else 0.0 for c in range(5)]
        )
        found[name] = -(row @ K - row[2] * K[2]) / row[2]
    found["computed"] = problem.contest(5)["PID_3^3"].coefficients[2]
    return found


def _eq41_note(book: Ledger) -> str:
    found = lines_of_14(book)
    return (
        f"As read. With the other printed gains of the row the second line of eq. (14) gives K_1 = "
        f"{found['second line']:.2f} and the third {found['third line']:.2f}; the print misses the second by "
        f"{found['printed'] - found['second line']:.2f}. Two digits differ; they may be misread."
    )


def tables_7_to_9(book: Ledger) -> None:
    """The ISE of Tables 7 to 9."""
    for g in problem.RIVAL:
        for name, both in ises(g).items():
            for kind, value in both.items():
                id = f"table{g + 2}.{SHORT[name]}.{kind}"
                if g == 5 and kind == "load" and name != "Lurang":
                    book.check(id, value, note=_table_7_note(book, name))
                else:
                    entry(book, id, value)


@cache
def integrated(name: str) -> tuple[float, float]:
    """Integral of the error of G_P5 over 4 s after the load step, and the least ISE that allows it."""
    run = pidalab.load_response(problem.loop(5, problem.contest(5)[name]), np.linspace(0, 4, SAMPLES))
    return run.ie(), run.ie() ** 2 / 4


def _table_7_note(book: Ledger, name: str) -> str:
    ie, least = integrated(name)
    printed = book.printed(f"table7.{SHORT[name]}.load")
    return (
        "Both entries of this kind repeat those of Table 8 digit for digit, though the process has eighteen times the "
        f"gain. With the gains of (41) the error integrates to {abs(ie):.4f} over 4 s, so the ISE is at least "
        f"{least:.3g} from there on (Cauchy–Schwarz), {least / printed:.0f} times the print. Computed over 4 s, the "
        "end that the digits of Table 8 need."
    )


@typeset
def table_7_bound(book: Ledger) -> pd.DataFrame:
    """Why the two values cannot be the ISE of G_P5."""
    rows = {}
    for name in ("PID_2^2", "PID_3^3"):
        (ie, least), printed = integrated(name), book.printed(f"table7.{SHORT[name]}.load")
        rows[name] = {
            "Table 8": f"{book.printed(f'table8.{SHORT[name]}.load'):.3g}",
            "Table 7, printed": f"{printed:.3g}",
            "IE over 4 s": f"{abs(ie):.4f}",
            "1/K_-1": f"{1 / problem.contest(5)[name].coefficients[0]:.4f}",
            "least ISE": f"{least:.3g}",
            "bound / printed": f"{least / printed:.0f}",
            "ISE, computed": f"{ises(5)[name]['load']:.4g}",
        }
    return pd.DataFrame(rows).T


def draw_13_to_15(g: int) -> Figure:
    """Paper Fig. 13, 14 or 15, computed: output on the left, control on the right; set point above load."""
    runs = {problem.tex(name): run for name, run in responses(g).items()}
    figure, axes = plt.subplots(2, 2, figsize=(6.4, 4.8))
    ends = {5: (4.0, 0.3), 6: (4.0, 0.2), 7: (4.0, 0.8)}[g]
    for row, kind in zip(axes, ("setpoint", "load"), strict=True):
        lines = {name: run[kind] for name, run in runs.items()}
        plots.signal(row[0], lines, "y", until=ends[0])
        plots.signal(row[1], lines, "u", until=ends[1] if kind == "setpoint" else ends[0])
        row[0].set(title=f"{kind.replace('setpoint', 'set-point')} step", ylabel="output y", xlabel="")
        row[1].set(ylabel="control u", xlabel="")
    axes[0, 1].set_yscale("symlog", linthresh=10, linscale=2)
    largest = max(run["setpoint"].peak("u") for run in runs.values())
    powers = [10**k for k in range(1, 7) if 10**k <= 2 * largest][::-2]
    axes[0, 1].set_yticks([*(-p for p in powers), 0, *powers])
    for ax in axes[1]:
        ax.set_xlabel("time, s")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=3)
    return figure
