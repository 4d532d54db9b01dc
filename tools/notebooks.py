"""Execute the notebooks of the book in parallel, and store their outputs in place.

Nothing is stored that changes between runs or machines, so a second run changes no file. The old and new text of each
changed output is printed. Read these changes before you commit. If paths are given as arguments, only these notebooks
are run.
"""

import difflib
import os
import sys
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

BOOK = Path(__file__).resolve().parents[1] / "book"
METADATA = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"name": "python", "pygments_lexer": "ipython3"},
}


def execute(path: Path) -> str:
    """Run one notebook and return the changes. If a cell fails, raise its traceback and leave the file unchanged."""
    notebook = nbformat.read(path, as_version=4)
    before = list(texts(notebook))
    NotebookClient(
        notebook,
        timeout=600,
        kernel_name="python3",
        record_timing=False,
        coalesce_streams=True,
        resources={"metadata": {"path": str(path.parent)}},
        extra_arguments=["--IPKernelApp.log_level=ERROR"],  # suppresses a warning about local connections
    ).execute()
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)  # an editor may have left time stamps
        for output in cell.get("outputs", []):
            if output.output_type == "error":  # the cell ended, but its result could not be shown
                raise RuntimeError("\n".join([f"{path.name}: {cell.source}", *output.traceback]))
    notebook.metadata = nbformat.from_dict(METADATA)
    nbformat.write(notebook, path)
    return changes(before, list(texts(notebook)))


def texts(notebook: Any) -> Iterator[str]:
    """Yield the lines of all text outputs. Each line begins with the id of its cell."""
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            text = output.get("text") or output.get("data", {}).get("text/plain", "")
            yield from (f"{cell.id}: {line}" for line in "".join(text).splitlines())


def changes(before: list[str], after: list[str]) -> str:
    """Return the lines that differ, as a diff."""
    lines = list(difflib.unified_diff(before, after, lineterm="", n=0))[2:]
    return "\n".join(f"    {line}" for line in lines if not line.startswith("@@"))


def notebooks(folder: Path) -> list[Path]:
    """Return the notebooks below a folder. Audits and large notebooks come first, so that no long one runs last."""
    found = [path for path in folder.rglob("*.ipynb") if ".ipynb_checkpoints" not in path.parts]
    return sorted(found, key=lambda path: (path.parent.name == "audit", path.stat().st_size), reverse=True)


def execute_all(paths: Iterable[Path]) -> None:
    """Run notebooks on all cores, print the changes of each, and raise the first error."""
    paths, start = list(paths), time.perf_counter()
    os.environ.setdefault("PIDALAB_COMPILE", "1")  # wait for compiled code
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # threads do not help with small matrices
    workers = (os.cpu_count() or 1) + 1  # one more, since workers wait while their kernels start or end
    with ThreadPoolExecutor(workers) as pool:
        runs = {pool.submit(execute, path): path for path in paths}
        for done, run in enumerate(as_completed(runs), start=1):
            try:
                changed = run.result()
            except Exception:
                print(f"{runs[run].name} failed", flush=True)
                pool.shutdown(cancel_futures=True)
                raise
            print(
                f"[{done:2}/{len(paths)}] {runs[run].name}  {time.perf_counter() - start:.0f} s", flush=True
            )
            if changed:
                print(changed, flush=True)


if __name__ == "__main__":
    execute_all([Path(name).resolve() for name in sys.argv[1:]] or notebooks(BOOK))
