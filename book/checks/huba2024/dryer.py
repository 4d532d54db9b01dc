"""Section 3 of huba2024: do the printed numbers of the dryer fit together? Its records are not published."""

from __future__ import annotations

from functools import cache
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pidalab
from matplotlib.figure import Figure
from pidalab import identification
from pidalab.ledger import CONVENTIONS, Ledger, every
from pidalab.rules import automatic_reset as ar

from . import loops
from .tables import tabled

GAIN, DELAY, FILTER = 8.31e-4, 74.5, 50.0  # (32) and the caption of Paper Fig. 5
VOLTS, RISE = 24.0, 55.0  # the supply, and from 25 to 80 °C
UNDER = ("PI", "PID", "PIDA_1", "PIDA_2")
LAGS = np.geomspace(1.0, 10000.0, 41)


@cache
def tangents(filter_time: float) -> tuple[np.ndarray, np.ndarray]:
    """Delay and slope of the inflection tangent of Q_4 with one lag in series, over LAGS."""
    filtered, found = pidalab.lags(4, filter_time), []
    for lag in LAGS:
        both = pidalab.Process(filtered.num, np.convolve(filtered.den, [lag, 1.0]))
        clock = np.linspace(0, 10 * filter_time + 3 * min(lag, 10 * filter_time), 4001)
        step = pidalab.open_loop_step(both, clock)
        model = identification.ipdt_tangent(step.t, step.y)
        found.append((model.delay, model.num[0]))
    delays, slopes = np.transpose(found)
    return delays, slopes


@cache
def alone() -> tuple[pidalab.Response, pidalab.Process]:
    """Step response of the filter of (32) alone, and its tangent."""
    step = pidalab.open_loop_step(pidalab.lags(4, FILTER), np.linspace(0, 400, 4001))
    return step, identification.ipdt_tangent(step.t, step.y)


@tabled
def consistency(book: Ledger) -> pd.DataFrame:
    """Can the tangent of the filtered step response have the delay 74.5 s?"""
    delays, slopes = tangents(FILTER)
    gain, delay = book.printed("eq32.ks"), book.printed("eq32.td")
    left = float(np.exp(np.interp(delay, delays, np.log(LAGS))))
    rise = VOLTS * gain / float(np.interp(left, LAGS, slopes))
    lag = float(np.exp(np.interp(-gain * VOLTS / RISE, -slopes, np.log(LAGS))))
    least = float(np.interp(np.log(lag), np.log(LAGS), delays))
    book.statement(
        "eq32.consistent",
        least,
        "<=",
        delay + book.row("eq32.td").half_unit,
        left_name="delay of the tangent, s, if 24 V heat one lag by 55 K",
        right_name="T_d as printed",
        note="The inflection tangent of Q_4 alone, with 50 s, has the delay "
        f"{alone()[1].delay:.1f} s. With a lag in series "
        f"it grows, towards 200 s: 74.5 s leaves a lag of {left:.1f} s, with which the printed "
        "K_s belongs to a rise of "
        f"{rise:.1f} K at 24 V. A rise of 55 K, from 25 to 80 °C, needs a lag of {lag:.0f} s, and the delay is "
        f"{least:.0f} s. Which of the numbers is off is not known.",
    )
    return pd.DataFrame(
        {
            "Q_4 with 50 s alone": {
                "lag, s": "0",
                "delay of the tangent, s": f"{alone()[1].delay:.1f}",
                "rise at 24 V, K": "–",
            },
            "as long as 74.5 s allow": {
                "lag, s": f"{left:.1f}",
                "delay of the tangent, s": f"{delay:.1f}",
                "rise at 24 V, K": f"{rise:.1f}",
            },
            "a rise of 55 K": {
                "lag, s": f"{lag:.0f}",
                "delay of the tangent, s": f"{least:.0f}",
                "rise at 24 V, K": f"{RISE:.0f}",
            },
        }
    ).T


