"""The exact engine against the high-precision oracle."""

import pytest
from engine_errors import oracle, worst_error


@pytest.mark.parametrize("points", [2, 14, 401], ids=lambda n: f"{n}points")
@pytest.mark.parametrize("case", oracle("delay_loops.json")["cases"], ids=lambda case: case["name"])
def test_oracle(case, points):
    """1e-9 relative to max(1, |value|) (or the running envelope) at every time, aligned with the dead time or not."""
    error, where = worst_error(case, points)
    assert error <= 1e-9, where
