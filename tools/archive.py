"""Pack the built site into one file, dist/pidalab-book-<version>.zip, for reading without a network.

Unpacked anywhere, its index.html opens from the disk. The same site gives the same bytes.
"""

import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SITE = ROOT / "_build" / "html"
DIST = ROOT / "dist"
UNSEEN = (".map", ".po", ".mo")  # no page asks for them: for developers of the theme


def pack(site: Path, archive: Path) -> None:
    """Write every file that a page may ask for, below one folder that is named like the archive."""
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as packed:
        for path in sorted(site.rglob("*")):
            if path.is_file() and path.suffix not in UNSEEN:
                # without a date, files carry that of the format's beginning
                entry = zipfile.ZipInfo(f"{archive.stem}/{path.relative_to(site).as_posix()}")
                entry.external_attr = 0o644 << 16
                packed.writestr(entry, path.read_bytes(), zipfile.ZIP_DEFLATED)


if __name__ == "__main__":
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    DIST.mkdir(exist_ok=True)
    made = DIST / f"pidalab-book-{project['version']}.zip"
    pack(SITE, made)
    print(f"{made.relative_to(ROOT)}: {made.stat().st_size / 1e6:.1f} MB")
