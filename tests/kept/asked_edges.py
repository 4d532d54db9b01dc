"""Questions at the edges: what is just allowed and just not, of blocks, loops, responses and simulations."""

import math

import control
import numpy as np
from asked_loops import PLANTS, controllers

import pidalab
from pidalab import (
    PIDA,
    AsymmetricPlant,
    HighOrderPID,
    Loop,
    NonInteractivePIDA,
    Process,
    Response,
    SeriesPIDA,
    robustness,
)

FIRST, THIRD = PLANTS["first order"], pidalab.lags(3, 1.0, 1.0, 1.0)
LOOP = Loop(FIRST, PIDA(0.5, 2.0))
SERIES = SeriesPIDA(0.5, 0.1, 0.05, 2.0, 0.05, 4, (-1.0, 2.0))
T = np.linspace(0.0, 20.0, 401)
RESPONSE = Response(T, 1.0, 0.0, 0.02 * np.sin(T), 1 - np.exp(-T) * np.cos(2 * T), np.cos(T) * np.exp(-T))


def variants(asked, door, call, *variants):
    """Ask the same door with one argument, or a tuple of them, after the other."""
    for i, variant in enumerate(variants):
        given = variant if isinstance(variant, tuple) else (variant,)
        asked[f"{door}, {i}"] = lambda given=given: call(*given)


def blocks():
    """Processes, controllers and their products at the limits of what is allowed."""
    asked = {}
    inf, nan = math.inf, math.nan
    variants(
        asked,
        "process",
        Process,
        ([1.0], [1.0, 1.0], -0.1),
        ([1.0], [0.0, 2.0, 1.0]),
        ([0.0, 1.0], [1.0, 2.0], 1e-310),
        ([1.0, 2.0], [1.0]),
        ([], [1.0]),
        ([1.0], [0.0]),
        ([nan], [1.0]),
        ("a", [1.0]),
        ([1.0], [1.0], inf),
        ([0.0], [1.0, 1.0]),
        ([1e-320], [1.0, 1.0]),
        ([1j], [1.0]),
    )
    variants(
        asked,
        "sopdt",
        pidalab.sopdt,
        (1.0, 1e-160, 0.5, 0.1),
        (1.0, 1e160, 0.5, 0.1),
        (1.0, 2.0, 0.0, 0.1),
        (1.0, 2.0, -0.1, 0.1),
    )
    variants(
        asked,
        "lags",
        pidalab.lags,
        (0, 1.0),
        (1, 1.0),
        (2, 1e-200),
        (3, 1e200),
        (2.5, 1.0),
        (True, 1.0),
        (2, 0.0),
    )
    variants(
        asked, "fopdt", pidalab.fopdt, (1.0, 0.0, 0.1), (0.0, 1.0, 0.1), (1.0, 1.0, 0.0), (1.0, -1.0, 0.1)
    )
    variants(
        asked,
        "at s",
        lambda p, s: PLANTS[p](s),
        ("first order", 0.0),
        ("integrator", 0.0),
        ("first order", 1e200),
        ("four lags", -2000.0),
        ("biproper", [0.1j, 1e5j]),
    )
    variants(
        asked,
        "algebra",
        lambda name: {
            "times 2": lambda: FIRST * 2.0,
            "2 times": lambda: 2.0 * FIRST,
            "negative": lambda: -FIRST,
            "by 4": lambda: FIRST / 4.0,
            "in series": lambda: FIRST * control.tf([1.0], [3.0, 1.0]),
            "two": lambda: FIRST * PLANTS["no delay"],
            "word": lambda: FIRST * "a",
            "by 0": lambda: FIRST / 0.0,
            "state space": lambda: Process.from_control(control.ss([[-1.0]], [[2.0]], [[3.0]], [[0.0]]), 0.2),
            "controller times 3": lambda: 3.0 * PIDA(1.0, 2.0),
            "controller negative": lambda: -SERIES,
            "plant by plant": lambda: FIRST / FIRST,
            "rational": lambda: FIRST.rational_part(),
            "discrete": lambda: Process.from_control(control.tf([1.0], [1.0, 0.5], 0.1)),
            "two inputs": lambda: Process.from_control(
                control.ss([[-1.0]], [[1.0, 2.0]], [[1.0]], [[0.0, 0.0]])
            ),
            "equal": lambda: [pidalab.fopdt(1.7, 2.3, 0.7) == FIRST, FIRST == THIRD, FIRST == 1.0],
        }[name](),
        *(
            "times 2",
            "2 times",
            "negative",
            "by 4",
            "in series",
            "two",
            "word",
            "by 0",
            "state space",
            "controller times 3",
            "controller negative",
            "plant by plant",
            "rational",
            "discrete",
            "two inputs",
            "equal",
        ),
    )
    variants(
        asked,
        "PIDA",
        PIDA,
        (0.0, 1.0),
        (1.0, 0.0),
        (1.0, -1.0),
        (1.0, 1.0, -0.1),
        (1.0, 1.0, 0.1, -0.1),
        (1.0, 1.0, 0.0, 0.2),
        (1.0, 1.0, 0.1, 0.0, 0.0),
        (1.0, inf, 0.3, 0.1),
        (nan, 1.0),
        (-2.0, 3.0, 0.4, 0.1, 20.0, 5.0),
    )
    variants(
        asked,
        "non-interactive",
        NonInteractivePIDA,
        (0.0, 1.0, 0.1, 0.1),
        (1.0, 1.0, 0.1, 0.1, 0.0),
        (1.0, 1.0, 0.0, 0.2),
        (1.0, inf, 0.1, 0.1),
        (-1.0, 2.0, 0.3, 0.2, 0.1, 0.1),
    )
    variants(
        asked,
        "high order",
        HighOrderPID,
        ([1.0, 2.0], 0.1, 1),
        ([1.0, 2.0, 3.0], 0.0, 0),
        ([1.0, 2.0], 0.0, 2),
        ([1.0, 2.0], 0.1, 0),
        ([1.0], 0.0, 0),
        ([1.0, 2.0, 1.0], 0.1, 0),
        ([0.0, 0.0], 0.1, 1),
        ([0.1, 1, 1, 1, 1], 0.1, 3),
    )
    variants(
        asked,
        "series",
        SeriesPIDA,
        (0.5, 0.1, 0.05, 2.0, 0.05, 1),
        (0.5, 0.1, 0.0, 2.0, 0.05, 1),
        (0.5, 0.1, 0.05, 0.0, 0.05, 4),
        (0.5, 0.1, 0.05, 2.0, 0.05, 4, (1.0, -1.0)),
        (0.5, 0.0, 0.0, inf, 0.05, 4),
    )
    for kind, controller in controllers(FIRST).items():
        variants(
            asked,
            f"controller, {kind}",
            lambda name, c=controller: getattr(c, name),
            "proportional",
            "limits",
            "automatic_reset",
        )
        variants(asked, f"transfer function, {kind}", lambda c: c.transfer_function(), controller)
    return asked


