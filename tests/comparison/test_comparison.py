"""Compare all rules on one process: each has a row, and no row within the limits beats the optimum."""

import pytest

import pidalab


@pytest.fixture(scope="module")
def integrating():
    return pidalab.compare(pidalab.ipdt(0.1, delay=1.0), ms=1.6, noise_gain=10.0, sample_time=0.05)


def row(table, rule, kind):
    (match,) = [candidate for candidate in table.rows if (candidate.rule, candidate.kind) == (rule, kind)]
    return match


def test_no_rule_within_the_limits_beats_the_optimum_of_its_kind(integrating):
    for kind in ("PI", "PID", "PIDA"):
        best = row(integrating, "optimal", kind)
        assert integrating.keeps(best)
        rivals = [rival for rival in integrating.rows if rival.kind == kind and integrating.keeps(rival)]
        assert min(rival.iae_load for rival in rivals) >= best.iae_load * 0.999


def test_a_rule_that_does_not_apply_is_a_row_with_the_reason(integrating):
    refused = row(integrating, "direct load", "PIDA")
    assert not refused.applies
    assert refused.design is None
    assert "integrating" in refused.reason
    for text in (str(integrating), integrating._repr_html_()):
        assert refused.reason[:30] in text
        assert "keeps both limits" in text


def test_a_filter_faster_than_the_sample_uses_backward_differences():
    process = pidalab.lags(3, delay=1.0)
    table = pidalab.compare(process, sample_time=0.05, rules=["itae setpoint", "haalman"])
    assert "backward" in row(table, "itae setpoint", "PIDA").reason
    filtered = row(table, "haalman", "PIDA")
    assert "backward" in filtered.reason
    digital = pidalab.Loop(process, filtered.design.discretise(0.05))
    assert filtered.noise_gain == pytest.approx(pidalab.noise_gain(digital, 0.05))


def test_relative_noise_gain_does_not_depend_on_the_sample_time():
    process, tables = pidalab.lags(3, delay=1.0), []
    for limits in ({}, {"noise_gain": 2.0, "sample_time": 0.1}):
        tables.append(pidalab.compare(process, **limits, rules=["simc"]))
        assert "relative noise gain" in str(tables[-1]).splitlines()[1]
    scale = pidalab.noise_scale(process)
    assert (tables[0].noise_gain, tables[0].sample_time) == (1.5 * scale.gain, scale.sample_time)
    rows = [row(table, "simc", "PI") for table in tables]
    assert rows[0].relative_noise == rows[1].relative_noise
    assert rows[0].noise_gain != rows[1].noise_gain
