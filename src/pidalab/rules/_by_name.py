"""Rules by their name, for a kind of controller: what they take in common, and what the front doors decide for them."""

from __future__ import annotations

from collections.abc import Callable

from pidalab.process import Process
from pidalab.rules._design import Design

ORDER = {"PI": 0, "PID": 1, "PIDA": 2}


def _haalman(process: Process, kind: str, ms: float) -> Design:
    from pidalab.rules import haalman

    return haalman.tune(process, ms, kind)


def _classical(name: str) -> Callable[[Process, str, float], Design]:
    def rule(process: Process, kind: str, ms: float) -> Design:
        from pidalab.rules import classical

        if kind == "PIDA":
            raise ValueError(
                "kind must be 'PI' or 'PID' for a classical rule: none of them knows acceleration"
            )
        return getattr(classical, name)(process, kind)

    return rule


def _itae(process: Process, kind: str, ms: float) -> Design:
    from pidalab.rules import itae

    if kind != "PIDA":
        raise ValueError(f"kind must be 'PIDA' for the rule 'itae', found {kind!r}")
    return itae.tune(process, "load")


def _direct(process: Process, kind: str, ms: float) -> Design:
    from pidalab.rules import direct

    if kind != "PIDA":
        raise ValueError(f"kind must be 'PIDA' for the rule 'direct', found {kind!r}")
    return direct.tune(process, "load")


def _magnitude_optimum(process: Process, kind: str, ms: float) -> Design:
    from pidalab.rules import magnitude_optimum

    order = ORDER[kind]
    # a filter ten times faster than the process's own time, its area divided by its gain
    areas = _lag_time(process)
    return magnitude_optimum.tune(process, order, order + 1, 0.1 * areas / (order + 1))


def _lag_time(process: Process) -> float:
    """Sum of lags and dead time, the first area over the gain."""
    from pidalab.areas import from_process

    first = from_process(process, 2)
    return float(first[1] / first[0])


def _mrdp(process: Process, kind: str, ms: float) -> Design:
    from pidalab.rules import mrdp

    m = ORDER[kind]
    if process.delay == 0:
        raise ValueError(
            "model must have a dead time for the rule 'mrdp', whose times are shares of it, found none"
        )
    return mrdp.tune(
        process, m, m + 1, max(0.25 * process.delay, 1.2 * mrdp.smallest_te(m, m + 1) * process.delay)
    )


RULES: dict[str, Callable[[Process, str, float], Design]] = {
    "haalman": _haalman,
    "simc": _classical("simc"),
    "amigo": _classical("amigo"),
    "lambda": _classical("lambda_tuning"),
    "ziegler-nichols": _classical("ziegler_nichols_ultimate"),
    "itae": _itae,
    "direct": _direct,
    "magnitude optimum": _magnitude_optimum,
    "mrdp": _mrdp,
}
