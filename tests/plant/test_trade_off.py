"""The trade-off of one plant: curves that are optima, rules beside them, and the picture."""

import math
import re
from functools import partial

import numpy as np
import pytest
from click.testing import CliRunner

import pidalab
from pidalab.plant import noise_curves as module
from pidalab.plant.cli import main
from pidalab.plant.page import trade_off_figure

PROCESS = pidalab.lags(3, delay=1.0)
LEVELS, NOISE, SAMPLE = (1.4, 2.0), (0.6, 2.0, 6.0), 0.07
LINE = 2e-3  # what a point may be off: a line of the picture is eight times as wide


@pytest.fixture(scope="module")
def found():
    return pidalab.trade_off(
        PROCESS, LEVELS, noise_gains=NOISE, sample_time=SAMPLE, kinds=("PID", "PI"), rules=("simc", "amigo")
    )


def test_more_noise_more_ms_and_more_derivatives_cost_nothing(found):
    iae = {point[:3]: point.iae for point in found.points}
    assert list(iae) == [(k, m, n) for m in LEVELS for k in ("PI", "PID") for n in NOISE]
    grid = np.reshape(list(iae.values()), (2, 2, 3))  # Ms, kind, noise
    for axis in range(3):
        assert np.all(np.diff(grid, axis=axis) <= 1e-4 * grid.max())
    assert grid[0, 1, -1] < 0.7 * grid[0, 0, -1]


def test_every_point_is_a_controller_that_keeps_its_limits(found):
    for point in found.points:
        loop = point.design.loop(PROCESS)
        assert pidalab.max_sensitivity(loop)[0] <= point.ms * (1 + 1e-6)
        assert point.design.noise_gain <= point.noise_gain * (1 + 1e-6)


@pytest.mark.parametrize(("kind", "ms", "noise"), [("PI", 2.0, 0.6), ("PID", 1.4, 0.6), ("PID", 2.0, 2.0)])
def test_a_point_is_what_a_search_from_many_starts_finds(found, kind, ms, noise):
    order = ("PI", "PID").index(kind)
    full = pidalab.optimal.load(PROCESS, order, ms=ms, noise_gain=noise, sample_time=SAMPLE)
    (point,) = [point for point in found.points if point[:3] == (kind, ms, noise)]
    assert point.iae == pytest.approx(full.iae, rel=LINE)


def test_rules_lie_above_the_curve_of_their_kind(found):
    assert {(row.rule, row.kind) for row in found.rules} == {
        (r, k) for r in ("simc", "amigo") for k in ("PI", "PID")
    }
    for row in found.rules:
        for point in found.points:
            if row.kind == point.kind and row.ms <= point.ms and row.noise_gain <= point.noise_gain:
                assert row.iae >= point.iae * (1 - 1e-3)


def test_no_point_stays_in_a_poor_valley():
    """Where much noise is allowed, a search that starts at Ms 1.4 ends 5 % above the best of Ms 2."""
    plant, noise, sample = pidalab.ipdt(1.0, 1.0), [2.4, 4.7], 0.04
    (quiet, loud) = pidalab.trade_off(
        plant, LEVELS, noise_gains=noise, sample_time=sample, kinds=["PIDA"], rules=[]
    ).curve("PIDA", 2.0)
    full = pidalab.optimal.load(plant, 2, ms=2.0, noise_gain=noise[1], sample_time=sample)
    assert loud.iae == pytest.approx(full.iae, rel=LINE)
    assert loud.iae < quiet.iae


