"""Find the shortest filters of the controllers of huba2024 for absolute stability and for stability.

Run it from the root of the project; it writes book/data/shortest_filters.csv in about ten seconds. The audit of the
paper computes some of its entries again.
"""

import sys
from dataclasses import replace

from tqdm import tqdm

import pidalab
from pidalab import robustness
from pidalab.rules import automatic_reset as ar

sys.path.insert(0, "book")
from papers import huba2024 as setup

HEAD = """\
# Shortest time constant T_f of Q_4, from 0.2 down to 0.01, with which a loop of huba2024 passes the criterion that
# certifies it at 0.2, and with which it is stable; 0 where it does down to 0.01.
# Written by studies/shortest_filters.py.
"""


def main() -> None:
    """Search all borders and write them."""
    rows = []
    for name, own in tqdm(setup.DESIGNS.items()):
        certified = robustness.circle if robustness.circle(own.loop()).holds else robustness.popov
        ways = {
            "gains stay": lambda T, own=own: pidalab.Loop(
                setup.plant(), replace(own.controller, filter_time=T)
            ),
            "gains anew": lambda T, name=name: setup.design(ar.SETTINGS[name], filter_time=T).loop(),
        }
        tests = (lambda loop, certified=certified: certified(loop).holds, pidalab.is_stable)
        for way, family in ways.items():
            found = [robustness.smallest_filter_time(family, test, 0.2, shortest=0.01) for test in tests]
            rows.append(f"{name},{way},{found[0]:.7f},{found[1]:.7f}\n")
    with open("book/data/shortest_filters.csv", "w", encoding="utf-8") as file:
        file.write(HEAD + "controller,way,criterion,stable\n")
        file.writelines(rows)


if __name__ == "__main__":
    main()
