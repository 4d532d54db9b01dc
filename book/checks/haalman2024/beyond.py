"""Beyond the paper: PIDA against PID at equal Ms and at equal noise, other processes, and the remaining statements."""

from __future__ import annotations

import math
from functools import cache
from itertools import product
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pidalab
from matplotlib.figure import Figure
from pidalab import plots
from pidalab.ledger import Ledger, every
from pidalab.rules import haalman
from scipy.optimize import brentq

from .work import ORDERS, PAIRS, PAPER_M, Case, Work, loop_at_ms, ms_of, once, sigma, work

ORDER = {"pida": 2, "pid": 1}  # of the output filter
OTHERS = {
    "geometric lags": pidalab.Process([1.0], np.poly([-1, -2, -4, -8]) / 64),
    "long dead time": pidalab.lags(3, delay=5.0),
    "non-minimum phase": pidalab.Process([-0.5, 1.0], np.poly([-1, -1, -1])),
    "one large lag": pidalab.Process([1.0], np.convolve([10.0, 1.0], pidalab.lags(3).den)),
}


class Fair(NamedTuple):
    """A loop whose Ms holds on the process, with its output filter."""

    time: float
    ki: float
    iae: float
    sigma: float


@cache
def fair(shared: Work, case: Case, time: float) -> Fair:
    """The loop of a case with another filter time; its gain gives Ms on the true process, with the filter."""
    loop = fair_loop(shared, case, time)
    error = pidalab.load_response(loop, np.linspace(0, 400, 8001))
    return Fair(time, loop.controller.kp / loop.controller.ti, error.iae(math.inf), sigma(loop))


def fair_loop(shared: Work, case: Case, time: float) -> pidalab.Loop:
    """See `fair`."""
    F = haalman.OutputFilter(time, ORDER[case.kind], math.nan)
    return loop_at_ms(shared.processes[case.example], shared.designs[case], case.ms, F)


@cache
def as_quiet(shared: Work, pida: Case, pid: Case) -> Fair:
    """The PIDA whose filter is slowed down until u carries the noise of the PID."""
    target = fair(shared, pid, shared.filters[pid].time).sigma

    def excess(log_time: float) -> float:
        return math.log(sigma(fair_loop(shared, pida, math.exp(log_time))) / target)

    start = shared.filters[pida].time
    return fair(shared, pida, math.exp(brentq(excess, math.log(start), math.log(8 * start), xtol=1e-13)))


def equal_ms(book: Ledger) -> pd.DataFrame:
    """PIDA against PID at the same Ms on the true process, filter included; then at the same noise in u, too."""
    shared = work(book)
    own = {
        name: [fair(shared, case, shared.filters[case].time) for case in pair] for name, pair in PAIRS.items()
    }
    quiet = {name: as_quiet(shared, *pair) for name, pair in PAIRS.items()}
    saved = [100 * (1 - pida.iae / pid.iae) for pida, pid in own.values()]
    louder = [pida.sigma / pid.sigma for pida, pid in own.values()]
    book.statement(
        "st.highorder",
        *every({name: (pida.iae, pid.iae) for name, (pida, pid) in own.items()}, "<"),
        left_name="load IAE of the PIDA",
        right_name="load IAE of the PID",
        note="Same Ms on the true process, with the filter times of the paper: lower by "
        f"{min(saved):.1f} to {max(saved):.1f} %, at {min(louder):.1f} to {max(louder):.1f} times the noise in u.",
    )
    change = [100 * (quiet[name].iae / own[name][1].iae - 1) for name in PAIRS]
    listed = ", ".join(f"{x:+.1f} % ({name})" for name, x in zip(PAIRS, change, strict=True))
    book.statement(
        "st.highorder.noise",
        *every({name: (quiet[name].iae, own[name][1].iae) for name in PAIRS}, "<"),
        left_name="load IAE of the PIDA",
        right_name="load IAE of the PID",
        note="Same Ms on the true process, and the filter of the PIDA slowed down until u carries the noise of the PID "
        f"(white over samples of 0.01): {listed}.",
    )
    rows = {
        name: [pid.iae, pida.iae, quiet[name].iae, pid.sigma, pida.sigma, pida.time, quiet[name].time]
        for name, (pida, pid) in own.items()
    }
    columns = ["PID", "PIDA", "PIDA as quiet", "σ(u), PID", "σ(u), PIDA", "filter time", "as quiet"]
    return pd.DataFrame(rows, index=columns).T.map("{:.4g}".format)


