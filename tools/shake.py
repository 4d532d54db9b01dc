"""Run every page of the book with a library that is slightly off, and see that what it hands over is off, too.

What stays was copied, or a formula of the page made it, or it is a whole number: its row says which, in ``made``. What
moves no more than the prints do, which are shaken a thousand times less, comes from print alone. Before that the pages
run with prints alone off, and a number that is called computed stays.

    python tools/shake.py                    # all papers
    python tools/shake.py huba2018           # one of them
"""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from paperledger.shake import Off, Shaker, shake

ROOT = Path(__file__).resolve().parents[1]


def process(found: Any, off: Off) -> Any:
    """Shake gain, dead time and unit of time of a process: a multiple pole stays one."""
    gain, delay, unit = off(1.0, "gain"), off(found.delay, "delay"), off(1.0, "unit")
    num, den = ([c * unit**k for k, c in enumerate(reversed(part))][::-1] for part in (found.num, found.den))
    return type(found)([gain * c for c in num], den, delay)


def response(found: Any, off: Off) -> Any:
    """Shake the control error, not the output: what has settled stays settled."""
    import numpy as np

    wanted = np.concatenate([[0.0], found.step * np.cumsum(found.r[:-1])])
    new = object.__new__(type(found))
    new.__dict__.update(found.__dict__)
    new.__dict__.update(
        y=found.r - off(found.r - found.y, "e"),
        area=wanted - off(wanted - found.area, "area"),
        u=off(found.u, "u"),
    )
    return new


def prepare() -> None:
    """Import what pages import, and compile the engine, before each page gets a process of its own."""
    from tqdm import tqdm

    from pidalab.warm_up import use_all

    tqdm.monitor_interval = 0  # no thread that watches its bars: this process forks
    use_all()


NAMING = ("fopdt", "sopdt", "ipdt", "lags", "binomial")  # they only say which plant is meant
LIBRARY = Shaker(
    "pidalab",
    exact=frozenset(f"pidalab.process.{name}" for name in NAMING),
    fields=frozenset(
        {"t", "times", "step", "h", "sample_time", "span", "tracking_gain"}
    ),  # the last is a share
    whole={"Process": process, "Response": response},
)


def main(arguments: list[str]) -> int:
    """Shake the library under the pages of some papers; 0 if every row is made by it, or says why not."""
    if not sys.flags.optimize:  # pages and modules beside them may assert digits, which are off here
        fixed = {"OPENBLAS_NUM_THREADS": "1", "PIDALAB_COMPILE": "1", "PYTHONWARNINGS": "ignore"}
        return subprocess.call([sys.executable, "-O", __file__, *arguments], env=os.environ | fixed)
    return shake(LIBRARY, ROOT / "book" / "ledger", arguments, prepare)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
