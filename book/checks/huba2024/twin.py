"""A simulated dryer to which the printed (32) would fit. Nothing here was measured; the rest is our choice."""

from __future__ import annotations

from functools import cache
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pidalab
from matplotlib.figure import Figure
from pidalab import identification, plots
from pidalab.ledger import Ledger
from pidalab.rules import automatic_reset as ar

from .dryer import DELAY, GAIN
from .tables import tabled

NAMES = ("PI", "PID", "PIDA_1")
VOLTS, WIDTHS, SAMPLE, LID = 24.0, 255, 0.5, 6000.0


@cache
def plant() -> tuple[pidalab.Process, float]:
    """The dryer, 4 K per volt, sensor 10 s, dead time 5 s, and the filter for which the tangent gives (32)."""
    slow, filter_time, clock = 5000.0, 15.0, np.linspace(0, 1500, 15001)
    for _ in range(8):
        dryer = pidalab.Process([4.0], np.convolve([slow, 1.0], [10.0, 1.0]), delay=5.0)
        filtered = pidalab.lags(4, filter_time)
        both = pidalab.Process(4.0 * filtered.num, np.convolve(dryer.den, filtered.den), delay=5.0)
        step = pidalab.open_loop_step(both, clock)
        model = identification.ipdt_tangent(step.t, step.y)
        slow, filter_time = slow * model.num[0] / GAIN, filter_time + (DELAY - model.delay) / 4
    return dryer, filter_time


@cache
def record() -> tuple[np.ndarray, np.ndarray]:
    """A step to 12 V with noise of ±0.3 K and a resolution of 0.1 K, as a rise above 25 °C."""
    clock = SAMPLE * np.arange(6001)
    noise = pidalab.uniform_noise(clock, 0.3, seed=2024)
    noise[0] = 0.0
    rise = 12.0 * pidalab.open_loop_step(plant()[0], clock).y
    return clock, 0.1 * np.rint((rise + noise) / 0.1)


@cache
def heating(name: str, real: bool = True) -> pidalab.Response:
    """From 25 to 80 °C, and a load of −6 V at 6000 s; with noise, resolution and pulses, or without."""
    dryer, filter_time = plant()
    clock = SAMPLE * np.arange(20001)
    own = ar.tune(
        pidalab.ipdt(GAIN, delay=DELAY), ar.SETTINGS[name], n=4, filter_time=filter_time, weight=0.0
    )
    extra: dict[str, Any] = {
        "noise": pidalab.uniform_noise(clock, 0.3, seed=6),
        "quanta": (0.1, 0.0),
        "pulse_widths": WIDTHS,
    }
    load = np.where(clock < LID, 0.0, -6.0)
    return pidalab.simulate_sampled(
        own.loop(dryer), clock, 55.0, load, limits=(0.0, VOLTS), **(extra if real else {})
    )


@tabled
def fits() -> pd.DataFrame:
    """The least-squares line of the noisy record behind two filters."""
    clock, rise = record()
    rows = {}
    for T in (plant()[1], 50.0):
        y = identification.binomial_filtered(clock, rise, T, 4)
        model = identification.ipdt_least_squares(clock, y, 12.0)
        rows[f"T_f = {T:.1f} s"] = {"K_s, K/(V s)": f"{model.num[0]:.3g}", "T_d, s": f"{model.delay:.1f}"}
    return pd.DataFrame(rows).T


def _arrival(name: str) -> float:
    """Time after which the temperature stays within 2 % of the step, before the lid opens."""
    r = heating(name, real=False)
    return float(r.t[(r.t < LID) & (np.abs(r.e) > 1.1)][-1])