def price(book: Ledger, points: int = 8) -> Figure:
    """Load IAE over the noise in u at equal Ms, along the filter time; marks at the filters of the paper."""
    shared = work(book)
    figure, axes = plt.subplots(2, 2, figsize=(6.4, 4.6))
    for ax, (name, pair) in zip(axes.flat, PAIRS.items(), strict=True):
        for case in pair:
            scale = 1.0 if case.example == "ex1" else 3.0
            found = [fair(shared, case, float(time)) for time in scale * np.geomspace(0.03, 0.6, points)]
            (line,) = ax.semilogx([x.sigma for x in found], [x.iae for x in found], label=case.kind.upper())
            own = fair(shared, case, shared.filters[case].time)
            ax.plot(own.sigma, own.iae, "o" if case.kind == "pida" else "s", color=line.get_color())
        ax.set_title(f"{ORDERS[pair[0].example]} lags, {name.split(', ')[1].replace('Ms', '$M_s =$')}")
    for ax in axes[1]:
        ax.set_xlabel("standard deviation of u")
    for ax in axes[:, 0]:
        ax.set_ylabel("load IAE")
    axes[0, 0].legend()
    return once(figure)


def others(book: Ledger) -> pd.DataFrame:
    """The recipe on four other processes: what the process gets of the Ms that the model was given."""
    rows = {}
    for (name, ms), loop in _other_loops().items():
        got, C = pidalab.margins(loop), loop.controller
        bare = ms_of(pidalab.Loop(loop.process, C))
        rows[f"{name}, Ms = {ms}"] = [C.kp, C.ti, bare, got.ms, got.gm, got.pm, got.dm]
    lags = {}
    for ms in (1.4, 2.0):
        error = pidalab.load_response(_other_loops()["one large lag", ms], np.linspace(0, 60, 6001)).e
        lags[f"Ms {ms}"] = float(20 / math.log(error[2000] / error[4000])), 10.0
    found = [value for value, _ in lags.values()]
    book.statement(
        "st.lag.dominant",
        *every(lags, "within", "similar"),
        left_name="time constant of the decay",
        right_name="cancelled lag",
        note="On 1/((10s+1)(s+1)³) the load response decays with the cancelled lag, whatever the gain: time constants "
        f"{found[0]:.2f} at Ms = 1.4 and {found[1]:.2f} at 2.0.",
    )
    columns = ["kp", "ti", "Ms", "Ms with F", "gain margin", "phase margin", "delay margin"]
    return pd.DataFrame(rows, index=columns).T.map("{:.3g}".format)


@cache
def _other_loops() -> dict[tuple[str, float], pidalab.Loop]:
    t, found = np.linspace(0, 120, 12001), {}
    for (name, process), ms in product(OTHERS.items(), (1.4, 2.0)):
        model = pidalab.identification.three_point(t, pidalab.open_loop_step(process, t).y).process
        C = haalman.pida(model, ms, m=PAPER_M)
        F = haalman.output_filter(model, C).transfer_function()
        found[name, ms] = pidalab.Loop(process, C, F)
    return found


def other_responses(book: Ledger) -> Figure:
    """Set-point step at 0 and load step at 60 on the four other processes."""
    t = np.linspace(0, 120, 3001)
    load = np.where(t >= 60, 1.0, 0.0)
    figure, axes = plt.subplots(2, 2, figsize=(6.4, 5.0), sharex=True)
    for ax, name in zip(axes.flat, OTHERS, strict=True):
        runs = {
            f"$M_s = {ms}$": pidalab.simulate(_other_loops()[name, ms], t, 1.0, load) for ms in (1.4, 2.0)
        }
        plots.signal(ax, runs, "y")
        ax.set(title=name, ylabel="output y", xlabel="")
    for ax in axes[1]:
        ax.set_xlabel("time units")
    axes[0, 0].legend()
    return once(figure)


def captions(book: Ledger) -> pd.DataFrame:
    """What only reading settles."""
    book.note(
        "fig3.caption",
        "The text of sec. 4.1 places the set-point response on the left and the load response on the right, as do the "
        "captions of Figs 2, 4 and 5; the caption of Fig. 3 has the two words exchanged.",
    )
    places = {"text": ("left", "right"), "Figs 2, 4, 5": ("left", "right"), "Fig. 3": ("right", "left")}
    return pd.DataFrame(places, index=["set point", "load"]).T
