"""Run the kernel of the exact engine as plain Python, which checks every index."""

from types import FunctionType

import numpy as np
import pytest
from engine_errors import oracle, oracle_loop

from pidalab._compiled import Kernel
from pidalab.simulation import ladder
from pidalab.simulation.realisation import cut_at_delay


def as_loops(value, done):
    """Return a compiled function and all functions that it calls as plain Python."""
    if not isinstance(value, Kernel):
        return value
    if id(value) not in done:
        names = dict(value.function.__globals__)
        code, defaults = value.function.__code__, value.function.__defaults__
        done[id(value)] = FunctionType(code, names, value.__name__, defaults)
        names.update({name: as_loops(global_value, done) for name, global_value in names.items()})
    return done[id(value)]


FEW = [case for case in oracle("delay_loops.json")["cases"] if case["delay"]][::4]


@pytest.mark.parametrize("form", ["arrays", "loops"])
@pytest.mark.parametrize("case", FEW, ids=lambda case: case["name"])
def test_both_plain_forms_give_the_response(case, form):
    """Forms with array operations and with loops match the engine, which is compared with the oracle."""
    cut = cut_at_delay(oracle_loop(case), "rd")
    step, n = case["delay"] / 3.7, 23
    arguments = (cut, step, n, ladder._intervals(cut, n, step), ladder.norm_over(cut, n, step))
    run = ladder._responses.python_form if form == "arrays" else as_loops(ladder._responses, {})
    response, _, status = run(*arguments)
    expected = ladder.responses(cut, n, step, arguments[-1])
    assert status == ladder.DONE
    np.testing.assert_allclose(response, expected, rtol=1e-11, atol=1e-12 * np.abs(expected).max())
