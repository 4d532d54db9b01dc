"""Criteria of absolute stability and the shortest filter against the oracle, to the digits that are documented."""

import control
import pytest
from engine_errors import oracle, oracle_loop

import pidalab
from pidalab.robustness import circle, popov, smallest_filter_time

FILE = oracle("limits.json")


def limited_loop(case):
    """The loop of a case, with its automatic reset if it has one."""
    loop = oracle_loop(case)
    return (
        pidalab.Loop(loop.process, pidalab.SeriesPIDA(**case["arguments"])) if "arguments" in case else loop
    )


@pytest.mark.parametrize("case", FILE["cases"], ids=lambda case: case["name"])
def test_circle(case):
    found, true = circle(limited_loop(case)), float(case["values"]["circle"])
    assert found.margin == pytest.approx(true, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    "case", [c for c in FILE["cases"] if "popov" in c["values"]], ids=lambda c: c["name"]
)
def test_popov(case):
    """No multiplier has more margin."""
    found, true = popov(limited_loop(case)), float(case["values"]["popov"])
    assert found.margin == pytest.approx(true, rel=1e-9, abs=1e-9)


def test_smallest_filter_time():
    """A derivative behind a filter that becomes too short; to 6 digits, as documented."""
    own = FILE["filter"]
    process = pidalab.Process(own["process"]["num"], own["process"]["den"], own["delay"])

    def family(time):
        kp, kd = own["kp"], own["kd"]
        return pidalab.Loop(process, control.tf([kp * time + kd, kp], [time, 1.0]))

    found = smallest_filter_time(family, pidalab.is_stable, longest=own["longest"])
    assert found == pytest.approx(float(own["filter_time"]), rel=1e-6)
