"""Measure what a change in the lab costs: the time until the change is drawn, on the page's one thread.

The built page in Chromium, as it is and slowed down to a quarter of its speed, as the browser's tools for developers do
it to stand for a slow laptop. The time is processor time of the thread, with style, layout and painting.
"""

from __future__ import annotations

import shutil
import statistics
from collections.abc import Callable, Iterator
from pathlib import Path

from playwright.sync_api import CDPSession, Page, sync_playwright

from benchmarks.measure import write

PAGE = Path(__file__).parents[1] / "_build" / "html" / "book" / "lab.html"
RESULTS = "lab_comparison"  # in book/data
COLUMNS = ("change", "designs", "slowed", "seconds", "browser")
SLOWED, WARM, COUNTED = (1, 4), 8, 30
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chromium-headless-shell")
KEPT = [
    {"kind": "PI", "kp": 0.5, "ti": 3, "td": 0, "ta": 0, "filterTime": 0.1, "filterOrder": 1},
    {"kind": "PID", "kp": 0.7, "ti": 3, "td": 1, "ta": 0, "filterTime": 0.1, "filterOrder": 2},
    {"kind": "PIDA", "kp": 0.8, "ti": 3, "td": 1, "ta": 0.333, "filterTime": 0.1, "filterOrder": 3},
]
LIMITS = {"limited": True, "low": -1, "high": 1.5}
CHANGES: dict[str, tuple[dict, str, Callable[[int], object]]] = {
    "a gain by hand": ({}, "kp", lambda k: 0.7 + 0.005 * k),
    "the filter time": ({}, "filterTime", lambda k: 0.05 + 0.002 * k),
    "Ms, lags cancelled": ({"rule": "cancellation"}, "ms", lambda k: 1.3 + 0.01 * k),
    "a gain at limits": (LIMITS, "kp", lambda k: 0.7 + 0.005 * k),
    "the upper limit": (LIMITS, "high", lambda k: 1.1 + 0.01 * k),
    "the size of the noise": ({"noisy": True}, "noise", lambda k: 0.01 + 0.001 * k),
    "the sample time": ({"sampled": True}, "sampleTime", lambda k: 0.05 + 0.01 * k),
    "the plant": (
        {"rule": "cancellation"},
        "plant",
        lambda k: ("lags3", "unequal", "haalman-1", "heo-1")[k % 4],
    ),
}
CHANGE = """async ([state, key, value]) => {
  const { lab } = document.querySelector(".pidalab-lab"), step = () => new Promise(requestAnimationFrame);
  if (state) {
    const { plant, sampled, noisy, kept, ...own } = state, designs = [own, ...kept];
    lab.change({ plant, sampled, noisy, chosen: 0, designs: designs.map((each) => ({ ...lab.design, ...each })) });
  }
  if (key in lab.state) lab.change({ [key]: value }); else lab.byHand({ [key]: value });
  for (let k = 0; k < 2; k++) { await step(); await new Promise((done) => setTimeout(done)); }
}"""


def worked(session: CDPSession) -> float:
    """Processor time of the page's thread so far, in seconds."""
    found = session.send("Performance.getMetrics")["metrics"]
    return next(one["value"] for one in found if one["name"] == "TaskDuration")


def timed(page: Page, session: CDPSession, name: str, kept: list[dict]) -> float:
    """Median of many changes of one kind, each to a value of its own."""
    state, key, value = CHANGES[name]
    start = {
        "plant": "lags3",
        "rule": "hand",
        "kept": kept,
        "limited": False,
        "noisy": False,
        "sampled": False,
    }
    page.evaluate(CHANGE, [start | state, key, value(0)])
    page.wait_for_timeout(400)  # until it has spoken
    times = []
    for k in range(1, WARM + COUNTED + 1):
        before = worked(session)
        page.evaluate(CHANGE, [None, key, value(k)])
        times.append(worked(session) - before)
    return statistics.median(times[WARM:])


def rows() -> Iterator[dict]:
    """Every kind of change, with one design and with three more that are kept."""
    if not PAGE.exists():
        raise FileNotFoundError(f"{PAGE}: run `make book` first")
    executable = next(filter(None, map(shutil.which, BROWSERS)), None)
    if executable is None:
        raise FileNotFoundError(f"the page needs a browser on PATH, found none of {', '.join(BROWSERS)}")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.goto(PAGE.as_uri())
        page.locator(".lab-ready").wait_for()
        session = page.context.new_cdp_session(page)
        session.send("Performance.enable", {"timeDomain": "threadTicks"})
        for slowed in SLOWED:
            session.send("Emulation.setCPUThrottlingRate", {"rate": slowed})
            for name in CHANGES:
                for kept in ([], KEPT):
                    found = {"change": name, "designs": 1 + len(kept), "slowed": slowed}
                    yield found | {"seconds": timed(page, session, name, kept), "browser": browser.version}
        browser.close()


def main() -> None:
    """Measure, print and write."""
    found = []
    for row in rows():
        found.append(row)
        print(
            f"{row['change']:24}{row['designs']:3}{row['slowed']:3}{1e3 * row['seconds']:8.1f} ms", flush=True
        )
    write(RESULTS, COLUMNS, found)


if __name__ == "__main__":
    main()
