"""Execute the book's notebooks and store their outputs in place.

Nothing is stored that changes from run to run or from machine to machine (time stamps, the Python version),
so a second run changes no file. With paths as arguments only these notebooks are run.
"""

import sys
from pathlib import Path

import nbformat
from nbclient import NotebookClient

BOOK = Path(__file__).resolve().parents[1] / "book"
METADATA = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"name": "python", "pygments_lexer": "ipython3"},
}


def execute(path: Path) -> None:
    """Run one notebook; on an error the traceback is raised and the file stays as it was."""
    notebook = nbformat.read(path, as_version=4)
    NotebookClient(
        notebook,
        timeout=600,
        kernel_name="python3",
        record_timing=False,
        coalesce_streams=True,
        resources={"metadata": {"path": str(path.parent)}},
    ).execute()
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)  # time stamps that an editor left
        for output in cell.get("outputs", []):
            if output.output_type == "error":  # one that did not stop the cell: its result could not be shown
                raise RuntimeError("\n".join([f"{path.name}: {cell.source}", *output.traceback]))
    notebook.metadata = nbformat.from_dict(METADATA)
    nbformat.write(notebook, path)


if __name__ == "__main__":
    for path in [Path(name) for name in sys.argv[1:]] or sorted(BOOK.glob("*.ipynb")):
        print(path.name, flush=True)
        execute(path)
