"""What sec. IV of huba2018 calls numerical imperfections, against the stability of the loops themselves."""

import math
from itertools import product

import control
import numpy as np
import pandas as pd
import pidalab
from pidalab.ledger import Ledger, every
from pidalab.rules import mrdp
from scipy.signal import cont2discrete

from .designs import (
    EXPERIMENTS,
    LIMITED,
    SAMPLE,
    USED_DELAY,
    constants,
    experiment,
    nominal,
    shortest_filter,
    span,
    unit,
)

SHORT = {"m = 4, n = 4": (4, 4, 0.25), "m = 4, n = 5": (4, 5, 0.25), "m = 4, n = 6": (4, 6, 0.25)} | {
    f"{name} of Paper Figs 5 to 7": (m, n, te / USED_DELAY) for name, (m, n, te) in EXPERIMENTS.items()
}
SHORT_PID = [(n, te) for n in range(1, 7) for te in (0.1, 0.03, 0.01, 0.003)]


def estimate(m: int, n: int) -> float:
    """Shortest T_e/T_dm from the height of the hump of |L|, for a pocket calculator."""
    kappa = constants(m).gain * constants(m).derivative_times[-1]
    height = math.sqrt((m - 1) ** (m - 1) * (n - m + 1) ** (n - m + 1) / n**n)
    share = (kappa * height) ** (1 / (m - 1)) / mrdp.filter_ratio(m, n)
    return share / (1 - share)


def imperfections(book: Ledger) -> pd.DataFrame:
    """Sec. IV: whether the loops with a short filter are stable at all."""
    short = {name: mrdp.tune(unit(), *key).loop() for name, key in SHORT.items()}
    unstable = {name: pidalab.unstable_poles(loop) for name, loop in short.items()}
    book.statement(
        "st.imperfection.short",
        *every({name: (count, 1) for name, count in unstable.items()}, ">="),
        left_name="unstable poles",
        right_name="one",
        note=f"m = 4 needs T_e of at least {shortest_filter(4, 4):.3f} T_dm (n = 4) to {shortest_filter(4, 6):.3f} "
        f"T_dm (n = 6), and PID_4^2 {shortest_filter(2, 4):.4f} T_dm.",
    )
    limits = {f"m = {m}, n = {n}": shortest_filter(m, n) for m, n in LIMITED}
    low, high = (pick(limits, key=lambda name: limits[name]) for pick in (min, max))
    book.statement(
        "st.imperfection.cause",
        limits[high],
        "<=",
        0,
        left_name=f"shortest stable T_e/T_dm for {high}",
        right_name="no limit",
        note="For each m of 2 to 4 and n up to 6 there is a shortest T_e below which the loop with the model is "
        f"unstable, from {limits[low]:.3f} T_dm ({low}) to {limits[high]:.3f} T_dm ({high}). The growth is real; "
        "what the solvers add to it is not known. The paper names no setting and claims no stability; the reading "
        "is ours.",
    )
    pid = {f"n = {n}, T_e = {te:g}": mrdp.tune(unit(), 1, n, te).loop() for n, te in SHORT_PID}
    margins = {
        name: pidalab.margins(loop).gm if pidalab.is_stable(loop) else 0.0 for name, loop in pid.items()
    }
    kappa = constants(1).gain * constants(1).derivative_times[0]
    book.statement(
        "st.imperfection.m1",
        *every({name: (gm, 1.0) for name, gm in margins.items()}, ">"),
        left_name="gain margin, 0 if unstable",
        right_name="none left",
        note=f"For n from 1 to 6 down to T_e = {min(te for _, te in SHORT_PID)} T_dm. Without filter |L| tends to "
        f"{kappa:.2f} at high frequency, and a filter only lowers it.",
    )
    rows = {
        name: {"Tₑ, dead times": te, "shortest": shortest_filter(m, n), "unstable poles": unstable[name]}
        for name, (m, n, te) in SHORT.items()
    }
    return pd.DataFrame(rows).T.astype({"unstable poles": int}).round(4)


