"""Add tasks that the page judges: a directive for elements of class `pidalab-task`, and scripts for their pages.

    ```{task} Short title
    :label: task-3-2

    What is asked.

    ---
    kind: number
    …
    ---

    A hint.

    ---

    The answer, worked.
    ```

The second part is YAML, as in `_static/lab/judge.js`, with three more entries. `lab` is a state of the
lab for a link. `key` is a right answer, whose numbers are in the worked answer. `wrong` lists usual wrong answers, each
with a word of the reply. The tests compare these answers with the library. Hint and answer unfold without JavaScript.
"""

import json
import re
from typing import ClassVar, NamedTuple

import yaml
from docutils import nodes
from docutils.parsers.rst import directives
from docutils.statemachine import StringList
from sphinx.util.docutils import SphinxDirective

SCRIPTS = ("engine", "model", "judge", "plot", "task")
SEARCHING = ("engine", "optima", "model", "optimum", "judge", "plot", "task")
FOR_TESTS = ("key", "wrong")


class Parts(NamedTuple):
    """Parts of a task. Words, hint and answer are Markdown."""

    words: str
    data: dict
    hint: str
    answer: str


def parts_of(content: str) -> Parts:
    """Split the content of a directive."""
    pieces = re.split(r"^---[ \t]*$", content, flags=re.MULTILINE)
    if len(pieces) != 4:
        raise ValueError(
            f"a task has four parts, words, data, hint and answer, with --- between them; found {len(pieces)}"
        )
    words, data, hint, answer = (piece.strip() for piece in pieces)
    return Parts(words, yaml.safe_load(data), hint, answer)


def number_of(label: str) -> str:
    """Return the number of a label: task-3-2 is Task 3.2, task-huba2018-1 is Task huba2018-1."""
    name = label.removeprefix("task-")
    return name.replace("-", ".") if re.fullmatch(r"[\d-]+", name) else name


def written(label: str, data: dict) -> str:
    """Return the data for the page, safe inside a script."""
    shown = {key: value for key, value in data.items() if key not in FOR_TESTS}
    return json.dumps({"label": label, **shown}, ensure_ascii=False).replace("<", "\\u003c")


class task_node(nodes.General, nodes.Element):
    """Node of a task."""


class task_data(nodes.General, nodes.Element):
    """Node with the data for the judge."""


class task_fold(nodes.General, nodes.Element):
    """Node of a hint or an answer."""


def open_task(self, node):
    label = node["ids"][0]
    self.body.append(
        f'<div class="pidalab-task" id="{label}" role="group" aria-labelledby="{label}-title">\n'
    )


def close_div(self, node):
    self.body.append("</div>\n")


def write_data(self, node):
    self.body.append(
        f'<script type="application/json">{node["text"]}</script>\n<div class="task-room"></div>\n'
    )
    raise nodes.SkipNode


def open_fold(self, node):
    name = node["name"]
    self.body.append(
        f'<details class="task-fold task-{name.lower()}"><summary>{name}</summary>\n<div class="task-inside">\n'
    )


def close_fold(self, node):
    self.body.append("</div></details>\n")


class Task(SphinxDirective):
    """Read a task."""

    has_content = True
    required_arguments = 1
    final_argument_whitespace = True
    option_spec: ClassVar = {"label": directives.unchanged_required}

    def run(self):
        label = self.options.get("label", "")
        if not re.fullmatch(r"task(-[a-z\d]+)+", label):
            raise self.error(f"expected a label such as task-3-2, found {label!r}")
        try:
            parts = parts_of("\n".join(self.content))
        except (ValueError, yaml.YAMLError) as error:
            raise self.error(f"{label}: {error}") from error
        domain = self.env.get_domain("std")
        number = f"Task {number_of(label)}"
        domain.anonlabels[label] = self.env.docname, label
        domain.labels[label] = self.env.docname, label, number
        host = task_node(ids=[label])
        title, _ = self.state.inline_text(self.arguments[0], self.lineno)
        host += nodes.paragraph(
            "",
            "",
            nodes.strong("", number, classes=["task-number"]),
            nodes.Text(" "),
            *title,
            ids=[f"{label}-title"],
            classes=["task-title"],
        )
        self.parse(parts.words, host)
        host += task_data(text=written(label, parts.data))
        for name in ("Hint", "Answer"):
            fold = task_fold(name=name)
            self.parse(getattr(parts, name.lower()), fold)
            host += fold
        return [host]

    def parse(self, text, parent):
        """Read Markdown into a node."""
        source = self.get_source_info()[0]
        self.state.nested_parse(StringList(text.splitlines(), source), self.content_offset, parent)


def add_scripts(app, pagename, templatename, context, doctree):
    """Add scripts and styles to a page with tasks. Tasks with a search need more scripts."""
    body = context.get("body", "")
    if 'class="pidalab-task"' in body:
        app.add_css_file("lab/lab.css")
        app.add_css_file("tasks.css")
        for script in SEARCHING if '"search": true' in body else SCRIPTS:
            app.add_js_file(f"lab/{script}.js")


def setup(app):
    app.add_directive("task", Task)
    app.add_node(task_node, html=(open_task, close_div))
    app.add_node(task_data, html=(write_data, None))
    app.add_node(task_fold, html=(open_fold, close_fold))
    app.connect("html-page-context", add_scripts)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