def whole_loops():
    """Loops, their transfer functions, margins, poles and criteria."""
    asked = {}
    variants(
        asked,
        "loop",
        lambda *blocks: Loop(*blocks),
        (FIRST, FIRST),
        (1.0, 2.0),
        (FIRST, control.tf([1.0, 2.0, 1.0], [1.0, 3.0])),
        (FIRST, PIDA(1.0, 2.0), None, control.tf([1.0], [1.0, -1.0])),
        (FIRST, "PI"),
        (Process([1.0], [1.0]), -1.0),
        (AsymmetricPlant(control.tf([1.0], [2.0, 1.0]), 3.0, 5.0), 1.0),
        (FIRST, 0.0),
        (FIRST, PIDA(1.0, 2.0).discretise(0.1), control.tf([1.0], [1.0, 1.0])),
        (FIRST, control.tf([1.0], [1.0, 0.5], 0.1)),
    )
    variants(
        asked,
        "loop has",
        lambda name: getattr(LOOP, name),
        "blocks",
        "open_loop",
        "digital",
        "limits",
        "nothing",
        "automatic_reset",
    )
    variants(
        asked,
        "frequencies",
        lambda w: LOOP.frequency_response(w).fresp,
        [0.1, 1.0],
        [1.0, 0.1],
        [0.0, 1.0],
        [-1.0, 1.0],
    )
    variants(
        asked,
        "transfer",
        LOOP.transfer,
        ("y", "r", 0.0),
        ("u", "q", 1j),
        ("x", "r", 1j),
        ("e", "d", [0.1j, 1j]),
    )
    variants(
        asked,
        "well-posed",
        lambda gain, delay: pidalab.margins(Loop(Process([1.0, 2.0], [1.0, 1.0], delay), gain)),
        (-1.0, 0.0),
        (-1.0, 0.3),
        (-0.5, 0.0),
        (1.0, 0.1),
        (0.999, 0.1),
        (-1.2, 0.0),
    )
    for name in (
        "margins",
        "is_stable",
        "unstable_poles",
        "rightmost_poles",
        "max_sensitivity",
        "gain_crossovers",
    ):
        variants(
            asked, name, getattr(pidalab, name), FIRST, 1.0, Loop(FIRST, PIDA(0.5, 2.0).discretise(0.1)), LOOP
        )
    variants(asked, "poles", lambda count: pidalab.rightmost_poles(LOOP, count), 0, 1, 2, 7, 40, 1.5)
    variants(
        asked,
        "limits",
        robustness.linear_part,
        LOOP,
        Loop(pidalab.ipdt(1.0, 0.5), SERIES),
        Loop(PLANTS["unstable"], SERIES),
        Loop(PLANTS["biproper"], 0.5),
        Loop(PLANTS["two integrators"], SERIES),
        Loop(pidalab.ipdt(-1.0, 0.5), SERIES),
    )
    variants(
        asked,
        "smallest filter",
        lambda longest, shortest, border: robustness.smallest_filter_time(
            lambda t: t, lambda t: t > border, longest, shortest
        ),
        (1.0, None, 0.3),
        (1.0, None, 0.0),
        (1.0, 0.5, 0.3),
        (1.0, 1.0, 0.3),
        (1.0, 2.0, 0.3),
        (0.2, None, 0.3),
        (1.0, 0.9, 0.95),
        (7.0, 0.007, 0.00701),
    )
    return asked


