"""The trade-off of one plant: the points are optima."""

import re
from functools import partial

import numpy as np
import pytest
from click.testing import CliRunner

import pidalab
from pidalab.plant.cli import main
from pidalab.plant.noise_curves import TradeOff, TradeOffPoint

PROCESS = pidalab.lags(3, delay=1.0)
LEVELS, NOISE = (1.4, 2.0), (0.15, 0.5, 1.5)


@pytest.fixture(scope="module")
def found():
    return pidalab.trade_off(PROCESS, LEVELS, limits=NOISE, kinds=("PID", "PI"))


def test_wider_limits_never_raise_the_error(found):
    iae = {point[:3]: point.iae for point in found.points}
    assert list(iae) == [(k, m, n) for m in LEVELS for k in ("PI", "PID") for n in NOISE]
    grid = np.reshape(list(iae.values()), (2, 2, 3))  # Ms, kind, noise
    for axis in range(3):
        assert np.all(np.diff(grid, axis=axis) <= 1e-4 * grid.max())
    assert grid[0, 1, -1] < 0.7 * grid[0, 0, -1]


def test_every_point_keeps_its_limits(found):
    for point in found.points:
        loop = point.design.loop(PROCESS)
        assert pidalab.max_sensitivity(loop)[0] <= point.ms * (1 + 1e-6)
        assert pidalab.relative_noise_gain(loop) <= point.relative_noise_gain * (1 + 1e-5)


def test_page_has_the_figure(found):
    report = pidalab.report(PROCESS, kinds=("PI",), rule="simc")
    assert report.page("A", traded=found.plot()).count("<figure>") == 2
    assert report.page("A").count("<figure>") == 1
    with pytest.raises(ValueError, match="nothing to draw"):
        TradeOff(PROCESS, ()).plot()


def test_no_point_where_no_controller_is_that_quiet():
    plant = pidalab.Process([1.0], [1.0, -0.2], 0.5)  # unstable: it needs a gain of 0.2 at least
    scale = pidalab.noise_scale(plant)
    limits = [x / scale.gain for x in (0.01, 0.02, 3.0, 30.0)]
    result = pidalab.trade_off(plant, [2.0], limits=limits, kinds=["PI"])
    assert [point.relative_noise_gain for point in result.points] == pytest.approx(limits[2:])


def test_table_has_a_dash_where_there_is_no_point():
    values = (("PI", 1.4, 0.5, 12.34567), ("PI", 1.4, 2.0, 8.0), ("PID", 1.4, 2.0, 6.0))
    points = tuple(TradeOffPoint(*value, None) for value in values)
    _, names, *rows = str(TradeOff(PROCESS, points)).splitlines()
    assert names.split()[-2:] == ["PI", "PID"]
    assert [row.split() for row in rows] == [["1.4", "0.5", "12.35", "-"], ["1.4", "2", "8", "6"]]


def test_command_writes_the_figure(monkeypatch, tmp_path):
    t = np.arange(0.0, 60.0, 0.5)
    y = pidalab.open_loop_step(pidalab.fopdt(2.0, 8.0, 2.0), t).y
    y = np.interp(t - 5, t, y + np.random.default_rng(0).normal(0, 0.01, t.size), left=0.0)
    columns = np.column_stack([t, np.where(t < 5, 0.0, 1.0), y])
    np.savetxt(tmp_path / "step.csv", columns, delimiter=",", header="t,u,y", comments="")
    small = partial(pidalab.trade_off, ms=[1.6], limits=[0.5, 2.0], kinds=["PI"])
    monkeypatch.setattr("pidalab.trade_off", small)
    options = ["--sample-time", "0.5", "--rule", "amigo", "--model", "fopdt", "--trade-off", "--out"]
    command = ["report", str(tmp_path / "step.csv"), *options, str(tmp_path / "report.html")]
    result = CliRunner().invoke(main, command)
    assert result.exit_code == 0, result.output
    assert re.search(r"^Trade-off\n.*least IAE of a load step", result.stdout, flags=re.MULTILINE)
    assert (tmp_path / "report.html").read_text(encoding="utf-8").count("<figure>") == 2


@pytest.mark.parametrize(
    ("argument", "options"),
    [("ms", {"ms": [1.0]}), ("limits", {"limits": [0.0]}), ("kinds", {"kinds": ["PD"]})],
)
def test_refusals(argument, options):
    with pytest.raises(ValueError, match=argument):
        pidalab.trade_off(PROCESS, **options)
