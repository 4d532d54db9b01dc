"""Build the site: execute every notebook of a copy in parallel, let Jupyter Book make the pages, add the slides.

The copy keeps the work tree as it is: what a notebook computes here is shown on its page, and compared with the
stored outputs by the tests, but never stored.
"""

import shutil
import subprocess
import sys
from pathlib import Path

import evidence
import slides
import vendored
from kernels import fork_kernels
from notebooks import execute_all, notebooks

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


def main() -> int:
    """Return the exit status of Jupyter Book; every warning is an error."""
    fork_kernels()  # it takes a while to compile the engine
    copy()
    evidence.fill(SOURCE / "book" / "how-we-know.md")
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
        slides.main(BUILD / "html" / "slides")
        vendored.write(vendored.SITE)
    return status


if __name__ == "__main__":
    sys.exit(main())
