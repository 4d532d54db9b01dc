"""Make between.json: values of loops with fast filters, at random times inside the intervals between dead times.

Each delay term is inverted alone by a fixed Talbot contour (`delay_loop_series.by_talbot`). The degree is raised until
two degrees agree to 1e-20 of the largest value. Circles (`respond`) are not used here, since poles up to 1e13 times
apart would need one circle each.

The times of each loop are drawn with a fixed seed. Run: python oracles/make_between.py
"""

import json
from multiprocessing import Pool
from pathlib import Path

import numpy as np
from delay_loop_series import by_talbot
from mpmath import mpf, nstr, workdps

from pidalab import PIDA, HighOrderPID, Loop, Process, fopdt, ipdt, lags, sopdt

DIGITS, TIMES, SPAN = 20, 3, 20.0
TO = Path(__file__).parents[1] / "tests" / "oracle" / "between.json"


def lag(time):
    return Process([1.0], [time, 1.0])


def loops():
    """Yield the names and loops."""
    yield "fopdt_fast_acceleration", Loop(fopdt(1, 1, 0.3713), PIDA(0.1, 0.9, 0.3, 0.02))
    for n, m in ((5, 5), (10, 10), (20, 50), (50, 20), (50, 50)):
        yield f"fopdt_{n}_{m}", Loop(fopdt(1, 1, 0.41), PIDA(0.12, 0.8, 0.25, 0.02, n=n, m=m))
        yield f"lags3_{n}_{m}", Loop(lags(3, delay=0.83), PIDA(1.1, 3.1, 0.9, 0.27, n=n, m=m))
    for m in (1e3, 1e5, 1e7, 1e9, 1e11, 1e13):
        yield f"lags3_m{m:.0e}", Loop(lags(3, delay=1.0), PIDA(1.0, 3.0, 1.0, 0.3, n=10, m=m))
    for time in (1e-5, 1e-7, 1e-9, 1e-11):
        yield f"lags2_filter_{time:.0e}", Loop(lags(2, delay=0.7), HighOrderPID([0.3, 0.6, 0.3], time, 2))
        yield (
            f"lags4_filter_{time:.0e}",
            Loop(lags(4, delay=0.9), HighOrderPID([0.25, 0.8, 0.9, 0.35], time, 3)),
        )
    yield "prefilter", Loop(lags(2, delay=0.5), PIDA(0.8, 2.0, 0.4, n=20), prefilter=lag(1.3))
    yield (
        "prefilter_fast",
        Loop(lags(2, delay=0.5), HighOrderPID([0.3, 0.6, 0.3], 1e-3, 2), prefilter=lag(1e-3)),
    )
    yield "output_filter", Loop(lags(3, delay=0.6), PIDA(0.9, 2.5, 0.7, n=50), output_filter=lag(1e-4))
    yield "zero_right", Loop(Process([-0.4, 1.0], [1.0, 2.2, 1.0], 0.37), PIDA(0.5, 1.9, 0.3, n=30))
    yield "zero_left_fast", Loop(Process([0.7, 1.0], [1.0, 3.0, 3.0, 1.0], 0.43), PIDA(0.7, 2.1, 0.4, n=1e6))
    yield "integrator", Loop(ipdt(1.0, 0.77), PIDA(0.45, 6.0, 0.2, n=15))
    yield "integrator_lag_fast", Loop(Process([1.0], [0.5, 1.0, 0.0], 0.61), PIDA(0.5, 7.0, 0.7, n=1e4))
    yield "double_lag_oscillating", Loop(sopdt(1.0, 0.6, 0.3, 0.29), PIDA(0.2, 0.7, 0.3, 0.05, n=8, m=25))
    yield "neutral", Loop(Process([0.3, 1.0], [1.0, 1.0], 0.53), PIDA(0.4, 2.0))
    yield "neutral_filtered", Loop(fopdt(1.0, 1.0, 0.47), PIDA(0.5, 1.2, 0.15, n=1e5))
    yield "unstable_process", Loop(Process([1.0], [1.0, -0.4], 0.35), PIDA(1.4, 6.0, 0.1, n=40))
    yield "long_dead_time", Loop(lags(2, delay=4.7), PIDA(0.3, 3.0, 0.5, 0.1, n=10, m=10))
    yield "short_dead_time", Loop(lags(2, lag=3.0, delay=0.71), PIDA(2.0, 8.0, 1.0, 0.3, n=20, m=3e4))


def case_of(number, name, loop):
    """Return the case in the format of delay_loop_series."""
    block = {
        key: dict(zip(("num", "den"), (part.tolist() for part in loop.blocks[key]), strict=True))
        for key in ("process", "controller", "output_filter", "prefilter")
    }
    rng = np.random.default_rng([49, number])
    times = np.sort(
        rng.uniform(0.2, 1.0, TIMES) * min(SPAN, (24 if number == 0 else 10) * loop.process.delay)
    ).tolist()
    return {"name": name, **block, "delay": loop.process.delay, "times": times}


def solve(item):
    case = case_of(*item)
    before = None
    for degree in (45, 70, 110, 180, 280):
        with workdps(degree + 60):
            found = by_talbot(case, case["times"], degree)
            if before:
                change = max(
                    abs(x - y) / max(1, *map(abs, found[key]))
                    for key in found
                    for x, y in zip(found[key], before[key], strict=True)
                )
                if change < mpf(10) ** -DIGITS:
                    break
            before = found
    else:
        raise ArithmeticError(f"{case['name']}: degrees still differ by {nstr(change, 3)}")
    values = {}
    for key, row in found.items():
        source, signal = key.split(".")
        values.setdefault(source, {})[signal] = [nstr(x, DIGITS) for x in row]
    return case | {"values": values}, f"{case['name']:28s} degree {degree}, change {nstr(change, 2)}"


def main():
    items = [(k, name, loop) for k, (name, loop) in enumerate(loops())]
    done = []
    with Pool(2) as pool:
        for case, line in pool.imap(solve, items):
            print(line, flush=True)
            done.append(case)
    about = f"Made by {Path(__file__).name}, which says how; see README.md for the format."
    TO.write_text(
        json.dumps({"about": about, "digits": DIGITS, "cases": done}, indent=1) + "\n", encoding="utf-8"
    )


if __name__ == "__main__":
    main()
