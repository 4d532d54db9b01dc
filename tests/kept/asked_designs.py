"""Questions at the edges: digital controllers, tuning rules, optima, and doors that few loops go through."""

import math

import control
import numpy as np
from asked_edges import FIRST, LOOP, THIRD, variants
from asked_loops import PLANTS, controllers

import pidalab
from pidalab import (
    PIDA,
    Loop,
    Process,
    SeriesPIDA,
    areas,
    digital,
    optimal,
)
from pidalab.rules import automatic_reset, direct, haalman, itae, magnitude_optimum, mrdp
from pidalab.simulation.settling import settled
from pidalab.tuning import corners


def in_computers():
    """Digital controllers, with one option after the other changed."""
    asked = {}
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
            variants(
                asked,
                f"digital, {kind}, {name}, {k}",
                lambda kind, given=given: _digital(controllers(FIRST)[kind].discretise(**given)),
                kind,
            )
    variants(
        asked,
        "from JSON",
        lambda text: repr(digital.from_json(text)),
        "",
        "{}",
        "[1]",
        PIDA(0.5, 2.0, 0.1).discretise(0.1).json(),
        PIDA(0.5, 2.0).discretise(0.1, limits=(-1.0, 1.0), prefilter=control.tf([1.0], [0.5, 1.0])).json(),
    )
    variants(
        asked,
        "step",
        lambda *given: PIDA(0.5, 2.0).discretise(0.1).step(*given),
        (1.0,),
        (1.0, 0.5),
        (None, None),
        (math.nan, 1.0),
    )
    variants(
        asked,
        "identifier",
        lambda name: PIDA(0.5, 2.0).discretise(0.1).c(name)[:300],
        "pid",
        "2a",
        "int",
        "a b",
        "",
    )
    return asked


def by_rules():
    """Tuning rules, each at the limits of its ground."""
    asked = {}
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
    for i, (plant, order, given) in enumerate(
        (
            (FIRST, 0, {"ms": 1.4}),
            (pidalab.ipdt(0.4, 1.3), 0, {"ms": 1.5, "noise_gain": 3.0, "sample_time": 0.2}),
            (FIRST, 1, {"ms": 1.4, "mks": 0.05}),
            (FIRST, 1, {"ms": 1.0, "mks": 5.0}),
            (FIRST, 1, {"noise_gain": 4.0}),
            (FIRST, 1, {"sample_time": 4.0}),
            (Process([1.0, 0.0], [1.0, 1.0], 0.1), 0, {"ms": 1.4, "mks": 9.0}),
            (PLANTS["biproper"], 0, {"ms": 1.5, "mks": 3.0}),
            (PLANTS["unstable"], 0, {"ms": 1.2, "mks": 3.0}),
            (PLANTS["two integrators"], 0, {"ms": 1.4, "mks": 9.0}),
            (1.0, 0, {}),
            (PLANTS["no delay"], 0, {"ms": 1.3, "mks": 4.0}),
        )
    ):
        asked[f"optimum, edge {i}"] = lambda p=plant, o=order, g=given: _found(optimal.load(p, o, **g))
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
            asked[f"digital loop: {kind}, {i}"] = lambda k=k: (lambda r: (r.y, r.u))(
                pidalab.simulate_sampled(Loop(FIRST, k[0]), 0.02 * np.arange(400.0), 0.4, 0.1)
            )
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
