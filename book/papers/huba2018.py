"""Orders, plants and a simulated thermal plant for the pages on huba2018.

The records of the thermal plant of sec. V are not published. So we simulate a twin with an assumed structure. The
twin gives the printed model (17) if it is identified in the same way as the paper's plant.
"""

from itertools import product

import numpy as np
import pandas as pd
from control import TransferFunction, ss
from scipy.integrate import RK45
from scipy.optimize import brentq

import pidalab
from pidalab import plots
from pidalab.identification import ipdt_tangent
from pidalab.rules import mrdp

ORDERS = range(5)  # derivative orders m of the tables
TABLE2 = [(m, n) for m in ORDERS for n in range(max(m, 1), 7)]  # cells of Table II
DESIGNED = [
    (m, n) for m, n in TABLE2 if n > m
]  # eq. (9) determines the pole only in these cells
UNIT = pidalab.ipdt(gain=1.0, delay=1.0)
THERMAL = pidalab.ipdt(gain=0.01, delay=5.0)  # model in the captions of Figs 5, 7, 8
SAMPLE = 0.02  # s, sample time of the experiments
LAMP = (0.0, 80.0)  # %, limits of the lamp power, sec. V.B
TANGENT = {"gain": 0.01, "delay": 5.56}  # printed model (17), delay in s


def equal_servo(m, ie):
    """Return the T_e with which the loop with UNIT has the IE `ie` after a set-point step, eq. (15)."""
    one, weights = mrdp.constants(m), mrdp.prefilter_weights(m, m + 1)
    return ie / ((1 - weights[0]) * one.integral_time) - 1


def equal_load(m, ie):
    """Return the T_e with which the loop with UNIT has the IE `ie` = T_i/K_c after a load step."""
    one = mrdp.constants(m)
    return np.sqrt(ie * one.gain / one.integral_time) - 1


def noise_in_u(loop, samples=250):
    """Return the standard deviation of u for white noise of standard deviation 1, `samples` values per dead time."""
    w = np.linspace(0.0, samples * np.pi, 10_001)[1:]
    return np.sqrt(np.mean(np.abs(loop.transfer("u", "n", 1j * w)) ** 2))


def thermal_plant(
    rise=30.0, fall=60.0, conduction=200.0, share=0.3, dip=0.05, lags=3, delay=0.1
):
    """Return a twin of the thermal plant: from lamp power in % to K above ambient; times in s.

    The lamp power w is u after the dead time `delay`. A body x follows w: T dx/dt = w - x, with T = `rise`
    where w > x, else `fall`. Output: y = K [(1 - share + share/(conduction s + 1)) x - dip w]/(T_l s + 1)^lags.
    K and T_l are chosen such that the steepest tangent of an upward step gives the model (17).
    """

    def plant(gain, lag):
        under = np.poly1d([lag, 1.0]) ** lags
        slow = np.poly1d([conduction, 1.0])
        main = TransferFunction(
            [gain * (1 - share) * conduction, gain], (slow * under).coef
        )
        direct = TransferFunction([-gain * dip], under.coef)
        return pidalab.AsymmetricPlant(main, rise, fall, direct, delay)

    t = np.linspace(0.0, 15 * TANGENT["delay"], 6001)

    # `tangent` leaves out the dead time of the plant, which is added to the delay of the tangent below.
    def tangent(lag):
        rising = plant(1.0, lag).rising
        undelayed = pidalab.Process(rising.num, rising.den)
        return ipdt_tangent(t, pidalab.open_loop_step(undelayed, t).y)

    lag = brentq(lambda lag: tangent(lag).delay + delay - TANGENT["delay"], 0.005, 5.56)
    return plant(TANGENT["gain"] / tangent(lag).num[0], lag)


def experiment(design, plant, anti_windup=None, hold=200.0):
    """Warm up to 10 K, step the set point to 15 K and back, each for `hold` s.

    The temperatures are above ambient. They are our assumption.
    """
    r = np.repeat([10.0, 15.0, 10.0], round(hold / SAMPLE))
    t = SAMPLE * np.arange(r.size)
    return pidalab.simulate_sampled(
        design.loop(), t, r, limits=LAMP, plant=plant, anti_windup=anti_windup
    )