def shortest_filters(book: Ledger) -> pd.DataFrame:
    """The estimate of the shortest filter beside the exact limit."""
    rows = {}
    for m, n in LIMITED:
        guess, exact = estimate(m, n), shortest_filter(m, n)
        rows[f"m = {m}, n = {n}"] = {
            "estimate": guess,
            "exact limit": exact,
            "error, %": 100 * (guess / exact - 1),
        }
    return pd.DataFrame(rows).T.round(4)


def three_ways(book: Ledger) -> pd.DataFrame:
    """The limit of stability by the argument principle, by the rightmost pole, and by the growth of exact responses."""
    t, rows = np.linspace(0, 300, 6001), {}
    corners = [(m, n) for m in (2, 3, 4) for n in (m, 6)]
    for (m, n), (side, factor) in product(corners, (("below", 0.98), ("above", 1.02))):
        loop = mrdp.tune(unit(), m, n, factor * shortest_filter(m, n)).loop()
        rows[f"m = {m}, n = {n}, {side}"] = {
            "limit": f"{shortest_filter(m, n):.4f}",
            "unstable poles": pidalab.unstable_poles(loop),
            "rightmost real part": f"{pidalab.rightmost_poles(loop)[0].real:+.4f}",
            "growth simulated": f"{growth(pidalab.step_response(loop, t), 200.0, 290.0):+.4f}",
        }
    return pd.DataFrame(rows).T


def growth(run: pidalab.Response, start: float, end: float, window: float = 10.0) -> float:
    """Rate at which the largest error of a window grows from one time to another."""
    first, last = (np.abs(run.e[(run.t >= at) & (run.t < at + window)]).max() for at in (start, end))
    return math.log(last / first) / (end - start)


def sampled(book: Ledger) -> pd.DataFrame:
    """Figs 5 and 7 with a digital controller: the loop with the model, sampled as in the experiments."""
    rates, simulated, rows = {}, {}, {}
    t = SAMPLE * np.arange(10_001)
    for name in EXPERIMENTS:
        loop = experiment(name)
        by_method = {method: _sampled_rate(loop, method) for method in ("zoh", "bilinear")}
        run = pidalab.simulate_sampled(loop, t, setpoint=1.0)
        rates[name], simulated[name] = by_method["zoh"], growth(run, 100.0, 190.0, 5.0)
        rows[name] = {
            "rightmost pole, continuous": f"{pidalab.rightmost_poles(loop)[0].real:+.4f}",
            "sampled, held inputs": f"{by_method['zoh']:+.4f}",
            "sampled, Tustin": f"{by_method['bilinear']:+.4f}",
            "simulated, 100 to 190 s": f"{simulated[name]:+.4f}",
            "doubles in, s": f"{math.log(2) / by_method['zoh']:.1f}",
        }
    book.statement(
        "st.fig7.numerical",
        math.exp(rates["PID₆⁴"]),
        "<",
        1.0,
        left_name="growth in a second",
        right_name="none",
        note=f"On the model with {USED_DELAY:g} s: T_e = {EXPERIMENTS['PID₆⁴'][2] / USED_DELAY:.2f} T_dm, and the "
        f"controller sampled with {SAMPLE} s makes the loop double what it is fed in "
        f"{math.log(2) / rates['PID₆⁴']:.1f} s, with held inputs and with Tustin's rule alike. The measured plant "
        "behaved otherwise, so it was not this model at high frequency.",
    )
    book.statement(
        "st.conclusion.realtime",
        *every({name: (math.exp(rate), 1.0) for name, rate in simulated.items()}, "<"),
        left_name="growth in a second, simulated",
        right_name="none",
        note=f"On the model with {USED_DELAY:g} s both sampled loops grow when simulated. Real-time control of the "
        "laboratory plant did not; its measurements are not published as numbers.",
    )
    return pd.DataFrame(rows)


