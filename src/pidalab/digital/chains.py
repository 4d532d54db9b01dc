"""Statements of the linear parts of a step: the prefilter of the set point, and the chains of lags with their gains."""

from __future__ import annotations

from pidalab.digital.paths import Path
from pidalab.digital.prefilter import Prefilter
from pidalab.digital.statements import If, Note, Set, Statement


def part(i: int) -> str:
    """Name of the i-th path in code, in small letters, counted from 1."""
    return f"part_{i + 1}"


def share(path: Path, i: int, kind: str, j: int) -> str:
    """Name of a share of the j-th lag of the i-th path: one name for equal lags."""
    return f"{part(i).upper()}_{kind}" + ("" if _equal(path) else f"_{j}")


def path_constants(path: Path, i: int) -> dict[str, float]:
    """Constants of the i-th path by name; those that nothing needs are left out."""
    name = part(i).upper()
    found = {f"{name}_WEIGHT": path.weight} if path.weight not in (0.0, 1.0) else {}
    for kind, shares in (("NEW", path.new), ("OLD", path.old)):
        found |= {share(path, i, kind, j): value for j, value in enumerate(shares, start=1) if value}
    return found | {f"{name}_GAIN_{m}": gain for m, gain in enumerate(path.gains) if gain}


def prefilter_constants(prefilter: Prefilter) -> dict[str, float]:
    """Constants of a prefilter by name."""
    found: dict[str, float] = {}
    for i, row in enumerate(prefilter.move, start=1):
        found |= {f"PREFILTER_MOVE_{i}_{j}": x for j, x in enumerate(row, start=1) if x}
    return found | {f"PREFILTER_OUT_{i}": x for i, x in enumerate(prefilter.out, start=1) if x}


def prefilter_states(prefilter: Prefilter) -> list[str]:
    """Names of the states of a prefilter: the last set point, where it is needed, and those that move."""
    return [f"prefilter_{j}" for j in range(0 if prefilter.old else 1, len(prefilter.out) + 1)]


def prefilter_statements(prefilter: Prefilter, found: dict[str, float]) -> list[Statement]:
    """Statements that filter the set point."""
    n = len(prefilter.out)
    shares = ((prefilter.new, "target"), (prefilter.old, "prefilter_0"))
    aim = " + ".join(x if value == 1.0 else f"{value!r} * {x}" for value, x in shares if value)
    body: list[Statement] = [
        Note("set-point prefilter: its states move towards the set point"),
        If("not started", [Set(x, "target") for x in prefilter_states(prefilter)]),
        Set("aim", aim),
        *([Set("prefilter_0", "target")] if prefilter.old else []),
        *(Set(f"distance_{j}", f"prefilter_{j} - aim") for j in range(1, n + 1)),
    ]
    for i in range(1, n + 1):
        name, x = f"PREFILTER_MOVE_{i}_", f"prefilter_{i}"
        terms = [f"{name}{j} * distance_{j}" for j in range(1, n + 1) if f"{name}{j}" in found]
        body += [Set(x, f"{x} + ({' + '.join(terms)})")] if terms else []
    outs = [(f"PREFILTER_OUT_{i}", f"prefilter_{i}") for i in range(1, n + 1)]
    terms = [f"{gain} * ({x} - target)" for gain, x in outs if gain in found]
    return body + ([Set("target", f"target + ({' + '.join(terms)})")] if terms else [])


def path_states(path: Path, i: int) -> list[str]:
    """Names of the states of a path: its input, where lags need that of one sample ago, and its lags."""
    return [f"{part(i)}_{j}" for j in range(0 if any(path.old) else 1, path.order + 1)] if path.order else []


def path_statements(path: Path, i: int, found: dict[str, float]) -> list[Statement]:
    """Statements of a chain of lags and the gains on its differences."""
    name, n, upper = part(i), path.order, part(i).upper()
    aim = {1.0: "target", 0.0: "0.0"}.get(path.weight, f"{upper}_WEIGHT * target")
    lags = f": {n}{' equal' * _equal(path)} lag{'s' if n > 1 else ''}" if n else ""
    # the path's own name is an identifier, which no comment can mistake
    body: list[Statement] = [
        Note(f"part {i + 1}, {path.name.replace('_', ' ')}{lags}"),
        Set("entering", f"{aim} - measured"),
    ]
    level = ["entering", *(f"{name}_{j}" for j in range(1, n + 1))]
    if n:
        body.append(If("not started", [Set(x, "entering") for x in path_states(path, i)]))
    if any(path.new) and any(path.old):
        body += [Set("before", f"{name}_0")]
        for j in range(1, n + 1):
            x = f"{name}_{j}"
            new, old = (share(path, i, kind, j) for kind in ("NEW", "OLD"))
            step = f"{x} + ({new} * ({level[j - 1]} - {x}) + {old} * (before - {x}))"
            body += [Set("after", step), Set("before", x), Set(x, "after")]
    elif any(path.new):
        for j in range(1, n + 1):
            x = f"{name}_{j}"
            body.append(Set(x, f"{x} + {share(path, i, 'NEW', j)} * ({level[j - 1]} - {x})"))
    elif n:  # the last lag first: each takes what the one before it was
        for j in range(n, 0, -1):
            x = f"{name}_{j}"
            body.append(Set(x, f"{x} + {share(path, i, 'OLD', j)} * ({name}_{j - 1} - {x})"))
    body += [Set(f"{name}_0", "entering")] if any(path.old) else []
    # differences that end at the last state, of one order after the other
    first = i == 0
    highest = max((m for m, gain in enumerate(path.gains) if gain), default=0)
    for m in range(highest + 1):
        for j in range(n, n - (highest - m) - 1 if m else n, -1):
            body.append(Set(f"difference_{j}", f"{level[j - 1]} - {level[j]}"))
        if m:
            level = [f"difference_{j}" if j >= n - (highest - m) else x for j, x in enumerate(level)]
        if f"{upper}_GAIN_{m}" in found:
            term = f"{upper}_GAIN_{m} * {level[n]}"
            body.append(Set("summed", term if first else f"summed + {term}"))
            first = False
    return body + ([Set("summed", "0.0")] if first else [])


def _equal(path: Path) -> bool:
    return len({*path.new}) == len({*path.old}) == 1
