"""Compare closed forms of step responses with the exact engine."""

import numpy as np
import pytest

import pidalab
from pidalab.plant.fitting.searching import FIRST_ORDER, INTEGRATOR, SHAPES, behind_lag, equal_lags

(SECOND_ORDER,), (LAGGED,), (ORDER_WITH_ZERO,) = (SHAPES[name] for name in ("sopdt", "ifopdt", "sopdtz"))


@pytest.mark.parametrize(
    ("shape", "p", "process"),
    [
        (FIRST_ORDER, [3.0], pidalab.fopdt(1.0, 3.0, 0.0)),
        (SECOND_ORDER, [2.0, 0.3], pidalab.sopdt(1.0, 2.0, 0.3, 0.0)),
        (SECOND_ORDER, [2.0, 1.25], pidalab.sopdt(1.0, 2.0, 1.25, 0.0)),
        (SECOND_ORDER, [2.0, 1.7], pidalab.sopdt(1.0, 2.0, 1.7, 0.0)),
        (SECOND_ORDER, [2.0, 1.0], pidalab.lags(2, 2.0)),
        (equal_lags(5), [0.7], pidalab.lags(5, 0.7)),
        (INTEGRATOR, [], pidalab.ipdt(1.0, 0.0)),
        (LAGGED, [3.0], pidalab.Process([1.0], [3.0, 1.0, 0.0])),
        (ORDER_WITH_ZERO, [2.0, 0.3, -1.0], pidalab.Process([-1.0, 1.0], [4.0, 1.2, 1.0])),
        (ORDER_WITH_ZERO, [2.0, 1.0, 1.5], pidalab.Process([1.5, 1.0], [4.0, 4.0, 1.0])),
        (ORDER_WITH_ZERO, [2.0, 1.25, -1.0], pidalab.Process([-1.0, 1.0], [4.0, 5.0, 1.0])),
        (behind_lag(FIRST_ORDER, 3.0), [3.0], pidalab.lags(2, 3.0)),
        (behind_lag(INTEGRATOR, 2.0), [], pidalab.Process([1.0], [2.0, 1.0, 0.0])),
    ],
)
def test_shapes_are_the_exact_step_responses(shape, p, process):
    t = np.linspace(0.0, 20.0, 201)
    assert np.allclose(shape.step(t, p), pidalab.open_loop_step(process, t).y, atol=1e-6)
    assert np.all(shape.step(np.array([-1.0, -1e-9]), p) == 0.0)
    assert shape.process(1.0, p, 0.0)(1j) == pytest.approx(process(1j))
