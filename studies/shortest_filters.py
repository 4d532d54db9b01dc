"""How short the filter of the controllers of huba2024 may be, for absolute stability and for stability.

Run it from the root of the project; it writes book/data/shortest_filters.csv in about ten seconds. The audit of the
chapter computes some of its entries again.
"""

from itertools import product

from tqdm import tqdm

import pidalab

HEAD = """\
# Shortest time constant T_f of Q_4, from 0.2 down to 0.01, with which a loop of huba2024 passes the criterion that
# certifies it at 0.2, and with which it is stable; 0 where it does down to 0.01.
# Written by studies/shortest_filters.py.
"""


def main() -> None:
    """Search all borders and write them."""
    checks = pidalab.ledger.checks("huba2024")
    absolute, names = checks.absolute, list(checks.loops.designs())
    with open("book/data/shortest_filters.csv", "w", encoding="utf-8") as file:
        file.write(HEAD + "controller,way,criterion,stable\n")
        for name, way in tqdm(list(product(names, absolute.WAYS))):
            found = [absolute.shortest(name, way, what) for what in absolute.WHATS]
            file.write(f"{name},{way},{found[0]:.7f},{found[1]:.7f}\n")


if __name__ == "__main__":
    main()
