"""Questions at the edges: what is just allowed and just not, files of every kind, limits on noise."""

import math
import tempfile
from pathlib import Path

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
    areas,
    digital,
    optimal,
    robustness,
)
from pidalab.rules import automatic_reset, direct, haalman, itae, magnitude_optimum, mrdp
from pidalab.simulation.settling import settled
from pidalab.tuning import corners

FIRST, THIRD = PLANTS["first order"], pidalab.lags(3, 1.0, 1.0, 1.0)
LOOP = Loop(FIRST, PIDA(0.5, 2.0))
SERIES = SeriesPIDA(0.5, 0.1, 0.05, 2.0, 0.05, 4, (-1.0, 2.0))
T = np.linspace(0.0, 20.0, 401)
RESPONSE = Response(T, 1.0, 0.0, 0.02 * np.sin(T), 1 - np.exp(-T) * np.cos(2 * T), np.cos(T) * np.exp(-T))


def _variants(asked, door, call, *variants):
    """Ask the same door with one argument, or a tuple of them, after the other."""
    for i, variant in enumerate(variants):
        given = variant if isinstance(variant, tuple) else (variant,)
        asked[f"{door}, {i}"] = lambda given=given: call(*given)


def edges():
    """Arguments at the limits of what is allowed."""
    asked = {}
    inf, nan = math.inf, math.nan
    _variants(
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
    _variants(
        asked,
        "sopdt",
        pidalab.sopdt,
        (1.0, 1e-160, 0.5, 0.1),
        (1.0, 1e160, 0.5, 0.1),
        (1.0, 2.0, 0.0, 0.1),
        (1.0, 2.0, -0.1, 0.1),
    )
    _variants(
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
    _variants(
        asked, "fopdt", pidalab.fopdt, (1.0, 0.0, 0.1), (0.0, 1.0, 0.1), (1.0, 1.0, 0.0), (1.0, -1.0, 0.1)
    )
    _variants(
        asked,
        "at s",
        lambda p, s: PLANTS[p](s),
        ("first order", 0.0),
        ("integrator", 0.0),
        ("first order", 1e200),
        ("four lags", -2000.0),
        ("biproper", [0.1j, 1e5j]),
    )
    _variants(
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
    _variants(
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
    _variants(
        asked,
        "non-interactive",
        NonInteractivePIDA,
        (0.0, 1.0, 0.1, 0.1),
        (1.0, 1.0, 0.1, 0.1, 0.0),
        (1.0, 1.0, 0.0, 0.2),
        (1.0, inf, 0.1, 0.1),
        (-1.0, 2.0, 0.3, 0.2, 0.1, 0.1),
    )
    _variants(
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
    _variants(
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
        _variants(
            asked,
            f"controller, {kind}",
            lambda name, c=controller: getattr(c, name),
            "proportional",
            "limits",
            "automatic_reset",
        )
        _variants(asked, f"transfer function, {kind}", lambda c: c.transfer_function(), controller)
    _variants(
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
    _variants(
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
    _variants(
        asked,
        "frequencies",
        lambda w: LOOP.frequency_response(w).fresp,
        [0.1, 1.0],
        [1.0, 0.1],
        [0.0, 1.0],
        [-1.0, 1.0],
    )
    _variants(
        asked,
        "transfer",
        LOOP.transfer,
        ("y", "r", 0.0),
        ("u", "q", 1j),
        ("x", "r", 1j),
        ("e", "d", [0.1j, 1j]),
    )
    _variants(
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
        _variants(
            asked, name, getattr(pidalab, name), FIRST, 1.0, Loop(FIRST, PIDA(0.5, 2.0).discretise(0.1)), LOOP
        )
    _variants(asked, "poles", lambda count: pidalab.rightmost_poles(LOOP, count), 0, 1, 2, 7, 40, 1.5)
    _variants(
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
    _variants(
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
    _variants(
        asked,
        "response",
        lambda name, *given: getattr(RESPONSE, name)(*given),
        ("iae", 20.0),
        ("iae", 20.1),
        ("iae", 0.0),
        ("iae", -1.0),
        ("ise", inf),
        ("itae", inf),
        ("itae", 7.3, -2.0),
        ("itae", None, 0.1),
        ("ie", inf),
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
    _variants(
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
    _variants(
        asked,
        "record of",
        lambda t, **more: Response(t, 1.0, 0.0, 0.0, np.linspace(0, 1, np.size(t)), 0.0).iae(),
        [0.0, 1.0, 2.0],
        [0.0, 1.0, 2.1],
        [1.0, 2.0, 3.0],
        [0.0],
        [0.0, 1.0],
    )
    _variants(
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
        _variants(
            asked,
            f"sampled {k}",
            lambda kind, given=given: (
                pidalab.simulate_sampled(Loop(FIRST, controllers(FIRST)[kind]), T, 1.0, 0.2, **given).u
            ),
            "PI",
            "P",
            "series",
        )
    _variants(
        asked,
        "sample time",
        lambda h, end: pidalab.simulate_sampled(Loop(FIRST, SERIES), h * np.arange(end / h), 1.0).y,
        (0.05, 3.0),
        (0.0501, 3.0),
        (0.049, 3.0),
    )
    _variants(
        asked,
        "own limits",
        lambda *limits: pidalab.simulate_sampled(Loop(FIRST, SERIES), T, 1.0, limits=limits).u,
        (-0.5, 5.0),
        (-5.0, 0.6),
        (-5.0, -2.0),
    )
    _variants(
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
    _variants(asked, "noise gain", lambda h: pidalab.noise_gain(LOOP, h), 0.01, 0.35, 0.7, 1.4, 0.0, 1e-6)
    _variants(
        asked,
        "plant",
        lambda *given: AsymmetricPlant(*given),
        (control.tf([1.0], [2.0, 1.0]), 0.0, 5.0),
        (control.tf([1.0], [2.0, 1.0]), 3.0, 5.0, "a"),
        (FIRST, 1.0, 2.0),
        (control.tf([1.0, 1.0], [2.0, 1.0]), 1.0, 2.0),
        (2.0, 1.0, 2.0),
    )
    _variants(
        asked,
        "rising",
        lambda delay, direct: (lambda p: (repr(p.rising), repr(p.falling)))(
            AsymmetricPlant(control.tf([1.2], [0.7, 1.0]), 0.9, 2.5, direct, delay)
        ),
        (0.2, 0.0),
        (0.0, 0.4),
        (0.1, control.tf([0.1], [0.5, 1.0])),
    )
    _variants(
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
    for k, (name, value) in enumerate(
        (
            ("b", 0.3),
            ("b", -0.1),
            ("c", 0.5),
            ("rate_limit", 0.0),
            ("rate_limit", 0.2),
            ("bias", 3.0),
            ("deadband", -0.1),
            ("y_span", 0.0),
            ("u_span", -2.0),
            ("tracking_time", 0.0),
            ("tracking_time", 2.0),
            ("anti_windup", None),
            ("anti_windup", "back-calculation"),
            ("anti_windup", "clamping"),
            ("anti_windup", "other"),
            ("limits", (1.0, 0.5)),
            ("method", "forward"),
            ("sample_time", 0.0),
            ("sample_time", 0.2),
            ("output_filter", control.tf([1.0], [1.0, 2.0])),
            ("output_filter", control.tf([1.0, 1.0], [2.0, 1.0])),
            ("prefilter", control.tf([2.0], [1.0, 1.0])),
            ("prefilter", control.tf([1.0], [0.01, 1.0])),
            ("prefilter", control.tf([1.0], [1.0, -1.0])),
            ("prefilter", 1.0),
            ("prefilter", control.tf([0.3, 1.0], [1.5, 0.7, 1.0])),
            ("prefilter", control.tf([1.0], [0.25, 1.0, 1.0])),
            ("source", "a"),
        )
    ):
        for kind, method in (
            ("PI", "backward"),
            ("PIDA", "tustin"),
            ("high order", "zoh"),
            ("series", "backward"),
            ("P", "tustin"),
        ):
            given = {"sample_time": 0.02, "method": method, "limits": (-2.0, 2.0), name: value}
            _variants(
                asked,
                f"digital, {kind}, {name}, {k}",
                lambda kind, given=given: _digital(controllers(FIRST)[kind].discretise(**given)),
                kind,
            )
    _variants(
        asked,
        "from JSON",
        lambda text: repr(digital.from_json(text)),
        "",
        "{}",
        "[1]",
        PIDA(0.5, 2.0, 0.1).discretise(0.1).json(),
        PIDA(0.5, 2.0).discretise(0.1, limits=(-1.0, 1.0), prefilter=control.tf([1.0], [0.5, 1.0])).json(),
    )
    _variants(
        asked,
        "step",
        lambda *given: PIDA(0.5, 2.0).discretise(0.1).step(*given),
        (1.0,),
        (1.0, 0.5),
        (None, None),
        (math.nan, 1.0),
    )
    _variants(
        asked,
        "identifier",
        lambda name: PIDA(0.5, 2.0).discretise(0.1).c(name)[:300],
        "pid",
        "2a",
        "int",
        "a b",
        "",
    )
    for rule, call in {
        "haalman": lambda *given: haalman.tune(*given),
        "output filter": lambda *given: haalman.output_filter(*given),
        "mrdp": lambda *given: mrdp.tune(*given),
        "itae": lambda *given: itae.pida_setpoint(*given),
        "direct": lambda *given: direct.tune(*given),
        "orders": lambda *given: [(c.m, c.n, c.iae) for c in magnitude_optimum.rank_orders(*given)],
        "exact noise": lambda *given: magnitude_optimum.tune_for_exact_noise(*given),
        "noise": lambda *given: magnitude_optimum.tune_for_noise(*given),
        "filter time": lambda *given: magnitude_optimum.filter_time(*given),
        "reset": lambda *given: automatic_reset.tune(*given),
        "optimum": lambda *given: magnitude_optimum.tune(*given),
        "gains": lambda *given: magnitude_optimum.gains(*given),
        "design noise": lambda h: magnitude_optimum.noise_gain(magnitude_optimum.tune(THIRD, 2, 3, 0.2), h),
    }.items():
        variants = {
            "haalman": (
                (THIRD, 1.0),
                (THIRD, 1e7),
                (THIRD, 1.0001),
                (THIRD, 1.4, "PIDA", 0.0),
                (THIRD, 1.4, "PIDA", 1e9),
                (THIRD, 1.4, "D"),
                (PLANTS["no delay"], 1.4),
                (THIRD, 3.0, "PIDA", 1e-3, 0.5),
            ),
            "output filter": (
                (THIRD, haalman.pida(THIRD)),
                (THIRD, 1.0),
                (THIRD, PIDA(50.0, 1.0)),
                (pidalab.sopdt(1.0, 1.0, 0.5, 0.3), haalman.pid(pidalab.sopdt(1.0, 1.0, 0.5, 0.3))),
            ),
            "mrdp": (
                (FIRST, 1, 2, 0.1),
                (pidalab.ipdt(1.0, 0.0), 1, 2, 0.0),
                (pidalab.ipdt(1.0, 1.0), 1, 0, 0.1),
                (pidalab.ipdt(1.0, 1.0), 1, 2, 0.0),
                (pidalab.ipdt(1.0, 1.0), 1, 2, 0.01),
                (pidalab.ipdt(1.0, 1.0), 2, 40, 0.5),
                (pidalab.ipdt(1.0, 1.0), 0, 0, 0.0),
                (pidalab.ipdt(1.0, 0.0), 1, 2, 0.3),
                (pidalab.ipdt(2.0, 1.0), 2, 3, 0.4, 1),
            ),
            "itae": (
                (pidalab.sopdt(1.0, 1.0, 0.8, 0.5), 0.05, 0.025, lambda m: (0.5, 0.2)),
                (pidalab.sopdt(1.0, 1.0, 0.8, 0.5), 0.05, 0.025, lambda m: (1.0, 0.2)),
                (pidalab.sopdt(1.0, 1.0, 0.8, 0.5), 0.05, 0.025, lambda m: 1.0),
                (pidalab.sopdt(1.0, 1.0, 0.8, 0.0),),
            ),
            "direct": (
                (pidalab.sopdt(1.0, 1.0, 0.8, 0.5), "load", 0.1, 0.1),
                (pidalab.sopdt(1.0, 1.0, 0.8, 0.5), "other"),
                (pidalab.sopdt(1.0, 1.0, 0.2, 0.5), "load"),
                (FIRST,),
            ),
            "orders": ((THIRD, 5.0, 0.1, 2, 3), (FIRST, 3.0, 0.05, 1, 2)),
            "exact noise": (
                (THIRD, 1, 2, 4.0, 0.1),
                (THIRD, 2, 3, 9.0, 0.05),
                (FIRST, 0, 1, 0.7, 0.02),
                (THIRD, 1, 2, 1e-6, 0.1),
            ),
            "noise": (
                (THIRD, 1, 2, 4.0, 0.1, 0.5),
                (THIRD, 1, 2, 4.0, 0.1, None, 0),
                (THIRD, 1, 2, 4.0, 0.1, 0.5, 2),
                (THIRD, 2, 4, 9.0, 0.05, None, 5),
                (THIRD, 1, 0, 4.0, 0.1),
                (THIRD, 0, 1, 4.0, 0.1),
                (THIRD, 1, 2, 0.0, 0.1),
            ),
            "filter time": (
                (1.0, 1, 2, 5.0, 0.1),
                (2.0, 2, 4, 5.0, 0.1),
                (1.0, 0, 1, 0.1, 0.1),
                (1.0, 3, 3, 50.0, 0.1),
                (1.0, 1, 1, 5.0, 0.1),
                (0.0, 1, 2, 5.0, 0.1),
            ),
            "reset": (
                (FIRST, automatic_reset.PI, 2, 0.1),
                (pidalab.ipdt(1.0, 1.0), automatic_reset.PIDA_1, 1, 0.1),
                (pidalab.ipdt(1.0, 1.0), automatic_reset.PIDA_1, 4, 0.9),
                (pidalab.ipdt(1.0, 1.0), automatic_reset.PIDA_1, 4, 0.1, 0.5),
                (pidalab.ipdt(1.0, 0.0), automatic_reset.PI, 2, 0.1),
                (pidalab.ipdt(1.0, 1.0), automatic_reset.PID, 3, 0.1, 1.0, -1),
            ),
            "optimum": (
                (THIRD, 2, 1, 0.1),
                (THIRD, 2, 3, 0.0),
                (THIRD, 7, 8, 0.1),
                ([1.0, 2.0, 3.0, 4.0, 5.0], 1, 2, 0.1),
                ([0.0, 2.0, 3.0, 4.0], 1, 2, 0.1),
                ([1.0, 2.0], 1, 2, 0.1),
            ),
            "gains": (
                ([1.0, 4.0, 10.0, 20.0], 1),
                ([1.0, 4.0, 10.0, 20.0, 35.0, 56.0], 2),
                ([1.0, 2.0], 0),
                ([1.0], 0),
                ([1.0, 1.0, 1.0, 1.0], 1),
            ),
            "design noise": (0.1, 0.01, 0.5, 0.0),
        }[rule]
        for i, given in enumerate(variants):
            asked[f"{rule}, edge {i}"] = lambda call=call, given=given: designed(
                call(*(given if isinstance(given, tuple) else (given,)))
            )
    return asked


def designed(value):
    return (dict(value.info), value.controller) if isinstance(value, pidalab.Design) else value


def _digital(k):
    """Return what a digital controller is, and does at its limits."""
    signals = [k.step(1.0, y) for y in (0.0, 0.3, -4.0, 4.0, 1.2, 1.0, 1.0)]
    k.reset(0.2)
    return k.coefficients, signals, [k.step(r, 0.5) for r in (0.5, 2.0, 2.0)], str(k.prefilter), k.anti_windup


def optima():
    """Optima under limits on noise, and the words of those that there are not."""
    asked = {}
    for i, (plant, test, order, given) in enumerate(
        (
            (FIRST, "load", 1, {"ms": 1.6, "mks": 15.0}),
            (PLANTS["integrator"], "setpoint", 1, {"ms": 1.6, "mks": 15.0}),
            (FIRST, "load", 0, {"ms": 1.4}),
            (FIRST, "load", 1, {"ms": 1.5, "noise_gain": 4.0, "sample_time": 0.1}),
            (pidalab.ipdt(0.4, 1.3), "setpoint", 0, {"ms": 1.5, "noise_gain": 3.0, "sample_time": 0.2}),
            (FIRST, "load", 1, {"ms": 1.4, "mks": 0.05}),
            (FIRST, "load", 1, {}),
            (FIRST, "load", 1, {"ms": 1.0, "mks": 5.0}),
            (FIRST, "load", 1, {"noise_gain": 4.0}),
            (FIRST, "load", 1, {"sample_time": 4.0}),
            (Process([1.0, 0.0], [1.0, 1.0], 0.1), "load", 0, {"ms": 1.4, "mks": 9.0}),
            (PLANTS["biproper"], "load", 0, {"ms": 1.5, "mks": 3.0}),
            (PLANTS["unstable"], "load", 0, {"ms": 1.2, "mks": 3.0}),
            (PLANTS["two integrators"], "load", 0, {"ms": 1.4, "mks": 9.0}),
            (FIRST, "setpoint", 0, {"ms": 1.7, "mks": 1.2}),
            (1.0, "load", 0, {}),
            (PLANTS["no delay"], "load", 0, {"ms": 1.3, "mks": 4.0}),
        )
    ):
        asked[f"optimum, edge {i}"] = lambda p=plant, t=test, o=order, g=given: _found(
            getattr(optimal, t)(p, o, **g)
        )
    return asked


def _found(design):
    """Return what a search ends in."""
    return design.iae, design.ms, design.active, design.edge, design.source


def more():
    """Doors that few loops go through: ensembles, settling, digital prefilters, many loops, kept portraits."""
    asked = {}
    t = np.linspace(0.0, 15.0, 101)
    noise = 0.1 * np.sin(np.outer([1.0, 2.0, 3.7], np.arange(101.0)))
    asked["ensemble"] = lambda: [(r.y, r.u) for r in pidalab.simulate_ensemble(LOOP, t, noise, 1.0, 0.2)]
    asked["ensemble of none"] = lambda: pidalab.simulate_ensemble(LOOP, t, noise[:0])
    for name in ("first order", "lag", "integrator", "unstable", "no delay", "two integrators"):
        for kind in ("PI", "PID"):
            loop = Loop(PLANTS[name], controllers(PLANTS[name])[kind])
            asked[f"settled: {name}, {kind}"] = lambda loop=loop: settled(pidalab.load_response, loop, 3.0).t
    asked["many"] = lambda: [r.y for r in pidalab.simulate_many([LOOP, Loop(FIRST, 0.4)], t, 1.0)]
    asked["many margins"] = lambda: [(m.ms, m.gm) for m in pidalab.margins_many([LOOP, Loop(FIRST, 0.4)])]
    asked["limited, exactly"] = lambda: pidalab.step_response(
        Loop(FIRST, SeriesPIDA(0.5, 0.1, 0.0, 2.0, 0.05, 2, (-0.1, 0.2))), t
    )
    echoing = Loop(Process([0.9, 1.0], [1.0, 1.0], 0.01), 1.0)
    for end in (3.0, 2000.0):
        asked[f"echoes until {end}"] = lambda end=end: (
            pidalab.step_response(echoing, np.linspace(0.0, end, 101)).y
        )
    asked["wild"] = lambda: pidalab.step_response(Loop(FIRST, 90.0), np.linspace(0.0, 900.0, 31))
    for i, (num, den) in enumerate(
        (([1.0], [0.5, 1.0]), ([0.3, 1.0], [1.5, 0.7, 1.0]), ([2.0, 1.0], [1.0, 3.0, 3.0, 1.0]))
    ):
        for method in ("backward", "tustin", "zoh"):
            asked[f"prefilter: {i}, {method}"] = lambda n=num, d=den, m=method: _prefiltered(n, d, m)
    for kind in ("P", "PI", "PID", "PIDA", "high order", "series"):
        for method in ("backward", "tustin", "zoh"):
            asked[f"in z: {kind}, {method}"] = lambda k=kind, m=method: _in_z(
                controllers(FIRST)[k].discretise(0.01, m)
            )
    units = {
        "limits": (-1.0, 2.0),
        "bias": 0.3,
        "y_span": 2.0,
        "u_span": 3.0,
        "y_offset": 0.5,
        "deadband": 0.01,
        "rate_limit": 0.9,
    }
    for i, options in enumerate(
        (
            {},
            units,
            units | {"anti_windup": "clamping", "b": 0.4},
            {"prefilter": control.tf([1.0], [0.5, 1.0])},
        )
    ):
        for kind in ("PI", "PIDA", "series"):
            k = [
                controllers(FIRST)[kind].discretise(0.02, **options),
                PIDA(0.3, 2.0).discretise(0.02, **options),
            ]
            grid = {"controller": np.array(k, object)}
            asked[f"digital portrait: {kind}, {i}"] = lambda k=k, grid=grid: pidalab.portrait(
                Loop(FIRST, k[0]), grid, 0.02 * np.arange(400.0), 0.4, 0.1
            )
            asked[f"digital loop: {kind}, {i}"] = lambda k=k: (lambda r: (r.y, r.u))(
                pidalab.simulate_sampled(Loop(FIRST, k[0]), 0.02 * np.arange(400.0), 0.4, 0.1)
            )
    for i, (grid, h) in enumerate(
        (
            ({"controller": []}, 0.02),
            ({"controller": [1.0]}, 0.02),
            ({"kp": [1.0]}, 0.02),
            (3.0, 0.02),
            ({"controller": [PIDA(0.3, 2.0).discretise(0.03)]}, 0.02),
        )
    ):
        asked[f"digital portrait, edge {i}"] = lambda g=grid, h=h: pidalab.portrait(
            Loop(FIRST, PIDA(0.3, 2.0).discretise(0.02)), g, h * np.arange(50.0), 1.0
        )
    asked["kept portrait"] = _resumed
    plant = Process([1.0], np.poly([-1 / 9, -1 / 3, -1]) * 27, 0.4)
    for shape, sign in ((0.0, 1.0), (0.3, -1.0)):
        asked[f"spread: {shape}"] = lambda a=shape, b=sign: [
            repr(p) for p in corners(pidalab.fopdt(b * 2.0, 3.0, 0.5 + a), 0.2)
        ]
    asked["measured rule"] = lambda: _measured(plant, 4.0)
    asked["measured rule, noise"] = lambda: _measured(plant, 4.0, 0.003)
    return asked


def _measured(plant, time, noise=0.0):
    """Tune the magnitude optimum for the areas of a record."""
    t = np.linspace(0.0, 40 * time, 1601)
    y = pidalab.open_loop_step(plant, t).y
    u, y = np.where(t > 0, 1.0, 0.0), np.concatenate([[0.0], y[:-1]]) + noise * np.sin(t**1.7)
    found = areas.from_record(t, u, y, 4)
    return (
        found,
        designed(magnitude_optimum.tune(found, 0, 2, 0.3 * time)),
        designed(magnitude_optimum.tune(areas.from_record(t, u, y, 6), 1, 2, 0.3 * time)),
    )


def _prefiltered(num, den, method):
    k = PIDA(0.5, 2.0).discretise(0.1, method, prefilter=control.tf(num, den))
    z = np.exp([0.1j, 1.0j, 3.0j])
    return k.prefilter(z), str(k.prefilter), [k.step(1.0, 0.0) for _ in range(5)], k.coefficients


def _in_z(k):
    return (
        k.transfer_function(),
        [path.fraction() for path in k.paths],
        [path.order for path in k.paths],
    )


def _resumed():
    """Ask for a portrait twice, with what was computed kept in a file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "kept.npz"
        grid = {"kp": [0.2, 0.4, 0.6]}
        found = [
            pidalab.portrait(Loop(FIRST, SERIES), grid, T, 1.0, chunk=1, resume=path).iae for _ in range(2)
        ]
        try:
            pidalab.portrait(Loop(FIRST, SERIES), {"kp": [0.2]}, T, 1.0, resume=path)
        except ValueError as refusal:
            found.append(str(refusal).replace(folder, ""))
        return found
