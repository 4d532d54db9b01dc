"""What a trade-off asks the search for, with limits of its own and in other units, and its table by its points."""

import math

import numpy as np
import pytest

import pidalab
from pidalab.plant.noise_curves import TradeOff, TradeOffPoint
from pidalab.rules import Design

PLAIN = pidalab.lags(3, delay=1.0)


@pytest.fixture
def searched(monkeypatch):
    """Limits that the search gets; each controller makes all the noise that is allowed."""
    asked = []

    def find_curves(process, order, ms, noise_gains, sample_time):
        asked.append((order, list(ms), list(noise_gains), sample_time))
        return {
            (k, m, n): Design(
                process, pidalab.PIDA(0.5, 3.0), info={"noise_gain": n, "iae": 1 / n / m / (1 + k)}
            )
            for k in range(order + 1)
            for m in ms
            for n in noise_gains
        }

    monkeypatch.setattr("pidalab.optimal.curves.find_curves", find_curves)
    return asked


@pytest.mark.parametrize(("gain", "time"), [(1.0, 1.0), (-5.0, 60.0)])
def test_by_default_noise_is_from_a_tenth_to_three_ultimate_gains_a_hundred_times_in_a_period(
    searched, gain, time
):
    process = pidalab.Process([gain], PLAIN.den * time ** np.arange(3.0, -1.0, -1.0), time)
    w = pidalab.reduction.ultimate_frequency(process)
    ultimate, period = 1 / abs(process(1j * w)), 2 * math.pi / w
    found = pidalab.trade_off(process, rules=["magnitude optimum", "haalman", "simc"])
    noises = sorted({point.noise_gain for point in found.points})
    assert len(noises) == 5
    assert [noises[0], noises[-1]] == pytest.approx([0.1 * ultimate, 3 * ultimate])
    assert np.all(np.diff(np.log(noises)) < math.log(3.0))  # no wide gaps
    assert found.sample_time == pytest.approx(period / 100)
    assert searched == [(2, [1.4, 2.0], noises, found.sample_time)]
    assert list(dict.fromkeys(point.ms for point in found.points)) == [1.4, 2.0]
    assert list(dict.fromkeys(point.kind for point in found.points)) == ["PI", "PID", "PIDA"]
    rows = {(row.rule, row.kind): row for row in found.rules}
    # rules that know limits get the least Ms and the noise in the middle
    cautious = pidalab.compare(process, ms=1.4, rules=["haalman"]).rows
    assert rows["haalman", "PIDA"].ms == pytest.approx(next(x.ms for x in cautious if x.kind == "PIDA"))
    assert rows["magnitude optimum", "PID"].noise_gain == pytest.approx(noises[2], rel=1e-2)
    assert rows["simc", "PI"].iae_load == pytest.approx(
        pidalab.load_response(
            pidalab.rules.classical.simc(process, "PI").loop(process), np.linspace(0.0, 200.0 * time, 20001)
        ).iae(),
        rel=1e-3,
    )


def test_the_points_are_those_that_are_asked_for_in_order(searched):
    found = pidalab.trade_off(
        PLAIN, [2.0, 1.4], noise_gains=[4.0, 1.0, 2.0], sample_time=0.1, kinds=["PID"], rules=[]
    )
    assert searched == [(1, [1.4, 2.0], [1.0, 2.0, 4.0], 0.1)]
    assert [point[1:3] for point in found.points] == [(m, n) for m in (1.4, 2.0) for n in (1.0, 2.0, 4.0)]
    for point in found.points:
        assert point.iae == point.design.iae == 1 / point.noise_gain / point.ms / 2


def test_the_table_has_each_point_and_a_dash_for_none():
    points = [
        TradeOffPoint(kind, ms, noise, iae, None)
        for kind, ms, noise, iae in (
            ("PI", 1.4, 0.5, 12.34567),
            ("PI", 1.4, 2.0, 8.0),
            ("PID", 1.4, 2.0, 6.0),
            ("PID", 2.0, 2.0, 4.0),
        )
    ]
    head, names, *rows = str(TradeOff(PLAIN, 0.1, tuple(points), ())).splitlines()
    assert head == f"{PLAIN!r}: least IAE of a load step"
    assert names.split()[-2:] == ["PI", "PID"]
    assert [row.split() for row in rows] == [
        ["1.4", "0.5", "12.35", "-"],
        ["1.4", "2", "8", "6"],
        ["2", "2", "-", "4"],
    ]
    ends = [len(row) for row in (names, *rows)]
    assert len(set(ends)) == 1  # columns stand below their heads


@pytest.mark.parametrize("missing", [{"noise_gains": [1.0]}, {"sample_time": 0.1}])
def test_one_of_both_can_be_given(searched, missing):
    found = pidalab.trade_off(PLAIN, [1.4], kinds=["PI"], rules=[], **missing)
    w = pidalab.reduction.ultimate_frequency(PLAIN)
    assert found.sample_time == pytest.approx(missing.get("sample_time", 2 * math.pi / w / 100))
    assert len(found.points) == len(missing.get("noise_gains", range(5)))
