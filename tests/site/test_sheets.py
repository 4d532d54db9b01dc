"""Tasks on paper: the same parts three times, and nothing on a sheet that it should not show."""

import pytest
import sheets

DATA = {
    "slips": [
        {"value": 0.4, "word": "The inverse."},
        {"of": "gm", "word": "The margin it has."},
        {"given": {"kp": 2, "ti": 3}, "word": "Too bold."},
        {"given": {"order": [1, 0]}, "word": "The other way."},
        {"when": {"ms": [1.5, 1.6]}, "word": "Used up."},
    ],
    "items": [{"name": "A"}, {"name": "B"}],
    "reasons": [{"text": "it is fast", "word": "It is slow."}, {"text": "it leads", "right": True}],
}


def test_wrong_answers_are_said_in_words():
    assert sheets.said(DATA) == [
        ("0.4", "The inverse."),
        ("gm", "The margin it has."),
        ("kp 2, ti 3", "Too bold."),
        ("B, A", "The other way."),
        ("ms from 1.5 to 1.6", "Used up."),
        ("it is fast", "It is slow."),
    ]


@pytest.mark.parametrize(("kind", "shown"), [(name, shown) for name, (_, shown) in sheets.KINDS.items()])
def test_a_sheet_has_every_task_and_what_is_for_its_reader(site, kind, shown):
    soup = sheets.sheet("Tasks", shown)
    tasks = soup.select(".pidalab-task")
    assert len(tasks) == sum(len(found) for _, found in sheets.collected()) >= 24
    assert soup.select(".pidalab-task script, .pidalab-task .headerlink, form") == []
    for task in tasks:
        parts = [part.get_text() for part in task.select(".task-part")]
        assert parts == [name for name in ("Hint", "Answer") if name.lower() in shown]
        assert bool(task.select(".task-said")) <= ("said" in shown)
    text = soup.get_text(" ")
    assert ("That is the integral gain" in text) == (kind == "tasks-teacher")
    assert "its lead allows more gain" in text  # options are part of the question
