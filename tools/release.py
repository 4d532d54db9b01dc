"""Build the source archive and the wheel, then install the wheel into an empty environment and use it.

The dependencies have the locked versions. The check fails if the wheel lacks a module, or if pyproject.toml lacks a
dependency.
"""

import os
import subprocess
import sys
import tarfile
import tempfile
import venv
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DIST = ROOT / "dist"
PACKAGES = [ROOT / "src" / name for name in ("pidalab", "paperledger")]


def build() -> tuple[Path, Path]:
    """Build the source archive, and from the archive the wheel. All files have the time of the last commit."""
    for old in DIST.glob("pidalab-*"):
        old.unlink()
    uv = Path(sys.executable).with_name("uv")
    options = ["--no-build-isolation", "--python", sys.executable, "--quiet", "--out-dir", DIST]
    subprocess.run(
        [uv, "build", *options, ROOT], check=True, env=os.environ | {"SOURCE_DATE_EPOCH": committed()}
    )
    return next(DIST.glob("*.tar.gz")), next(DIST.glob("*.whl"))


def committed() -> str:
    """Return the time of the last commit, in seconds since 1970."""
    command = ["git", "-C", ROOT, "log", "-1", "--format=%ct"]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def missing(wheel: Path, archive: Path) -> list[str]:
    """List files that the wheel or the archive lacks, and unexpected files in the wheel."""
    kinds = {".py", ".pyi", ".typed", ".j2", ".csv", ".txt"}
    paths = [path for package in PACKAGES for path in package.rglob("*") if path.suffix in kinds]
    own = {path.relative_to(ROOT / "src").as_posix() for path in paths}
    with zipfile.ZipFile(wheel) as packed:
        wheeled = {name for name in packed.namelist() if ".dist-info/" not in name}
    with tarfile.open(archive) as packed:
        sources = {name.partition("/src/")[2] for name in packed.getnames()}
    return [
        *(f"the wheel lacks {name}" for name in sorted(own - wheeled)),
        *(f"the wheel has {name}" for name in sorted(wheeled - own)),
        *(f"the source archive lacks {name}" for name in sorted(own - sources)),
    ]


def locked(folder: Path) -> Path:
    """Write the locked versions as constraints, without hashes. With hashes, pip would refuse the local wheel."""
    lines = (ROOT / "requirements.txt").read_text(encoding="utf-8").splitlines()
    pins = [line.rstrip(" \\") for line in lines if "==" in line and not line.startswith(("#", " "))]
    path = folder / "constraints.txt"
    path.write_text("\n".join(pins) + "\n", encoding="utf-8")
    return path


def use(wheel: Path) -> None:
    """Install the wheel into an empty environment, and use it in an empty folder."""
    # Remove paths to the sources, which would count as an installed package.
    clean = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "NUMBA"))}
    clean["PIDALAB_COMPILE"] = "0"  # a background compiler would write while the folder is deleted
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        venv.create(folder / "env", with_pip=True)
        empty = folder / "empty"
        empty.mkdir()

        def python(*arguments: str | Path) -> None:
            subprocess.run(
                [folder / "env" / "bin" / "python", "-I", *arguments], check=True, cwd=empty, env=clean
            )

        pip = ("-m", "pip", "--disable-pip-version-check")
        python(*pip, "install", "--quiet", "--no-compile", "--constraint", locked(folder), wheel)
        python(*pip, "check")
        python(ROOT / "tools" / "exercise.py")


def main() -> int:
    """Return 1 if the wheel or the archive has the wrong files."""
    archive, wheel = build()
    if wrong := missing(wheel, archive):
        print("\n".join(wrong), file=sys.stderr)
        return 1
    use(wheel)
    print(*(path.relative_to(ROOT) for path in (archive, wheel)), sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
