"""Run the tests of the library and the notebooks as other machines would, and store what passed.

A processor chooses the kernels of OpenBLAS, the loops of NumPy, the machine code of numba and the functions of the
C library, and each rounds in its own way. A lesser one can be imitated. Other Pythons, and the lowest and newest
versions of the dependencies, get an environment of their own. Words choose variants by their names
(``python tools/processors.py nehalem``); without any, all but the lowest and newest versions are run. What passed goes
to book/data/processors.csv; a variant that is not tried keeps its rows, and is named.
"""

import argparse
import csv
import json
import math
import os
import platform
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from notebooks import BOOK, notebooks
from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

from paperledger import papers

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "book" / "data" / "processors.csv"
COLUMNS = ("variant", "what", "packages", "passed", "failed", "skipped", "seconds", "date")
SHOWN = ("numpy", "scipy", "numba", "control", "matplotlib")
KERNELS = {"Nehalem": "SSE42", "Sandybridge": "AVX", "Haswell": "AVX2", "Zen": "AVX2", "SkylakeX": "AVX512F"}
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
SETS = {"lowest": "lowest-direct", "newest": "highest"}
# the tests of the library; the book, its ledger and the house have nothing to do with processors
NAMES = {path.stem for path in (ROOT / "src" / "pidalab").iterdir()} - {"__init__", "__main__"}
TESTS = [
    f"tests/{one.name}"
    for one in sorted((ROOT / "tests").iterdir())
    if one.stem.removeprefix("test_") in NAMES
]
TOOLS = ["pytest", "pytest-xdist", "nbval", "hypothesis", "mpmath", "pandas", "numpydoc", "mini-racer"]
TOOLS += ["pyyaml", "tclab"]
QEMU = "qemu-aarch64-static"
UV = Path(sys.executable).with_name("uv")
PARALLEL = ["-n", "auto", "--dist", "loadfile", "--no-loadscope-reorder"]
# what is in force, under the names of the variables that ask for it, and the versions of packages
PROBE = """
import json, math, os, sys
from importlib.metadata import version
import numba, numpy, scipy.linalg
from threadpoolctl import threadpool_info
from numpy._core._multiarray_umath import __cpu_features__ as has
blas = [library for library in threadpool_info() if library["internal_api"] == "openblas"]
off = os.environ.get("NPY_DISABLE_CPU_FEATURES", "").split()
print(json.dumps([{
    "OPENBLAS_CORETYPE": "/".join(sorted({library["architecture"] for library in blas})),
    "OPENBLAS_NUM_THREADS": "/".join(sorted({str(library["num_threads"]) for library in blas})),
    "NPY_DISABLE_CPU_FEATURES": " ".join(name for name in off if not has[name]),
    "NUMBA_CPU_NAME": str(numba.config.CPU_NAME),
}, hash(tuple(map(math.sin, range(20000)))), {name: version(name) for name in sys.argv[1:]}]))
"""


@dataclass(frozen=True)
class Variant:
    """A machine to imitate."""

    name: str
    environment: dict[str, str] = field(default_factory=dict)
    python: str | None = None  # another Python than this one
    packages: str | None = None  # "lowest" or "newest", instead of the locked ones
    needs: str | None = None  # a feature of the processor
    arm: bool = False  # 64-bit Arm, instruction by instruction: ten to thirty times slower

    @property
    def missing(self) -> str | None:
        """What this machine lacks."""
        if self.needs and not __cpu_features__.get(self.needs):
            return f"this processor has no {self.needs}"
        if self.arm and not all(map(shutil.which, (QEMU, "apt-get", "dpkg"))):
            return f"no {QEMU} with Debian's packages"
        if self.python and interpreter(self.python) is None:
            return f"no Python {self.python}"
        return None


class NotInForceError(Exception):
    """A library does not do what it was asked for; OpenBLAS, for one, is often built without some of its kernels."""


def variants() -> list[Variant]:
    """Return every variant, the least capable last of those with the Python and the packages of this environment."""
    dispatched = " ".join(name for name in __cpu_dispatch__ if __cpu_features__.get(name))
    plain = {"NPY_DISABLE_CPU_FEATURES": dispatched} if dispatched else {}
    generic = {"NUMBA_CPU_NAME": "generic"}
    glibc = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA"} if fused() else {}
    own = f"{sys.version_info.major}.{sys.version_info.minor}"
    return [
        Variant("this processor"),
        Variant("two BLAS threads", {"OPENBLAS_NUM_THREADS": "2"}),
        *(
            Variant(f"OpenBLAS kernel {name}", {"OPENBLAS_CORETYPE": name}, needs=need)
            for name, need in KERNELS.items()
        ),
        Variant("NumPy without dispatched features", plain),
        Variant("numba for a generic processor", generic),
        Variant("C library without FMA", glibc),
        Variant("least capable", {"OPENBLAS_CORETYPE": "Nehalem"} | plain | generic | glibc, needs="SSE42"),
        Variant("64-bit Arm", {"DRAW": "10"}, arm=True),  # of the long tests one in ten
        *(Variant(f"Python {version}", python=version) for version in PYTHONS if version != own),
        *(
            Variant(f"Python {version}, {packages}", python=version, packages=packages)
            for version in PYTHONS
            for packages in SETS
        ),
    ]