def _sampled_rate(loop: pidalab.Loop, method: str) -> float:
    """Growth rate of the loop with a sampled controller and an integrator behind a whole number of samples: exact."""
    num, den = (np.atleast_1d(loop.blocks["controller"][i]) for i in (0, 1))
    b, a, _ = cont2discrete((num, den), SAMPLE, method=method)
    b, delay = np.ravel(b), round(loop.process.delay / SAMPLE)
    velocity = float(loop.process.num[-1])
    closed = np.concatenate([np.convolve(a, [1.0, -1.0]), np.zeros(delay)])  # (z − 1) A(z) z^delay + K h B(z)
    closed[-b.size :] += velocity * SAMPLE * b
    return math.log(np.abs(np.roots(closed)).max()) / SAMPLE


def bursts(book: Ledger) -> pd.DataFrame:
    """Sec. IV: how much more of the growth shows after a set-point step than after a load step."""
    t, cases, rows = np.linspace(0, 10, 10_001), {}, {}
    for name, (m, n, te) in SHORT.items():
        loop, stable = mrdp.tune(unit(), m, n, te).loop(), mrdp.tune(unit(), m, n, 0.5).loop()
        last = t >= 9.0
        servo = np.abs(pidalab.step_response(loop, t).e[last]).max()
        peak = pidalab.load_response(stable, t).y.max()
        load = np.abs(pidalab.load_response(loop, t).y[last]).max() / peak
        cases[name] = (float(servo), float(load))
        rows[name] = {"set point": f"{servo:.3g}", "load": f"{load:.3g}", "ratio": f"{servo / load:.0f}"}
    book.statement(
        "st.imperfection.setpoint",
        *every(cases, ">"),
        left_name="set point",
        right_name="load",
        note="The loops of st.imperfection.short, unstable with the model: the largest error between 9 and 10 T_dm "
        "after the step, against the set-point step, and against the peak of the load response with T_e = 0.5 "
        f"T_dm. It is {span([a / b for a, b in cases.values()], '.0f')} times as large after a set-point step, "
        "which enters ahead of the controller and its large gain at this frequency; the load enters behind it.",
    )
    return pd.DataFrame(rows).T


def sampling(book: Ledger) -> pd.DataFrame:
    """Step 4 of the tuning procedure: the filter against the sample time."""
    ratio = {name: mrdp.filter_ratio(m, n) * te for name, (m, n, te) in EXPERIMENTS.items()}
    for name, key in (("PID₄²", "fig5"), ("PID₆⁴", "fig7")):
        book.statement(
            f"st.step4.{key}",
            ratio[name],
            ">",
            SAMPLE,
            convention="negligible",
            left_name="T_f",
            right_name="T_s, in s",
            note=f"{name} with T_e = {EXPERIMENTS[name][2]} s: T_f is {ratio[name] / SAMPLE:.1f} times T_s.",
        )
    cells = {
        name: {"filter time, s": x, "filter time / sample time": x / SAMPLE} for name, x in ratio.items()
    }
    return pd.DataFrame(cells).T.round(4)


def taming_lags(book: Ledger) -> pd.DataFrame:
    """Figs 5 and 7: how much lag, beside the dead time or in place of some of it, makes these loops stable."""
    lags, rows = np.geomspace(0.02, 4.9, 160), {}
    for name, (m, n, te) in EXPERIMENTS.items():
        d = mrdp.tune(nominal(), m, n, te)
        ways = {"beside it": lambda lag: USED_DELAY, "in its place": lambda lag: USED_DELAY - lag}
        rows[name] = {
            "Tₑ, dead times": f"{te / USED_DELAY:.2f}",
            "shortest": f"{shortest_filter(m, n):.4f}",
            "unstable poles": f"{pidalab.unstable_poles(d.loop())}",
            "grows at, rad/s": f"{pidalab.rightmost_poles(d.loop())[0].imag:.1f}",
        }
        for way, rest in ways.items():
            kept = [
                x
                for x in lags
                if pidalab.is_stable(d.loop(pidalab.Process([0.01], [x, 1.0, 0.0], delay=rest(x))))  # type: ignore[no-untyped-call]
            ]
            gaps = np.diff(np.searchsorted(lags, kept)).max() > 1
            end = (
                f"{kept[-1]:.1f}"
                + (", the longest tried" if kept[-1] == lags[-1] else "")
                + (", with gaps" if gaps else "")
            )
            rows[name][f"stable with a lag {way}, s"] = f"{kept[0]:.2f} to {end}"
    return pd.DataFrame(rows)


