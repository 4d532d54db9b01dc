"""All rules on one process: each is a row, measured on the process, and the optimum is the best of those in limits."""

import numpy as np
import pytest

import pidalab
from pidalab.rules import classical


@pytest.fixture(scope="module")
def integrating():
    return pidalab.compare(pidalab.ipdt(0.1, delay=1.0), ms=1.6, noise_gain=10.0, sample_time=0.05)


def row(table, rule, kind):
    (found,) = [one for one in table.rows if (one.rule, one.kind) == (rule, kind)]
    return found


def test_nothing_in_the_limits_beats_the_optimum_of_its_kind(integrating):
    for kind in ("PI", "PID", "PIDA"):
        best = row(integrating, "optimal", kind)
        assert integrating.keeps(best)
        rivals = [one for one in integrating.rows if one.kind == kind and integrating.keeps(one)]
        assert min(one.iae_load for one in rivals) >= best.iae_load * 0.999


def test_a_rule_outside_its_validity_is_a_row_with_its_message(integrating):
    found = row(integrating, "direct load", "PIDA")
    assert not found.applies
    assert found.design is None
    assert "integrating" in found.reason
    for text in (str(integrating), integrating._repr_html_()):
        assert found.reason[:30] in text
        assert "keeps both limits" in text


def test_rows_are_measured_on_the_process_itself():
    process = pidalab.lags(3, delay=1.0)
    table = pidalab.compare(process, sample_time=0.05, rules=["simc", "itae setpoint", "haalman"])
    found = row(table, "simc", "PI")
    loop = classical.simc(process, "PI").loop(process)
    margins, load = pidalab.margins(loop), pidalab.load_response(loop, np.linspace(0, 200, 20001))
    setpoint = pidalab.step_response(loop, np.linspace(0, 200, 20001))
    assert (found.iae_load, found.iae_setpoint) == pytest.approx((load.iae(), setpoint.iae()), rel=1e-4)
    assert (found.ms, found.delay_margin) == pytest.approx((margins.ms, margins.dm))
    assert found.noise_gain == pytest.approx(pidalab.noise_gain(loop, 0.05))
    assert found.relative_noise == pytest.approx(pidalab.relative_noise_gain(loop))
    assert found.tv == pytest.approx(load.tv("u"), rel=1e-3)
    # a filter faster than the sample is judged as a PLC runs it, and that is said; with its output filter, too
    assert "backward" in row(table, "itae setpoint", "PIDA").reason
    filtered = row(table, "haalman", "PIDA")
    assert "backward" in filtered.reason
    digital = pidalab.Loop(process, filtered.design.discretise(0.05))
    assert filtered.noise_gain == pytest.approx(pidalab.noise_gain(digital, 0.05))


def test_the_table_shows_the_relative_noise_gain_whatever_the_sample_time():
    process, tables = pidalab.lags(3, delay=1.0), []
    for limits in ({}, {"noise_gain": 2.0, "sample_time": 0.1}):
        tables.append(pidalab.compare(process, **limits, rules=["simc"]))
        assert "relative noise gain" in str(tables[-1]).splitlines()[1]
    scale = pidalab.noise_scale(process)
    assert (tables[0].noise_gain, tables[0].sample_time) == (1.5 * scale.gain, scale.sample_time)
    rows = [row(table, "simc", "PI") for table in tables]
    assert rows[0].relative_noise == rows[1].relative_noise
    assert rows[0].noise_gain != rows[1].noise_gain


@pytest.mark.parametrize("wrong", [{"ms": 1.0}, {"noise_gain": 0.0}, {"sample_time": -1.0}])
def test_limits_out_of_range(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        pidalab.compare(pidalab.lags(2), **wrong)