def arm_python(folder: Path) -> Path:
    """Make a Debian userland for 64-bit Arm with the locked packages, and a command that runs its Python."""
    root, places = folder / "root", folder / "apt"
    for part in ("state/lists/partial", "cache/archives/partial"):
        (places / part).mkdir(parents=True)
    (places / "state" / "status").touch()  # nothing is installed
    options = [
        "APT::Architecture=arm64",
        "APT::Architectures=arm64",
        f"Dir::State={places / 'state'}",
        f"Dir::State::status={places / 'state' / 'status'}",
        f"Dir::Cache={places / 'cache'}",
        "Debug::NoLocking=true",
    ]
    apt = ["apt-get", "-qq", *(word for option in options for word in ("-o", option))]
    subprocess.run([*apt, "update"], check=True)
    wanted = ["python3", "libgomp1", "libstdc++6"]
    subprocess.run(
        [*apt, "install", "--download-only", "--yes", "--no-install-recommends", *wanted], check=True
    )
    for package in sorted((places / "cache" / "archives").glob("*.deb")):
        subprocess.run(["dpkg", "-x", package, root], check=True)
    (inside,) = root.glob("usr/bin/python3.[0-9]*[0-9]")
    version = inside.name.removeprefix("python")
    site = folder / "site"
    target = ["--python-platform", "aarch64-manylinux_2_28", "--python-version", version, "--target", site]
    lock = ["--require-hashes", "-r", ROOT / "requirements-dev.txt"]
    subprocess.run([UV, "pip", "install", "--quiet", *target, *lock], check=True)
    # our version; what runs is the source
    (about,) = Path(sysconfig.get_path("purelib")).glob("pidalab-*.dist-info")
    shutil.copytree(about, site / about.name)
    command = folder / "python"
    command.write_text(
        f'#!/bin/sh\nexport PYTHONPATH="{ROOT / "src"}:{site}:$PYTHONPATH"\n'
        f'exec {QEMU} -L {root} -0 "$0" {inside} "$@"\n',
        encoding="utf-8",
    )
    command.chmod(0o755)
    return command


def fused() -> bool:
    """Whether the C library has functions of its own for a processor that multiplies and adds in one step."""
    return platform.libc_ver()[0] == "glibc" and bool(__cpu_features__.get("FMA3"))


def interpreter(version: str) -> Path | None:
    """Find a Python that runs, on PATH or among pyenv's."""
    name = f"python{version}"
    places = [shutil.which(name), *sorted(Path.home().glob(f".pyenv/versions/{version}.*/bin/{name}"))]
    for place in filter(None, places):
        if subprocess.run([place, "-c", ""], capture_output=True, check=False).returncode == 0:
            return Path(place)
    return None


def pins(version: str, resolution: str) -> list[str]:
    """Return the versions to install, as far as there are wheels."""
    options = ["--quiet", "--no-header", "--no-annotate", "--only-binary", ":all:", "--python-version"]
    command = [UV, "pip", "compile", *options, version, "--resolution", resolution, ROOT / "pyproject.toml"]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()


@contextmanager
def prepared(variant: Variant) -> Iterator[tuple[Path, dict[str, str]]]:
    """Yield the Python of a variant, and the environment to run it in."""
    with tempfile.TemporaryDirectory() as made:
        one = {"OPENBLAS_NUM_THREADS": "1"} | variant.environment
        if variant.python or variant.arm or "NUMBA_CPU_NAME" in one:
            one["NUMBA_CACHE_DIR"] = str(Path(made) / "cache")
        if variant.arm:
            yield arm_python(Path(made)), one
            return
        if variant.python is None:
            yield Path(sys.executable), one
            return
        python = Path(made) / "env" / "bin" / "python"
        subprocess.run(
            [UV, "venv", "--quiet", "--python", interpreter(variant.python), python.parents[1]], check=True
        )
        install = [UV, "pip", "install", "--quiet", "--python", python]
        if variant.packages:
            wanted = pins(variant.python, SETS[variant.packages])
            subprocess.run([*install, *wanted, *TOOLS], check=True)
            one["PYTHONPATH"] = str(ROOT / "src")
        else:
            subprocess.run([*install, "--require-hashes", "-r", ROOT / "requirements-dev.txt"], check=True)
            subprocess.run([*install, "--no-deps", "--no-build-isolation", "--editable", ROOT], check=True)
        yield python, one


