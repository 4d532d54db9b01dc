"""How the rules for second-order models do all over their range: book/data/itae_rules.csv.

The rows are those of `beyond.tasks` in book/checks/heo2023, which the audit of heo2023 reads; it recomputes a tenth of
them at each run. A minute on one core::

    python studies/itae_rules.py
"""

import csv
from pathlib import Path

from tqdm import tqdm

import pidalab

DATA = Path(__file__).parents[1] / "book" / "data"


def main() -> None:
    """Compute and write all rows, with eight digits."""
    beyond = pidalab.ledger.checks("heo2023", DATA.parent / "ledger").beyond
    rows = [(*task.names, *beyond.measure(task)) for task in tqdm(beyond.tasks())]
    with (DATA / "itae_rules.csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*beyond.Task.NAMES, *beyond.COLUMNS])
        writer.writerows([f"{v:.8g}" if isinstance(v, float) else v for v in row] for row in rows)


if __name__ == "__main__":
    main()