@tabled
def printed_loops(book: Ledger) -> pd.DataFrame:
    """The loops of Paper Fig. 6 with the printed numbers and no dead time at all but the filter's."""
    gain, delay = book.printed("eq32.ks"), book.printed("eq32.td")
    model = pidalab.ipdt(gain, delay=delay)
    found = {}
    for name in UNDER:
        own = ar.tune(model, ar.SETTINGS[name], n=4, filter_time=FILTER, weight=0.0).controller
        loop = pidalab.Loop(pidalab.ipdt(gain, delay=0.0), own)
        lagged = [_gain_limit(pidalab.Loop(process, own)) for process in _one_lag(gain)]
        found[name] = (int(pidalab.unstable_poles(loop)), _gain_limit(loop), max(lagged))
    said = (
        "The printed numbers contradict it: with K_s and T_d of (32), Q_4 with 50 s, and a pure integrator without any "
        "dead time, the loop with "
        + ", ".join(
            f"{name} bears {x:.2f} times its gain and has {n} unstable poles"
            for name, (n, x, _) in found.items()
        )
        + f". With one lag in place of the integrator, {len(_one_lag(gain))} of them that 24 V heat by 55 K or more, "
        + ", ".join(f"{name} bears at most {x:.2f}" for name, (_, _, x) in found.items())
        + ". The measurement is not doubted; one of the printed numbers must be off, and which is not known."
    )
    given: dict[str, Any] = {"left_name": "unstable poles", "right_name": "none"}
    known = {name: (poles, 0) for name, (poles, *_) in found.items()}
    book.statement(
        "fig6.reference", *every({n: known[n] for n in ("PI", "PID", "PIDA_1")}, "=="), **given, note=said
    )
    pida = {n: known[n] for n in ("PIDA_1", "PIDA_2")}
    book.statement("fig6.pida.monotonic", *every(pida, "=="), **given, note=said)
    fastest = RISE / (VOLTS * gain)
    book.statement(
        "fig5.filter",
        4 * FILTER / fastest,
        "<",
        CONVENTIONS["clearly"].limit,
        left_name="mean delay of the filter over the least time to heat",
        right_name="what the book calls significant",
        note=f"Read as the mean delay n T_f = {4 * FILTER:.0f} s against the time in which 24 V "
        "can heat by 55 K at the "
        f"printed K_s, at least {fastest:.0f} s.",
    )
    return pd.DataFrame(
        {
            name: {
                "unstable poles": str(poles),
                "bears a factor of": f"{ratio:.2f}",
                "with one lag, at most": f"{lagged:.2f}",
            }
            for name, (poles, ratio, lagged) in found.items()
        }
    ).T


def _one_lag(gain: float) -> list[pidalab.Process]:
    """One-lag dryers whose filtered step response has the printed slope, and which 24 V heat by 55 K or more."""
    least, found = RISE / VOLTS, []
    for lag in np.geomspace(1000.0, 10000.0, 12):
        static = gain / float(np.interp(np.log(lag), np.log(LAGS), tangents(FILTER)[1]))
        if static >= least:
            found.append(pidalab.Process([static], [lag, 1.0]))
    return found


def _gain_limit(loop: pidalab.Loop) -> float:
    """Factor of the loop gain at which the loop is on the border of stability."""
    w = pidalab.phase_crossovers(loop)
    return float(np.min(1 / np.abs(loop.L(1j * np.asarray(w)))))


@tabled
def largest_model(book: Ledger) -> pd.DataFrame:
    """Section 3.1: of several models, the one with the largest gain or dead time is the safe choice."""
    rows, stable, margin = {}, {}, {}
    for name in ("PI", "PID", "PIDA_1"):
        own = loops.designs()[name]
        for factor in (0.5, 0.7, 0.9):
            for what, process in (
                ("gain", pidalab.ipdt(factor, delay=1.0)),
                ("dead time", pidalab.ipdt(1.0, delay=factor)),
            ):
                stable[f"{name}, {what} {factor:g} of the model's"] = (
                    int(pidalab.unstable_poles(own.loop(process))),
                    0,
                )
        found = pidalab.margins(own.loop())
        margin[name] = (found.gm, found.dm)
        few = max(poles for key, (poles, _) in stable.items() if key.startswith(f"{name},"))
        rows[name] = {
            "unstable poles with less": str(few),
            "gain margin": f"{found.gm:.2f}",
            "delay margin": f"{found.dm:.2f}",
        }
    book.statement(
        "st.identification.largest",
        *every(stable, "=="),
        left_name="unstable poles",
        right_name="none",
        note="PI, PID and PIDA_1 tuned for the loop of Paper Fig. 3, on processes whose gain or "
        "dead time is 0.5, 0.7 or "
        "0.9 of the model's. Upward the gain may grow "
        + ", ".join(f"{gm:.2f} times with {name}" for name, (gm, _) in margin.items())
        + ".",
    )
    return pd.DataFrame(rows).T


def draw_tangent() -> Figure:
    """The filter alone with its tangent, and the delay of the tangent over the lag of the dryer."""
    figure, axes = plt.subplots(1, 2, figsize=(6.4, 3.4))
    step, model = alone()
    axes[0].plot(step.t, step.y, label="$Q_4$ alone")
    line = model.num[0] * (step.t - model.delay)
    shown = (line > -0.03) & (line < 1.0)
    axes[0].plot(step.t[shown], line[shown], label="tangent")
    axes[0].plot([DELAY] * 2, [0, 0.45], ":", color="#808080", label="$T_d$ of (32)")
    axes[0].set(xlabel="time, s", ylabel="share of the final value")
    axes[0].legend(loc="lower right", fontsize=9)
    for filter_time, style in ((FILTER, "-"), (15.0, "--")):
        axes[1].semilogx(LAGS, tangents(filter_time)[0], style, label=f"$T_f$ = {filter_time:g} s")
    axes[1].axhline(DELAY, color="#808080", linestyle=":", linewidth=1.5)
    axes[1].set(xlabel="lag of the dryer, s", ylabel="delay of the tangent, s")
    axes[1].legend(fontsize=9)
    return figure
