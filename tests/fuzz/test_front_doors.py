"""Tune random plants: by a second calculation the design keeps its limits, or an error explains why not."""

import drawn
import pytest
from hypothesis import given, strategies as st

import pidalab
from pidalab import Loop, Process

METHODS = st.sampled_from(["backward", "tustin", "zoh"])
KINDS = st.sampled_from(["PI", "PID", "PIDA"])


def answer(call, *words):
    """Return the result of a call, or None after a ValueError whose message has one of these words."""
    try:
        return call()
    except ValueError as error:
        refusal = str(error)
    assert any(word in refusal for word in words), refusal
    return None


@drawn.cases(3, share=0.3)
@given(drawn.processes, KINDS, st.sampled_from([1.3, 1.6, 2.0]), st.booleans())
def test_a_design_keeps_what_it_promises(process, kind, ms, sampled):
    limits = {"sample_time": 0.1, "noise_gain": 5.0} if sampled else {}
    design = answer(
        lambda: pidalab.tune(process, kind, ms=ms, **limits),
        "no stable controller",
        "too slow to simulate",
        "nothing else limits",
        "no controller was found whose loop keeps",
    )
    if design is None:
        return
    # The design counts the hold of half a sample as dead time.
    loop = design.loop(Process(process.num, process.den, process.delay + (0.05 if sampled else 0.0)))
    runs = Loop(process, design.controller.discretise(0.1)) if sampled else loop
    margins = pidalab.margins(runs)
    assert margins.stable
    assert margins.ms <= ms * (1 + 2e-3)  # a design may neglect a very short dead time
    assert design.ms == pytest.approx(pidalab.margins(design.loop(process)).ms, rel=2e-3)
    # The IAE is at least the integral of the error, 1/ki.
    ki = design.controller.gains().ki
    assert design.iae >= (1 - 1e-6) * abs(1 / ki)
    if sampled:
        assert pidalab.noise_gain(loop, 0.1) <= 5.0 * (1 + 1e-3)
