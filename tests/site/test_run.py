"""Run cells in pages, and compare the results with the stored outputs."""

import functools
import http.server
import json
import re
import threading

import pytest
from playwright.sync_api import expect

LECTURES = (
    "learn/what-acceleration-does",
    "learn/when-it-pays",
    "learn/tuning",
    "learn/filter-and-noise",
    "learn/limits",
    "learn/digital",
)
NUMBER = re.compile(r"[-−+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?", re.IGNORECASE)


class Quiet(http.server.SimpleHTTPRequestHandler):
    """A web server without log output."""

    def log_message(self, *_):
        pass


@pytest.fixture(scope="module")
def served(site):
    """Serve the site if it was built with the engine. A worker cannot start from a file."""
    if not (site / "live" / "engine.json").is_file():
        pytest.skip("the site was built without the engine: `make live`, then `make book LIVE=1`")
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=site))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/book/"
    server.shutdown()
    server.server_close()


@pytest.fixture
def started(served, visit):
    """Open a page and start its interpreter."""

    def started(name):
        page, wrong = visit(f"{served}{name}.html")
        page.get_by_role("button", name="Run this page").click()
        bar = page.locator(".pidalab-run-bar[data-state]")
        bar.wait_for(timeout=120_000)
        assert bar.get_attribute("data-state") == "ready", bar.inner_text()
        return page, wrong

    return started


def run_all(page):
    """Run every cell. Return text and number of figures of each cell that shows its code."""
    page.get_by_role("button", name="Run all").click()
    status = page.locator(".pidalab-run-bar .pidalab-run-status")
    expect(status).to_have_text(re.compile("^(Done|Cell|The interpreter)"), timeout=600_000)
    assert status.text_content() == "Done."
    figures = "e.querySelectorAll('img.only-light').length"
    script = f"(all) => all.map((e) => [Number(e.dataset.cell), [e.textContent, {figures}]])"
    return dict(page.locator(".pidalab-run-output").evaluate_all(script))


def stored(root, name):
    """Return text and number of figures of each cell from a notebook's stored outputs."""
    notebook = json.loads((root / "book" / f"{name}.ipynb").read_text(encoding="utf-8"))
    shown, cells = {}, [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    for number, cell in enumerate(cells):
        if {"remove-input", "remove-cell"} & set(cell["metadata"].get("tags", ())):
            continue
        texts, figures = [], 0
        for output in cell["outputs"]:
            data = output.get("data", {})
            figures += "image/svg+xml" in data
            if "image/svg+xml" not in data:
                html = re.sub(r"<[^>]*>", " ", "".join(data.get("text/html", "")))
                texts.append(html or "".join(output.get("text", data.get("text/plain", ""))))
        shown[number] = " ".join(texts), figures
    return shown


def numbers(text):
    return [float(each.replace("−", "-")) for each in NUMBER.findall(text)]


@pytest.mark.parametrize("name", [*LECTURES, "haalman2024"])
def test_cells_match_stored_outputs(name, root, started):
    page, wrong = started(name)
    fresh, kept = run_all(page), stored(root, name)
    # A live figure replaces a stored figure and its code.
    assert len(kept) - page.locator(".pidalab-live").count() <= len(fresh) <= len(kept)
    assert any(numbers(text) for text, _ in fresh.values())
    for cell, (text, figures) in fresh.items():
        assert figures == kept[cell][1]
        assert numbers(text) == pytest.approx(numbers(kept[cell][0]), rel=1e-6, abs=1e-12), text
    assert wrong == []


def test_changed_cell_shows_result_or_traceback(started):
    page, _ = started("learn/tuning")
    cell = page.locator(".pidalab-run:not(:has(details))").first
    code, run = cell.locator("pre").first, cell.get_by_role("button", name="Run")
    code.fill("print(6 * 7)")
    run.click()
    cell.locator(".pidalab-run-output", has_text="42").wait_for()
    code.fill("1 / 0")
    run.click()
    cell.locator(".pidalab-run-error", has_text="ZeroDivisionError").wait_for()
    page.get_by_role("button", name="Reset").click()
    page.locator(".pidalab-run-status", has_text="Reset.").wait_for()
    assert "6 * 7" not in code.inner_text()


def test_changed_ms_changes_later_cells(root, started):
    page, _ = started("haalman2024")
    kept, cells = stored(root, "haalman2024"), page.locator(".pidalab-run")
    code = cells.first.locator("pre").first
    code.fill(code.inner_text().replace("ms=1.4", "ms=1.7"))
    cells.nth(2).get_by_role("button", name="Run").click()
    for cell in cells.nth(0), cells.nth(2):
        output = cell.locator(".pidalab-run-output:not([hidden])")
        output.wait_for()
        fresh = numbers(output.inner_text())
        assert fresh
        assert fresh != numbers(kept[int(output.get_attribute("data-cell"))][0])
    assert cells.nth(1).locator(".pidalab-run-output img.only-light").count() == 1


def test_stop_ends_an_endless_cell(started):
    page, _ = started("learn/tuning")
    cell = page.locator(".pidalab-run:not(:has(details))").first
    cell.locator("pre").first.fill("while True: pass")
    cell.get_by_role("button", name="Run").click()
    cell.locator(".pidalab-run-status", has_text="running").wait_for()
    page.get_by_role("button", name="Stop").click()
    page.locator(".pidalab-run-status", has_text="Stopped.").wait_for()


def test_failed_start_is_reported_and_can_be_repeated(served, visit):
    page, _ = visit(f"{served}learn/tuning.html")
    page.evaluate("caches.delete('pidalab-live')")
    page.route("**/packages.zip*", lambda route: route.abort())
    page.get_by_role("button", name="Run this page").click()
    page.get_by_role("button", name="Retry").wait_for()
    assert "did not start" in page.locator(".pidalab-run-bar").inner_text()
