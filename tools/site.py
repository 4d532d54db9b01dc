"""Build the site: copy the book, execute every notebook of the copy in parallel, let Jupyter Book make the pages.

The copy keeps the work tree as it is: what a notebook computes here is shown on its page, and compared with the
stored outputs by the tests, but never stored.
"""

import shutil
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import evidence
import numpy as np
import vendored
from notebooks import execute_all, notebooks

import pidalab
from pidalab.simulation.ladder import responses
from pidalab.simulation.realisation import Cut, cut_at_delay

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "_build"
SOURCE = BUILD / "source"


def copy() -> None:
    """Start from nothing: Sphinx does not see that a change of the library changes a page."""
    shutil.rmtree(BUILD, ignore_errors=True)
    ignored = shutil.ignore_patterns(".*", "__pycache__")
    shutil.copytree(ROOT / "book", SOURCE / "book", ignore=ignored)
    # an audit shows how far the engine is from the oracle of the tests
    shutil.copytree(ROOT / "tests" / "oracle", SOURCE / "tests" / "oracle", ignore=ignored)
    for name in ("_config.yml", "_toc.yml"):
        shutil.copy(ROOT / name, SOURCE)


LOOP = pidalab.Loop(pidalab.lags(3, delay=1.0), pidalab.PIDA(1.0, 3.0, 1.0, 0.3))


def compile_first_half() -> None:
    """Compile how a loop is cut open at its dead time, for a response, and the steps of sampled controllers."""
    cut_at_delay(LOOP, "d")
    pidalab.simulate_sampled(LOOP, 0.001 * np.arange(3))


def compile_second_half() -> None:
    """Compile the steps from dead time to dead time, for a plant that rests, and the margins."""
    at_rest = Cut(*map(np.zeros, ((2, 2), 2, 2)), 0.0, *map(np.zeros, ((3, 2), 3, (2, 1))), 1.0)
    responses(at_rest, 2, 0.1, 1.0)
    pidalab.margins(LOOP)


def compile_engine() -> None:
    """Compile at once what the first notebooks on all cores would each compile for itself, for half a minute."""
    with ProcessPoolExecutor(max_workers=2) as pool:
        for half in [pool.submit(compile_first_half), pool.submit(compile_second_half)]:
            half.result()


def main() -> int:
    """Return the exit status of Jupyter Book; every warning is an error."""
    copy()
    evidence.fill(SOURCE / "book" / "how-we-know.md")
    compile_engine()
    execute_all(notebooks(SOURCE))
    command = [
        Path(sys.executable).with_name("jupyter-book"),
        "build",
        "--all",
        "-q",
        "-W",
        "-n",
        "--keep-going",
    ]
    status = subprocess.run([*command, "--path-output", ROOT, SOURCE], check=False).returncode
    if status == 0:
        vendored.write(vendored.SITE)
    return status


if __name__ == "__main__":
    sys.exit(main())