def read_off_responses():
    """Measures of a response, and records that are none."""
    asked = {}
    variants(
        asked,
        "response",
        lambda name, *given: getattr(RESPONSE, name)(*given),
        ("iae", 20.0),
        ("iae", 20.1),
        ("iae", 0.0),
        ("iae", -1.0),
        ("ise", math.inf),
        ("itae", math.inf),
        ("itae", 7.3, -2.0),
        ("itae", None, 0.1),
        ("ie", math.inf),
        ("between", 3.0, 3.0),
        ("between", 5.0, 3.0),
        ("between", 3.01, 9.99),
        ("between", 3.0, 20.0),
        ("between", -1.0, 3.0),
        ("tv", "y"),
        ("tv", "x"),
        ("tv", "u", 3.02, 9.9),
        ("tv1", "y", 0.0, 4.0),
        ("tv1", "u", 5.0),
        ("tv", "u", 5.0, 5.0),
        ("saturated", (-0.2, 0.5)),
        ("saturated", (0.5, -0.2)),
        ("saturated", (-0.01, 0.9), 1.0, 9.0),
        ("rise_time", 0.0, 0.9),
        ("rise_time", 0.9, 0.1),
        ("rise_time", 0.1, 1.0),
        ("rise_time", 0.2, 0.95),
        ("settling_time", 1.0),
        ("settling_time", 0.0),
        ("settling_time", 1e-9),
        ("settling_time", 0.3),
        ("peak", "u"),
        ("peak", "x"),
        ("overshoot",),
        ("undershoot",),
        ("measured",),
    )
    variants(
        asked,
        "no set point",
        lambda name: getattr(Response(T, 0.0, 1.0, 0.0, np.exp(-T) * T, 0.0), name)(),
        "overshoot",
        "undershoot",
        "rise_time",
        "settling_time",
        "iae",
        "peak",
    )
    variants(
        asked,
        "record of",
        lambda t, **more: Response(t, 1.0, 0.0, 0.0, np.linspace(0, 1, np.size(t)), 0.0).iae(),
        [0.0, 1.0, 2.0],
        [0.0, 1.0, 2.1],
        [1.0, 2.0, 3.0],
        [0.0],
        [0.0, 1.0],
    )
    return asked


