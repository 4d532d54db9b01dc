"""Questions about loops: plants and controllers of every kind, through the doors that compute with them."""

import hashlib
import itertools
import math
import re

import control
import numpy as np

import pidalab
from pidalab import PIDA, HighOrderPID, Loop, NonInteractivePIDA, Process, SeriesPIDA
from pidalab.robustness import sampled as by_samples

PLANTS = {
    "first order": pidalab.fopdt(1.7, 2.3, 0.7),
    "lag": pidalab.fopdt(-0.6, 20.0, 0.3),
    "delay": pidalab.fopdt(2.1, 0.4, 3.1),
    "damped": pidalab.sopdt(0.8, 1.4, 1.6, 0.2),
    "oscillating": pidalab.sopdt(1.3, 1.1, 0.35, 0.6),
    "four lags": pidalab.lags(4, 0.9, 1.2, 0.5),
    "no delay": pidalab.lags(3, 1.3, 0.9),
    "lag alone": Process([2.0], [3.0, 1.0]),
    "integrator": pidalab.ipdt(0.4, 1.3),
    "integrator and lag": Process([0.7], [1.5, 1.0, 0.0], 0.8),
    "inverse": Process([-0.9, 1.1], [1.2, 2.6, 1.0], 0.4),
    "unstable": Process([1.2], [1.6, -1.0], 0.3),
    "biproper": Process([0.5, 1.2], [0.9, 1.0], 0.45),
    "resonant": Process([1.9], [1.0, 0.1, 1.0], 0.2),
    "two integrators": Process([1.1], [0.5, 1.0, 0.0, 0.0], 0.1),
    "zero": Process([1.3, 0.9], [2.0, 3.0, 1.4, 1.0], 0.33),
    "fast": pidalab.fopdt(170.0, 2.3e-4, 0.9e-4),
    "dead time alone": Process([0.8], [1.0], 1.1),
}


def size(plant):
    """Gain and time that a controller of a plant is made of."""
    last = np.flatnonzero(plant.den)[-1]
    lag = abs(plant.den[last - 1] / plant.den[last]) if last else 0.0
    return plant.num[-1] / abs(plant.den[last]), plant.delay + lag


def controllers(plant):
    gain, time = size(plant)
    kp = 0.45 / gain
    return {
        "P": PIDA(kp, math.inf),
        "PI": PIDA(0.8 * kp, 0.9 * time),
        "PID": PIDA(1.1 * kp, 0.8 * time, 0.2 * time, 0.0, 8.0),
        "PIDA": PIDA(kp, time, 0.25 * time, 0.03 * time**2, 9.0, 7.0 * time),
        "non-interactive": NonInteractivePIDA(kp, time, 0.3 * time, 0.15 * time),
        "high order": HighOrderPID([0.5 * kp / time, 0.7 * kp, 0.1 * kp * time], 0.06 * time, 3),
        "series": SeriesPIDA(kp, 0.2 * kp * time, 0.02 * kp * time**2, time, 0.05 * time, 4),
    }


def loops(kinds=None, plants=PLANTS):
    for name in plants:
        for kind, controller in controllers(PLANTS[name]).items():
            if kinds is None or kind in kinds:
                yield f"{name}, {kind}", Loop(PLANTS[name], controller)
    if kinds is None:
        plant = PLANTS["four lags"]
        own, behind = controllers(plant)["PIDA"], control.tf([1.0], [0.02, 0.3, 1.0])
        yield "filter behind", Loop(plant, own, behind)
        yield "prefilter", Loop(plant, own, None, control.tf([0.5, 1.0], [1.2, 1.6, 1.0]))
        yield "both filters", Loop(plant, own, behind, control.tf([1.0], [0.7, 1.0]))
        yield "high gain", Loop(plant, PIDA(6.0, 2.0))
        yield "gain alone", Loop(PLANTS["biproper"], 0.6)


def times(loop, count=41, horizon=9.0):
    return np.linspace(0.0, horizon * size(loop.process)[1], count)


