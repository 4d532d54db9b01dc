"""Which order of controller a noisy record of G_P3 supports: writes book/data/record_orders.csv (vrancic2021).

    python studies/record_orders.py

For each length and sample time of the record and each noise level, 20 records with seeds 0 to 19. Of each the areas are
taken, a controller of order m = 1, 2 and 3 is tuned with the filter that belongs to a noise gain of 10, and put into
the loop with the true process; `beyond.serves` in book/checks/vrancic2021 says when it counts as good. All records are
simulated. About ten seconds.
"""

import csv
from itertools import product
from pathlib import Path

from tqdm import tqdm

from pidalab import ledger

BOOK = Path(__file__).resolve().parents[1] / "book"
HEAD = "length", "step", "noise", "pid", "pida", "third", "end"


def main() -> None:
    """Run all kinds of records and write the table."""
    beyond = ledger.checks("vrancic2021", BOOK / "ledger").beyond
    lines = []
    for (length, step), noise in tqdm(list(product(beyond.LENGTHS, beyond.LEVELS)), desc="records"):
        counts, end = beyond.supported(length, step, noise)
        lines.append([length, step, noise, *counts, round(end, 6)])
    with (BOOK / "data" / "record_orders.csv").open("w", newline="", encoding="utf-8") as file:
        file.write(
            "# simulated; studies/record_orders.py; good controllers of 20 records (of 1 without noise)\n"
        )
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(HEAD)
        writer.writerows(lines)


if __name__ == "__main__":
    main()