def test_the_picture(found):
    figure = trade_off_figure(found)
    assert [ax.get_title(loc="left") for ax in figure.axes] == ["Ms at most 1.4", "Ms at most 2"]
    for ax in figure.axes:
        curves = {line.get_label(): line for line in ax.get_lines() if line.get_marker() == "None"}
        assert set(curves) == {"PI", "PID"}
    marks = [sum(line.get_marker() != "None" for line in ax.get_lines()) for ax in figure.axes]
    assert sum(marks) == 4
    assert marks[0] == sum(row.ms <= 1.4 for row in found.rules)
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend == ["PI", "PID", "simc", "amigo"]
    report = pidalab.report(PROCESS, kinds=("PI",), rule="simc")
    assert report.page(traded=found).count("<figure>") == 2
    assert report.page().count("<figure>") == 1
    with pytest.raises(ValueError, match="nothing to draw"):
        trade_off_figure(pidalab.TradeOff(PROCESS, SAMPLE, (), ()))


def test_where_no_controller_is_that_quiet_there_is_no_point(monkeypatch):
    """The full search is asked once, and refuses; what keeps the next limit as well is one design."""
    asked, full = [], pidalab.optimal.least_iae

    def least_iae(process, order, requirements, start):
        asked.append((order, requirements.noise_gain))
        return full(process, order, requirements, start=start)

    monkeypatch.setattr("pidalab.optimal.curves.least_iae", least_iae)
    plant = pidalab.Process([1.0], [1.0, -0.2], 0.5)  # unstable: it needs a gain of 0.2 at least
    made = pidalab.trade_off(
        plant, [2.0], noise_gains=[0.01, 0.02, 3.0, 30.0], sample_time=SAMPLE, kinds=["PI"], rules=["mrdp"]
    )
    assert [point.noise_gain for point in made.points] == [3.0, 30.0]
    assert len({id(point.design) for point in made.points}) == 1
    assert asked == [(0, 0.02)]
    assert [row.kind for row in made.rules] == ["PI"]


def test_a_response_longer_than_the_search_is_searched_in_full(monkeypatch):
    """As if the search had seen another IAE than the simulation."""
    monkeypatch.setattr("pidalab.optimal.curves.SAME_IAE", -math.inf)
    (point,) = pidalab.trade_off(
        PROCESS, [1.6], noise_gains=[2.0], sample_time=SAMPLE, kinds=["PI"], rules=[]
    ).points
    assert point.design.digits == 9


def test_the_command_writes_the_picture(monkeypatch, tmp_path):
    t = np.arange(0.0, 60.0, 0.5)
    y = pidalab.open_loop_step(pidalab.fopdt(2.0, 8.0, 2.0), t).y + np.random.default_rng(0).normal(
        0, 0.01, t.size
    )
    record = np.column_stack([t, np.where(t < 5, 0.0, 1.0), np.interp(t - 5, t, y, left=0.0)])
    np.savetxt(tmp_path / "step.csv", record, delimiter=",", header="t,u,y", comments="")
    small = partial(pidalab.trade_off, ms=[1.6], noise_gains=[0.5, 2.0], kinds=["PI"], rules=["simc"])
    monkeypatch.setattr(module, "trade_off", lambda process, sample_time: small(process, sample_time=0.5))
    out = tmp_path / "report.html"
    options = [
        "--sample-time",
        "0.5",
        "--rule",
        "amigo",
        "--model",
        "fopdt",
        "--trade-off",
        "--out",
        str(out),
    ]
    result = CliRunner().invoke(main, ["report", str(tmp_path / "step.csv"), *options])
    assert result.exit_code == 0, result.output
    assert re.search(r"^Trade-off\n.*least IAE of a load step", result.stdout, flags=re.MULTILINE)
    assert out.read_text(encoding="utf-8").count("<figure>") == 2


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: pidalab.trade_off(pidalab.lags(2)), "noise_gains and sample_time must be given"),
        (lambda: pidalab.trade_off(PROCESS, [1.0]), "ms must be above 1"),
        (lambda: pidalab.trade_off(PROCESS, noise_gains=[0.0]), "noise_gains must be above 0"),
        (lambda: pidalab.trade_off(PROCESS, kinds=["PD"]), "kinds must be 'PI', 'PID' or 'PIDA', found 'PD'"),
    ],
)
def test_it_refuses(call, message):
    with pytest.raises(ValueError, match=message):
        call()
