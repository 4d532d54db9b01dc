"""Questions about methods: tuning rules, models of records and of plants, and the pieces of the search for optima."""

import itertools
import math

import numpy as np
from asked_loops import PLANTS, controllers, size
from kept import refused

import pidalab
from pidalab import Loop, Process, Record, areas, identification, reduction
from pidalab.optimal import _units
from pidalab.optimal._problem import Problem
from pidalab.optimal._solver import Limits, Search, _distinct, _valleys
from pidalab.optimal._starts import at_once
from pidalab.rules import automatic_reset, classical, direct, haalman, itae, magnitude_optimum, mrdp

SHARES = (0.1, 0.13, 0.3, 0.85, 0.95, 1.1, 1.9, 2.0, 2.1)  # of a dead time in a lag
MODELS = (
    PLANTS
    | {
        f"second order, {r}, {damping}": pidalab.sopdt(1.4, 2.0, damping, 2.0 * r)
        for r, damping in itertools.product(SHARES, (0.3, 0.5, 0.85, 1.0, 1.3, 2.0))
    }
    | {f"first order, {r}": pidalab.fopdt(0.7, 3.0, 3.0 * r) for r in (0.01, 0.1, 0.2, 0.5, 1.0, 2.0, 8.0)}
    | {
        "third order": Process([1.0], [0.905, 3.159, 3.37, 1.0], 0.826),
        "third order, slow pair": Process([1.0], np.polymul([2.0, 1.0], [4.0, 0.6, 1.0]), 0.5),
        "lags of all sizes": Process([2.0], np.poly([-1 / 9, -1 / 3, -1, -4]) * 6.75, 0.4),
        "two zeros": Process([0.3, 1.0, 1.2], [1.0, 3.0, 3.0, 1.0], 0.3),
        "zero at 0": Process([1.0, 0.0], [1.0, 2.0, 1.0], 0.2),
        "long tail": pidalab.lags(8, 0.4, 1.1, 0.2),
    }
)
EXTRA = tuple(MODELS)[-6:]
DESIGNS = {
    "amigo": lambda plant, kind: classical.amigo(plant, kind),
    "lambda": lambda plant, kind: classical.lambda_tuning(plant, kind),
    "lambda, 2": lambda plant, kind: classical.lambda_tuning(plant, kind, 2.0, 5),
    "simc": lambda plant, kind: classical.simc(plant, kind),
    "simc, 1.5": lambda plant, kind: classical.simc(plant, kind, 1.5, 4),
    "Ziegler-Nichols, step": lambda plant, kind: classical.ziegler_nichols_step(plant, kind),
    "Ziegler-Nichols, ultimate": lambda plant, kind: classical.ziegler_nichols_ultimate(plant, kind),
    "haalman": lambda plant, kind: haalman.tune(plant, 1.6, kind),
    "haalman, m": lambda plant, kind: haalman.tune(plant, 1.4, kind, 7, 9.0),
}


def _told(design):
    """What is known of a design, and its blocks at a frequency."""
    loop = design.loop()
    at = 0.7j / size(loop.process)[1]
    return dict(design.info), [loop.block(name, at) for name in ("controller", "output_filter", "prefilter")]


