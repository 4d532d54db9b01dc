"""Equations (1) to (7), (13), (16) and (19): the form of the controller."""

import math
from typing import Any

import numpy as np
import pandas as pd
import pidalab
from pidalab.controllers import NonInteractivePIDA
from pidalab.ledger import Ledger
from scipy.integrate import quad

from .examples import listed, percents, processes, proposed, runs
from .printed_itae import nearer_by_eq7

ALPHA_D = 0.05  # recommended in sec. 2.1
ALPHA_A = 0.5 * ALPHA_D
CONTROLLER = NonInteractivePIDA(kc=2.0, tau_i=3.0, tau_d=0.8, tau_a=0.6)
ERROR = np.poly1d(
    [0.7, -2.0, 0.5, 1.0]
)  # a test signal: third order, so that every term of the controller differs


def _by_eq5(t: float, e: np.poly1d = ERROR, c: NonInteractivePIDA = CONTROLLER) -> float:
    """Control signal by eq. (5), for an error that is a polynomial."""
    predicted = e(t) + c.tau_d * e.deriv()(t) + c.tau_a**2 / 2 * e.deriv(2)(t)
    return float(c.kc * (predicted + e.integ()(t) / c.tau_i))


def _by_eq1(t: float, c: NonInteractivePIDA = CONTROLLER) -> float:
    """Control signal by eq. (1), with the gains of the library."""
    g, e = c.gains(), ERROR
    return float(g.kp * e(t) + g.ki * e.integ()(t) + g.kd * e.deriv()(t) + g.ka * e.deriv(2)(t))


def _bracket(s: complex, c: NonInteractivePIDA = CONTROLLER) -> complex:
    """Eq. (6): the controller without filters."""
    return c.kc * (1 + 1 / (c.tau_i * s) + c.tau_d * s + c.tau_a**2 / 2 * s**2)


def _transform_of_eq5(s: float, c: NonInteractivePIDA = CONTROLLER) -> float:
    """U(s)/E(s) of eq. (5) for the error t³e^(-t), which begins at rest; by numerical integration."""

    def u(t: float) -> float:
        decay = math.exp(-t)
        e, slope, bend = t**3, 3 * t**2 - t**3, 6 * t - 6 * t**2 + t**3
        area = 6 - (t**3 + 3 * t**2 + 6 * t + 6) * decay
        return c.kc * ((e + c.tau_d * slope + c.tau_a**2 / 2 * bend) * decay + area / c.tau_i)

    value = quad(lambda t: u(t) * math.exp(-s * t), 0, math.inf, epsabs=1e-13, epsrel=1e-13)[0]
    return float(value / (6 / (s + 1) ** 4))


def form(book: Ledger) -> pd.DataFrame:
    """(2) to (6): what the four parameters mean."""
    ahead = CONTROLLER.tau_d
    parabolas = [np.poly1d(c) for c in ((1.0, -2.0, 0.5), (0.0, 1.0, 3.0), (2.0, 0.3, -1.0))]
    guess = [e(1.4) + ahead * e.deriv()(1.4) + ahead**2 / 2 * e.deriv(2)(1.4) for e in parabolas]
    taylor = max(abs(x / e(1.4 + ahead) - 1) for x, e in zip(guess, parabolas, strict=True))
    book.note(
        "eq3.taylor",
        "Put t + τ_d for t_f. The series is exact for every parabola, as the audit shows on three.",
    )
    ideal = NonInteractivePIDA(2.0, 3.0, ahead, ahead).gains()
    same = abs(ideal.ka / ideal.kp / (ideal.kd / ideal.kp) ** 2 * 2 - 1)
    text = "With τ_a = τ_d the weight of ë is half the square of that of ė. For other τ_a, (4) is a choice."
    book.identity("eq4.general", same, note=text)
    moments = (0.0, 0.5, 1.0, 2.0)
    parallel = max(abs(_by_eq1(t) / _by_eq5(t) - 1) for t in moments)
    text = (
        f"Control signals for an error of third order at {len(moments)} times; (1) with the library's gains."
    )
    book.identity("eq5.parallel", parallel, note=text)
    at = (0.5, 1.0, 2.0)
    laplace = max(abs(_transform_of_eq5(s) / _bracket(s) - 1) for s in at)
    text = f"Laplace transform of (5) for an error t³ exp(−t) at {len(at)} real s, by numerical integration."
    book.identity("eq6.laplace", laplace, note=text)
    slow = NonInteractivePIDA(
        3 * CONTROLLER.kc, *(7 * x for x in (CONTROLLER.tau_i, ahead, CONTROLLER.tau_a))
    )
    points = [0.3 + 0.2j, 1j, -0.5 + 2j, 3.0 - 1j]
    units = max(abs(slow(s / 7) / (3 * CONTROLLER(s)) - 1) for s in points)
    book.identity(
        "eq6.units", units, note="Times multiplied by 7 give C(s/7), k_c multiplied by 3 gives 3 C(s)."
    )
    residuals = {"(3)": taylor, "(4)": same, "(5) is (1)": parallel, "(6) is (5)": laplace, "units": units}
    return pd.DataFrame({"residual below": {k: _decade(x) for k, x in residuals.items()}})


