"""Simulate the Temperature Control Lab, and use a fake board with the interface of a real one."""

import random
import sys

import numpy as np
import pytest
import tclab

import pidalab
from pidalab.plant.fitting import fit
from pidalab.plant.heater import Lab


class Board:
    """Fake board: the simulated lab with the functions and clock of a real board."""

    def __init__(self, model, clock):
        self.model, self.clock, self.off = model, clock, False

    def __getattr__(self, name):
        self.model.update(self.clock.now)
        return getattr(self.model, name)

    def close(self):
        self.off = True


class Clock:
    now = 5.0

    def time(self):
        return self.now

    def sleep(self, delay):
        self.now += delay


@pytest.fixture
def board(monkeypatch, capsys):
    clock = Clock()
    model = tclab.TCLabModel(synced=False)
    model.tlast = clock.now
    made = Board(model, clock)
    monkeypatch.setattr(tclab, "TCLab", lambda: made)
    monkeypatch.setattr(tclab, "labtime", clock)
    return made


def controller(h=1.0):
    return pidalab.PIDA(kp=5.0, ti=80.0).discretise(h, limits=(0.0, 100.0))


def test_step_test_identifies_the_simulated_lab(capsys):
    with Lab() as lab:
        record = lab.step_test()
    fitted = fit(record)
    # Per second, two heaters lose 1/20 of their excess to the room and exchange 1/100 of their difference.
    gain = 200 / 5720 * 0.06 / (0.06**2 - 0.01**2)
    assert fitted.parameters["gain"] == pytest.approx(gain, rel=0.01)
    slow, fast = sorted(-1 / np.roots(fitted.process.den).real, reverse=True)
    assert slow == pytest.approx(140.0, rel=0.03)
    assert 12.0 < fast < 22.0
    assert record.steps[0][1:] == (0.0, 50.0)
    assert capsys.readouterr().out == ""


def test_closed_loop_rejects_the_load():
    load = np.where(np.arange(1201) < 700, 0.0, 80.0)
    with Lab() as lab:
        run = lab.closed_loop(controller(), 40.0, 1200.0, load)
    assert np.mean(run.y[600:700]) == pytest.approx(40.0, abs=0.4)
    assert np.max(run.y[700:]) > 40.7
    assert np.mean(run.y[-100:]) == pytest.approx(40.0, abs=0.4)
    assert np.mean(run.u[-50:]) < np.mean(run.u[650:700])
    assert run.u.min() >= 0.0
    assert run.u.max() <= 100.0


def test_runs_are_reproducible():
    random.seed(7)
    expected = random.random()
    random.seed(7)
    first, again, other = (Lab(seed=seed).closed_loop(controller(), 30.0, 60.0) for seed in (0, 0, 1))
    assert random.random() == expected
    assert np.array_equal(first.y, again.y)
    assert not np.array_equal(first.y, other.y)


def test_connected_board(board):
    with Lab(connected=True) as lab:
        record = lab.step_test(duration=200.0, rest=20.0)
        run = lab.closed_loop(controller(2.0), 45.0, 100.0)
    assert board.clock.now == pytest.approx(5.0 + 221.0 + 102.0)
    assert record.y[-1] > 35.0
    assert run.u.max() > 0.0
    assert board.off


def test_heaters_are_off_after_a_failure(board):
    with pytest.raises(ValueError, match="setpoint"), Lab(connected=True) as lab:
        lab.closed_loop(controller(), [1.0, 2.0], 100.0)
    assert board.off


def test_missing_package(monkeypatch):
    monkeypatch.setitem(sys.modules, "tclab", None)
    with pytest.raises(ImportError, match=r"also for simulation: pip install tclab"):
        Lab()


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda lab: lab.step_test(after=101.0), ValueError, "after must be at least 0 and at most 100"),
        (lambda lab: lab.hold(-1.0), ValueError, "power must be at least 0"),
        (lambda lab: lab.step_test(rest=0.0), ValueError, "rest must be above 0"),
        (lambda lab: lab.step_test(sample_time=700.0), ValueError, "at least two samples"),
        (lambda lab: lab.closed_loop(pidalab.PIDA(1.0, 2.0), 40.0), TypeError, "discretise"),
    ],
)
def test_refusals(call, error, message):
    with pytest.raises(error, match=message):
        call(Lab())
