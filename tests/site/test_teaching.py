"""Parts of lectures and chapters: answers in words that were run, and links to the lab."""

import re
from pathlib import Path

import nbformat

PARTS = (
    "**The question.**",
    "**The answer in one figure.**",
    "## The recipe",
    "## Try it",
    "## Common mistakes",
    "## Exercises",
    "## Project",
    "## Where to go on",
)
MOST_OF_A_RECIPE, LEAST_EXERCISES = 10, 6
RUN = "\n<a cell that ran>\n"
ANSWER = re.compile(r"\{solution-start\}[^\n]*\n(?::class:[^\n]*\n)?```(.*?)```\{solution-end\}", re.DOTALL)
LIVE, IN_THE_LAB = 'class="pidalab-live"', '"lab": true'


def cells_of(path: Path) -> list:
    return nbformat.read(path, as_version=4).cells


def unanswered(cells: list) -> list[str]:
    """Exercises without an answer that has a sentence and a cell that printed or drew something."""
    text = "\n".join(RUN if c.cell_type == "code" and c.outputs else c.source for c in cells)
    answers = ANSWER.findall(text)
    wrong = [f"an answer that does not run: {answer.strip()}" for answer in answers if RUN not in answer]
    for answer in answers:
        if len(re.findall(r"\w+", answer.replace(RUN, ""))) < 5 or "." not in answer:
            wrong.append(f"an answer without words: {answer.strip()}")
    if (asked := text.count("```{exercise}")) != len(answers):
        wrong.append(f"{asked} exercises, {len(answers)} answers")
    return wrong


def without_lab(cells: list) -> list[str]:
    """Live figures that do not lead to the lab with their loops loaded."""
    figures = sum(cell.source.count(LIVE) for cell in cells)
    told = [o.get("data", {}).get("text/html", "") for c in cells if c.cell_type == "code" for o in c.outputs]
    linked = sum(IN_THE_LAB in html for html in told)
    return (
        [f"{figures} live figures, {linked} of them lead to the lab"]
        if not figures or linked != figures
        else []
    )


def lecture_problems(cells: list) -> list[str]:
    text = "\n".join(cell.source for cell in cells if cell.cell_type == "markdown")
    wrong = [f"without {part}" for part in PARTS if part not in text]
    at = next((k for k, cell in enumerate(cells) if "## The recipe" in cell.source), len(cells))
    recipe = next((cell.source.splitlines() for cell in cells[at:] if cell.cell_type == "code"), [])
    if not 0 < len(recipe) <= MOST_OF_A_RECIPE:
        wrong.append(f"a recipe of {len(recipe)} lines")
    if text.count("```{exercise}") < LEAST_EXERCISES:
        wrong.append(f"fewer than {LEAST_EXERCISES} exercises")
    return wrong


def chapters(root: Path) -> list[Path]:
    ledgers = sorted(path.stem for path in root.glob("book/ledger/*.csv"))
    return [root / "book" / f"{paper}.ipynb" for paper in ledgers if paper not in ("manifest", "removed")]


def lectures(root: Path) -> list[Path]:
    return sorted(root.glob("book/learn/*.ipynb"))


def test_lectures_have_their_parts(root):
    assert len(lectures(root)) == 6
    assert [(path.name, wrong) for path in lectures(root) for wrong in lecture_problems(cells_of(path))] == []


def test_every_exercise_has_an_answer_in_words_that_was_run(root):
    pages = lectures(root) + chapters(root)
    assert len(pages) == 11
    assert [(path.name, wrong) for path in pages for wrong in unanswered(cells_of(path))] == []


def test_every_lecture_and_chapter_leads_to_the_lab(root):
    pages = lectures(root) + chapters(root)
    assert [(path.name, wrong) for path in pages for wrong in without_lab(cells_of(path))] == []


def test_every_fold_of_code_says_what_it_shows(root):
    """Names are unique on a page."""
    for path in sorted((root / "book").rglob("*.ipynb")):
        hidden = [c for c in cells_of(path) if {"hide-input", "hide-cell"} & set(c.metadata.get("tags", []))]
        names = [c.metadata.get("mystnb", {}).get("code_prompt_show") for c in hidden]
        assert all(name and name.startswith("Code: ") for name in names), path.name
        assert len(set(names)) == len(names), path.name
