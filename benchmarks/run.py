"""Time and error of pidalab beside other libraries, in one run; the tables go to book/data.

Times are medians of several runs, CPU times of one thread unless a row is about all processors; since machines differ,
quote the ratios. ``python -m benchmarks.run`` takes about six minutes on a quiet machine.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from benchmarks import dead_time, loops, optimum, portraits
from benchmarks.measure import write

RESULTS = "speed_comparison"  # in book/data


def shown(rows: Iterable[dict]) -> Iterator[dict]:
    """Print rows on their way."""
    last = None
    for row in rows:
        if (head := (row["quantity"], row["loop"], row["value"])) != last:
            last = head
            print(f"\n{head[0]}: {head[1]} {head[2]}")
        numbers = f"{'':31}"
        if row["seconds"]:
            numbers = f"{1e3 * row['seconds']:12.2f} ms{row['ratio']:8.2f}{row['error']:8.0e}"
        print(f"    {row['method']:24}{numbers}  {row['note']}", flush=True)
        yield row


def main() -> None:
    """Compare, print and write."""
    parts = (loops.responses, loops.margins, loops.scaling, optimum.rows)
    write(RESULTS, loops.COLUMNS, [row for part in parts for row in shown(part())])
    dead_time.main()
    portraits.main()


if __name__ == "__main__":
    main()
