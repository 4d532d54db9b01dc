"""Reference values of a loop to a stated number of digits, and their checks.

Everything here is the same for every oracle of loops with dead time: make_delay_loops.py says what is
computed and why it can be trusted.
"""

import numpy as np
from delay_loop_series import by_talbot, circles, last_term, on_circles
from mpmath import mpf, nstr, workdps

ENVELOPE_DIGITS = 25  # the envelope is stored as floats


def difference(a, b):
    """Largest |a - b| / max(1, |b|) over all signals and times."""
    return max(abs(x - y) / max(1, abs(y)) for n in b for x, y in zip(a[n], b[n], strict=True))


def respond(case, times, digits):
    """Values at times, the last difference by doubling, and the nodes used."""
    places, nodes, size = circles(case, digits)
    precision, agree = int(size) + digits + 35, mpf(10) ** -(digits + 7)
    with workdps(precision):
        values = on_circles(case, times, places, nodes)
    for _ in range(4):
        before, nodes, precision = values, 2 * nodes, precision + 20
        with workdps(precision):
            values = on_circles(case, times, places, nodes)
            change = difference(before, values)
        if change < agree:
            return values, change, nodes
    raise ArithmeticError(f"{case['name']}: no convergence, {nstr(change, 3)}")


def check_talbot(case, values, digits):
    """Difference from Talbot at every third time from the last, up to 500 terms in all."""
    times, delay = case["times"], case["delay"]
    picked, terms = [], 0
    for i in range(len(times) - 1, -1, -3 if delay else -1):
        terms += last_term(times[i], delay)
        if not picked or terms < 500:
            picked.append(i)
    ours = {name: [row[i] for i in picked] for name, row in values.items()}
    before = None
    for degree in (60, 100, 160, 260, 420, 680, 1100):
        if degree < 2 * digits:  # the method yields 0.6 digits per degree at best
            continue
        with workdps(degree + 60):
            new = by_talbot(case, [times[i] for i in picked], degree)
            gap = difference(new, ours)
            if before and max(gap, difference(before, new)) < mpf(10) ** -(digits + 2):
                return gap
            before = new
    raise ArithmeticError(f"{case['name']}: Talbot differs by {nstr(gap, 3)}")


def reference(case, digits):
    """{signal: values at the case's times}, checked, and a line of evidence."""
    values, change, nodes = respond(case, case["times"], digits)
    talbot = check_talbot(case, values, digits)
    seen = f"{nodes:5d} nodes, change by doubling {nstr(change, 2)}, Talbot differs {nstr(talbot, 2)}"
    return values, f"{case['name']:28s}{len(case['times']):3d} times, {seen}"


def running_maximum(case):
    """Running maximum of |value| at the case's times, over these and its envelope_times."""
    grid = sorted({*case["times"], *case["envelope_times"]})
    dense, _, _ = respond(case, grid, ENVELOPE_DIGITS)
    pick = [grid.index(t) for t in case["times"]]
    size = {n: [abs(float(text(x, ENVELOPE_DIGITS))) for x in row] for n, row in dense.items()}
    return {n: np.maximum.accumulate(row)[pick] for n, row in size.items()}


def stored(case, values, digits, sources=("setpoint", "load", "noise")):
    """The case as it goes to the file."""
    out = {key: content for key, content in case.items() if key != "envelope_times"}
    out["values"] = nest(values, sources, lambda v: text(v, digits))
    if "envelope_times" in case:
        out["envelope"] = nest(running_maximum(case), sources, float)
    return out


def nest(values, sources, convert):
    """{"setpoint": {"y": [...], "u": [...]}, "load": ..., ...} for the sources named."""
    out = {}
    for name, row in values.items():
        source, signal = name.split(".")
        if source in sources:
            out.setdefault(source, {})[signal] = [convert(v) for v in row]
    return out


def text(v, digits):
    return nstr(v, digits) if abs(v) > mpf(10) ** -(digits + 5) else "0.0"
