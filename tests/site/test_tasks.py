"""Solve tasks in the browser: by keyboard, with storage or without, on a phone."""

import json

from bs4 import BeautifulSoup
from looking import NARROW, OVERFLOW, problems

from paperledger import papers

FOLDS = "(label) => ['hint', 'answer'].map((name) => document.querySelector(`#${label} .task-${name}`).open)"
REFUSED = "Object.defineProperty(window, 'localStorage', { get() { throw new Error('refused'); } });"
STOPS = "(label) => [...document.querySelectorAll(`#${label} :is(input, select, button, a[href], summary)`)].length"


def address(site, page):
    return (site / "book" / f"{page}.html").as_uri()


def soup_of(site, page):
    return BeautifulSoup((site / "book" / f"{page}.html").read_text(encoding="utf-8"), "html.parser")


def verdict(page, label):
    return page.locator(f"#{label} .task-verdict")


def test_a_task_is_solved_by_keyboard_and_stays_solved(site, visit):
    """The task is still solved after the page is reloaded."""
    label, url = "task-1-1", address(site, "learn/what-acceleration-does")
    page, wrong = visit(url, viewport=NARROW)
    assert page.evaluate(OVERFLOW) <= 1
    field = page.locator(f"#{label}-answer")
    assert page.get_by_label("Your answer").first.get_attribute("id") == f"{label}-answer"
    assert verdict(page, label).get_attribute("role") == "status"

    said = []
    for entered in ("one", "0,4", "7", "9"):
        field.focus()
        page.keyboard.press("Control+a")
        page.keyboard.type(entered)
        page.keyboard.press("Enter")
        said.append((verdict(page, label).text_content(), page.evaluate(FOLDS, label)))
    assert "must be a number" in said[0][0]
    assert "its inverse" in said[1][0]
    assert [folds for _, folds in said] == [[False, False], [False, False], [True, False], [True, True]]

    page.keyboard.press("Control+a")
    page.keyboard.type("2,5")
    page.keyboard.press("Tab")  # to the button
    page.keyboard.press("Enter")
    assert verdict(page, label).text_content().startswith("Right: 2.5")
    assert page.locator(f"#{label} .task-badge").text_content() == "✓ solved"

    reached = set()
    field.focus()
    for _ in range(page.evaluate(STOPS, label)):
        reached.add(page.evaluate("() => document.activeElement.closest('.pidalab-task')?.id"))
        page.keyboard.press("Tab")
    assert label in reached

    badge = page.locator(f"#{label} .task-badge")
    for _ in range(10):  # a busy browser stores data a moment later
        page.wait_for_timeout(500)
        page.reload()
        page.locator(f"#{label} form").wait_for()
        if badge.text_content():
            break
    assert badge.text_content() == "✓ solved"
    assert page.locator(f"#{label}-answer").input_value() == "2,5"
    assert problems(page) == []
    assert wrong == []


def test_tasks_work_without_storage(site, browser):
    page = browser.new_page()
    page.add_init_script(REFUSED)
    page.goto(address(site, "learn/tuning"))
    page.locator("#task-3-2 button[type=submit]").click()
    assert "a longer filter" in verdict(page, "task-3-2").text_content()
    page.close()


def test_the_questions_of_the_guided_lab_come_one_at_a_time(site, visit):
    page, wrong = visit(address(site, "learn/guided-lab"), viewport=NARROW)
    shown = page.locator(".pidalab-steps .pidalab-task:visible")
    assert shown.count() == 1
    assert page.locator(".task-step").count() == 5
    page.get_by_role("button", name="Next question").click()
    assert shown.get_attribute("id") == "task-lab-2"
    page.get_by_role("button", name="Question 3").click()
    page.locator("#task-lab-3-sensor").fill("0.305")
    page.locator("#task-lab-3 button[type=submit]").click()
    assert verdict(page, "task-lab-3").text_content().startswith("Right")
    assert page.get_by_role("button", name="Question 3, solved").count() == 1
    link = page.locator("#task-lab-3 .task-actions a").get_attribute("href")
    assert "book/lab.html#lab-" in link
    page.get_by_role("button", name="Question 2").click()
    page.locator("#task-lab-2-noise").fill("1.5")
    page.locator("#task-lab-2 button[type=submit]").click()
    assert "Searching" in verdict(page, "task-lab-2").text_content()
    page.wait_for_function(
        "() => document.querySelector('#task-lab-2 .task-verdict').textContent.includes('still saves too much')"
    )
    assert page.evaluate(OVERFLOW) <= 1
    assert wrong == []


def test_lectures_and_chapters_have_two_tasks_with_answers_without_scripts(site, root):
    lessons = [f"learn/{path.stem}" for path in root.glob("book/learn/*.ipynb")]
    lessons += papers(root / "book" / "ledger")
    tasks = [task for name in lessons for task in soup_of(site, name).select(".pidalab-task")]
    assert len(tasks) == 2 * len(lessons) == 22
    for task in tasks:
        data = json.loads(task.script.string)
        assert data["label"] == task["id"]
        assert not {"key", "wrong"} & set(data)
        assert [fold.summary.get_text() for fold in task.select("details")] == ["Hint", "Answer"]
        assert task.select_one(".task-room").get_text() == ""


def test_figures_and_exercises_are_numbered_by_lecture(site):
    soup = soup_of(site, "learn/when-it-pays")
    exercises = [
        title.get_text(" ", strip=True).split(" (")[0] for title in soup.select(".exercise .admonition-title")
    ]
    assert exercises == [f"Exercise 2.{k}" for k in range(1, 7)]
    figures = [number.get_text(strip=True) for number in soup.select("figcaption .caption-number")]
    assert figures == [f"Fig. 2.{k}" for k in range(1, len(figures) + 1)]
    for link in soup.select("a[href^='#learn-2-']"):
        if link.get_text().startswith("Exercise"):
            assert link.get_text() == f"Exercise {link['href'].removeprefix('#learn-').replace('-', '.')}"
