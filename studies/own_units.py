"""Plants in units of their own, and tables of studies that can be interrupted.

A loop can hardly be faster than the ultimate period Pu of its plant, and the gain of its controller can hardly exceed
the ultimate gain Ku. In these units plants of different speed are comparable:

=================  ===============  ========================================================
quantity           unit             consequence
=================  ===============  ========================================================
time               Pu               noise is sampled a hundred times in a period: Pu/100
gain of noise      Ku               1 is the gain of the proportional controller that makes the loop oscillate
IAE, load step     Pu/Ku            y moves by about 1/Ku, for about a period
IAE, set point     Pu
=================  ===============  ========================================================
"""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import pidalab
from pidalab import NoiseScale, Process, noise_scale
from pidalab.comparison.benchmarking import TABLES
from pidalab.comparison.judging import one_line
from pidalab.plant.tuning import perturbed_plants
from pidalab.simulation import sampled

DATA = Path(__file__).parents[1] / "book" / "data"
OFF = 0.2  # relative error of the model in gain, time scale and dead time
HORIZON = 24.0  # length of the first response, in ultimate periods
DIGITS = 5


def five_digits() -> None:
    """Compute responses to noise to only five digits, since slow loops take long."""
    sampled.FADED = 1e-7


OPTIMUM = ("plant", "order", "ms_limit", "noise_limit", "iae", "ms", "mks", "noise_gain", "filter_time")
GAINS = tuple(f"k{k}" for k in range(-1, 4))
WORST = ("ms_worst", "iae_worst")
COLUMNS = (*OPTIMUM, *GAINS, *WORST, "active", "reason")


def optimum(name: str, process: Process, order: int, ms: float, noise: float) -> dict[str, Any]:
    """Return a row with the least IAE within both limits, in units of the plant, or with the reason of failure."""
    own = noise_scale(process)
    row: dict[str, Any] = {"plant": name, "order": order, "ms_limit": ms, "noise_limit": noise}
    try:
        found = pidalab.optimal.load(
            process, order, ms=ms, noise_gain=noise * own.gain, sample_time=own.sample_time
        )
    except (ValueError, ArithmeticError) as refusal:
        return row | {"reason": one_line(refusal)}
    gains = found.controller.coefficients
    row |= {
        "iae": found.iae * own.gain / own.period,
        "ms": found.ms,
        "mks": found.mks / own.gain,
        "noise_gain": found.noise_gain / own.gain,
        "filter_time": found.controller.filter_time / own.period,
        "active": " ".join((*found.active, *found.edge)).replace(" = 0", "=0"),
    }
    row |= {f"k{k}": gain / (own.gain * own.period**k) for k, gain in enumerate(gains, start=-1)}
    return row | worst(found.loop(process), process, own)


def worst(loop: pidalab.Loop, process: Process, own: NoiseScale) -> dict[str, float]:
    """Return the largest Ms and IAE over the eight changed plants. Both are infinite if a loop is unstable."""
    loops = off(loop, process)
    if not all(pidalab.is_stable(other) for other in loops):
        return {"ms_worst": math.inf, "iae_worst": math.inf}
    largest = max(pidalab.max_sensitivity(other)[0] for other in loops)
    error = max(load_iae(other, own) for other in loops)
    return {"ms_worst": largest, "iae_worst": error * own.gain / own.period}


def least_robust(loop: pidalab.Loop, process: Process, own: NoiseScale) -> dict[str, float]:
    """Return the largest Ms over the eight changed plants, and the IAE on the plant with this Ms."""
    loops = off(loop, process)
    if not all(pidalab.is_stable(other) for other in loops):
        return {"ms_worst": math.inf, "iae_least_robust": math.inf}
    largest, which = max((pidalab.max_sensitivity(other)[0], i) for i, other in enumerate(loops))
    return {"ms_worst": largest, "iae_least_robust": load_iae(loops[which], own) * own.gain / own.period}


def off(loop: pidalab.Loop, process: Process) -> list[pidalab.Loop]:
    """Return the loops of the controller with the changed plants."""
    return [
        pidalab.Loop(plant, loop.controller, loop.output_filter) for plant in perturbed_plants(process, OFF)
    ]


def load_iae(loop: pidalab.Loop, own: NoiseScale) -> float:
    """Return the IAE of a load step."""
    from pidalab.simulation.exact import simulate_until_settled

    return simulate_until_settled(pidalab.load_response, loop, HORIZON * own.period).iae(horizon=math.inf)


# --- tables -----------------------------------------------------------------------------------------------------------


def written(value: Any) -> Any:
    """Return a number with few digits, for a file that people read."""
    return f"{value:.{DIGITS}g}" if isinstance(value, float) else value


def resume(
    file: str,
    columns: Sequence[str],
    tasks: Iterable[tuple[Any, ...]],
    key: Sequence[str],
    work: Callable[..., list[dict[str, Any]]],
    workers: int | None = None,
) -> None:
    """Compute the tasks that are not in the file yet, on all cores. Write the rows of each task when it is done.

    A task begins with the values of the columns `key`, which identify it.
    """
    from tqdm import tqdm

    path = (TABLES if (TABLES / file).exists() else DATA) / file
    if not path.exists():
        path.write_text(",".join(columns) + "\n", encoding="utf-8")
    with path.open(encoding="utf-8", newline="") as old:
        done = {tuple(row[name] for name in key) for row in csv.DictReader(old)}
    left = [task for task in tasks if tuple(str(written(value)) for value in task[: len(key)]) not in done]
    with (
        ProcessPoolExecutor(workers or os.cpu_count(), initializer=five_digits) as pool,
        path.open("a", encoding="utf-8", newline="") as out,
    ):
        writer = csv.DictWriter(out, columns, lineterminator="\n")
        runs = [pool.submit(work, *task) for task in left]
        for run in tqdm(as_completed(runs), total=len(runs), desc=file, unit="task"):
            writer.writerows({name: written(value) for name, value in row.items()} for row in run.result())
            out.flush()
