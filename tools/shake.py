"""Run every page of the book with a slightly changed library, and check that its results change, too.

`paperledger.shake` explains the method. Pages with rows of the basis *computed* run first with an exact library, and
only the printed numbers change.

    python tools/shake.py                    # all papers
    python tools/shake.py huba2018           # one paper
"""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from paperledger.shake import Off, Shaker, shake

ROOT = Path(__file__).resolve().parents[1]


def process(found: Any, off: Off) -> Any:
    """Change gain, dead time and unit of time of a process. Multiple poles stay multiple."""
    gain, delay, unit = off(1.0, "gain"), off(found.delay, "delay"), off(1.0, "unit")
    num, den = ([c * unit**k for k, c in enumerate(reversed(part))][::-1] for part in (found.num, found.den))
    return type(found)([gain * c for c in num], den, delay)


def response(found: Any, off: Off) -> Any:
    """Change the control error instead of the output, so that a settled response remains settled."""
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
    """Import modules and compile all kernels once, before a process is forked for each page."""
    from tqdm import tqdm

    from pidalab.warm_up import use_all

    tqdm.monitor_interval = 0  # starts no monitoring thread, since this process forks
    use_all()


NAMING = ("fopdt", "sopdt", "ipdt", "lags", "binomial")  # these functions only define a plant
LIBRARY = Shaker(
    "pidalab",
    exact=frozenset(f"pidalab.process.{name}" for name in NAMING),
    fields=frozenset(
        {"t", "times", "step", "h", "sample_time", "span", "tracking_gain"}
    ),  # tracking_gain is a fraction between 0 and 1
    whole={"Process": process, "Response": response},
)


def main(arguments: list[str]) -> int:
    """Run the pages with a changed library. Return 0 if every row changes or says why it does not."""
    if not sys.flags.optimize:  # -O turns off assertions about digits in pages and their modules
        fixed = {"OPENBLAS_NUM_THREADS": "1", "PIDALAB_COMPILE": "1", "PYTHONWARNINGS": "ignore"}
        return subprocess.call([sys.executable, "-O", __file__, *arguments], env=os.environ | fixed)
    return shake(LIBRARY, ROOT / "book" / "ledger", arguments, prepare)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