def margins():
    asked = {}
    for name, loop in loops():
        asked[f"margins: {name}"] = lambda loop=loop: pidalab.margins(loop)
        asked[f"unstable poles: {name}"] = lambda loop=loop: pidalab.unstable_poles(loop)
        if len(loop.process.num) < len(loop.process.den) or "series" in name:  # else ripples without end
            asked[f"Mks: {name}"] = lambda loop=loop: pidalab.robustness.max_control_sensitivity(loop)
        asked[f"transfer: {name}"] = lambda loop=loop: [
            loop.transfer(output, source, 0.3j / size(loop.process)[1])
            for output, source in itertools.product("yue", "rdn")
        ]
    for name, loop in loops(("PI", "PIDA")):
        asked[f"poles: {name}"] = lambda loop=loop: pidalab.rightmost_poles(loop, 3)
    for name, loop in loops(("PID",)):
        asked[f"frequencies: {name}"] = lambda loop=loop: loop.frequency_response().omega
        asked[f"phase crossovers: {name}"] = lambda loop=loop: pidalab.phase_crossovers(loop, 0.7)
    for name, loop in loops(("PI", "series"), ["first order", "four lags", "integrator"]):
        asked[f"circle: {name}"] = lambda loop=loop: pidalab.robustness.circle(loop)
        asked[f"Popov: {name}"] = lambda loop=loop: pidalab.robustness.popov(loop)
    return asked


def signals(response):
    return response.y, response.u, response.area


def measures(response):
    def found(name, *values, **options):
        try:
            return getattr(response, name)(*values, **options)
        except ValueError as refusal:
            return str(refusal)

    end = float(response.t[-1])
    plain = ("ie", "iae", "itae", "ise", "tv", "tv1", "overshoot", "undershoot", "rise_time", "settling_time")
    return {
        **{name: found(name) for name in plain},
        "to": [found(name, 0.37 * end) for name in ("ie", "iae", "itae", "ise")],
        "for ever": [found(name, math.inf) for name in ("ie", "iae", "itae", "ise")],
        "later": [found("itae", None, 0.2 * end), found("tv", "y", 0.1 * end, 0.61 * end)],
        "peaks": [
            found("peak"),
            found("peak", "u"),
            found("settling_time", 0.11),
            found("rise_time", 0.3, 0.7),
        ],
        "stretch": found("between", 0.25 * end, 0.75 * end).iae(),
        "limits": found("saturated", (-0.2, 0.3)),
        "tv1": found("tv1", "u", 0.2 * end, 0.7 * end),
    }


def responses():
    asked = {}
    for name, loop in loops():
        t = times(loop)
        asked[f"set point: {name}"] = lambda loop=loop, t=t: signals(pidalab.step_response(loop, t))
        asked[f"load: {name}"] = lambda loop=loop, t=t: signals(pidalab.load_response(loop, t))
    for name, loop in loops(("PI", "PIDA", "series")):
        t = times(loop, 1501, 25.0)
        asked[f"measures, set point: {name}"] = lambda loop=loop, t=t: measures(
            pidalab.step_response(loop, t)
        )
        asked[f"measures, load: {name}"] = lambda loop=loop, t=t: measures(pidalab.load_response(loop, t))
    for name, loop in loops(("PID", "high order")):
        t = times(loop, 57)
        wave = np.sin(np.arange(57.0))
        given = {"setpoint": np.where(t > 0.3 * t[-1], 1.0, 0.2), "load": 0.1 * wave, "noise": 0.05 * wave}
        asked[f"signals: {name}"] = lambda loop=loop, t=t, given=given: signals(
            pidalab.simulate(loop, t, **given)
        )
    for name, plant in PLANTS.items():
        t = np.linspace(0.0, 5.0 * size(plant)[1], 31)
        asked[f"open loop: {name}"] = lambda plant=plant, t=t: signals(pidalab.open_loop_step(plant, t))
    return asked


def summary(code):
    """Lines of a program, and a digest of its text with six digits of its numbers."""
    text = re.sub(r"\d+\.\d+(?:e[-+]?\d+)?", lambda number: f"{float(number[0]):.6g}", code)
    return len(text.splitlines()), hashlib.md5(text.encode()).hexdigest()


