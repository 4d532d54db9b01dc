"""Compare a portrait (10,000 loops, 60,000 samples each) with single simulations by python-control.

The controllers are near the controller (25) of huba2024. The responses are load steps on an integrator with dead time,
T_s = 0.001, as in the paper's Fig. 3. The portrait is timed on all processors, and with one and two workers.
python-control integrates a few of these loops one after the other, in continuous time with a Padé approximation of the
dead time. Its time for all loops is extrapolated. Results are written to book/data/portrait_comparison.csv.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

import control
import numpy as np

import pidalab
from benchmarks.measure import clocked, write
from pidalab import Loop, SeriesPIDA

AROUND = {"kp": 0.17 / 1.8, "kd": 0.45, "ka": 0.1157 * 1.8, "ti": 0.36 * 1.8}  # T_d = 1.8
SPREAD, EACH = 0.2, 10  # relative range around the values above, and number of values of each parameter
FEW = (0, 5555, 9999)
PADE = 5
LIMITS = (-1.1, 0.1)
LOOP = Loop(
    pidalab.ipdt(1.0, delay=1.0), SeriesPIDA(**AROUND, filter_time=0.2, filter_order=4, limits=LIMITS)
)
T = 0.001 * np.arange(60_000)
RESULTS = "portrait_comparison"  # name of the table in book/data
COLUMNS = ("method", "sets", "seconds", "cpu_seconds", "seconds_for_all", "ratio", "iae_difference")


def grid() -> dict[str, np.ndarray]:
    """Return the parameters as arrays that broadcast to the grid."""
    values = (middle * np.linspace(1 - SPREAD, 1 + SPREAD, EACH) for middle in AROUND.values())
    return dict(zip(AROUND, np.ix_(*values), strict=True))


def one_set(index: int) -> SeriesPIDA:
    """Return the controller of a set in flat order."""
    values = {name: float(np.broadcast_to(x, (EACH,) * 4).flat[index]) for name, x in grid().items()}
    return SeriesPIDA(**values, filter_time=0.2, filter_order=4, limits=LIMITS)


def plain_system(own: SeriesPIDA, delay: float) -> control.NonlinearIOSystem:
    """Return the closed loop for python-control. The states are those of filter, reset, dead time and output."""
    pade = control.tf2ss(*control.pade(delay, PADE))
    A, b, c, d = (np.asarray(x) for x in (pade.A, pade.B[:, 0], pade.C[0], pade.D[0, 0]))
    n, low, high = own.filter_order, *own.limits

    def signal(x: np.ndarray) -> tuple[float, np.ndarray]:
        chain = np.concatenate([[-x[-1]], x[:n]])
        slopes = (chain[:-1] - chain[1:]) / own.filter_time
        second = (slopes[-2] - slopes[-1]) / own.filter_time
        wanted = own.kp * x[n - 1] + own.kd * slopes[-1] + own.ka * second + x[n]
        return min(max(wanted, low), high), slopes

    def update(t: float, x: np.ndarray, load: np.ndarray, params: dict) -> np.ndarray:
        u, slopes = signal(x)
        late, v = x[n + 1 : -1], u + load[0]
        return np.concatenate([slopes, [(u - x[n]) / own.ti], A @ late + b * v, [c @ late + d * v]])

    def output(t: float, x: np.ndarray, load: np.ndarray, params: dict) -> np.ndarray:
        return np.array([x[-1], signal(x)[0]])

    return control.nlsys(update, output, inputs=1, outputs=2, states=n + 2 + PADE)


def plain(own: SeriesPIDA, t: np.ndarray) -> pidalab.Response:
    """Simulate one set with python-control."""
    system = plain_system(own, LOOP.process.delay)
    out = control.input_output_response(system, t, np.ones_like(t), np.zeros(system.nstates))
    return pidalab.Response(t, r=0.0, d=1.0, n=0.0, y=out.outputs[0], u=out.outputs[1])


def main() -> None:
    """Measure times and differences. Print and write them."""
    pidalab.portrait(LOOP, {}, T[:100], load=1.0)  # compiles
    sets = EACH**4
    clock, cpu, portrait = clocked(lambda: pidalab.portrait(LOOP, grid(), T, load=1.0))
    iae = portrait.iae.ravel()
    rows = [("portrait", sets, clock, cpu, clock, 1.0, 0.0)]
    for workers, name in ((1, "portrait, one worker"), (2, "portrait, two workers")):
        with ThreadPoolExecutor(workers) as pool:
            clock_k, cpu_k, same = clocked(
                lambda pool=pool: pidalab.portrait(LOOP, grid(), T, load=1.0, executor=pool)
            )
        apart = float(np.max(np.abs(same.iae.ravel() / iae - 1)))
        rows.append((name, sets, clock_k, cpu_k, clock_k, clock_k / clock, apart))
    for method, simulate in (
        ("simulate_sampled", lambda own: pidalab.simulate_sampled(Loop(LOOP.process, own), T, 0.0, load=1.0)),
        ("python-control, input_output_response", lambda own: plain(own, T)),
    ):
        simulate(one_set(FEW[0]))
        few, few_cpu, records = clocked(lambda simulate=simulate: [simulate(one_set(i)) for i in FEW])
        worst = max(abs(r.iae() / iae[i] - 1) for r, i in zip(records, FEW, strict=True))
        rows.append(
            (method, len(FEW), few, few_cpu, few / len(FEW) * sets, few / len(FEW) * sets / clock, worst)
        )
    print(
        f"\n{sets} loops of {T.size} samples on {os.cpu_count()} processors; of the others {len(FEW)}, extrapolated"
    )
    print(f"{'':40}{'sets':>7}{'clock, s':>10}{'CPU, s':>9}{'for all, s':>12}{'ratio':>9}{'IAE off by':>12}")
    for method, count, *numbers, worst in rows:
        print(
            f"{method:40}{count:7}{numbers[0]:10.2f}{numbers[1]:9.2f}{numbers[2]:12.1f}{numbers[3]:9.0f}{worst:12.0e}"
        )
    write(RESULTS, COLUMNS, (dict(zip(COLUMNS, row, strict=True)) for row in rows))


if __name__ == "__main__":
    main()
