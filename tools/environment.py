"""Make `.venv` from the locked requirements: ``python tools/environment.py``. ``--dev`` adds what tests and tools need.

The script needs only Python. Every package is verified by its hash. Packages are installed by `uv`, which is several
times faster than pip, or by pip if `uv` cannot be installed.
"""

import os
import re
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / ".venv"
LOCKS = {"book": ROOT / "requirements.txt", "dev": ROOT / "requirements-dev.txt"}
SCRIPTS = FOLDER / ("Scripts" if os.name == "nt" else "bin")
PYTHON = SCRIPTS / ("python.exe" if os.name == "nt" else "python")
HASHES = "--require-hashes"


def pip(*arguments: str | Path) -> bool:
    """Run pip of the environment. Return True if it succeeded."""
    command = [PYTHON, "-m", "pip", "--disable-pip-version-check", "install", "--quiet", *arguments]
    return subprocess.run(command, check=False).returncode == 0


def uv() -> Path | None:
    """Return the path of uv, after installing it if necessary. Return None if this fails."""
    found = SCRIPTS / ("uv.exe" if os.name == "nt" else "uv")
    if found.exists():
        return found
    locked = re.search(r"^uv==.*?(?=^\S)", LOCKS["dev"].read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    if not locked:
        return None
    with tempfile.TemporaryDirectory() as folder:
        alone = Path(folder, "uv.txt")
        alone.write_text(locked[0], encoding="utf-8")
        return found if pip(HASHES, "-r", alone) else None


def install(lock: Path) -> None:
    """Install the packages of a lock file."""
    fast = uv()
    if fast:
        command = [fast, "pip", "install", "--quiet", "--python", PYTHON, HASHES, "-r", lock]
        if subprocess.run(command, check=False).returncode == 0:
            return
        print("uv did not succeed; trying pip", file=sys.stderr)
    if not pip(HASHES, "-r", lock):
        sys.exit("the environment could not be filled: see pip's message above")


def main(which: str) -> None:
    """Fill the environment, and write the stamp for `make`."""
    if not PYTHON.exists():
        venv.create(FOLDER, with_pip=True)
    install(LOCKS[which])
    if not pip("--no-deps", "--no-build-isolation", "--editable", ROOT):
        sys.exit("pidalab itself could not be installed: see pip's message above")
    (FOLDER / f".{which}").touch()
    if not (FOLDER / ".book").exists():  # the dev packages include those of the book
        (FOLDER / ".book").touch()
    print(f"{PYTHON.relative_to(ROOT)} has what {'tests and tools' if which == 'dev' else 'the book'} need")


if __name__ == "__main__":
    main("dev" if "--dev" in sys.argv[1:] else "book")
