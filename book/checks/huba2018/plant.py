"""Section V of huba2018: the thermal plant of Figs 4 to 8, on a simulated twin and on the model."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pidalab
from matplotlib.figure import Figure
from pidalab import plots, twins
from pidalab.ledger import Ledger, every
from pidalab.rules import mrdp

from .designs import USED_DELAY, nominal, shortest_filter

ADDED = 7.0  # s, T_a of Fig. 8
HOLD = {"figs 5 to 7": 200.0, "fig 8": 400.0, "variants": 300.0}  # s
ASSUMED = {"rise": 30.0, "fall": 60.0, "conduction": 200.0, "share": 0.3, "dip": 0.05, "delay": 0.1}


@cache
def twin() -> pidalab.AsymmetricPlant:
    """Return the simulated plant."""
    return twins.thermal_plant()


def identified(book: Ledger) -> Figure:
    """Fig. 4: the step response of the twin, and the tangent at its steepest point."""
    t = np.linspace(0.0, 80.0, 4001)
    y = pidalab.open_loop_step(twin().rising, t).y
    found = pidalab.identification.ipdt_tangent(t, y)
    book.statement(
        "plant.tdm.used",
        abs(book.printed("plant.tdm") - USED_DELAY),
        "<=",
        book.row("plant.tdm").half_unit,
        left_name="difference",
        right_name="half a unit of the print, in s",
        note=f"{book.row('plant.tdm').printed} s is identified, {USED_DELAY:g} s stands in the captions. The text "
        "does not say why.",
    )
    steepest = t[(t > found.delay) & (t < 30.0)]
    figure, ax = plt.subplots(figsize=(6.4, 3.2))
    ax.plot(*plots.thin(t, 20 * y), label="twin, lamp from 0 to 20 %")
    ax.plot(steepest, 20 * found.num[0] * (steepest - found.delay), label="integrator with dead time")
    ax.set(xlabel="time, s", ylabel="temperature above ambient, K", xlim=(0, 80))
    ax.legend(loc="lower right")
    return figure


@cache
def fig5() -> dict[str, pidalab.Response]:
    """Run the controllers of Fig. 5 on the twin: T_e = 0.2 s, n = m + 2."""
    designs = {m: mrdp.tune(nominal(), m, m + 2, te=0.2) for m in (0, 1, 2)}
    return {f"m = {m}": twins.thermal_experiment(d.loop(), twin()) for m, d in designs.items()}


@cache
def fig6() -> dict[str, pidalab.Response]:
    """Run PID_4^2 on the twin, tuned for the dead times of Fig. 6."""
    models = {delay: pidalab.ipdt(0.01, delay=delay) for delay in (0.5, 1.0, 2.0, 4.0, 5.0, 8.0)}
    return {
        f"tuned for {delay:g} s": twins.thermal_experiment(mrdp.tune(model, 2, 4, te=0.2).loop(), twin())
        for delay, model in models.items()
    }


@cache
def fig7() -> dict[str, pidalab.Response]:
    """Run PID_6^4 on the twin with T_e = 0.8 s."""
    return {"m = 4": twins.thermal_experiment(mrdp.tune(nominal(), 4, 6, te=0.8).loop(), twin())}


@cache
def fig8() -> dict[str, pidalab.Response]:
    """Run the controllers of Fig. 8 on the twin with 7 s more: PI without filter, the others with T_e = 5 s."""
    longer, delayed = (
        pidalab.ipdt(0.01, delay=USED_DELAY + ADDED),
        replace(twin(), delay=twin().delay + ADDED),
    )
    designs = {m: mrdp.tune(longer, m, m + 2 if m else 0, te=5.0 if m else 0.0) for m in range(5)}
    return {
        f"m = {m}": twins.thermal_experiment(d.loop(), delayed, hold=HOLD["fig 8"])
        for m, d in designs.items()
    }


def drawn(runs: Mapping[str, pidalab.Response]) -> Figure:
    """Draw experiments: temperature above lamp power."""
    figure = plots.experiment(runs, "temperature, K", "lamp power, %", "time, s")
    figure.set_size_inches(6.4, 4.8)
    return figure


def step_measures(run: pidalab.Response, start: float, stop: float) -> dict[str, float]:
    """Measure the step of the set point between two times: per cent, s, K s, s, per cent."""
    part = run.between(start, stop)
    last = np.flatnonzero(np.abs(part.e) > 0.05 * abs(part.r[-1]))[-1]  # sample outside the band of 5 %
    return {
        "overshoot": part.overshoot(),
        "undershoot": part.undershoot(),
        "settling": part.step * (last + 1) if last + 1 < part.t.size else float("inf"),
        "iae": part.iae(),
        "saturated": run.saturated(twins.LAMP, start, stop),
        "tv": part.tv(),
    }


def measured(runs: Mapping[str, pidalab.Response], hold: float = HOLD["figs 5 to 7"]) -> pd.DataFrame:
    """Measure the step up and the step down of each run."""
    spans = {"up": (hold, 2 * hold), "down": (2 * hold, 3 * hold)}
    rows = {
        f"{label}, {way}": step_measures(run, *span)
        for label, run in runs.items()
        for way, span in spans.items()
    }
    return pd.DataFrame(rows).T.round(1)


def orders_on_twin(book: Ledger) -> pd.DataFrame:
    """Fig. 5 on the twin."""
    return measured(fig5())


def dead_times_on_twin(book: Ledger) -> pd.DataFrame:
    """Fig. 6 on the twin."""
    return measured(fig6())


def highest_on_twin(book: Ledger) -> pd.DataFrame:
    """Fig. 7 on the twin."""
    return measured(fig7())


def longer_on_twin(book: Ledger) -> pd.DataFrame:
    """Fig. 8 on the twin."""
    return measured(fig8(), HOLD["fig 8"])


def longer_on_model(book: Ledger) -> pd.DataFrame:
    """Fig. 8 on the model: oscillation over m, and how short T_e may be."""
    longer = pidalab.ipdt(gain=1.0, delay=1.0)
    te = {m: 5.0 / (USED_DELAY + ADDED) if m else 0.0 for m in range(5)}
    t, rows = np.linspace(0, 40, 8001), {}
    for m in range(5):
        loop = mrdp.tune(longer, m, m + 2 if m else 0, te[m]).loop()
        run = pidalab.step_response(loop, t)
        rows[m] = {
            "overshoot, %": run.overshoot(),
            "Ms": pidalab.margins(loop).ms,
            "variation of y": run.tv("y", final=1.0),
        }
    book.statement(
        "st.fig8.oscillation",
        rows[4]["variation of y"],
        "<",
        rows[0]["variation of y"],
        left_name="total variation of y with PID_6^4",
        right_name="PI",
        note="On the model with 12 s, set-point step, PI without filter and PID_6^4 with T_e = 5 s, little above "
        f"the shortest stable one: the output of PID_6^4 overshoots by {rows[4]['overshoot, %']:.0f} %, that of PI "
        f"by {rows[0]['overshoot, %']:.1f} %. The output of PI keeps its direction whatever the others do. T_e of "
        "the three controllers is not in the text, and the measurements are not published as numbers.",
    )
    limit = shortest_filter(4, 6)
    book.statement(
        "st.fig8.short",
        limit,
        "<",
        1 + limit,
        convention="negligible",
        left_name="shortest stable T_e",
        right_name="T_d, in T_dm",
        note=f"PID_6^4 on the model with {USED_DELAY + ADDED:g} s: stable from T_e = "
        f"{limit * (USED_DELAY + ADDED):.2f} s on, where T_d is {1 / limit + 1:.1f} times T_e.",
    )
    return pd.DataFrame(rows).T.rename_axis("m").round(3)


def simple_models(book: Ledger) -> pd.DataFrame:
    """Abstract: an integrator with dead time as the model of something else, here of three to eight equal lags."""
    t, rows, cases = np.linspace(0, 60, 3001), {}, {}
    for order in range(3, 9):
        plant = pidalab.lags(order)
        model = pidalab.identification.ipdt_tangent(t, pidalab.open_loop_step(plant, t).y)
        for m in range(5):
            loop = mrdp.tune(model, m, m + 2, te=0.25 * 1.5**m * model.delay).loop(plant)
            found, stable = pidalab.margins(loop), pidalab.is_stable(loop)
            cases[f"{order} lags, m = {m}"] = (found.gm if stable else 0.0, 1.0)
            rows[f"{order} lags, m = {m}"] = found.ms
    book.statement(
        "st.abstract.identification",
        *every(cases, ">"),
        left_name="gain margin, 0 if unstable",
        right_name="none left",
        note="Three to eight equal lags, a tangent at the steepest point of the step response as model, T_e from "
        "eq. (16) with T_e0 a quarter of T_dm and q = 1.5, n = m + 2, m from 0 to 4: Ms from "
        f"{min(rows.values()):.2f} to {max(rows.values()):.2f}. The thermal plant of the paper is another matter: "
        "its records are not published as numbers.",
    )
    table = pd.Series(rows).rename("Ms")
    table.index = pd.MultiIndex.from_tuples([tuple(name.split(", ")) for name in rows])
    return table.unstack().round(2)


@cache
def variants() -> list[pidalab.AsymmetricPlant]:
    """Return twins with one assumed number halved or raised by half, or with two or four lags."""
    changes: list[dict[str, Any]] = [{name: f * value} for name, value in ASSUMED.items() for f in (0.5, 1.5)]
    changes += [{"lags": lags} for lags in (2, 4)]
    return [twins.thermal_plant(**change) for change in changes]


@cache
def on_variants() -> tuple[dict[str, pd.DataFrame], dict[str, pd.DataFrame]]:
    """Measure six settings on all variants, steps up and steps down."""
    longer = pidalab.ipdt(0.01, delay=USED_DELAY + ADDED)
    settings = {
        "pi": (mrdp.tune(nominal(), 0, 2, 0.2), 0.0),
        "pida": (mrdp.tune(nominal(), 2, 4, 0.2), 0.0),
        "pida, 8 s": (mrdp.tune(pidalab.ipdt(0.01, delay=8.0), 2, 4, 0.2), 0.0),
        "m = 4": (mrdp.tune(nominal(), 4, 6, 0.8), 0.0),
        "m = 0, longer": (mrdp.tune(longer, 0, 0, 0.0), ADDED),
        "m = 4, longer": (mrdp.tune(longer, 4, 6, 5.0), ADDED),
    }
    up, down, hold = {}, {}, HOLD["variants"]
    for name, (design, extra) in settings.items():
        plants = [replace(plant, delay=plant.delay + extra) for plant in variants()]
        runs = [twins.thermal_experiment(design.loop(), plant, hold=hold) for plant in plants]
        up[name], down[name] = (
            pd.DataFrame([step_measures(run, *span) for run in runs])
            for span in ((hold, 2 * hold), (2 * hold, 3 * hold))
        )
    return up, down


def sensitivity_of_twin(book: Ledger) -> pd.DataFrame:
    """How many of the variants of the twin show each observation."""
    up, down = on_variants()
    shown = {
        "PIDA undershoots more than PI, upwards": up["pida"].undershoot > up["pi"].undershoot,
        "and less than half as much downwards": 2 * down["pida"].undershoot < up["pida"].undershoot,
        "its downward steps settle later": down["pida"].settling > up["pida"].settling,
        "tuned for 8 s it undershoots by less than 1 %": up["pida, 8 s"].undershoot < 1,
        "and overshoots by less than 10 % downwards": down["pida, 8 s"].overshoot < 10,
        "PID with m = 4 settles, both ways": np.isfinite(up["m = 4"].settling + down["m = 4"].settling),
        "and is longer at a limit downwards": down["m = 4"].saturated > up["m = 4"].saturated,
        "with 7 s more, m = 4 overshoots less than PI": down["m = 4, longer"].overshoot
        < down["m = 0, longer"].overshoot,
    }
    counts = {name: int(found.sum()) for name, found in shown.items()}
    return pd.Series(counts, name=f"of {len(variants())} twins").to_frame()
