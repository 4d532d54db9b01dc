"""Build the site with Jupyter Book from the stored outputs of the notebooks, and write the tasks as sheets.

No notebook runs here. `make test` compares the notebooks with their stored outputs, and `make notebooks` stores new
outputs. The site is built from a copy, so that the work tree does not change.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import evidence
import live
import sheets
import vendored

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "_build"
SOURCE = BUILD / "source"


def copy() -> None:
    """Copy the sources to an empty folder, since Sphinx does not notice changes of the library."""
    shutil.rmtree(BUILD, ignore_errors=True)
    ignored = shutil.ignore_patterns(".*", "__pycache__")
    shutil.copytree(ROOT / "book", SOURCE / "book", ignore=ignored)
    for name in ("_config.yml", "_toc.yml"):
        shutil.copy(ROOT / name, SOURCE)


def main() -> int:
    """Return the exit status of Jupyter Book, for which every warning is an error."""
    copy()
    evidence.fill(SOURCE / "book" / "how-we-know.md")
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
        sheets.main(BUILD / "html" / "sheets")
        vendored.write(vendored.SITE)
        if os.environ.get("LIVE"):
            live.main()
            shutil.copytree(live.FOLDER, vendored.SITE / "live")
    return status


if __name__ == "__main__":
    sys.exit(main())
