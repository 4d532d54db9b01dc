"""Compare live figures with the library."""

import json
import re
import shutil

import numpy as np
import pytest
from pictured import CELLS, missing_parts, plots, rows

import pidalab
from pidalab.digital import DigitalController
from pidalab.robustness import max_control_sensitivity

SCRIPTS = "".join(
    f'<script src="lab/{name}.js"></script>' for name in ("engine", "model", "record", "plot", "lab", "live")
)
LIVE_STATE = """{"plant": "lags3", "names": ["one"], "lab": true, "plots": ["bode"], "numbers": ["ms", "first", "hump"],
 "designs": [{"kind": "PIDA", "kp": 1, "ti": 3, "td": 1, "ta": 0.3, "filterTime": 0.1, "filterOrder": 3}],
 "knobs": [{"key": "kp", "label": "gain", "low": 0.1, "high": 10},
  {"key": "plant.delay", "label": "dead time", "low": 0, "high": 4}]}"""
CAPTIONED = """<!doctype html><html lang="en" data-content_root="./"><meta charset="utf-8"><title>Live</title>
<div class="pidalab-live">
<figure id="fig"><img alt="still" src="data:,"><figcaption>Words.</figcaption></figure>
<script type="application/json">%s</script></div>%s</html>"""


@pytest.fixture
def open_figure(root, tmp_path, visit):
    """Return a function that opens a page with one live figure."""

    def open_figure(html):
        shutil.copytree(root / "book" / "_static" / "lab", tmp_path / "lab")
        (tmp_path / "index.html").write_text(html, encoding="utf-8")
        return visit((tmp_path / "index.html").as_uri())

    return open_figure


PROCESS, END = pidalab.Process([1.0, 1.2], [8.0, 14.0, 7.0, 1.0], delay=1.0), 40.0
CONTROLLERS = {
    "PI": pidalab.HighOrderPID([0.12, 0.7], filter_time=0.5, filter_order=1),
    "PID": pidalab.HighOrderPID([0.3, 1.5, 2.5], filter_time=0.1, filter_order=2),
    "PIDA": pidalab.HighOrderPID([0.4, 2.2, 4.4, 3.0], filter_time=0.1, filter_order=3),
}
LOOKS = (4, 1, 0)  # colours and dashes of PI, PID, PIDA
PLOTS = ["setpoint", "load", "control", "effort", "nyquist", "bode", "closed", "lead", "noise"]
NUMBERS = {  # names in the table by their keys
    "iae": "IAE load",
    "iaeSetpoint": "IAE set point",
    "ms": "Ms",
    "mks": "Mks",
    "gm": "gain margin",
    "pm": "phase margin, °",
    "dm": "delay margin",
    "peak": "peak of u",
    "overshoot": "overshoot, %",
    "sigma": "relative noise gain",
    "gmLeast": "at least Ms/(Ms−1)",
    "pmLeast": "at least 2 asin 1/(2 Ms), °",
    "first": "phase margin at the first crossover, °",
    "hump": "top of |L| beyond it",
}
OF_RESPONSES = ["iae", "iaeSetpoint", "peak", "overshoot"]


def responses(loop, **how):
    """Return numbers and curves of the steps of set point and load."""
    digital = loop.controller if isinstance(loop.controller, DigitalController) else None
    t = np.arange(0.0, END + 1e-9, digital.sample_time if digital else 0.01)
    simulate = pidalab.simulate_sampled if digital or how else pidalab.simulate
    setpoint, load = simulate(loop, t, 1.0, load=0.0, **how), simulate(loop, t, 0.0, load=1.0, **how)
    numbers = {
        "iae": load.iae(),
        "iaeSetpoint": setpoint.iae(),
        "peak": np.abs(setpoint.u).max(),
        "overshoot": 100 * max(setpoint.y.max() - 1, 0),
    }
    curves = {
        "Output y, step of the set point": (t, setpoint.y),
        "Output y, step of the load": (t, load.y),
        "Control signal u, step of the set point": (t, setpoint.u),
        "Control signal u, step of the load": (t, load.u),
    }
    return numbers, curves


def frequencies(loop):
    """Return numbers and curves of a loop's frequency responses."""
    w = np.geomspace(0.8 / END, 16_000 / END, 20_001)
    open_loop, margins = loop.L(1j * w), pidalab.margins(loop)
    size, control = np.abs(open_loop), open_loop / loop.process(1j * w)
    below = int(np.argmax(size < 1))
    rising = np.flatnonzero(np.diff(size[below:]) > 0)
    numbers = {
        **{key: getattr(margins, key) for key in ("ms", "gm", "pm", "dm")},
        "mks": max_control_sensitivity(loop)[0],
        "sigma": pidalab.relative_noise_gain(loop),
        "gmLeast": 1 / (1 - 1 / margins.ms),
        "pmLeast": np.degrees(2 * np.arcsin(1 / (2 * margins.ms))),
        "first": 180 + np.degrees(np.angle(open_loop[below])),
        "hump": size[below:][rising[0] :].max() if len(rising) else 0.0,
    }
    curves = {
        "Nyquist curve, unit circle, circle 1/Ms": (open_loop.real, open_loop.imag),
        "Loop gain |L|": (w, size),
        "From set point to output: |T|": (w, size / np.abs(1 + open_loop)),
        "Phase of the controller, degrees": (w, np.degrees(np.unwrap(np.angle(control)))),
        "From measurement noise to u: |C S|": (w, np.abs(control / (1 + open_loop))),
    }
    return numbers, curves


