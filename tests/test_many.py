"""Many loops at once: what each yields alone, whoever computes, and errors that name the loop."""

from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np
import pytest

import pidalab

T = np.linspace(0.0, 20.0, 201)
LOOPS = [
    pidalab.Loop(pidalab.fopdt(1.0, lag, 0.5), pidalab.PIDA(0.8, lag)) for lag in np.linspace(0.5, 3.0, 130)
]


def test_each_is_what_it_is_alone():
    many = pidalab.simulate_many(LOOPS, T, setpoint=1.0, load=np.where(T < 10, 0.0, -0.5))
    margins = pidalab.margins_many(iter(LOOPS))
    assert len(many) == len(margins) == len(LOOPS)
    for i in (0, 64, 129):
        one = pidalab.simulate(LOOPS[i], T, setpoint=1.0, load=np.where(T < 10, 0.0, -0.5))
        np.testing.assert_array_equal(many[i].y, one.y)
        assert margins[i].ms == pidalab.margins(LOOPS[i]).ms


def test_processes_give_the_same():
    with ProcessPoolExecutor(1) as executor:
        many = pidalab.simulate_many(LOOPS[:3], T, setpoint=1.0, executor=executor)
    np.testing.assert_array_equal(many[2].y, pidalab.step_response(LOOPS[2], T).y)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (
            lambda: pidalab.simulate_many([*LOOPS[:3], pidalab.lags(2)], T),
            TypeError,
            r"loops\[3\]: loop must be",
        ),
        (lambda: pidalab.margins_many(LOOPS[0]), TypeError, "loops must be a sequence, found Loop"),
        (lambda: pidalab.margins_many(LOOPS, executor=2), TypeError, "executor must be .* found int"),
        (lambda: pidalab.simulate_many(LOOPS, T[1:]), ValueError, "t must start at 0"),
    ],
)
def test_many_complain(call, error, message):
    with pytest.raises(error, match=message):
        call()


def test_there_is_no_bar_unless_asked(capsys):
    for many in (pidalab.margins_many, partial(pidalab.simulate_many, t=T)):
        for asked in ({}, {"progress": True}):
            many(LOOPS[:2], **asked)
            assert ("2/2" in capsys.readouterr().err) == bool(asked)
