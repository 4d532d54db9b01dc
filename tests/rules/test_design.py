"""One Design for all rules: what each returns, that it does not change, and what it says where something is missing."""

import copy
import pickle

import numpy as np
import pytest

import pidalab
from pidalab.rules import automatic_reset, direct, haalman, itae, magnitude_optimum, mrdp

SECOND = pidalab.sopdt(1.0, tau=1.5, damping=1.0, delay=1.0)
REDUCED = pidalab.reduction.to_sopdt(pidalab.lags(3))
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


def test_info_can_be_read_as_attributes_and_nothing_changes(design):
    for name, value in design.info.items():
        assert getattr(design, name) is value
        assert name in dir(design)
        assert f"  {name} " in str(design)
    for change in (lambda: setattr(design, "model", None), lambda: setattr(design, "iae", 1.0)):
        with pytest.raises(AttributeError, match="cannot assign"):
            change()
    with pytest.raises(TypeError, match="does not support item assignment"):
        design.info["iae"] = 1.0
    with pytest.raises(AttributeError, match="this design has no 'nonsense'; its info has"):
        _ = design.nonsense


def test_a_design_travels(design):
    for other in (pickle.loads(pickle.dumps(design)), copy.copy(design), copy.deepcopy(design)):
        assert (other.controller, other.info, other.source) == (design.controller, design.info, design.source)
        assert str(other) == str(design)


def test_every_number_of_a_rule_names_its_source():
    for name in ("mrdp", "automatic_reset", "magnitude_optimum"):
        one = TUNES[name]()
        assert set(one.sources) == set(one.info)


def test_areas_are_no_model():
    areas = pidalab.areas.from_process(pidalab.lags(4), 8)
    design = magnitude_optimum.tune(areas, m=2, n=3, filter_time=0.1)
    with pytest.raises(TypeError, match="process must be given"):
        design.loop()
    assert pidalab.is_stable(design.loop(pidalab.lags(4)))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: haalman.tune(SECOND, kind="PDA"), "kind must be 'PIDA', 'PID' or 'PI', found 'PDA'"),
        (lambda: itae.tune(SECOND, kind="PI"), "kind must be 'PIDA' or 'PID', found 'PI'"),
        (lambda: itae.tune(SECOND, test="noise"), "test must be 'setpoint' or 'load', found 'noise'"),
        (lambda: direct.tune(SECOND, test="noise"), "test must be 'setpoint' or 'load', found 'noise'"),
    ],
)
def test_choices(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda d: pidalab.margins(d), r"loop must be a pidalab\.Loop, found Design"),
        (lambda d: pidalab.simulate(d, np.arange(3.0)), r"found Design"),
        (lambda d: pidalab.Loop(INTEGRATOR, d), r"controller must .* found Design; pass its \.controller"),
        (lambda d: pidalab.margins(INTEGRATOR), "found Process"),
        (
            lambda d: haalman.pid(REDUCED),
            r"found SecondOrderModel; pass its \.process",
        ),
        (lambda d: pidalab.Loop(REDUCED, 1.0), r"pass its \.process"),
        (lambda d: magnitude_optimum.tune(REDUCED, 0, 1, 0.1), r"found SecondOrderModel; pass its \.process"),
        (lambda d: pidalab.areas.from_process(REDUCED, 4), r"found SecondOrderModel; pass its \.process"),
        (lambda d: pidalab.reduction.to_fopdt(REDUCED), r"found SecondOrderModel; pass its \.process"),
        (lambda d: pidalab.simulate_sampled(d.loop(), np.arange(9.0), plant=REDUCED), r"pass its \.process"),
    ],
)
def test_errors_say_what_to_pass(call, message):
    with pytest.raises(TypeError, match=message):
        call(TUNES["haalman PID"]())