def rules():
    """Ask every rule about every model that it may take or refuse."""
    asked = {}
    for (name, plant), (rule, design) in itertools.product(MODELS.items(), DESIGNS.items()):
        for kind in ("PI", "PID", "PIDA") if "haalman" in rule else ("PI", "PID"):
            if rule == "haalman, m" and name not in PLANTS:
                continue
            few = plant.den.size > 2 and name not in PLANTS and name not in EXTRA
            if few and not ("simc" in rule or ("haalman" in rule and kind == "PID")):
                continue  # refused, as of a wrong order, or of no other branch
            asked[f"{rule}: {name}, {kind}"] = lambda d=design, p=plant, k=kind: _told(d(p, k))
    for name, plant in MODELS.items():
        for test in ("setpoint", "load"):
            asked[f"direct: {name}, {test}"] = lambda p=plant, t=test: _told(direct.tune(p, t))
            for kind in ("PID", "PIDA"):
                asked[f"ITAE: {name}, {test}, {kind}"] = lambda p=plant, t=test, k=kind: _told(
                    itae.tune(p, t, k)
                )
        asked[f"ITAE: {name}, IMC"] = lambda p=plant: itae.imc_pid(p)
        asked[f"ITAE: {name}, factors"] = lambda p=plant: [
            f(p) for f in (itae.factors, itae.setpoint_factors, itae.load_factors)
        ]
        for m, n in ((0, 1), (2, 4), (3, 3)):
            asked[f"magnitude optimum: {name}, {m}, {n}"] = lambda p=plant, m=m, n=n: _told(
                magnitude_optimum.tune(p, m, n, 0.03 * size(p)[1])
            )
        for m, n in ((2, 3),):
            asked[f"magnitude optimum for noise: {name}, {m}, {n}"] = lambda p=plant, m=m, n=n: _told(
                magnitude_optimum.tune_for_noise(p, m, n, 6.0, 0.01 * size(p)[1])
            )
    for m in range(6):
        asked[f"MRDP: {m}"] = lambda m=m: (
            mrdp.constants(m),
            [mrdp.prefilter_weights(m, k) for k in range(1, m + 2)],
        )
        for n in range(max(m, 1), 8):
            asked[f"MRDP: {m}, {n}"] = lambda m=m, n=n: (mrdp.filter_ratio(m, n), mrdp.smallest_te(m, n))
            asked[f"MRDP: {m}, {n}, tune"] = lambda m=m, n=n: _told(
                mrdp.tune(
                    pidalab.ipdt(-0.6, 1.7),
                    m,
                    n,
                    1.7 * (0.05 + mrdp.smallest_te(m, n)),
                    cancelled=1 + n % (m + 1),
                )
            )
    integrators = {
        "slow": pidalab.ipdt(0.02, 9.0),
        "fast": pidalab.ipdt(-30.0, 0.004),
        "lag": MODELS["integrator and lag"],
    }
    for name, setting in automatic_reset.SETTINGS.items():
        for model, plant in integrators.items():
            for n, share, weight, cancelled in (
                (2, 0.1, 1.0, 0),
                (4, 0.07, 0.6, 0),
                (3, 0.02, 0.0, 1),
                (5, 0.1, 1.0, 1),
            ):
                asked[f"automatic reset: {name}, {model}, {n}"] = (
                    lambda s=setting, p=plant, n=n, t=share, w=weight, c=cancelled: _told(
                        automatic_reset.tune(p, s, n, t * p.delay, w, c, limits=(-2.0, 1.5))
                    )
                )
    for name in ("first order", "four lags", "third order", "second order, 0.3, 0.85"):
        asked[f"words: {name}"] = lambda p=MODELS[name]: [
            refused(lambda design=design: str(design()))
            for design in (
                lambda: haalman.tune(p, 1.5, "PID"),
                lambda: haalman.tune(p, 1.5),
                lambda: magnitude_optimum.tune(p, 2, 3, 0.1),
                lambda: direct.tune(p),
                lambda: classical.simc(p),
            )
        ]
    asked["automatic reset: made"] = lambda: (
        [automatic_reset.double_zero(ratio) for ratio in (0.6, 1.0, 1.7)],
        [automatic_reset.multiple_pole(m) for m in (0, 1, 2)],
    )
    for rule, kind in itertools.product(
        ("simc", "haalman", "magnitude optimum", "mrdp", "itae", "direct", "lambda"), ("PI", "PID", "PIDA")
    ):
        for name in ("first order", "four lags", "integrator", "second order, 0.3, 0.85", "unstable"):
            asked[f"tune: {rule}, {kind}, {name}"] = lambda r=rule, k=kind, p=MODELS[name]: _told(
                pidalab.tune(p, k, 1.5, rule=r)
            )
    return asked


