"""Write the tasks of the built site as sheets for printing: without answers, with answers, and for the teacher.

`tasks.html` has space to write, `tasks-answers.html` has the worked answers, and `tasks-teacher.html` also has the
hints and the replies to known wrong answers.
"""

import json
from copy import copy
from functools import cache
from pathlib import Path

import yaml
from bs4 import BeautifulSoup, Tag

ROOT = Path(__file__).resolve().parents[1]
SITE = ROOT / "_build" / "html"
STYLE = """
body { display: block; max-width: 180mm; margin: 0 auto; font-size: 10pt; background: #fff; color: #000; }
.pidalab-task { border: 0; border-top: 0.5pt solid #888; padding: 2mm 0; margin: 0 0 3mm; background: none;
  break-inside: avoid; }
.pidalab-task .task-room { height: 28mm; border: 0; }
.with-answers .pidalab-task .task-room { height: 0; }
.task-inside { padding: 0; }
.task-said { font-size: 9pt; margin: 1mm 0; }
.task-part { font-weight: 600; margin: 1mm 0 0; }
"""
KINDS = {
    "tasks": ("Tasks", ()),
    "tasks-answers": ("Tasks, with answers", ("answer",)),
    "tasks-teacher": ("Tasks, for the teacher", ("hint", "answer", "said")),
}


@cache
def collected() -> list[tuple[str, list[Tag]]]:
    """Return title and tasks of each page that has tasks, in the order of the table of contents."""
    parts = yaml.safe_load((ROOT / "_toc.yml").read_text(encoding="utf-8"))["parts"]
    found = []
    for name in (chapter["file"] for part in parts for chapter in part["chapters"]):
        text = (SITE / f"{name}.html").read_text(encoding="utf-8")
        if 'class="pidalab-task"' in text:  # parse only these pages, since parsing is slow
            body = BeautifulSoup(text, "html.parser").select_one("article.bd-article")
            head = "".join(body.h1.find_all(string=True, recursive=False)).strip()
            found.append((head, body.select(".pidalab-task")))
    return found


def entered(slip: dict) -> str:
    """Describe a wrong answer in words."""
    if "given" in slip:
        return ", ".join(f"{name} {value}" for name, value in slip["given"].items())
    if "when" in slip:
        return ", ".join(f"{name} from {low} to {high}" for name, (low, high) in slip["when"].items())
    return str(slip.get("value", slip.get("of")))


def said(data: dict) -> list[tuple[str, str]]:
    """List the known wrong answers of a task with their replies."""
    names = [item["name"] for item in data.get("items", [])]
    slips = []
    for slip in data.get("slips", []):
        order = slip.get("given", {}).get("order")
        slips.append((", ".join(names[k] for k in order) if order else entered(slip), slip["word"]))
    choices = [*data.get("options", []), *data.get("reasons", [])]
    return slips + [(one.get("name") or one["text"], one["word"]) for one in choices if "word" in one]


def on_paper(soup: BeautifulSoup, task: Tag, shown: tuple[str, ...]) -> Tag:
    """Prepare a task for a sheet that shows only some of its parts."""
    task = copy(task)
    data = json.loads(task.script.string)
    for gone in task.select("script, .headerlink"):
        gone.decompose()
    for link in task.select("a"):  # links are useless on paper
        link.unwrap()
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
                listed.append(_with_text(soup, "li", one.get("name") or one["text"]))
            task.select_one(".task-room").insert_before(listed)
    if "said" in shown:
        for wrong, word in said(data):
            task.append(_with_text(soup, "p", f"{wrong}: {word}", "task-said"))
    return task


def _with_text(soup: BeautifulSoup, name: str, text: str, kind: str = "") -> Tag:
    tag = soup.new_tag(name, attrs={"class": kind} if kind else {})
    tag.string = text
    return tag


def sheet(title: str, shown: tuple[str, ...]) -> BeautifulSoup:
    """Return the document of one kind of sheet. Of the scripts, it keeps only those that show formulas."""
    soup = BeautifulSoup((SITE / "book" / "intro.html").read_text(encoding="utf-8"), "html.parser")
    for script in soup.select("script"):
        if "MathJax" in script.get_text() or "mathjax" in script.get("src", ""):
            soup.head.append(script.extract())
        else:
            script.decompose()
    for link in soup.select("link[rel=next], link[rel=prev]"):
        link.decompose()
    soup.head.append(_with_text(soup, "style", STYLE))
    soup.html["data-theme"] = "light"
    soup.title.string = f"pidalab: {title}"
    soup.body.clear()
    soup.body.attrs = {"class": ["bd-content", *(["with-answers"] if shown else [])]}
    soup.body.append(_with_text(soup, "h1", title))
    for head, tasks in collected():
        soup.body.append(_with_text(soup, "h2", head))
        soup.body.extend([on_paper(soup, task, shown) for task in tasks])
    return soup


def main(target: Path) -> None:
    """Write the sheets."""
    target.mkdir(parents=True, exist_ok=True)
    for name, (title, shown) in KINDS.items():
        (target / f"{name}.html").write_text(str(sheet(title, shown)), encoding="utf-8")
