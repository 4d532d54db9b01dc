"""Find in the source of a page what a run under `make shake` cannot show, one line for each finding."""

import ast
import json
import re
from pathlib import Path

MARKERS = re.compile(r"#\s*(NBVAL_\w+|PYTEST_VALIDATE\w*)")
TAGS = re.compile(r"raises-exception|nbval-.*|skip-execution|remove-output")
ASKING = re.compile(
    r"__debug__|__wrapped__|\bget_ipython|sys\.(flags|modules|argv|meta_path)|os\.(environ|getenv)|\binspect\b|book\.path"
)


def cells(path: Path) -> list[tuple[str, list[str]]]:
    """Return source and tags of the code cells of a notebook, without magics of one line."""
    code = [
        cell for cell in json.loads(path.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"
    ]
    sources = [re.sub(r"(?m)^(%(?!%)|!).*$", "", "".join(cell["source"])) for cell in code]
    return [(source, cell["metadata"].get("tags", [])) for source, cell in zip(sources, code, strict=True)]


def page(path: Path) -> list[str]:
    """Read a notebook that hands something over."""
    code = cells(path)
    text = "\n".join(source for source, _ in code)
    found = [f"tag {tag}" for _, tags in code for tag in tags if TAGS.fullmatch(tag)]
    found += [f"marker {marker}" for marker in MARKERS.findall(text)]
    if any(source.lstrip().startswith("%%") for source, _ in code):
        return [*found, "a cell magic decides whether it runs"]
    if text.rstrip().splitlines()[-1] != "book.close()":
        found.append("does not end with book.close()")
    if text.count("Ledger.open(") != 1:
        found.append("opens not one ledger")
    return found + module(text)


def module(text: str) -> list[str]:
    """Read the code of a page, or of a module beside it."""
    found = [f"asks where it runs by {asked[0]}" for asked in ASKING.finditer(text)]
    for node in ast.walk(ast.parse(text)):
        decides = isinstance(node, ast.Call) and ast.unparse(node.func).endswith(".decide")
        if decides and any(isinstance(part, ast.comprehension) and part.ifs for part in ast.walk(node)):
            found.append("leaves cases of a statement out")
    return found