def digital():
    asked = {}
    settings = (
        {"method": "backward"},
        {"method": "tustin", "b": 0.4, "c": 0.0, "limits": (-0.3, 0.5)},
        {
            "method": "zoh",
            "rate_limit": 0.3,
            "anti_windup": "clamping",
            "limits": (-0.3, 0.5),
            "deadband": 0.02,
        },
        {
            "method": "backward",
            "tracking_time": 2.0,
            "anti_windup": "back-calculation",
            "limits": (-0.4, 2.0),
        },
        {"method": "backward", "bias": 0.2, "y_span": 2.0, "c": 0.3, "limits": (0.0, 0.9)},
        {
            "method": "tustin",
            "prefilter": control.tf([0.5, 1.0], [1.2, 1.6, 1.0]),
            "y_offset": 0.3,
            "u_span": 3.0,
        },
        {"method": "zoh", "output_filter": control.tf([1.0], [0.16, 0.8, 1.0]), "limits": (-0.3, 0.5)},
    )
    errors = np.sin(0.7 * np.arange(25.0)) * np.linspace(0.2, 1.4, 25)

    def made(controller, h, options):
        k = controller.discretise(h, **options)
        steps = [k.step(1.0, y) for y in errors[:20]]
        steps += [
            k.step(1.0, 0.3, manual=0.4),
            k.step(1.0, 0.2),
            k.step(1.0, 0.1, track=0.1),
            k.step(0.0, 0.0),
        ]
        return k.coefficients, steps, k.source

    for kind, controller in controllers(PLANTS["four lags"]).items():
        for i, options in enumerate(settings):
            for h in (0.01, 0.2):
                asked[f"steps: {kind}, {i}, {h}"] = lambda c=controller, h=h, o=options: made(c, h, o)
        for i in (1, 2, 3, 5):
            for language in ("c", "structured_text", "python", "json"):
                asked[f"{language}: {kind}, {i}"] = lambda c=controller, o=settings[i], language=language: (
                    summary(getattr(c.discretise(0.01, **o), language)())
                )

    def closed(loop, h, options):
        k = loop.controller.discretise(h, **options)
        digital = Loop(loop.process, k)
        return by_samples.margins_sampled(loop, k), pidalab.is_stable(digital), pidalab.noise_gain(digital, h)

    for name, loop in loops(("PI", "PIDA")):
        method = "tustin" if name.endswith("PI") else "backward"
        h = 0.009 * size(loop.process)[1]
        asked[f"digital loop: {name}"] = lambda loop=loop, h=h, m=method: closed(loop, h, {"method": m})
    return asked


def sampled():
    asked = {}
    wave = 0.02 * np.sin(1.7 * np.arange(601.0))

    def run(loop, controller, **options):
        t = np.linspace(0.0, 9.0 * size(loop.process)[1], 601)
        step = np.where(t > 0.5 * t[-1], -0.2, 0.0)
        if controller:
            h = t[-1] / 600
            loop = Loop(loop.process, loop.controller.discretise(h, "backward", limits=(-2.0, 1.5)))
        found = pidalab.simulate_sampled(loop, t, 1.0, step, wave, **options)
        return (
            signals(found),
            found.iae(),
            found.ise(),
            found.tv1(),
            found.between(0.2 * t[-1], 0.7 * t[-1]).itae(),
        )

    options = (
        {},
        {"limits": (-0.4, 0.7)},
        {"limits": (-0.1, 0.9), "anti_windup": "clamping"},
        {"quanta": (0.01, 0.05)},
        {"pulse_widths": 20, "limits": (0.0, 1.0)},
    )
    asked_for = itertools.product(loops(("PI", "PID", "series")), enumerate(options))
    for (name, loop), (i, one) in asked_for:
        if "series" in name and "anti_windup" in one:
            continue
        asked[f"sampled: {name}, {i}"] = lambda loop=loop, one=one: run(loop, False, **one)
    for name, loop in loops(("PID",)):
        asked[f"digital: {name}"] = lambda loop=loop: run(loop, True)
    plant = pidalab.AsymmetricPlant(
        control.tf([1.0], [2.0, 1.0]), 3.0, 5.0, control.tf([0.1], [0.5, 1.0]), 0.2
    )
    for i, one in enumerate(options):
        loop = Loop(pidalab.fopdt(1.0, 3.0, 0.5), PIDA(0.8, 3.0, 0.3, 0.0, 4))
        asked[f"asymmetric: {i}"] = lambda loop=loop, one=one: run(loop, False, plant=plant, **one)
    for name, loop in loops(("PI",)):
        h = 0.004 * size(loop.process)[1]
        asked[f"noise gain: {name}"] = lambda loop=loop, h=h: pidalab.noise_gain(loop, h)
    for name, loop in loops(("series",)):
        c = loop.controller
        grid = {"kp": c.kp * np.array([[0.2], [1.6]]), "ti": c.ti * np.array([0.9, 2.0, 7.0])}
        t = np.linspace(0.0, 9.0 * size(loop.process)[1], 301)
        late = np.where(t > t[-1] / 3, 0.5, 0.0)
        for i, one in enumerate(
            ({"setpoint": 1.0}, {"load": late, "limits": (-0.8, 0.9), "noise": 0.1 * late})
        ):
            asked[f"portrait: {name}, {i}"] = lambda loop=loop, t=t, one=one, grid=grid: pidalab.portrait(
                loop, grid, t, **one
            )
    return asked