def stairs(curve):
    """Return a curve that holds each value until the next."""
    t, y = curve
    return np.repeat(t, 2)[1:], np.repeat(y, 2)[:-1]


def shown(open_figure, **more):
    """Return numbers and plots of a live figure of the three loops."""
    page, wrong = open_figure(
        CAPTIONED % (json.dumps(pidalab.plots.live(PROCESS, CONTROLLERS, **more).state), SCRIPTS)
    )
    assert missing_parts(page) + wrong == []
    host = page.locator(".pidalab-live")
    head, *rows = host.evaluate(CELLS)
    assert [row[0] for row in rows] == list(CONTROLLERS)
    assert head[1:] == [NUMBERS[key] for key in more["numbers"]]
    numbers = [[float(text.replace("∞", "inf")) for text in row[1:]] for row in rows]
    assert page.locator(".lab-live").text_content().count(" IAE load ") == 3
    words = page.locator(".lab-table p").all_text_contents()
    assert len(words) == ("sigma" in more["numbers"])
    assert all("divided by the ultimate gain" in each for each in words)
    return [dict(zip(more["numbers"], row, strict=True)) for row in numbers], plots(host)


def test_numbers_and_curves_of_linear_loops_are_those_of_the_library(open_figure):
    numbers, drawn = shown(open_figure, plots=PLOTS, numbers=list(NUMBERS), conditions={"end": END})
    assert len(drawn) == len(PLOTS)
    for k, controller in enumerate(CONTROLLERS.values()):
        loop = pidalab.Loop(PROCESS, controller)
        (ours, signals), (others, curves) = responses(loop), frequencies(loop)
        assert numbers[k] == pytest.approx({**ours, **others}, rel=6e-3)
        for title, curve in {**signals, **curves}.items():
            assert drawn[title].apart(f"lab-{LOOKS[k]}", *curve) < 1.0, (title, k)


@pytest.mark.parametrize("way", ["none", "clamping", "conditioning"])
def test_numbers_and_curves_of_digital_loops_with_limits(open_figure, way):
    h, limits, names = 0.25, (-1.05, 1.5), {"none": None, "conditioning": "reset"}
    numbers, drawn = shown(
        open_figure,
        plots=PLOTS[:4],
        numbers=[*OF_RESPONSES, "ms"],
        conditions={"end": END, "sampleTime": h, "limits": limits, "antiWindup": way},
    )
    for k, controller in enumerate(CONTROLLERS.values()):
        loop = pidalab.Loop(PROCESS, controller.discretise(h, limits=limits, anti_windup=names.get(way, way)))
        ours, signals = responses(loop)
        assert numbers[k] == pytest.approx({**ours, "ms": pidalab.margins(loop).ms}, rel=6e-3)
        for title, curve in signals.items():
            expected = stairs(curve) if title.startswith("Control") else curve
            assert drawn[title].apart(f"lab-{LOOKS[k]}", *expected) < 1.0, (title, k)


def test_a_live_figure_replaces_its_picture_and_keeps_the_caption(open_figure):
    page, wrong = open_figure(CAPTIONED % (LIVE_STATE, SCRIPTS))
    assert missing_parts(page) + wrong == []
    assert page.locator("#fig img").count() == 0
    assert page.locator("#fig figcaption").inner_text() == "Words. Open in the lab."
    assert page.locator("#fig svg").count() == 1


def test_an_unstable_loop_has_a_row(open_figure):
    page, _ = open_figure(CAPTIONED % (LIVE_STATE.replace('"kp": 1', '"kp": 9'), SCRIPTS))
    ((verdict, first, hump),) = rows(page.locator(".pidalab-live"))
    assert verdict == "unstable"
    assert re.fullmatch(r"-?[\d.]+", first)
    assert re.fullmatch(r"[\d.]+", hump)


def test_the_link_of_a_live_figure_opens_its_loops_in_the_lab(lab, open_figure):
    page, _ = open_figure(CAPTIONED % (LIVE_STATE, SCRIPTS))
    link = page.get_by_role("link", name="Open in the lab.")
    state = "() => pidalabModel.read(new URL(document.querySelector('a').href).hash)"
    assert page.evaluate(state)["plant"] == "lags3"
    page.get_by_label("dead time, number").fill("2.5")
    page.keyboard.press("Enter")
    page.wait_for_function(f"() => ({state})().plant === 'given'")
    there = lab(f"{lab().url.partition('#')[0]}#{link.get_attribute('href').partition('#')[2]}")
    assert there.get_by_label("plant", exact=True).input_value() == "given"
    ((ms, *_),) = rows(page.locator(".pidalab-live"))
    assert float(rows(there.locator(".pidalab-lab"))[0][2]) == pytest.approx(float(ms), abs=0.01)


def test_the_first_lecture_prints_what_its_live_figure_shows(visit, site):
    page, _ = visit((site / "book" / "learn" / "what-acceleration-does.html").as_uri())
    output = page.locator(".cell_output .output", has_text="noise gain").first.inner_text()
    printed = re.findall(r"Ms ([\d.]+), IAE ([\d.]+), relative noise gain ([\d.]+)", output)
    shown = [[float(cell) for cell in row] for row in rows(page.locator(".pidalab-live .lab-table"))]
    assert len(printed) == len(shown) == 3
    for texts, (iae, ms, sigma) in zip(printed, shown, strict=True):
        for text, value in zip(texts, (ms, iae, sigma), strict=True):
            assert float(text) == pytest.approx(value, abs=0.51 * 10.0 ** -len(text.partition(".")[2])), text