@tabled
def results(book: Ledger) -> pd.DataFrame:
    """Heating and load with three controllers, with and without noise."""
    rows, noise = {}, {}
    for name in NAMES:
        clean, real = heating(name, real=False), heating(name)
        after = clean.t >= LID
        back = clean.t[after & (np.abs(clean.e) > 0.2)][-1] - LID
        noise[name] = float(np.std(real.u[-2000:] - clean.u[-2000:])) * WIDTHS / VOLTS
        rows[name] = {
            "highest temperature, °C": f"{25 + clean.y.max():.2f}",
            "the same with noise, °C": f"{25 + real.y.max():.2f}",
            "within 2 % after, s": f"{_arrival(name):.0f}",
            "falls after the load by, K": f"{clean.e[after].max():.2f}",
            "within 0.2 K after a further, s": f"{back:.0f}",
            "noise in the duty cycle, of 255": f"{noise[name]:.2f}",
        }
    said = "The measurements behind Figs 5 and 6 are not published as numbers. "
    said += "On a simulated dryer, whose noise is ours, "
    book.note(
        "discussion.smooth",
        said
        + "the duty cycle of 0 to 255 has the standard deviation "
        + ", ".join(f"{x:.2f} with {name}" for name, x in noise.items())
        + ".",
    )
    book.note(
        "fig6.accelerate",
        said
        + "all heat at full power for most of the time; they are within 2 % of the step after "
        + ", ".join(f"{_arrival(name):.0f} s with {name}" for name in NAMES)
        + ". For the loop of Paper Fig. 3 see st.abstract.accelerate.",
    )
    return pd.DataFrame(rows).T


def draw_record() -> Figure:
    """A figure like Paper Fig. 5: the record, two filters, and the model (32)."""
    clock, rise = record()
    figure, axes = plt.subplots(1, 2, figsize=(6.4, 3.9))
    for ax, end in zip(axes, (3000, 300), strict=True):
        part = clock <= end
        seen = plots.thin(clock[part], 25 + rise[part], 400)
        ax.plot(*seen, "-", color="#7a6a1c", alpha=0.5, linewidth=0.7, label="simulated record")
        for T in (plant()[1], 50.0):
            y = identification.binomial_filtered(clock, rise, T, 4)
            ax.plot(*plots.thin(clock[part], 25 + y[part], 400), label=f"$Q_4$, $T_f$ = {T:.3g} s")
        ramp = 25 + 12 * GAIN * np.clip(clock - DELAY, 0, None)
        ax.plot(*plots.thin(clock[part], ramp[part], 100), ":k", label="model (32)")
        ax.set(xlabel="time, s", xlim=(0, end))
    axes[0].set(ylabel="temperature, °C", ylim=(24, 60))
    axes[1].set_ylim(24.5, 28)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left", ncols=2)
    return figure


def draw_heating() -> Figure:
    """A figure like Paper Fig. 6: temperature, duty cycle, the end of heating, and the load."""
    figure, axes = plt.subplots(2, 2, figsize=(6.4, 5.4))
    views = {(0, 0): (0, 10000), (0, 1): (3400, 5000), (1, 1): (5900, 7400)}
    for name in NAMES:
        r, label = heating(name), name.replace("_1", "$_1$")
        for panel, (low, high) in views.items():
            part = (r.t >= low) & (r.t <= high)
            axes[panel].plot(*plots.thin(r.t[part], 25 + r.y[part], 300), label=label)
        axes[1, 0].plot(*plots.thin(r.t, r.u * WIDTHS / VOLTS, 300), linewidth=1.2, label=label)
    for panel, (low, high) in (views | {(1, 0): (0, 10000)}).items():
        axes[panel].set(xlim=(low, high), ylabel="temperature, °C")
    axes[0, 0].set(title="temperature")
    axes[0, 1].set(title="end of heating", ylim=(75, 82), ylabel="")
    axes[1, 0].set(title="control signal", ylabel="duty cycle, of 255", xlabel="time, s")
    axes[1, 1].set(title="after the load", ylim=(78.8, 80.8), xlabel="time, s", ylabel="")
    axes[0, 0].legend(loc="lower right")
    return figure