def simulated():
    """Sampled simulations, noise, asymmetric plants and portraits."""
    asked = {}
    variants(
        asked,
        "times",
        lambda *t: pidalab.step_response(LOOP, np.array(t)),
        (0.0, 1.0, 3.0),
        (1.0, 2.0),
        (0.0,),
        (0.0, -1.0),
        (0.0, 1.0, 2.0),
    )
    for k, given in enumerate(
        (
            {"limits": (1.0, -1.0)},
            {"limits": (0.5, 2.0)},
            {"limits": (0.0, 0.0)},
            {"quanta": (0.1, -0.1)},
            {"quanta": 0.1},
            {"pulse_widths": 10},
            {"pulse_widths": -1, "limits": (0.0, 1.0)},
            {"plant": 1.0},
            {"pulse_widths": 4, "limits": (0.0, 1.0), "quanta": (0.0, 0.1)},
            {"pulse_widths": 1, "limits": (-1.0, 1.0)},
            {"anti_windup": "reset"},
            {"anti_windup": "clamping", "limits": (-1.0, 1.0)},
            {"anti_windup": "tracking", "limits": (0.0, 0.4)},
        )
    ):
        variants(
            asked,
            f"sampled {k}",
            lambda kind, given=given: (
                pidalab.simulate_sampled(Loop(FIRST, controllers(FIRST)[kind]), T, 1.0, 0.2, **given).u
            ),
            "PI",
            "P",
            "series",
        )
    variants(
        asked,
        "sample time",
        lambda h, end: pidalab.simulate_sampled(Loop(FIRST, SERIES), h * np.arange(end / h), 1.0).y,
        (0.05, 3.0),
        (0.0501, 3.0),
        (0.049, 3.0),
    )
    variants(
        asked,
        "own limits",
        lambda *limits: pidalab.simulate_sampled(Loop(FIRST, SERIES), T, 1.0, limits=limits).u,
        (-0.5, 5.0),
        (-5.0, 0.6),
        (-5.0, -2.0),
    )
    variants(
        asked,
        "noise",
        lambda *given: pidalab.uniform_noise(T, *given),
        (0.1, 3),
        (0.0, 1),
        (-1.0, 1),
        (1e300, 1),
        (0.1, 3, 0.1),
        (0.1, 3, 0.07),
        (0.1, -1),
        (0.1, 1.5),
    )
    variants(asked, "noise gain", lambda h: pidalab.noise_gain(LOOP, h), 0.01, 0.35, 0.7, 1.4, 0.0, 1e-6)
    variants(
        asked,
        "plant",
        lambda *given: AsymmetricPlant(*given),
        (control.tf([1.0], [2.0, 1.0]), 0.0, 5.0),
        (control.tf([1.0], [2.0, 1.0]), 3.0, 5.0, "a"),
        (FIRST, 1.0, 2.0),
        (control.tf([1.0, 1.0], [2.0, 1.0]), 1.0, 2.0),
        (2.0, 1.0, 2.0),
    )
    variants(
        asked,
        "rising",
        lambda delay, direct: (lambda p: (repr(p.rising), repr(p.falling)))(
            AsymmetricPlant(control.tf([1.2], [0.7, 1.0]), 0.9, 2.5, direct, delay)
        ),
        (0.2, 0.0),
        (0.0, 0.4),
        (0.1, control.tf([0.1], [0.5, 1.0])),
    )
    variants(
        asked,
        "portrait",
        lambda given: pidalab.portrait(Loop(FIRST, SERIES), t=T, setpoint=1.0, load=0.1, **given),
        {"parameters": {}},
        {"parameters": {"kp": []}},
        {"parameters": {"kq": 1.0}},
        {"parameters": {"kp": [1.0, 2.0], "ti": [1.0, 2.0, 3.0]}},
        {"parameters": {"kp": ["a"]}},
        {"parameters": {"ti": [1.0, 0.0]}},
        {"parameters": 3.0},
        {"parameters": {"filter_time": [0.05, 0.2]}},
        {"parameters": {"kd": [0.0, 0.3], "ka": 0.0}},
        {"parameters": {"kp": [0.2, 0.6]}, "prefilter": ([1.0], [0.5, 1.0])},
        {"parameters": {"kp": [0.2, 0.6]}, "prefilter": ([1.0, 1.0], [0.5])},
        {"parameters": {"kp": [0.2, 0.6]}, "prefilter": 3},
        {"parameters": {"kp": [0.2, 0.6]}, "memory": 10.0},
        {"parameters": {"kp": [[0.2], [0.6]]}, "chunk": 1},
        {"parameters": {"kp": [0.2]}, "executor": 3},
        {"parameters": {"kp": [0.2, 900.0]}},
        {"parameters": {"kp": [0.4]}, "prefilter": ([[0.4, 0.3]], [0.6, 0.9, 1.0])},
        {"parameters": {"kp": [0.2, -0.1]}},
    )
    return asked