def wrong_dead_times(book: Ledger) -> pd.DataFrame:
    """Fig. 6: PID_4^2 tuned for another dead time than the plant has; poles on the model and on the twin."""
    twin, rows, cases = pidalab.twins.thermal_plant().rising, {}, {}
    for delay in (0.5, 1.0, 2.0, 4.0, 5.0, 8.0):
        d = mrdp.tune(pidalab.ipdt(gain=0.01, delay=delay), 2, 4, te=0.2)
        plants = {"that dead time": d.model, "5 s": nominal(), "the twin": twin}
        rows[f"tuned for {delay:g} s"] = {
            name: pidalab.unstable_poles(d.loop(plant)) for name, plant in plants.items()
        }
        cases[f"tuned for {delay:g} s"] = (rows[f"tuned for {delay:g} s"]["5 s"], 1)
    tried = np.geomspace(0.1, 20.0, 60)
    counts = [
        pidalab.unstable_poles(mrdp.tune(pidalab.ipdt(0.01, delay=x), 2, 4, 0.2).loop(nominal()))
        for x in tried
    ]
    book.statement(
        "st.fig6.robust",
        *every(cases, "<"),
        left_name="unstable poles on the model with 5 s",
        right_name="one",
        note="On the model with 5 s all six settings of Fig. 6 are unstable: those tuned for less by a slow "
        f"oscillation, the others at high frequency. Of {tried.size} dead times between 0.1 and 20 s tried in the "
        f"tuning {sum(count == 0 for count in counts)} give a stable loop. The measured plant behaved otherwise; "
        "its records are not published as numbers.",
    )
    return pd.DataFrame(rows).T.rename(columns=lambda name: f"unstable poles with {name}")


def short_pid() -> pd.DataFrame:
    """PID with ever shorter filters, which stays stable: IAE, margins, and what the control signal pays."""
    t, rows = np.linspace(0, 20, 20_001), {}
    for te in (0.5, 0.1, 0.01, 0.001):
        d = mrdp.tune(unit(), 1, 2, te)
        run, found = pidalab.step_response(d.loop(), t), pidalab.margins(d.loop())
        rows[f"Tₑ = {te:g}"] = {
            "IE": f"{d.ie:.5f}",
            "IAE": f"{run.iae():.5f}",
            "overshoot, %": f"{run.overshoot():.4f}",
            "largest u": f"{run.peak('u'):.1f}",
            "Ms": f"{found.ms:.3f}",
            "delay margin": f"{found.dm:.3f}",
        }
    return pd.DataFrame(rows).T


def pade() -> pd.DataFrame:
    """Unstable poles of PIDA with the dead time replaced by a Padé approximation, beside the true ones."""
    rows = {}
    for te in (0.04, 0.2):
        d = mrdp.tune(unit(), 2, 4, te)
        chain = control.ss(control.tf([1.0], [1.0, 0.0])) * control.ss(d.controller.transfer_function())
        counts = {}
        for order in (1, 2, 3, 5, 10, 20):
            closed = control.feedback(chain * control.ss(control.tf(*control.pade(1.0, order))), 1)
            counts[f"order {order}"] = int(np.sum(closed.poles().real > 0))
        rows[f"Tₑ = {te:g}"] = counts | {"exact": int(pidalab.unstable_poles(d.loop()))}
    return pd.DataFrame(rows).T