def models():
    """Plants made smaller, told apart, written down, and read as areas."""
    asked = {}
    for name, plant in MODELS.items():
        asked[f"ultimate: {name}"] = lambda p=plant: reduction.ultimate_frequency(p)
        asked[f"areas: {name}"] = lambda p=plant: areas.from_process(p, 6)
        asked[f"filtered areas: {name}"] = lambda p=plant: areas.with_binomial_filter(
            areas.from_process(p, 4), 0.3, 3
        )
        asked[f"words: {name}"] = lambda p=plant: (
            repr(p),
            p._repr_latex_(),
            p.gain(),
            p(0.3j),
            repr(-p),
        )
        asked[f"unit of time: {name}"] = lambda p=plant: [
            _units.unit_of_time(p, limits)
            for limits in (Limits(1.4, 20.0, None, None), Limits(2.0, None, 8.0, 0.1))
        ]
    for name in (*PLANTS, "third order", "long tail", "two zeros", "zero at 0", "second order, 0.3, 0.5"):
        asked[f"first order: {name}"] = lambda p=MODELS[name]: reduction.to_fopdt(p)
        asked[f"second order: {name}"] = lambda p=MODELS[name]: reduction.to_sopdt(p)
        asked[f"second order, 4: {name}"] = lambda p=MODELS[name]: reduction.to_sopdt(p, 4)
    for kind, controller in (
        controllers(PLANTS["four lags"]) | {"lag": controllers(PLANTS["lag"])["PIDA"]}
    ).items():
        asked[f"controller: {kind}"] = lambda c=controller: (repr(c), c.fraction(), c.parts(), c.gains())
        asked[f"forms: {kind}"] = lambda c=controller: [
            refused(form) for form in (c.gains().standard, c.gains().non_interactive, c.gains().series)
        ]
        asked[f"vendor: {kind}"] = lambda c=controller: str(c.vendor_forms())
    return asked


def _experiment(plant, samples, h, noise, seed=0, start=0, rest=0.2, step=1.5):
    """Times, input and output of a step test: at rest for a share of it, then a step."""
    t = start + h * np.arange(samples)
    first = round(rest * samples)
    y = np.concatenate(
        [np.zeros(first), step * pidalab.open_loop_step(plant, h * np.arange(samples - first)).y]
    )
    wave = np.sin(37.7 * np.arange(samples) ** 1.3 + seed)  # in place of noise: the same on every machine
    return t, np.where(np.arange(samples) < first, 2.0, 2.0 + step), 20.0 + y + noise * wave


