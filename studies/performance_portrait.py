"""Search settings of the series PIDA of huba2024, in the loop of its Fig. 3.

Run it from the root of the project; it writes two tables to book/data in about two minutes. The page
book/audit/huba2024-portrait.ipynb shows them and runs the winners again.
"""

import sys

import numpy as np

import pidalab
from pidalab.rules import automatic_reset as ar

sys.path.insert(0, "book")
from papers import huba2024 as setup

BOUND = 1e-3  # of (23)
MAPS = """\
# Best settings of grids within 30 % of huba2024, eq. (25): so many values for each of four parameters, T_s = 0.001,
# limits of Paper Fig. 3. `fulfil` counts the settings that fulfil (23) after a load. What the best is judged by:
# load: IAE after a load; both: the same, (23) asked of the set point too; sum: IAE of load and set point added, and
# (23) asked of both; setpoint: IAE of the set point, and (23) asked of it.
# Written by studies/performance_portrait.py.
values,fulfil,judged,kappa,td,ta,ti
"""
CLEAN = """\
# Settings of the series PIDA of huba2024 whose y and u keep their shapes (excess at most 0.001) after steps of load
# and set point with the dead times 0.8, 1.0 and 1.2, T_s = 0.005, of 3528 that were asked; IAE after a load with
# T_s = 0.001 and the dead time 1, and the sensitivity. Written by studies/performance_portrait.py.
kappa,td,ta,ti,iae,ms
"""


def mesh(*axes):
    """Return all combinations of the values on four axes."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))


def write(name, head, rows):
    """Write a table with its head."""
    with open(f"book/data/{name}.csv", "w", encoding="utf-8") as file:
        file.write(head)
        file.writelines(",".join(row) + "\n" for row in rows)


def maps():
    """Return the results of grids of 5 to 10 values, of the finest by four measures."""
    rows, centre = [], setup.point(ar.PPM_PIDA)
    for values in range(5, 11):
        spots = mesh(*(np.linspace(0.7 * x, 1.3 * x, values) for x in centre))
        load = setup.portrait(spots)
        good = setup.worst(load) <= BOUND
        judged = {"load": (good, load.iae)}
        if values == 10:
            servo = setup.portrait(spots, "setpoint")
            fine = setup.worst(servo, "setpoint") <= BOUND
            judged["both"] = good & fine, load.iae
            judged["sum"] = good & fine, load.iae + servo.iae
            judged["setpoint"] = fine, servo.iae
        for way, (allowed, cost) in judged.items():
            best = spots[np.argmin(np.where(allowed, cost, np.inf))]
            rows.append([str(values), str(good.sum()), way, *(f"{x:.7g}" for x in best)])
    write("portrait_maps", MAPS, rows)


def clean():
    """Return settings that keep their shapes in six experiments, first with a coarse sample time, twice the bound."""
    axes = (0.06, 0.22, 9), (2.4, 3.8, 8), (0.45, 1.05, 7), (0.22, 0.46, 7)
    spots = mesh(*(np.linspace(*axis) for axis in axes))
    for h, bound in ((0.02, 2 * BOUND), (0.005, BOUND)):
        for delay in (0.8, 1.2, 1.0):
            for step in setup.STEPS:
                spots = spots[setup.worst(setup.portrait(spots, step, h, delay), step) <= bound]
    cost = setup.portrait(spots).iae
    peaks = [pidalab.max_sensitivity(setup.design(setup.setting_at(x)).loop())[0] for x in spots]
    table = np.column_stack([spots, cost, peaks])
    write("clean_settings", CLEAN, [[f"{x:.5g}" for x in row] for row in table])


if __name__ == "__main__":
    maps()
    clean()
