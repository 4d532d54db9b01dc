"""Cells that run in the page: what comes out in a browser is what the page stores."""

import functools
import http.server
import json
import re
import threading

import pytest

LECTURES = (
    "learn/what-acceleration-does",
    "learn/when-it-pays",
    "learn/tuning",
    "learn/filter-and-noise",
    "learn/limits",
    "learn/digital",
)
NUMBER = re.compile(r"[-−+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?", re.IGNORECASE)
BAR = "document.querySelector('.pidalab-run-bar').dataset.state"


class Quiet(http.server.SimpleHTTPRequestHandler):
    """A web server that says nothing."""

    def log_message(self, *_):
        pass


@pytest.fixture(scope="module")
def served(site):
    """Serve the site, if it was built with the engine; a worker starts from no file."""
    if not (site / "live" / "engine.json").is_file():
        pytest.skip("the site was built without the engine: `make live`, then `make book LIVE=1`")
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=site))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/book/"
    server.shutdown()


@pytest.fixture
def started(served, visit):
    """Open a page and start its interpreter."""

    def started(name):
        page, wrong = visit(f"{served}{name}.html")
        page.get_by_role("button", name="Run this page").click()
        page.wait_for_function(BAR)
        assert page.evaluate(BAR) == "ready", page.locator(".pidalab-run-bar").inner_text()
        return page, wrong

    return started


def run_all(page):
    """Run every cell and return what the cells with code show: texts, tables and numbers of figures."""
    page.get_by_role("button", name="Run all").click()
    status = page.locator(".pidalab-run-bar .pidalab-run-status")
    page.wait_for_function(
        "(e) => /^(Done|Cell|The interpreter)/.test(e.textContent)",
        arg=status.element_handle(),
        timeout=600_000,
    )
    assert status.text_content() == "Done."
    script = "(all) => all.map((e) => [e.textContent, e.querySelectorAll('img.only-light').length])"
    return page.locator(".pidalab-run-output").evaluate_all(script)


def stored(root, name):
    """Return the same of a notebook's stored outputs, for the cells whose code the page shows."""
    notebook = json.loads((root / "book" / f"{name}.ipynb").read_text(encoding="utf-8"))
    found = []
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code" and not {"remove-input", "remove-cell"} & set(
            cell["metadata"].get("tags", ())
        ):
            texts, figures = [], 0
            for output in cell["outputs"]:
                data = output.get("data", {})
                figures += "image/svg+xml" in data
                if "image/svg+xml" not in data:
                    html = re.sub(r"<[^>]*>", " ", "".join(data.get("text/html", "")))
                    texts.append(html or "".join(output.get("text", data.get("text/plain", ""))))
            found.append((" ".join(texts), figures))
    return found


def numbers(text):
    return [float(each.replace("−", "-")) for each in NUMBER.findall(text)]


@pytest.mark.parametrize("name", [*LECTURES, "haalman2024"])
def test_cells_give_in_the_page_what_is_stored(name, root, started):
    page, wrong = started(name)
    fresh, kept = run_all(page), stored(root, name)
    assert len(fresh) == len(kept)
    assert any(numbers(text) for text, _ in fresh)
    for (text, figures), (expected, pictures) in zip(fresh, kept, strict=True):
        assert figures == pictures
        assert numbers(text) == pytest.approx(numbers(expected), rel=1e-6, abs=1e-12), text
    assert wrong == []


def test_a_changed_cell_shows_its_result_and_a_wrong_one_its_traceback(started):
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


def test_stop_ends_a_cell_that_never_ends(started):
    page, _ = started("learn/tuning")
    cell = page.locator(".pidalab-run:not(:has(details))").first
    cell.locator("pre").first.fill("while True: pass")
    cell.get_by_role("button", name="Run").click()
    cell.locator(".pidalab-run-status", has_text="running").wait_for()
    page.get_by_role("button", name="Stop").click()
    page.locator(".pidalab-run-status", has_text="Stopped.").wait_for()


def test_a_failed_start_says_so_and_offers_another(served, visit):
    page, _ = visit(f"{served}learn/tuning.html")
    page.evaluate("caches.delete('pidalab-live')")
    page.route("**/packages.zip*", lambda route: route.abort())
    page.get_by_role("button", name="Run this page").click()
    page.get_by_role("button", name="Retry").wait_for()
    assert "did not start" in page.locator(".pidalab-run-bar").inner_text()