def records():
    """Records of step tests, clean and not, through every way to a model."""
    asked = {}
    plants = (
        "first order",
        "lag",
        "damped",
        "oscillating",
        "four lags",
        "integrator",
        "inverse",
        "zero",
        "lag alone",
    )
    for name in plants:
        plant = PLANTS[name]
        time = size(plant)[1]
        for noise, samples in ((0.0, 120), (0.004, 300), (0.05, 90)):
            t, u, y = _experiment(plant, samples, 14.0 * time / samples, noise)
            record = Record(t, u, y)
            label = f"{name}, {noise}, {samples}"
            asked[f"record: {label}"] = lambda r=record: (
                str(r),
                r.sampling,
                r.step,
                r.noise,
                r.uniform(),
                r.after_step(),
                r.spectrum(),
            )
            asked[f"areas: {label}"] = lambda r=record: areas.from_record(r, count=4)
            asked[f"areas, linear: {label}"] = lambda t=t, u=u, y=y: areas.from_record(
                t, u, y, 3, between="linear"
            )
            for method in ("three_point", "ipdt_tangent", "ipdt_least_squares"):
                asked[f"{method}: {label}"] = lambda r=record, m=method: getattr(identification, m)(r)
        t = np.linspace(0.0, 9.0 * time, 80)
        y = pidalab.open_loop_step(plant, t).y
        asked[f"arrays: {name}"] = lambda t=t, y=y: [
            refused(lambda: identification.three_point(t, y, 1.3)),
            refused(lambda: identification.three_point(t, y, 1.3, (0.1, 0.4, 0.8), "sampled")),
            refused(lambda: identification.ipdt_tangent(t, y, -0.7, 0.4 * t[-1] / 9)),
            refused(lambda: identification.ipdt_least_squares(t, -y, 2.0, 0.35)),
            identification.binomial_filtered(t, y, 0.03 * t[-1], 3),
        ]
    for name in ("first order", "oscillating", "four lags", "integrator"):
        t, u, y = _experiment(PLANTS[name], 150, 0.1 * size(PLANTS[name])[1], 0.01)
        for model in ("auto", "fopdt") if name == "four lags" else ("auto",):
            asked[f"fit: {name}, {model}"] = lambda t=t, u=u, y=y, m=model: _fitted(
                identification.fit(Record(t, u, y), m)
            )
    t, u, y = _experiment(PLANTS["four lags"], 200, 0.4, 0.02)
    y[[17, 90]] = np.nan
    spoiled = {
        "gap": (np.delete(t, slice(100, 130)), np.delete(u, slice(100, 130)), np.delete(y, slice(100, 130))),
        "late": (t + 100.0, u, y),
        "coarse": (t, u, np.round(y, 1)),
        "outlier": (t, u, y + np.where(np.arange(200) == 120, 5.0, 0.0)),
        "two steps": (t, u + np.where(t > 50.0, 0.7, 0.0), y),
        "drift": (t, u, y + 0.01 * t),
        "backwards": (t[::-1], u[::-1], y[::-1]),
        "uneven": (t + 0.1 * np.sin(t), u, y),
        "short": (t[:50], u[:50], y[:50]),
        "slow noise": (t, u, y + 0.1 * np.sin(0.3 * t)),
        "still": (t, 0.0 * u, y),
    }
    for name, given in spoiled.items():
        asked[f"record: {name}"] = lambda given=given: (
            lambda r: (str(r), r.doubts, r.noise, r.steps, r.t, r.y)
        )(Record(*given))
        asked[f"areas: {name}"] = lambda given=given: areas.from_record(Record(*given), count=3)
    return asked


def _fitted(fit):
    return str(fit), fit.process, dict(fit.uncertainty), fit.deviation, fit.spread(2)


def search():
    """Ask the pieces of the search for optima: worth, limits and their slopes, where it starts."""
    asked = {}
    for name in ("first order", "four lags", "integrator", "unstable", "no delay", "inverse"):
        plant, limits = PLANTS[name], Limits(1.6, 15.0, None, None)
        unit = _units.unit_of_time(plant, limits)
        for order in (1, 2):
            asked[f"search: {name}, {order}"] = lambda p=plant, u=unit, o=order: _pieces(p, u, o)
    asked["valleys"] = lambda: (_valleys([3.0, 1.0, 1.001, 2.0, 1.5, 0.9]), _valleys([1.0]))
    asked["distinct"] = lambda: _distinct(
        [(1.0, np.ones(2)), (1.0, 1.001 * np.ones(2)), (0.9, np.zeros(2))], 2
    )
    return asked


def _pieces(plant, unit, order):
    problem = Problem(plant, order, (size(plant)[0], unit))
    one = Search(problem, Limits(1.6, 15.0, None, None))
    found = []
    for x in at_once(one)[:3]:
        value, slope = problem.worth(30.0)(x)
        limit, by_x = problem.limits(np.geomspace(0.1, 10.0, 5), 1.6, 15.0)(x)
        found += [x, value, slope(), limit, by_x(), problem.unstable(x), one.missed(x)]
    return found, one.rungs, math.log(unit), Loop(plant, 1.0)
