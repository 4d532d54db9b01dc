"""Print the tasks of the built site as sheets: without answers, with them, and for the teacher.

dist/pidalab-tasks-<version>.pdf has room to write, -answers has the worked answers, and -teacher the hints and the
wrong answers that the page knows, too, with what it says to them.
"""

import json
import sys
import tomllib
from copy import copy
from functools import cache

import pdf
from bs4 import BeautifulSoup, Tag
from pypdf import PdfReader

STYLE = """
article.bd-article { break-before: auto; }
.pidalab-task { border: 0; border-top: 0.5pt solid #888; padding: 2mm 0; margin: 0 0 3mm; background: none; }
.pidalab-task .task-room { height: 28mm; border: 0; }
.with-answers .pidalab-task .task-room { height: 0; }
.task-inside { padding: 0; }
.task-said { font-size: 9pt; margin: 1mm 0; }
.task-part { font-weight: 600; margin: 1mm 0 0; }
"""
MARK = 'class="pidalab-task"'
KINDS = {
    "": ("Tasks", ()),
    "-answers": ("Tasks, with answers", ("answer",)),
    "-teacher": ("Tasks, for the teacher", ("hint", "answer", "said")),
}


@cache
def collected() -> list[tuple[str, list[Tag]]]:
    """The pages with tasks, in the order of the table of contents: the title of each, and its tasks."""
    pages = [page for _, names in pdf.parts() for page in names]
    found = []
    for page in pages:
        text = (pdf.SITE / f"{page}.html").read_text(encoding="utf-8")
        if MARK in text:  # reading all pages takes a while
            body = BeautifulSoup(text, "html.parser").select_one("article.bd-article")
            head = "".join(body.h1.find_all(string=True, recursive=False)).strip()
            found.append((head, body.select(".pidalab-task")))
    return found


def entered(slip: dict) -> str:
    """Say in words what a wrong answer is."""
    if "given" in slip:
        return ", ".join(f"{name} {value}" for name, value in slip["given"].items())
    if "when" in slip:
        return ", ".join(f"{name} from {low} to {high}" for name, (low, high) in slip["when"].items())
    return str(slip.get("value", slip.get("of")))


def said(data: dict) -> list[tuple[str, str]]:
    """List the wrong answers that a task knows, each with what the page says."""
    names = [item["name"] for item in data.get("items", [])]
    slips = []
    for slip in data.get("slips", []):
        order = slip.get("given", {}).get("order")
        slips.append((", ".join(names[k] for k in order) if order else entered(slip), slip["word"]))
    options = [(one.get("name") or one["text"], one["word"]) for one in choices(data) if "word" in one]
    return slips + options


def choices(data: dict) -> list[dict]:
    """Options and reasons of a task."""
    return [*data.get("options", []), *data.get("reasons", [])]


def on_paper(soup: BeautifulSoup, task: Tag, shown: tuple[str, ...]) -> Tag:
    """Return a task for a sheet with these of its parts."""
    task = copy(task)
    data = json.loads(task.script.string)
    for gone in task.select("script, .headerlink"):
        gone.decompose()
    for name in ("hint", "answer"):
        fold = task.select_one(f".task-{name}")
        if name in shown:
            fold.name, fold["class"] = "div", "task-unfolded"
            fold.summary["class"], fold.summary.name = "task-part", "p"
        else:
            fold.decompose()
    for what in ("options", "reasons"):
        if what in data:
            listed = soup.new_tag("ul")
            for one in data[what]:
                line = soup.new_tag("li")
                line.string = one.get("name") or one["text"]
                listed.append(line)
            task.select_one(".task-room").insert_before(listed)
    if "said" in shown:
        for wrong, word in said(data):
            line = soup.new_tag("p", attrs={"class": "task-said"})
            line.string = f"{wrong}: {word}"
            task.append(line)
    return task


def sheet(title: str, shown: tuple[str, ...]) -> BeautifulSoup:
    """Return the document of one kind of sheet."""
    soup = pdf.empty(f"pidalab: {title}")
    soup.head.select("style")[-1].string += STYLE
    body = soup.new_tag("article", attrs={"class": ["bd-article", *(["with-answers"] if shown else [])]})
    pdf.heading(soup, body, "h1", title)
    for head, tasks in collected():
        part = soup.new_tag("h3")
        part.string = head
        body.append(part)
        body.extend([on_paper(soup, task, shown) for task in tasks])
    soup.body.append(body)
    return soup


def main() -> int:
    """Print the sheets."""
    version = tomllib.loads((pdf.ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    pdf.DIST.mkdir(exist_ok=True)
    for name, (title, shown) in KINDS.items():
        target = pdf.DIST / f"pidalab-tasks-{version}{name}.pdf"
        source = pdf.SITE / f"_tasks{name}.html"
        source.write_text(str(sheet(title, shown)), encoding="utf-8")
        try:
            pdf.printed(source, target, f"pidalab: {title}")
        finally:
            source.unlink()
        print(f"{target.relative_to(pdf.ROOT)}: {len(PdfReader(target).pages)} pages")
    return 0


if __name__ == "__main__":
    sys.exit(main())
