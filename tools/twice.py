"""Build the site twice from the last commit, in two clones, and compare the results byte for byte."""

import filecmp
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def built(folder: Path) -> Path:
    """Clone the last commit into a folder and build its site there."""
    subprocess.run(["git", "clone", "--quiet", ROOT, folder], check=True)
    own = os.environ | {"PYTHONPATH": str(folder / "src")}
    subprocess.run([sys.executable, folder / "tools" / "site.py"], check=True, cwd=folder, env=own)
    return folder / "_build" / "html"


def differences(first: Path, second: Path) -> list[str]:
    """List files that only one of two folders has, and files that are not the same in both."""
    names = [{path.relative_to(one) for path in one.rglob("*") if path.is_file()} for one in (first, second)]
    shared = sorted(names[0] & names[1])
    _, unequal, unread = filecmp.cmpfiles(first, second, shared, shallow=False)
    return [
        *(f"only once: {name.as_posix()}" for name in sorted(names[0] ^ names[1])),
        *(f"not equal: {Path(name).as_posix()}" for name in sorted([*unequal, *unread])),
    ]


def main() -> int:
    """Return 1 if the two sites differ."""
    with tempfile.TemporaryDirectory() as made:
        first, second = (built(Path(made) / name) for name in ("first", "second"))
        wrong = differences(first, second)
        count = sum(path.is_file() for path in first.rglob("*"))
    print("\n".join(wrong) or f"two builds, {count} files each: all equal")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
