"""Find the optima that the lab has in store and write them to book/_static/lab/optima.js (a minute).

For each of the lab's plants the PI, PID and PIDA with the least IAE after a step of the load, under the limits below.
The tests hold what is stored against the limits, and one of them against a new search.
"""

import json
from pathlib import Path

from py_mini_racer import MiniRacer

import pidalab
from pidalab import optimal

LAB = Path(__file__).resolve().parents[1] / "book" / "_static" / "lab"
MS, NOISE = 1.4, 20.0  # largest Ms, and largest gain from noise to control, in units of 1/gain of the plant
KINDS = ("PI", "PID", "PIDA")
HEAD = """/* Optima in store: the least IAE that `pidalab.optimal.load` found for each plant of the lab, with Ms at most
   {ms:g} and a gain from noise to u of at most {noise:g}/K, K the gain of the plant. Written by tools/optima.py. */
globalThis.pidalabOptima = """


def plants() -> dict[str, pidalab.Process]:
    """The lab's plants."""
    context = MiniRacer()
    context.eval("\n".join((LAB / f"{name}.js").read_text(encoding="utf-8") for name in ("engine", "model")))
    found = json.loads(context.eval("JSON.stringify(pidalabModel.PLANTS)"))
    return {key: pidalab.Process(p["num"], p["den"], p["delay"]) for key, p in found.items()}


def gain(process: pidalab.Process) -> float:
    """Static gain, or velocity gain of a plant that integrates."""
    den = process.den[process.den != 0]
    return float(process.num[-1] / den[-1])


def best(process: pidalab.Process, kind: str) -> dict[str, float]:
    """The optimum of one kind, in the lab's form, rounded to more digits than the search is sure of."""
    order = KINDS.index(kind)
    design = optimal.load(process, order, ms=MS, mks=NOISE / abs(gain(process)))
    ki, kp, kd, ka = [*design.controller.coefficients, 0.0, 0.0][:4]
    values = {
        "kp": kp,
        "ti": kp / ki,
        "td": kd / kp,
        "ta": ka / kp,
        "filterTime": design.controller.filter_time,
    }
    return {key: float(f"{value:.7g}") for key, value in values.items()} | {"filterOrder": order + 1}


def main() -> None:
    """Find all of them and write the file."""
    designs = {key: {kind: best(process, kind) for kind in KINDS} for key, process in plants().items()}
    lines = ",\n".join(
        f'  "{key}": {{\n' + ",\n".join(f'    "{k}": {json.dumps(x)}' for k, x in each.items()) + "\n  }"
        for key, each in designs.items()
    )
    text = f"{HEAD.format(ms=MS, noise=NOISE)}{{ ms: {MS:g}, noise: {NOISE:g}, designs: {{\n{lines}\n}} }};\n"
    (LAB / "optima.js").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
