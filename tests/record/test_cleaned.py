"""Records as plants give them: what is cleaned, what is found, what is refused."""

import numpy as np
import pytest

import pidalab
from pidalab import Record


def step_record(count=200, size=7.0, noise=0.0, seed=0, at=20.0):
    t = np.linspace(0.0, 100.0, count)
    u = np.where(t < at, 40.0, 40.0 + size)
    y = 300.0 + 2.0 * size * (1 - np.exp(-np.maximum(t - at - 5.0, 0.0) / 10.0))
    return t, u, y + np.random.default_rng(seed).normal(0.0, noise, count)


def test_step_rest_and_noise_are_found():
    record = Record(*step_record(noise=0.2))
    assert [s[1:] for s in record.steps] == [(40.0, 47.0)]
    assert record.steps[0].time == pytest.approx(20.0, abs=0.51)
    assert record.rest == pytest.approx(300.0, abs=0.1)
    assert record.noise.deviation == pytest.approx(0.2, rel=0.3)
    assert abs(record.noise.correlation) < 0.4


def test_cleaning_is_said_and_changes_nothing_else():
    t, u, y = step_record()
    order = np.random.default_rng(1).permutation(t.size)
    worse = [np.append(x[order], x[:3]) for x in (t, u, y)]
    worse[2] = np.append(worse[2], np.nan)
    worse[0], worse[1] = np.append(worse[0], 50.0), np.append(worse[1], 47.0)
    record = Record(*worse)
    assert np.allclose(record.t, t)
    assert np.allclose(record.y, y)
    said = " ".join(record.doubts)
    for word in ("missing value", "not in order", "averaged"):
        assert word in said


def test_coarse_outputs_gaps_several_steps_and_drift_are_doubted():
    t, u, y = step_record()
    keep = (t < 60) | (t > 80)
    assert "gap" in " ".join(Record(t[keep], u[keep], y[keep]).doubts)
    assert "levels" in " ".join(Record(t, u, np.round(y / 2) * 2).doubts)
    twice = Record(t, u + 3.0 * (t > 70), y)
    assert len(twice.steps) == 2
    with pytest.raises(ValueError, match="changes again"):
        twice.after_step()
    assert "still moves" in " ".join(Record(t, u, np.maximum(t - 25, 0.0)).doubts)
    assert "drifts" in " ".join(Record(t, u, y + 0.2 * t).doubts) or "drifts" in " ".join(
        Record(t, u, y + 0.2 * t + np.random.default_rng(0).normal(0, 0.1, t.size)).doubts
    )


def test_response_from_the_step_on_is_that_of_a_unit_step():
    t, y = Record(*step_record(2001)).after_step()
    assert t[0] == 0.0
    assert np.allclose(y, 2.0 * (1 - np.exp(-np.maximum(t - 5.0, 0.0) / 10.0)), atol=0.02)


def test_a_ramp_of_the_input_is_one_step_at_its_middle():
    t, _, y = step_record()
    record = Record(t, np.interp(t, [20.0, 24.0], [40.0, 47.0]), y)
    assert len(record.steps) == 1
    assert record.steps[0].time == pytest.approx(22.0, abs=0.6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t, u, y: (t[:10], u[:10], y[:10]), "needs 20 usable samples or more, found 10 of 10"),
        (lambda t, u, y: (t, u, y[:-1]), "t, u and y must have one length"),
        (lambda t, u, y: (t, 0 * u, y), "u never changes"),
        (lambda t, u, y: (t, u, 0 * y), "y never changes"),
        (lambda t, u, y: (t, u, y, 90.0), "step: no change of the input at or after 90"),
        (lambda t, u, y: (np.zeros_like(t), u, y), "20 different times or more, found 1"),
    ],
)
def test_refusals(change, message):
    with pytest.raises(ValueError, match=message):
        Record(*change(*step_record()))


def test_a_word_among_numbers_is_refused():
    t, u, _ = step_record()
    with pytest.raises(TypeError, match="y must be an array of real numbers"):
        Record(t, u, ["a"] * t.size)


def test_the_package_offers_it():
    assert pidalab.Record is Record


def test_uniform_keeps_a_uniform_record_and_puts_the_step_of_another_on_the_grid():
    t, u, y = step_record()
    again = Record(500.0 + t, u, y).uniform()
    assert again[0] == pytest.approx(t)
    assert again[1].tolist() == u.tolist()
    assert again[2] == pytest.approx(y)
    rng = np.random.default_rng(5)
    moved = np.sort(np.delete(t, [30, 31, 90]) + rng.uniform(-0.1, 0.1, t.size - 3))
    record = Record(
        moved,
        np.where(moved < 20.0, 40.0, 47.0) + rng.uniform(-0.02, 0.02, moved.size),
        np.interp(moved, t, y),
    )
    grid, held, output = record.uniform()
    k = int(np.argmax(held > 43.0))
    assert np.all(held[:k] == record.step.before)
    assert grid[k] + moved[0] == pytest.approx(record.step.time, abs=record.sampling)
    assert grid == pytest.approx(record.sampling * np.arange(grid.size))
    assert output[0] == pytest.approx(300.0)


def test_the_step_that_matters_has_to_be_one():
    t, u, y = step_record()
    twice = np.where(t > 60.0, 40.0, u)
    with pytest.raises(ValueError, match="the input changes again after the step"):
        _ = Record(t, twice, y).step
    assert Record(t, twice, y, step=50.0).step.after == 40.0


def test_an_input_that_creeps_is_no_step():
    """A controller that jumps and then integrates: its output is no level for the rules that look at a step."""
    t = np.arange(0.0, 600.0)
    u = np.where(t < 50, 40.0, 42.5 - np.exp(-(t - 50) / 40))
    record = Record(t, u, np.interp(t, [0, 55, 120, 600], [0.0, 0.0, 5.0, 5.0]))
    assert record.steps == ()
    assert any("does not step between lasting levels" in doubt for doubt in record.doubts)
    with pytest.raises(ValueError, match="no step of the input from one level to another"):
        pidalab.identification.three_point(record)


def test_a_ramp_between_levels_is_said():
    t = np.arange(0.0, 300.0)
    y = np.interp(t, [0, 105, 200, 300], [0.0, 0.0, 5.0, 5.0])
    ramps = {seconds: Record(t, np.interp(t, [100, 100 + seconds], [40.0, 50.0]), y) for seconds in (3, 40)}
    assert not any("takes" in doubt for doubt in ramps[3].doubts)
    assert ramps[40].steps[0].time == 120.0
    assert any("takes more than 30 to go from 40 to 50" in doubt for doubt in ramps[40].doubts)