def _decade(residual: float) -> str:
    """Power of ten above a rounding error, at least 1e-12, so that it is the same on every machine."""
    return f"1e{max(-12, math.ceil(math.log10(max(residual, 1e-300))))}"


def filters(book: Ledger) -> pd.DataFrame:
    """(7), (13) and (16): the filters, and what the controller does at once after a step."""
    kicks = {k: runs()[k, "proposed", "setpoint"].u[0] for k in processes()}
    gain = {k: proposed()[k, "setpoint"].kc for k in processes()}
    bound = 1 + 1 / ALPHA_D + 1 / (2 * ALPHA_A**2)
    pid = {k: runs()[k, "itae2", "setpoint"].u[0] / runs()[k, "itae2", "setpoint"].u[-1] for k in processes()}
    text = (
        f"u(0+) is {bound:.0f} k_c after a unit step of the set point, which is the bound of the gain, "
        f"k_c(1 + 1/α_d + 1/(2α_a²)): {listed(kicks.values(), '.0f')} in Examples 1 to 3, where the ITAE-2 PID has "
        f"{listed(pid.values(), '.0f')}."
    )
    residual = max(abs(kicks[k] / (bound * gain[k]) - 1) for k in processes())
    book.identity("eq13.proper", residual, note=text)
    w, rows = (1e2, 1e4, 1e6), {}
    for name, power in (("(7), first order", 1), ("(16), squared", 2)):
        rows[name] = [abs(_filtered(1j * x, power)) / CONTROLLER.kc for x in w]
    text = (
        "The sentence before (7) announces a second-order filter, and (13) and (16) print the square. In continuous "
        f"time (7) is improper: its gain is {rows['(7), first order'][-1]:.2g} k_c at a frequency of 1e6 and grows "
        f"with it. Sampled it can be run, and then meets {nearer_by_eq7(book)} of the five proposed ITAE values better "
        "than (16) does."
    )
    names: dict[str, Any] = {
        "left_name": "gain of (7) over k_c at 1e6",
        "right_name": "u(0+) over k_c by (16)",
    }
    book.statement("eq7.filter", rows["(7), first order"][-1], "<=", kicks[1] / gain[1], note=text, **names)
    return pd.DataFrame(rows, index=[f"at {x:g}" for x in w]).T.map("{:.4g}".format)


def _filtered(s: complex, power: int, c: NonInteractivePIDA = CONTROLLER) -> complex:
    """(7) and (16): the controller whose acceleration filter is raised to a power."""
    derivative = c.tau_d * s / (ALPHA_D * c.tau_d * s + 1)
    acceleration = c.tau_a**2 * s**2 / (2 * (ALPHA_A * c.tau_a * s + 1) ** power)
    return c.kc * (1 + 1 / (c.tau_i * s) + derivative + acceleration)


def example3(book: Ledger) -> pd.DataFrame:
    """(18) and (19): which of them is underdamped."""
    rows, slow = {}, {}
    for k, process in processes().items():
        slow[k] = min(np.roots(process.den), key=lambda p: -p.real / abs(p))
        free = pidalab.open_loop_step(process, np.linspace(0, 20, 2001))
        rows[f"({16 + k})"] = {
            "least damping of a pole": -slow[k].real / abs(slow[k]),
            "highest output after a unit step": free.y.max() / process.gain(),
        }
    table = pd.DataFrame(rows).T
    (damping, _), (_, peak) = rows["(19)"].values(), rows["(18)"].values()
    text = f"Poles {slow[3].real:.4f} ± {abs(slow[3].imag):.4f}j."
    book.statement(
        "eq19.underdamped", damping, "<", 1, note=text, left_name="damping ratio of the slow poles"
    )
    text = (
        "Eq. (18) has five equal poles and no dead time, and does not overshoot; the underdamped third-order process "
        f"with dead time is (19), which overshoots by {percents([rows['(19)'][table.columns[1]] - 1])}. One digit, so "
        "perhaps of the reading."
    )
    names: dict[str, Any] = {"left_name": "highest output of (18) after a unit step", "right_name": "its end"}
    book.statement("ex3.reference", peak, ">", 1.0, note=text, **names)
    return table.map("{:.3f}".format)
