"""Check the Design that a rule returns: loop, attributes, copies, and that it is immutable."""

import copy
import pickle

import pytest

import pidalab
from pidalab.rules import automatic_reset, direct, haalman, itae, magnitude_optimum, mrdp

SECOND = pidalab.sopdt(1.0, tau=1.5, damping=1.0, delay=1.0)
INTEGRATOR = pidalab.ipdt(1.0, delay=1.0)
TUNES = {
    "haalman": lambda: haalman.tune(pidalab.lags(3, delay=1.0)),
    "haalman PID": lambda: haalman.tune(SECOND, kind="PID"),
    "haalman PI": lambda: haalman.tune(pidalab.fopdt(2.0, 3.0, 1.0), ms=1.6, kind="PI"),
    "itae": lambda: itae.tune(SECOND),
    "itae PID load": lambda: itae.tune(SECOND, test="load", kind="PID"),
    "direct": lambda: direct.tune(SECOND, test="load"),
    "mrdp": lambda: mrdp.tune(INTEGRATOR, 2, 3, te=0.5),
    "automatic_reset": lambda: automatic_reset.tune(INTEGRATOR, automatic_reset.PIDA_1, n=4, filter_time=0.2),
    "magnitude_optimum": lambda: magnitude_optimum.tune(pidalab.lags(4), m=2, n=3, filter_time=0.1),
}


@pytest.fixture(params=TUNES)
def design(request):
    return TUNES[request.param]()


def test_every_rule_returns_one_design(design):
    assert type(design) is pidalab.Design
    loop = design.loop()
    assert pidalab.is_stable(loop)
    assert (loop.process, loop.controller) == (design.model, design.controller)
    assert (loop.output_filter, loop.prefilter) == (design.output_filter, design.prefilter)
    assert design.loop(pidalab.lags(5)).process == pidalab.lags(5)
    assert str(design).startswith(f"Design by {design.source}")
    assert len(max(str(design).splitlines(), key=len)) < 160


def test_info_is_read_as_attributes_and_a_design_is_immutable(design):
    for name, value in design.info.items():
        assert getattr(design, name) is value
        assert name in dir(design)
        assert f"  {name} " in str(design)
    for name in ("model", "iae"):
        with pytest.raises(AttributeError, match="cannot assign"):
            setattr(design, name, None)
    with pytest.raises(TypeError, match="item assignment"):
        design.info["iae"] = 1.0
    with pytest.raises(AttributeError, match="nonsense"):
        _ = design.nonsense


def test_a_design_can_be_pickled_and_copied(design):
    for other in (pickle.loads(pickle.dumps(design)), copy.copy(design), copy.deepcopy(design)):
        assert (other.controller, other.info, other.source) == (design.controller, design.info, design.source)
        assert str(other) == str(design)
