"""Compare the exact simulation with other methods for loops with dead time.

Four loops of huba2018 are used, from stable and stiff to unstable. Results are written to
book/data/engine_comparison.csv. Times are CPU times of one thread without set-up, such as the compilation for JiTCDDE.
They vary between machines, so compare the ratios.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable

import numpy as np

import pidalab
from benchmarks import peers
from benchmarks.measure import case_loop, duration, error, limit, median_time, oracle_cases, write

LOOPS = [(1, 2, 0.005), (2, 4, 0.2), (4, 6, 0.5), (2, 3, 0.02)]  # m, n, T_e; the last one is unstable
HORIZON = 20.0  # in dead times; up to this time the unstable response stays below 1e8
CAP = 30  # largest CPU time for one row, in seconds
RESULTS = "engine_comparison"  # name of the table in book/data
COLUMNS = (
    "m",
    "n",
    "te",
    "method",
    "setting",
    "points",
    "seconds",
    "ratio",
    "error",
    "setup_seconds",
    "note",
)

Peer = Callable[..., peers.Task]
METHODS: dict[str, tuple[Peer, str, tuple]] = {
    "pidalab": (peers.exact, "none", (None,)),
    "python-control, Padé": (peers.pade, "order {}", (3, 5, 10, 20)),
    "zero-order hold": (peers.hold, "h/{}", (20, 100, 500, 2500)),
    "Runge–Kutta 4": (peers.runge_kutta, "h/{}", (20, 100, 500, 2500)),
    "JiTCDDE": (peers.jitcdde, "tolerance {:.0e}", (1e-4, 1e-7, 1e-10)),
    "ddeint": (peers.ddeint, "h/{}", (20, 100, 500)),
}


def case_of(m: int, n: int, te: float) -> dict:
    """Return the case of an integrator with dead time and the controller of the rule."""
    model = {"gain": 1.0, "delay": 1.0}
    design = {"m": m, "n": n, "te": te, "cancelled": m + 1}
    return next(c for c in oracle_cases("mrdp_loops.json") if c["model"] == model and c["design"] == design)


def measured(peer: Peer, loop: pidalab.Loop, setting: object, case: dict) -> dict:
    """Return one row of results. Times are medians of several runs, or of one run if it takes seconds."""
    row = dict.fromkeys(COLUMNS, "")
    try:
        with limit(CAP), warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # the error shows a failure
            start = time.perf_counter()  # use wall time, since a compiler runs in another process
            task = peer(loop, HORIZON, setting)
            row["setup_seconds"] = time.perf_counter() - start
            seconds, (t, y) = duration(task)
            if seconds < 2.0:
                seconds = median_time(task)
        row |= {"points": t.size, "seconds": seconds, "error": error(t, y, case)}
        row["note"] = "" if row["error"] < 1.0 else "no digit is right"
    except Exception as reason:
        row["note"] = str(reason).partition("\n")[0] or type(reason).__name__
    return row


def compare(m: int, n: int, te: float) -> list[dict]:
    """Return the rows of one loop."""
    case, rows = case_of(m, n, te), []
    loop = case_loop(case)
    for method, (peer, text, settings) in METHODS.items():
        for setting in settings:
            row = measured(peer, loop, setting, case)
            if peer is peers.jitcdde and row["points"]:
                bare = median_time(peers.jitcdde(loop, HORIZON, setting, output=False), 3)
                row["note"] = f"without output {bare:.2g} s"
            rows.append(row | {"m": m, "n": n, "te": te, "method": method, "setting": text.format(setting)})
    own = rows[0]["seconds"]
    for row in rows:
        row["ratio"] = row["seconds"] / own if row["points"] else ""
    return rows


def show(rows: list[dict]) -> None:
    """Print the table of one loop."""
    m, n, te = (rows[0][key] for key in ("m", "n", "te"))
    print(f"\nm = {m}, n = {n}, T_e = {te}: set-point step over {HORIZON:g} dead times")
    print(f"{'':40}{'points':>8}{'set-up, ms':>12}{'time, ms':>10}{'ratio':>8}{'error':>10}  note")
    for row in rows:
        name = f"{row['method']:22}{row['setting'] if row['setting'] != 'none' else '':18}"
        numbers = f"{'':48}"
        if row["points"]:
            numbers = f"{row['points']:8}{1e3 * row['setup_seconds']:12.1f}{1e3 * row['seconds']:10.1f}"
            numbers += f"{row['ratio']:8.2f}{row['error']:10.0e}"
        print(f"{name}{numbers}  {row['note']}")


def main() -> None:
    """Compare the methods for each loop. Print and write the results."""
    results = []
    for design in LOOPS:
        rows = compare(*design)
        show(rows)
        results += rows
    write(RESULTS, COLUMNS, results)


if __name__ == "__main__":
    main()
