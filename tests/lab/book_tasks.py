"""Read the tasks of the book, and run the judge of the pages in a JavaScript interpreter."""

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import nbformat
from engine import SCRIPT
from py_mini_racer import MiniRacer

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "book" / "_ext"))
from tasks import Parts, parts_of  # noqa: E402

BLOCK = re.compile(
    r"^(`{3,})\{task\} (?P<title>[^\n]*)\n:label: (?P<label>\S+)\n(?P<content>.*?)^\1$",
    re.DOTALL | re.MULTILINE,
)
SCRIPTS = ("engine", "optima", "model", "optimum", "judge")
CALL = """(name, task, more) => {
  const words = (key, x) => typeof x === "number" && !Number.isFinite(x) ? String(x) : x;
  return JSON.stringify(globalThis.pidalabForTests[name](JSON.parse(task), JSON.parse(more)) ?? null, words);
}"""
FACTS = """globalThis.pidalabForTests = {
  judge: pidalabJudge.judge,
  facts: (task, {given, names}) => names.map(pidalabJudge.facts(task, given)),
  along: (task, {items, fact}) => pidalabJudge.alongItems(task, items, fact),
};"""


class Task(NamedTuple):
    """A task and its page."""

    label: str
    title: str
    page: str
    parts: Parts

    @property
    def data(self) -> dict[str, Any]:
        return self.parts.data


def texts(path: Path) -> Iterator[str]:
    if path.suffix == ".md":
        yield path.read_text(encoding="utf-8")
    else:
        yield from (c.source for c in nbformat.read(path, as_version=4).cells if c.cell_type == "markdown")


def tasks_of_the_book() -> list[Task]:
    """Return every task, in the order of the pages."""
    tasks = []
    for path in sorted(each for end in ("ipynb", "md") for each in ROOT.glob(f"book/**/*.{end}")):
        for text in texts(path):
            for block in BLOCK.finditer(text):
                parts = parts_of(block["content"])
                tasks.append(Task(block["label"], block["title"], path.stem, parts))
    return tasks


class Judge:
    """Call `globalThis.pidalabJudge` with Python's numbers."""

    def __init__(self) -> None:
        context = MiniRacer()
        for name in SCRIPTS:
            context.eval(SCRIPT.with_name(f"{name}.js").read_text(encoding="utf-8"))
        context.eval(FACTS)
        self.context, self.call = context, context.eval(CALL)

    def _ask(self, name: str, task: dict, more: Any) -> Any:
        return json.loads(self.call(name, json.dumps(task), json.dumps(more)))

    def judge(self, task: dict, given: dict) -> dict:
        return self._ask("judge", task, given)

    def facts(self, task: dict, given: dict, *names: str) -> list:
        return self._ask("facts", task, {"given": given, "names": names})

    def along(self, task: dict, items: list, fact: str) -> list:
        return self._ask("along", task, {"items": items, "fact": fact})
