"""Random plants and controllers through the front doors: tune, report, compare, portrait, and the code at the end.

What comes out keeps what it says, by a second calculation; or the door refuses, in words of ours.
"""

import math
import warnings

import control
import drawn
import numpy as np
import pytest
from hypothesis import assume, given, strategies as st

import pidalab
from pidalab import PIDA, Loop, NonInteractivePIDA, Process, SeriesPIDA
from pidalab.rules.haalman import OutputFilter
from pidalab.rules.registry import RULES

METHODS = st.sampled_from(["backward", "tustin", "zoh"])
KINDS = st.sampled_from(["PI", "PID", "PIDA"])


def answer(call, *words):
    """Return what a call answers, or None where it refuses, which it has to do with one of these words."""
    try:
        return call()
    except ValueError as error:
        refusal = str(error)
    assert any(word in refusal for word in words), refusal
    return None


@st.composite
def any_controllers(draw):
    """A controller of each class; its times are of the order of 1."""
    kp, ti = draw(drawn.gains), draw(drawn.decades(-0.3, 1))
    td, ta = draw(st.just(0.0) | drawn.decades(-1, 0)), draw(st.just(0.0) | drawn.decades(-1.5, 0))
    kind = draw(st.sampled_from(["standard", "non-interactive", "series", "high order"]))
    if kind == "standard":
        return PIDA(kp, draw(st.just(math.inf) | st.just(ti)), td, ta, draw(drawn.decades(0, 1.5)), 5)
    if kind == "non-interactive":
        return NonInteractivePIDA(kp, ti, td, math.sqrt(ta))
    filter_time = draw(drawn.decades(-1.5, 0))
    if kind == "series":
        return SeriesPIDA(kp, kp * td, kp * ta, ti, filter_time, draw(st.integers(2, 5)))
    return draw(drawn.controllers(pidalab.fopdt(math.copysign(1.0, kp), 1.0, 0.5), proper=False))


@st.composite
def prefilters(draw):
    """None, or lags and a pair of poles with a zero."""
    if not draw(st.booleans()):
        return None
    num, den = [1.0], [1.0]
    for time in draw(st.lists(drawn.decades(-1.5, 1), min_size=1, max_size=3)):
        den = np.polymul(den, [time, 1.0])
    if draw(st.booleans()):
        time = draw(drawn.decades(-1, 0.5))
        den = np.polymul(den, [time**2, 2 * draw(drawn.decades(-1, 0)) * time, 1.0])
    if draw(st.booleans()):
        num = [draw(drawn.decades(-1, 1)), 1.0]
    return control.tf(num, den)


def quiet(call):
    """The same call without its warnings of long samples."""

    def called(*arguments, **options):
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "sample_time should be at most")
            return call(*arguments, **options)

    return called


@st.composite
def digital_ones(draw):
    """A controller, its digital form, and what was asked for; refusals are left out by `assume`."""
    controller, method, h = draw(any_controllers()), draw(METHODS), draw(drawn.decades(-2.5, 0))
    order = draw(st.integers(0, 3))
    behind = OutputFilter(draw(drawn.decades(-1.5, 1)), order, math.nan) if order else None
    options = {
        "b": draw(st.sampled_from([0.0, 0.4, 1.0])),
        "c": draw(st.sampled_from([0.0, 1.0])),
        "limits": draw(st.sampled_from([(-math.inf, math.inf), (-4.0, 6.0), (0.0, math.inf)])),
        "rate_limit": draw(st.sampled_from([math.inf, 40.0])),
        "deadband": draw(st.sampled_from([0.0, 0.03])),
        "y_offset": draw(st.sampled_from([0.0, 3.0])),
        "bias": draw(st.sampled_from([0.0, 0.5])),
        "anti_windup": draw(st.sampled_from(["reset", "clamping", None])),
        "prefilter": draw(prefilters()),
    }
    k = answer(
        lambda: quiet(controller.discretise)(h, method, behind, **options),
        "sample_time must be at most",
        "goes by the integral time",
        "the set point would have no effect",
    )
    assume(k is not None)
    return controller, behind, options["prefilter"], k


@drawn.cases(20)
@given(digital_ones())
def test_digital_controllers_are_what_was_discretised(drawing):
    controller, behind, prefilter, k = drawing
    z = np.exp(1j * np.array([1e-3, 0.03, 0.3, 1.0, 3.0])) * np.array([1.0, 1.0, 1.0, 1.05, 0.95])
    h = k.sample_time
    s = {"backward": (1 - 1 / z) / h, "tustin": 2 / h * (z - 1) / (z + 1)}.get(k.method)
    if s is not None:
        expected = controller(s)
        if behind is not None:
            expected = expected / (behind.time * s + 1) ** behind.order
        # what is far below the largest gain is lost in its digits
        scale = np.sum([np.abs(path.gains).sum() for path in k.paths]) + sum(np.abs(k.growth))
        np.testing.assert_allclose(k(z), expected, rtol=1e-9, atol=1e-13 * scale)
    if k.prefilter is not None:
        num, den = prefilter.num[0][0], prefilter.den[0][0]
        if s is not None:
            expected = np.polyval(num, s) / np.polyval(den, s)
            np.testing.assert_allclose(k.prefilter(z), expected, rtol=1e-8, atol=1e-10)
        assert k.prefilter(1.0) == 1.0


@drawn.cases(3, share=0.3)
@given(drawn.processes, KINDS, st.sampled_from([1.3, 1.6, 2.0]), st.booleans())
def test_a_design_keeps_what_it_promises(process, kind, ms, sampled):
    limits = {"sample_time": 0.1, "noise_gain": 5.0} if sampled else {}
    design = answer(
        lambda: pidalab.tune(process, kind, ms, **limits),
        "no stable controller",
        "too slow to be followed",
        "nothing else limits",
        "no controller was found whose loop keeps",
    )
    if design is None:
        return
    # with the half sample that a held signal waits, which the design counts as dead time
    loop = design.loop(Process(process.num, process.den, process.delay + (0.05 if sampled else 0.0)))
    runs = Loop(process, design.controller.discretise(0.1)) if sampled else loop
    found = pidalab.margins(runs)
    assert found.stable
    assert found.ms <= ms * (1 + 2e-3)  # with the dead time that a design may leave out
    assert design.ms == pytest.approx(pidalab.margins(design.loop(process)).ms, rel=2e-3)
    # the IAE is at least the error's integral, which the integral gain gives
    ki = design.controller.gains().ki
    assert design.iae >= (1 - 1e-6) * abs(1 / ki)
    if sampled:
        assert pidalab.noise_gain(loop, 0.1) <= 5.0 * (1 + 1e-3)


@drawn.cases(12)
@given(drawn.processes, st.sampled_from(sorted(RULES)), KINDS)
def test_a_rule_by_its_name_designs_or_refuses(process, rule, kind):
    design = answer(
        lambda: pidalab.tune(process, kind, rule=rule, sample_time=0.05), " must ", "found", "is unstable"
    )
    if design is None:
        return
    found = pidalab.margins(design.loop())
    assert found.stable == math.isfinite(design.ms)
    if found.stable:
        assert design.ms == pytest.approx(found.ms, rel=1e-6)
    k = answer(lambda: design.discretise(0.05), "integral time, which must be above 0")
    assert k is None or (k.prefilter is None) == (design.prefilter is None)
