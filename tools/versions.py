"""Test the library with the lowest and the newest versions of what it stands on, on each Python that is found.

The lowest are those that pyproject.toml allows, the newest those of the package index, both as far as wheels exist.
Without arguments every Python of `PYTHONS` is tried; `python tools/versions.py 3.12 lowest` runs one. The results go to
book/data/versions.csv; a Python that is not on this machine keeps its old rows, and is named.
"""

import csv
import os
import re
import shutil
import subprocess
import sys
import tempfile
from datetime import UTC, datetime
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "book" / "data" / "versions.csv"
PYTHONS = ("3.11", "3.12", "3.13")
SETS = {"lowest": "lowest-direct", "newest": "highest"}
SHOWN = ("numpy", "scipy", "numba", "control", "matplotlib")
COLUMNS = ("python", "set", *SHOWN, "passed", "failed", "skipped", "date")
# the tests of src; the book, its ledger and the house have nothing to do with versions
FOLDERS = ("areas", "digital", "identification", "optimal", "record", "robustness", "rules", "simulation")
FILES = (
    "cli",
    "comparison",
    "controllers",
    "loop",
    "process",
    "reduction",
    "response",
    "roots",
    "tuning",
)
TESTS = [*(f"tests/{name}" for name in FOLDERS), *(f"tests/test_{name}.py" for name in FILES)]
TOOLS = (
    "pytest",
    "pytest-xdist",
    "nbval",
    "hypothesis",
    "mpmath",
    "pandas",
    "numpydoc",
    "mini-racer",
    "pyyaml",
    "tclab",
)
UV = Path(sys.executable).with_name("uv")


def interpreter(version: str) -> Path | None:
    """Find a Python that runs, on PATH or among pyenv's."""
    name = f"python{version}"
    places = [shutil.which(name), *sorted(Path.home().glob(f".pyenv/versions/{version}.*/bin/{name}"))]
    for place in filter(None, places):
        if subprocess.run([place, "-c", ""], capture_output=True, check=False).returncode == 0:
            return Path(place)
    return None


def pins(version: str, resolution: str) -> list[str]:
    """Return the versions to install."""
    options = [
        "--quiet",
        "--no-header",
        "--no-annotate",
        "--only-binary",
        ":all:",
        "--python-version",
        version,
    ]
    command = [UV, "pip", "compile", *options, "--resolution", resolution, ROOT / "pyproject.toml"]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()


def tested(python: Path, wanted: list[str]) -> dict[str, int]:
    """Make an environment, run the tests in it, count what came out."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        own = folder / "env" / "bin" / "python"
        subprocess.run([UV, "venv", "--quiet", "--python", python, folder / "env"], check=True)
        subprocess.run([UV, "pip", "install", "--quiet", "--python", own, *wanted, *TOOLS], check=True)
        # a warning of an old package on a new Python is no failure of ours
        options = ["-q", "-W", "default", "-o", "addopts=--import-mode=importlib", "-p", "no:cacheprovider"]
        paths = {"PYTHONPATH": str(ROOT / "src"), "NUMBA_CACHE_DIR": str(folder / "cache")}
        command = [own, "-m", "pytest", *options, *TESTS]
        run = subprocess.run(
            command, cwd=ROOT, env=os.environ | paths, capture_output=True, text=True, check=False
        )
    last = run.stdout.splitlines()[-1] if run.stdout else run.stderr
    counts = {word: int(n) for n, word in re.findall(r"(\d+) (passed|failed|skipped|errors?)", last)}
    if run.returncode not in (0, 1) or not counts.get("passed"):
        raise RuntimeError(f"the tests did not run: {last}\n{run.stderr}")
    print(
        "\n".join(line for line in run.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))),
        flush=True,
    )
    failed = counts.get("failed", 0) + counts.get("error", 0) + counts.get("errors", 0)
    return {"passed": counts["passed"], "failed": failed, "skipped": counts.get("skipped", 0)}


def rows() -> dict[tuple[str, str], dict[str, str]]:
    """Read the stored results."""
    if not RESULTS.is_file():
        return {}
    with RESULTS.open(encoding="utf-8", newline="") as file:
        return {(row["python"], row["set"]): row for row in csv.DictReader(file)}


def store(found: dict[tuple[str, str], dict[str, str]]) -> None:
    """Write the results, in order."""
    with RESULTS.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(found[key] for key in sorted(found))


def main(pythons: list[str], sets: list[str]) -> int:
    """Return 1 if a test failed."""
    found = rows()
    for version in pythons:
        python = interpreter(version)
        if python is None:
            print(f"Python {version}: not on this machine, not tried")
            continue
        for name in sets:
            wanted = pins(version, SETS[name])
            versions = dict(pin.split("==") for pin in wanted if "==" in pin)
            shown = {package: versions[package] for package in SHOWN}
            counts = tested(python, wanted)
            date = datetime.now(UTC).date().isoformat()
            found[version, name] = {"python": version, "set": name, **shown, **counts, "date": date}
            print(" ".join(str(value) for value in found[version, name].values()), flush=True)
            store(found)
    return int(any(int(row["failed"]) for row in found.values()))


if __name__ == "__main__":
    given = sys.argv[1:]
    some = [one for one in given if one in PYTHONS] or list(PYTHONS)
    sys.exit(main(some, [one for one in given if one in SETS] or list(SETS)))
