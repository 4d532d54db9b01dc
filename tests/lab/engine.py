"""Run the lab's engine from Python, in a JavaScript interpreter."""

import json
from pathlib import Path

from py_mini_racer import MiniRacer

SCRIPT = Path(__file__).resolve().parents[2] / "book" / "_static" / "lab" / "engine.js"

# JSON has no infinity and no nan, so strings represent them.
CALL = """(name, text) => {
  const asked = JSON.parse(text), words = (key, x) =>
    ArrayBuffer.isView(x) ? [...x] : typeof x === "number" && !Number.isFinite(x) ? String(x) : x;
  try { return JSON.stringify(pidalabEngine[name](asked), words); }
  catch (error) { return JSON.stringify({error: String(error)}); }
}"""
NUMBERS = {"Infinity": float("inf"), "-Infinity": float("-inf"), "NaN": float("nan")}


class Engine:
    """Call `globalThis.pidalabEngine` with Python's numbers."""

    def __init__(self, source: str | None = None) -> None:
        self.context = MiniRacer()
        self.context.eval(SCRIPT.read_text(encoding="utf-8") if source is None else source)
        self.call = self.context.eval(CALL)

    def __getattr__(self, name):
        def function(**asked):
            answer = json.loads(self.call(name, json.dumps(asked)))
            if "error" in answer:
                raise ValueError(answer["error"])
            return {key: NUMBERS.get(x, x) if isinstance(x, str) else x for key, x in answer.items()}

        return function


def asked(process, controller, **more):
    """Return the engine's arguments for a Process and a HighOrderPID."""
    gains = [*controller.coefficients, 0.0, 0.0, 0.0][:4]
    return {
        "process": {"num": process.num.tolist(), "den": process.den.tolist(), "delay": process.delay},
        "controller": {
            "gains": gains,
            "filterTime": controller.filter_time,
            "filterOrder": controller.filter_order,
        },
        **more,
    }
