"""Check the switches and buttons of the lab."""

import re

import numpy as np
import pytest
from driving import COLUMNS, NEXT_FRAME, choose, enter, follow, press, value_of
from pictured import plots

import pidalab

ROWS = "() => document.querySelectorAll('.lab-table tbody').length"
CONTROL = "Control signal u, step of the set point"


def says(page, words):
    """Wait until the lab says these words."""
    page.wait_for_function(
        "words => document.querySelector('.lab-live').textContent.includes(words)", arg=words
    )


def test_copy_remove_and_restart(lab):
    page = lab()
    press(page, "Add a copy")
    page.wait_for_function(f"() => ({ROWS})() === 2")
    other = page.locator(".lab-plots path.lab-2")
    assert other.count() == 6
    page.get_by_label("name", exact=True).fill("faster")
    page.keyboard.press("Enter")
    page.wait_for_function("() => document.querySelector('.lab-table').textContent.includes('faster')")
    press(page, "Remove faster")
    page.wait_for_function(f"() => ({ROWS})() === 1")
    assert other.count() == 0
    start = value_of(page, "kp")
    enter(page, "kp", 9)
    says(page, "the loop is unstable")
    assert page.get_by_label("rule", exact=True).input_value() == "hand"
    press(page, "Start anew")
    says(page, "IAE")
    assert value_of(page, "kp") == start


def test_a_link_is_copied(lab):
    page = lab()
    page.evaluate("""() => Object.defineProperty(navigator, "clipboard", {
        value: { writeText: async (text) => { globalThis.copied = text; } } })""")
    press(page, "Copy a link")
    says(page, "The link is copied.")
    assert page.evaluate("() => copied") == page.url


@pytest.mark.parametrize("damping", [0.4, 1.0])
def test_an_own_plant_may_have_no_rule(lab, damping):
    page = lab()
    choose(page, "plant", "own")
    values = {
        "gain": 2,
        "lag T1": 3,
        "lag T2": 1.5,
        "lag T3": 0.5,
        "damping": damping,
        "zero": -0.7,
        "dead time": 0.8,
    }
    for label, value in values.items():
        enter(page, label, value)
    page.get_by_label("integrating", exact=True).check()
    says(page, "needs a plant that does not integrate")
    press(page, "As a library call")
    call = re.search(r"pidalab\.Process\(.*\)", page.locator(".lab-out").text_content())[0]
    s = 1j * np.geomspace(0.01, 10, 50)
    pair = 9 * s**2 + 6 * damping * s + 1 if damping < 1 else (3 * s + 1) * (1.5 * s + 1)
    expected = 2 * (1 - 0.7 * s) * np.exp(-0.8 * s) / (pair * (0.5 * s + 1) * s)
    assert np.allclose(eval(call, {"pidalab": pidalab})(s), expected, rtol=1e-6)


def test_a_slider_extends_to_the_entered_value(lab):
    page = lab()
    choose(page, "plant", "own")
    for label, value, key, low, high in (
        ("gain", -2, "ArrowRight", -2.2, -2),
        ("lag T2", 40, "ArrowLeft", 39, 40),
    ):
        enter(page, label, value)
        page.evaluate(NEXT_FRAME)
        page.get_by_label(label, exact=True).press(key)
        page.evaluate(NEXT_FRAME)
        assert low < float(value_of(page, label)) < high


def test_limits_and_noise_show_in_the_control_signal(lab):
    page = lab()
    page.get_by_label("limits of the actuator").check()
    enter(page, "filter time", 0.05)  # a faster filter, with a kick to both sides
    enter(page, "lowest u", -0.2)
    enter(page, "highest u", 1.5)

    def reached():
        plot = plots(page.locator(".pidalab-lab"))[CONTROL]
        low, high = plot.y.place([-0.2, 1.5])
        heights = plot.line("lab-0")[:, 1]
        assert heights.max() < low + 0.2
        assert heights.min() > high - 0.2
        return np.sum(heights > low - 0.2), np.sum(heights < high + 0.2)

    page.wait_for_function(
        "() => document.querySelector('.lab-table tbody td:nth-of-type(5)').textContent === '1.5'"
    )
    calm = reached()
    # Each change is drawn separately.
    for change in (
        page.get_by_label("measurement noise", exact=True).check,
        lambda: enter(page, "noise, ±", 0.2),
    ):
        before = page.locator(".lab-results").inner_html()
        change()
        page.wait_for_function(
            "before => document.querySelector('.lab-results').innerHTML !== before", arg=before
        )
    noisy = reached()
    assert min(calm + noisy) > 0
    assert noisy[1] > 5 * calm[1]  # the peak reaches the upper limit once, the noise often


def test_each_anti_windup_option(lab):
    page, iae = lab(), []
    follow(
        page,
        """{plant: "huba-ipdt", designs: [{rule: "hand", limited: true, low: -0.1, high: 0.1, antiWindup: "none",
        kind: "PIDA", kp: 0.611, ti: 5.486, td: 0.7404, ta: 0.1481, filterTime: 0.2, filterOrder: 4}]}""",
    )
    for way in ("none", "conditioning", "clamping", "reset"):
        choose(page, "anti-windup", way)
        page.wait_for_function(f"before => ({COLUMNS})()[0][2] !== before", arg=iae[-1] if iae else "")
        iae.append(page.evaluate(COLUMNS)[0][2])
    values = list(map(float, iae))
    assert sorted(values, reverse=True) == values
    assert values[-1] < values[0] / 2