def measures(run, hold=200.0):
    """Measure both steps. A loop has settled if y stays within 5 % of the set point in the last fifth of `hold`."""
    found = {}
    for way, start in (("up", hold), ("down", 2 * hold)):
        part = run.between(start, start + hold)
        outside = np.flatnonzero(np.abs(part.e) > 0.05 * abs(part.r[-1]))[-1] + 1
        settled = outside < 0.8 * part.t.size
        found[way] = {
            "overshoot, %": part.overshoot() if settled else np.nan,
            "settled after, s": part.step * outside if settled else np.nan,
            "at a limit, s": run.saturated(LAMP, start, start + hold),
        }
    return pd.DataFrame(found).T


def tried(designs, plant, hold=200.0):
    """Run designs without anti-windup and with clamping. Return the runs and a table of overshoot and settling."""
    runs, tables = {}, {}
    for (name, design), way in product(designs.items(), ("none", "clamping")):
        protection = None if way == "none" else way
        run = runs[name, way] = experiment(design, plant, protection, hold)
        tables[name, way] = measures(run, hold)
    table = pd.concat(tables, names=[None, "anti-windup", "step"]).unstack([1, 2])
    table = table[["overshoot, %", "settled after, s"]]
    return runs, table.map("{:.1f}".format).replace("nan", "–")


def drawn(runs, size=(6.4, 3.2)):
    """Draw temperature and set point, and below them the lamp power."""
    figure = plots.experiment(runs, "temperature, K", "lamp power, %", "time, s")
    figure.set_size_inches(size)


def ode45(design, setpoint=0.0, load=0.0, end=15.0, rtol=1e-3, atol=1e-6):
    """Return times and output of a loop on UNIT, simulated as by a solver with variable steps.

    The solver is Dormand and Prince's pair with the usual tolerances and the usual longest step, `end`/50.
    Between the ends of past steps the delayed control signal is interpolated linearly.
    """
    blocks = design.loop().blocks
    parts = [ss(TransferFunction(*blocks[x])) for x in ("controller", "prefilter")]
    control, filtered = parts
    split = 1 + control.nstates
    times, late = np.zeros(100_000), np.zeros(100_000)
    x, t, k, h = np.zeros(split + filtered.nstates), 0.0, 0, end / 50

    def signals(x):
        r = filtered.C[0] @ x[split:] + filtered.D[0, 0] * setpoint
        return control.C[0] @ x[1:split] + control.D[0, 0] * (r - x[0]), r - x[0]

    def slope(t, x):
        u = np.interp(t - 1.0, times[: k + 1], late[: k + 1], left=0.0)
        inner = control.A @ x[1:split] + control.B[:, 0] * signals(x)[1]
        outer = filtered.A @ x[split:] + filtered.B[:, 0] * setpoint
        return np.concatenate([[u + load * (t >= 1.0)], inner, outer])

    late[0], out = signals(x)[0], [0.0]
    first = slope(t, x)
    h = min(h, 0.8 * rtol**0.2 / np.max(np.abs(first) / (atol / rtol) + 1e-300))
    while t < end - 1e-9:
        h = min(h, end / 50, end - t)
        slopes = [first]
        for place, row in zip(RK45.C[1:], RK45.A[1:], strict=True):
            inside = x + h * (row[: len(slopes)] @ slopes)
            slopes.append(slope(t + place * h, inside))
        new = x + h * (RK45.B @ slopes)
        slopes.append(slope(t + h, new))
        size = np.maximum(np.maximum(np.abs(x), np.abs(new)), atol / rtol)
        error = h * np.max(np.abs(RK45.E @ slopes) / size) / rtol
        if error <= 1.0:
            t, x, k = t + h, new, k + 1
            times[k], late[k] = t, signals(x)[0]
            first = slope(t, x)
            out.append(x[0])
        h *= min(5.0, max(0.1, 0.8 * (error + 1e-300) ** -0.2))
    return times[: k + 1], np.array(out)


# The paper's notation for the parts of names in the ledger.
WORDS = {"ko": "K_o", "tau_i": "τ_io", "table4": "IAE_s/T_d"}
WORDS |= {f"tau{j}": f"τ_{j}o" for j in range(1, 5)} | {
    f"n{n}": f"n = {n}" for n in range(7)
}
WORDS |= {f"b{k}": f"b_{k}" for k in range(5)} | {f"m{m}": f"m = {m}" for m in ORDERS}
for m in ORDERS:
    WORDS |= {f"table{k}.m{m}": f"m = {m}" for k in (1, 2)}
    WORDS |= {f"table3.m{m}.p{p}": f"m = {m}, p = {p}" for p in range(1, m + 2)}
