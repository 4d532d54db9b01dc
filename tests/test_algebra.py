"""Check products of blocks, and frequency responses for python-control."""

import control
import numpy as np
import pytest

import pidalab
from pidalab import PIDA, HighOrderPID, Loop, NonInteractivePIDA, Process, SeriesPIDA

S = 1j * np.geomspace(0.01, 100.0, 30)
P = pidalab.fopdt(2.0, lag=3.0, delay=0.5)
LAG = control.tf([1.0], [0.2, 1.0])
CONTROLLERS = [
    PIDA(1.5, 4.0, 1.0, 0.3),
    NonInteractivePIDA(1.5, 4.0, 1.0, 1.0),
    HighOrderPID([0.4, 1.3, 1.0], 0.1, 2),
    SeriesPIDA(1.0, 0.5, 0.1, ti=2.0, filter_time=0.1, filter_order=2, limits=(-1.0, 2.0)),
]
LOOP = Loop(pidalab.lags(3, delay=1.0), PIDA(1.0, 3.0, 1.0, 0.3))


@pytest.mark.parametrize("block", [P, *CONTROLLERS], ids=lambda block: type(block).__name__)
def test_a_number_multiplies_the_gain_only(block):
    for product, factor in ((2 * block, 2), (block * np.float64(2), 2), (block / 4, 0.25), (-block, -1)):
        assert type(product) is type(block)
        np.testing.assert_allclose(product(S), factor * block(S), rtol=1e-13)
        # Limits are those of the actuator.
        assert getattr(product, "limits", None) == getattr(block, "limits", None)


def test_processes_in_series():
    product = P * pidalab.ipdt(0.5, delay=1.0)
    assert product == Process([1.0], [3.0, 1.0, 0.0], delay=1.5)
    np.testing.assert_allclose((P * P)(S), P(S) ** 2, rtol=1e-12)


def test_products_with_python_control():
    lagged = 1 / (0.2 * S + 1)
    for product in (LAG * P, P * LAG):
        assert (type(product), product.delay) == (Process, 0.5)
        np.testing.assert_allclose(product(S), P(S) * lagged, rtol=1e-12)
    for C in CONTROLLERS:
        for product in (LAG * C, C * LAG):
            assert isinstance(product, control.TransferFunction)
            np.testing.assert_allclose(product(S), C(S) * lagged, rtol=1e-9)


def test_frequency_response_has_the_dead_time_exactly():
    response = LOOP.frequency_response()
    w = response.omega
    np.testing.assert_allclose(response.frdata[0, 0], LOOP.L(1j * w), rtol=0)
    margins, gm_pm = pidalab.margins(LOOP), control.stability_margins(response)[:2]
    assert gm_pm == pytest.approx((margins.gm, margins.pm), rel=1e-6)
    # The phase can be unwrapped, and both crossovers are well inside.
    assert np.max(np.abs(np.diff(np.unwrap(np.angle(LOOP.L(1j * w)))))) < 0.5
    assert w[0] < margins.wgc / 3
    assert w[-1] > 3 * margins.wpc
    assert LOOP.frequency_response([0.5, 1.0]).omega.tolist() == [0.5, 1.0]