def in_force(python: Path, environment: dict[str, str]) -> dict[str, str]:
    """Return the versions of the packages that are shown.

    Raises
    ------
    NotInForceError
        If the processor is not imitated as it was asked for.
    """
    run = subprocess.run(
        [python, "-W", "error::ImportWarning", "-c", PROBE, *SHOWN],
        env=os.environ | environment,
        check=True,
        capture_output=True,
        text=True,
    )
    found, sines, versions = json.loads(run.stdout)
    wrong = {
        name: found[name] for name in found.keys() & environment.keys() if found[name] != environment[name]
    }
    if "GLIBC_TUNABLES" in environment and sines == hash(tuple(map(math.sin, range(20000)))):
        wrong["GLIBC_TUNABLES"] = "no effect"
    if wrong:
        raise NotInForceError(f"asked for {environment}, but found {wrong}")
    return versions


def command(variant: Variant, what: str) -> list[str | Path]:
    """Return what to give to pytest; of notebooks a processor that is imitated step by step runs the chapters alone."""
    if what == "notebooks":
        chapters = [BOOK / f"{paper}.ipynb" for paper in papers(BOOK / "ledger")]
        return [*PARALLEL, "--nbval", "--nbval-current-env", *(chapters if variant.arm else notebooks(BOOK))]
    # a warning of an old package on a new Python is not our failure
    lenient = ["-W", "default", "-o", "addopts=--import-mode=importlib"] if variant.packages else []
    return [*PARALLEL, *lenient, *TESTS]


def run(variant: Variant, python: Path, environment: dict[str, str], what: str) -> dict[str, str | int]:
    """Run tests or notebooks, print what pytest says if one failed, and count."""
    start = time.monotonic()
    done = subprocess.run(
        [python, "-m", "pytest", "-q", "--color=no", "-p", "no:cacheprovider", *command(variant, what)],
        cwd=ROOT,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    last = done.stdout.splitlines()[-1] if done.stdout else done.stderr
    counts = {word: int(n) for n, word in re.findall(r"(\d+) (passed|failed|skipped|error)", last)}
    if done.returncode not in (0, 1) or not counts.get("passed"):
        raise RuntimeError(f"pytest did not run: {last}\n{done.stdout[-2000:]}{done.stderr}")
    if done.returncode:
        print(done.stdout, flush=True)
    return {
        "passed": counts["passed"],
        "failed": counts.get("failed", 0) + counts.get("error", 0),
        "skipped": counts.get("skipped", 0),
        "seconds": round(time.monotonic() - start),
    }


def store(row: dict[str, str | int]) -> None:
    """Put a row in its place among the stored ones."""
    order = [(variant.name, what) for variant in variants() for what in ("tests", "notebooks")]
    with RESULTS.open(encoding="utf-8", newline="") as file:
        found = {(old["variant"], old["what"]): old for old in csv.DictReader(file)}
    found[row["variant"], row["what"]] = row
    place = {key: k for k, key in enumerate(order)}
    with RESULTS.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(found[key] for key in sorted(found, key=lambda key: place.get(key, len(place))))


def chosen(words: list[str]) -> list[Variant]:
    """Return the variants whose name is one of the words or contains one that is no name."""
    names = {one.name.lower(): one for one in variants()}
    if not words:
        return [one for one in names.values() if not one.packages]
    found = {name for word in words for name in names if name == word or (word not in names and word in name)}
    if not found:
        raise ValueError(f"no variant is called {' or '.join(words)}; there are {', '.join(names)}")
    return [one for name, one in names.items() if name in found]


def main() -> int:
    """Return 1 if anything failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("words", nargs="*", help="a variant is run if its name contains one of these")
    parser.add_argument("--only", choices=("tests", "notebooks"), help="leave the other out")
    parser.add_argument("--no-store", action="store_true", help="print, and leave the stored table alone")
    given = parser.parse_args()
    failed = 0
    for variant in chosen([word.lower() for word in given.words]):
        kinds = ["tests"] if variant.packages else ["tests", "notebooks"]
        if given.only:
            kinds = [kind for kind in kinds if kind == given.only]
        if variant.missing or not kinds:
            print(f"{variant.name}: not tried, {variant.missing or 'its packages do not run the notebooks'}")
            continue
        with prepared(variant) as (python, environment):
            try:
                versions = in_force(python, environment)
            except NotInForceError as error:
                if given.words:
                    raise
                print(f"{variant.name}: not tried, {error}")
                continue
            for what in kinds:
                row = {"variant": variant.name, "what": what}
                row["packages"] = " ".join(f"{name} {version}" for name, version in versions.items())
                row |= run(variant, python, environment, what)
                row["date"] = datetime.now(UTC).date().isoformat()
                print(", ".join(str(row[key]) for key in COLUMNS if key != "packages"), flush=True)
                failed += int(row["failed"])
                if not given.no_store:
                    store(row)
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
