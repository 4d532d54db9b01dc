"""The loop of Paper Fig. 3, in which nearly all claims of huba2024 are tried: designs, limits, runs and measures."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pidalab
from pidalab.rules import automatic_reset as ar

T_S = 0.001  # the paper's sample time
SPARE = 0.1  # how far the limits of Paper Fig. 3 lie beyond the states of rest
STEPS = ("setpoint", "load")
MRDP = ("PI", "PID", "MRDP-PIDA")
SHORT_RESET = ("PID", "PPM-PIDA", "PIDA_1", "PIDA_2")
FREE = (-math.inf, math.inf)
LABELS = {"PIDA_1": "PIDA$_1$", "PIDA_2": "PIDA$_2$"}
END = 60.0


def plant(delay: float = 1.0) -> pidalab.Process:
    """The integrator with dead time, K_s = 1."""
    return pidalab.ipdt(1.0, delay=delay)


def pi() -> ar.Setting:
    """PI of the multiple pole, computed when it is asked for."""
    return ar.multiple_pole(0)


def pid() -> ar.Setting:
    """PID of the multiple pole."""
    return ar.multiple_pole(1)


def pida() -> ar.Setting:
    """PIDA of the multiple pole."""
    return ar.multiple_pole(2)


def design(setting: ar.Setting, n: int = 4, filter_time: float = 0.2, **options: Any) -> pidalab.Design:
    """A controller for T_dp = 1 behind Q_n; by default n T_f = 0.8, so T_d = 1.8."""
    return ar.tune(plant(), setting, n=n, filter_time=filter_time, **options)


@cache
def designs() -> dict[str, pidalab.Design]:
    """The six controllers of the paper."""
    return {name: design(setting) for name, setting in ar.SETTINGS.items()}


def series(name: str) -> pidalab.SeriesPIDA:
    """The controller of one of them, with its reset."""
    own = designs()[name].controller
    assert isinstance(own, pidalab.SeriesPIDA)
    return own


def limits(step: str, spare: float = SPARE) -> tuple[float, float]:
    """Limits that leave the actuator so much beyond what it needs at rest."""
    return (-spare, spare) if step == "setpoint" else (-1.0 - spare, spare)


def clock(end: float = END, h: float = T_S) -> np.ndarray:
    """Sample times from 0 to the end."""
    return h * np.arange(round(end / h) + 1)


def sampled(
    loop: pidalab.Loop,
    step: str,
    bounds: tuple[float, float] | None = None,
    end: float = END,
    h: float = T_S,
    **options: Any,
) -> pidalab.Response:
    """Response to a unit step of set point or load, by default between the limits of Paper Fig. 3."""
    inputs: dict[str, Any] = {"setpoint": 0.0, "load": 0.0} | {step: 1.0}
    bounds = limits(step) if bounds is None else bounds
    return pidalab.simulate_sampled(loop, clock(end, h), **inputs, limits=bounds, **options)


@cache
def run(name: str, step: str, linear: bool = False) -> pidalab.Response:
    """One of the six controllers, between the limits of Paper Fig. 3 or without any; PI takes 300 time units."""
    bounds = FREE if linear else None
    return sampled(designs()[name].loop(), step, bounds, end=300.0 if name == "PI" else END)


def excess(response: pidalab.Response, step: str) -> tuple[float, float]:
    """What y and u move beyond their ideal shapes: a monotonic step, or one pulse as in (24); ends as in theory."""
    of_u = response.tv1("u", final=0.0 if step == "setpoint" else -1.0)
    of_y = response.tv("y", final=1.0) - 1.0 if step == "setpoint" else response.tv1("y", final=0.0)
    return of_y, of_u


def change(response: pidalab.Response, step: str) -> tuple[float, float]:
    """How far y and u move: what an excess is measured against."""
    of_y = 1.0 if step == "setpoint" else float(np.max(np.abs(response.y)))
    return of_y, float(np.ptp(np.append(response.u, 0.0)))


def beyond(response: pidalab.Response, step: str) -> float:
    """Overshoot of the set point, or undershoot after the load, in units of y; not below 0."""
    return max(0.0, float(response.y.max() - 1.0 if step == "setpoint" else -response.y.min()))


ROUNDING = 1e-9  # share of the change below which an excess is none: the engine has no more digits


def shapes(name: str, linear: bool = False) -> dict[str, tuple[float, float]]:
    """Excess and change of y and u for both steps, by what they are."""
    found: dict[str, tuple[float, float]] = {}
    for step in STEPS:
        response = run(name, step, linear)
        pairs = zip("yu", excess(response, step), change(response, step), strict=True)
        found |= {
            f"{name}, {signal} after the {step}": (abs(e) if abs(e) > ROUNDING * c else 0.0, c)
            for signal, e, c in pairs
        }
    return found


@cache
def estimate(name: str) -> np.ndarray:
    """The load as the reset knows it while the unit load of Paper Fig. 3 acts."""
    return -series(name).reset_signal(run(name, "load").u, T_S)


def parallel(name: str) -> pidalab.Loop:
    """The same linear controller with an integrator in place of the automatic reset."""
    own = designs()[name]
    return pidalab.Loop(plant(), own.controller.transfer_function(), prefilter=own.prefilter)


def portrait(
    points: object,
    h: float,
    step: str = "load",
    delay: float = 1.0,
    end: float = END,
    spare: float = SPARE,
    n: int = 4,
    filter_time: float = 0.2,
) -> pidalab.Portrait:
    """Portrait of settings (kappa, tau_D, tau_A, tau_i), each with its prefilter (20)."""
    kappa, td, ta, ti = np.moveaxis(np.asarray(points, float), -1, 0)
    total = 1.0 + n * filter_time
    inputs: dict[str, Any] = {step: 1.0}
    held = pidalab.SeriesPIDA(1.0, 1.0, 1.0, 1.0, filter_time=filter_time, filter_order=n)
    gains = {"kp": kappa / total, "kd": kappa * td, "ka": kappa * ta * total, "ti": ti * total}
    den = [ta * ti * total**3, (ta + td * ti) * total**2, (td + ti) * total, np.ones_like(ti)]
    return pidalab.portrait(
        pidalab.Loop(plant(delay), held),
        gains,
        clock(end, h),
        limits=limits(step, spare),
        prefilter=([1.0], den),
        **inputs,
    )


def point(setting: ar.Setting) -> np.ndarray:
    """A setting as a point (kappa, tau_D, tau_A, tau_i) of the portrait."""
    return np.array([setting.kp, *setting.times, setting.ti])


def setting_at(spot: np.ndarray, name: str = "portrait") -> ar.Setting:
    """A point of the portrait as a setting."""
    kappa, td, ta, ti = (float(x) for x in spot)
    return ar.Setting(name, "portrait", 0.5, kappa, kappa * td, kappa * ta, ti)


def y_excess(p: pidalab.Portrait, step: str) -> np.ndarray:
    """Excess of y in a portrait: over one pulse after the load, over a monotonic step of the set point."""
    return p.tv1_y if step == "load" else p.tv_y + np.abs(1.0 - p.y_end) - 1.0
