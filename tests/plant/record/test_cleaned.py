"""Clean records, and check steps, rest, noise, doubts and refusals."""

import numpy as np
import pytest

import pidalab
from pidalab import Record


def step_record(count=200, size=7.0, noise=0.0, seed=0, at=20.0):
    t = np.linspace(0.0, 100.0, count)
    u = np.where(t < at, 40.0, 40.0 + size)
    y = 300.0 + 2.0 * size * (1 - np.exp(-np.maximum(t - at - 5.0, 0.0) / 10.0))
    return t, u, y + np.random.default_rng(seed).normal(0.0, noise, count)


def test_ramp_is_a_step_at_its_middle():
    t, _, y = step_record()
    record = Record(t, np.interp(t, [20.0, 24.0], [40.0, 47.0]), y)
    assert len(record.steps) == 1
    assert record.steps[0].time == pytest.approx(22.0, abs=0.6)


@pytest.mark.parametrize(
    ("error", "message", "change"),
    [
        (ValueError, "20 usable samples or more, found 10 of 10", lambda t, u, y: (t[:10], u[:10], y[:10])),
        (ValueError, "20 usable samples or more, found 19", lambda t, u, y: (t[:19], u[:19], y[:19])),
        (ValueError, "t, u and y must have one length", lambda t, u, y: (t, u, y[:-1])),
        (ValueError, r"u never changes: .*\(--u-before\)", lambda t, u, y: (t, 0 * u, y)),
        (ValueError, "y never changes", lambda t, u, y: (t, u, 0 * y)),
        (ValueError, "20 different times or more, found 19", lambda t, u, y: (np.minimum(t, t[18]), u, y)),
        (ValueError, "the times go back at sample 140, .* 2 runs", lambda t, u, y: (t - 20 * (t > 70), u, y)),
        (TypeError, "y must be an array of real numbers", lambda t, u, y: (t, u, ["a"] * t.size)),
    ],
)
def test_refusals(error, message, change):
    with pytest.raises(error, match=message):
        Record(*change(*step_record()))


def test_step_of_several_is_refused():
    t, u, y = step_record()
    with pytest.raises(ValueError, match="the input changes again after the step"):
        _ = Record(t, np.where(t > 60.0, 40.0, u), y).step


def test_creeping_input_is_not_a_step():
    """The output of a PI controller jumps and then creeps. Rules for a step need a constant level."""
    t = np.arange(0.0, 600.0)
    u = np.where(t < 50, 40.0, 42.5 - np.exp(-(t - 50) / 40))
    record = Record(t, u, np.interp(t, [0, 55, 120, 600], [0.0, 0.0, 5.0, 5.0]))
    assert record.steps == ()
    assert any("does not step from one steady level to another" in doubt for doubt in record.doubts)
    with pytest.raises(ValueError, match="no step between steady levels"):
        pidalab.identification.three_point(record)


def bench(count=40, first=20, before=1.0, after=3.0, rest=None):
    """Return a record with a sample each second, an input step at `first`, and an output that rises a sample later."""
    t = np.arange(float(count))
    y = 5.0 + (np.minimum(np.maximum(t - first, 0.0), 8.0) if rest is None else rest)
    return t, np.where(t < first, before, after), y


def test_samples_of_the_same_time():
    t, u, y = bench()
    t, u, y = (np.append(x, more) for x, more in ((t, [30.0, 30.0]), (u, [7.0, 2.0]), (y, [1.0, 6.0])))
    record = Record(t, u, y)
    assert record.t.tolist() == np.arange(40.0).tolist()
    assert (record.u[30], record.u[29], record.u[31]) == (2.0, 3.0, 3.0)
    assert (record.y[29], record.y[30], record.y[31]) == (13.0, pytest.approx((13.0 + 1.0 + 6.0) / 3), 13.0)
    assert record.doubts[:2] == (
        "the times were not in order, first at sample 40, and were sorted",
        "2 sample(s) had the same time as another sample and were averaged",
    )


def test_twenty_samples_are_enough():
    t, u, y = bench(20, 10)
    assert Record(t, u, y).t.size == 20
    spoiled = [np.append(x, np.nan) for x in (t, u, y)]
    for k in range(3):  # a missing time, input or output
        columns = [np.append(x, 21.0) for x in (t, u, y)]
        columns[k] = spoiled[k]
        record = Record(*columns)
        assert record.t.size == 20
        assert record.doubts[0] == "1 of 21 samples had a missing value and were left out"


LONG = np.arange(101.0)


@pytest.mark.parametrize(
    ("u", "number"),
    [
        # a step is at least a twentieth of the span
        (np.select([LONG < 20, LONG < 60], [0.0, 0.952], 1.0), 1),
        (np.select([LONG < 20, LONG < 60], [0.0, 0.947], 1.0), 2),
        # a level lasts at least four samples
        (np.select([LONG < 20, LONG < 23], [0.0, 0.5], 1.0), 1),
        (np.select([LONG < 20, LONG < 24], [0.0, 0.5], 1.0), 2),
        # within a level the quantiles of 2 and 98 % may differ by a tenth of the span
        (np.where(LONG < 20, 0.0, 1.0 + 0.095 / 0.96 * ((LONG - 20) / 80 - 1)), 1),
        (np.where(LONG < 20, 0.0, 1.0 + 0.115 / 0.96 * ((LONG - 20) / 80 - 1)), 0),
        # levels last for at least seven tenths of the record
        (np.interp(LONG, [20.0, 50.0], [0.0, 1.0]), 1),
        (np.interp(LONG, [20.0, 51.0], [0.0, 1.0]), 0),
    ],
)
def test_steps_are_counted(u, number):
    assert len(Record(LONG, u, np.minimum(LONG, 50.0)).steps) == number


def test_time_of_a_step():
    t = np.arange(40.0)
    for shares, time in (([0.5], 20.0), ([0.49], 21.0), ([0.3, 0.5, 0.8], 21.0), ([0.3, 0.4, 0.6], 22.0)):
        for low, high in ((1.0, 3.0), (3.0, -1.0)):
            u = np.where(t < 20, low, high)
            u[20 : 20 + len(shares)] = low + np.array(shares) * (high - low)
            assert Record(t, u, bench()[2]).steps == ((time, low, high),)


@pytest.mark.parametrize("samples", [7, 8])
def test_noise_in_closed_form(samples):
    """The output alternates. 8 samples at rest suffice for the noise. With 7, all second differences are used."""
    rest = np.resize([0.5, -0.5], 40)
    record = Record(*bench(first=samples, rest=rest))
    if samples == 8:
        assert record.noise == (pytest.approx(0.5 * np.sqrt(8 / 7)), pytest.approx(-7 / 8), 8)
        assert record.rest == 5.0
        assert not any("uncertain" in doubt for doubt in record.doubts)
    else:
        assert record.noise == (pytest.approx(2.0 / 0.6745 / np.sqrt(6)), 0.0, 0)
        assert record.rest == 5.5  # the median
        assert "only 7 sample(s) before the input changes: the state of rest is uncertain" in record.doubts


@pytest.mark.parametrize(
    ("wobble", "slope", "said"),
    [(0.2, 0.08, True), (2.0, 0.08, False), (0.0, 0.0045, True), (0.0, 0.0041, False)],
)
def test_drift_is_doubted(wobble, slope, said):
    t, u, _ = bench()
    y = slope * np.minimum(t, 20.0) + wobble * np.resize([0.5, -0.5], 40) + np.where(t > 20, 4.0, 0.0)
    doubts = Record(t, u, y).doubts
    assert any("drifts" in doubt for doubt in doubts) == said
    if said and not wobble:
        assert f"the output drifts by {slope * 19:.3g} before the step: it was not at rest" in doubts


def test_correlation_of_noise_on_a_drift():
    t = np.arange(400.0)
    y = 0.05 * t + np.random.default_rng(1).normal(size=400) + np.where(t > 300, 50.0, 0.0)
    record = Record(t, np.where(t < 300, 0.0, 1.0), y)
    assert any("drifts" in doubt for doubt in record.doubts)
    assert abs(record.noise.correlation) < 0.2


def test_doubts_of_levels_and_gaps():
    """Distances of 6 and 8 samples are gaps, a distance of 5 samples is not."""
    t = 0.5 * np.delete(np.arange(101.0), [*range(41, 46), *range(61, 68), *range(81, 85)])
    u = np.select([t < 10, t < 35], [1.0, 3.0], 2.0)
    y = np.where(t < 12.5, 0.0, 4.0)
    assert Record(t, u, y).doubts == (
        "the output has only 2 levels, 4 apart",
        "the record has 2 gap(s); the longest begins at time 30 and lasts 4 time units",
    )


@pytest.mark.parametrize(("slow", "said"), [(5, False), (6, True)])
def test_slow_input_is_doubted(slow, said):
    """Samples between 10 and 90 % of the step are counted, up to half-way to the next step."""
    t = np.arange(200.0)
    u = np.where(t < 50, 2.0, 4.0)
    u[50 : 50 + slow] = np.linspace(2.21, 3.79, slow)
    for held in (u, np.where(t > 150, 2.0, u)):
        doubts = Record(t, held, np.minimum(t, 90.0)).doubts
        assert any(f"takes more than {slow - 1} to go from 2 to 4" in doubt for doubt in doubts) == said


AGES, HALVES = np.arange(200.0), np.resize([0.5, -0.5], 200)
RISING = np.select([AGES < 20, AGES < 190], [0.0, 10.0], 10.45)


@pytest.mark.parametrize(
    ("y", "doubt", "said"),
    [
        (np.minimum(np.maximum(AGES - 20.0, 0.0), 19), "only 20 levels, 1 apart", True),
        (np.minimum(np.maximum(AGES - 20.0, 0.0), 20), "only 21 levels, 1 apart", False),
        # In the last tenth the means of both halves differ by more than two hundredths of the change of 10.
        (np.select([AGES < 20, AGES < 190], [0.0, 9.81], 10.0), "still moves at the end", False),
        (np.select([AGES < 20, AGES < 190], [0.0, 9.79], 10.0), "still moves at the end", True),
        # Means of ten samples have a tenth of the variance of the noise. Three standard deviations count as noise.
        (RISING + 0.6 * HALVES, "still moves at the end", True),
        (RISING + 1.2 * HALVES, "still moves at the end", False),
    ],
)
def test_doubts_of_the_output(y, doubt, said):
    assert any(doubt in one for one in Record(AGES, np.where(AGES < 20, 1.0, 3.0), y).doubts) == said


def test_uniform_in_closed_form():
    """Samples are 2 apart and some are missing. A grid point lies at the step, and the output is interpolated."""
    t = np.delete(np.arange(0.0, 60.0, 2.0), [2, 20]) + 7.0
    u = np.where(t < 27.0, 1.0, 3.0)
    u[3] = 1.02  # the input rests until it steps
    grid, held, y = Record(t, u, 10.0 * t).uniform()
    assert grid == pytest.approx(np.arange(0.0, 60.0, 2.0))
    assert held.tolist() == [1.0] * 10 + [3.0] * 20
    assert y == pytest.approx(10.0 * (7.0 + grid))
    # If the step is off the grid of the first sample, samples before a whole interval are left out.
    grid, held, y = Record(np.append(0.3, np.arange(1.0, 40.0)), bench()[1], bench()[2]).uniform()
    assert (grid[0], grid[-1], held[18], held[19]) == (0.0, 38.0, 1.0, 3.0)


def test_after_step_in_closed_form():
    t, u, y = bench(50, 20, before=4.0, after=2.0)
    times, response = Record(*(np.delete(x, [30, 31]) for x in (t, u, y))).after_step()
    assert times.tolist() == np.arange(30.0).tolist()
    assert response == pytest.approx(-np.minimum(times, 8.0) / 2)


def test_record_as_text():
    record = Record(*bench(rest=np.resize([0.5, -0.5], 40)))
    assert str(record).splitlines()[:3] == [
        "40 samples over 39, every 1",
        "input: step from 1 to 3 at 20",
        "output: at rest 5 before the step, standard deviation of the noise 0.513, correlation -0.95",
    ]
    assert str(record).splitlines()[3] == "doubt: the output has only 2 levels, 1 apart"
    assert repr(record) == "Record(40 samples from 0 to 39)"


def test_counters_continue_and_reversed_order_is_turned():
    t, u, y = step_record()
    wrapped = Record(np.round(10 * t + 300) % 1000, u, y)
    assert np.diff(wrapped.t).min() > 0
    assert "the time is a counter that returns to 0 at 1000 (1 time(s)): it was continued" in wrapped.doubts
    for counter in (60.0, 3600.0, 86400.0):  # seconds of a minute, an hour, a day
        anew = Record((t * counter / 200.0 + 0.6 * counter) % counter, u, y)
        assert anew.t == pytest.approx((t - t[0]) * counter / 200.0 + anew.t[0], rel=1e-9)
    turned = Record(t[::-1], u[::-1], y[::-1])
    assert turned.y.tolist() == y.tolist()
    assert "the newest sample came first: the order was reversed" in turned.doubts


def test_record_that_begins_with_its_step():
    t, u, y = (x[40:] for x in step_record())
    told = Record(t, u, y, u_before=40.0)
    seen = Record(np.append(t[0], t), np.append(40.0, u), np.append(y[0], y))
    for record in (told, seen):
        assert record.steps == ((t[0], 40.0, 47.0),)
        assert record.at_rest
    one = Record(*(x[39:] for x in step_record()))  # one sample before
    assert one.steps == ((t[0], 40.0, 47.0),)


TIMES = np.arange(400.0)


@pytest.mark.parametrize(
    ("u", "name"),
    [
        (np.where(TIMES < 50, 0.0, 1.0), "a step"),
        (np.where((TIMES < 50) | (TIMES > 150), 0.0, 1.0), "a pulse"),
        (np.select([TIMES < 50, TIMES < 100, TIMES < 150], [0.0, 1.0, -1.0], 0.0), "a doublet"),
        (np.select([TIMES < 50, TIMES < 100, TIMES < 150], [0.0, 1.0, 2.0], 3.0), "several steps"),
        (np.repeat(np.random.default_rng(0).integers(0, 2, 40), 10).astype(float), "a binary test signal (PRBS)"),
        (np.repeat(np.random.default_rng(0).uniform(0, 1, 20), 20), "steps to many levels"),
        (0.1 * np.maximum(TIMES - 30.0, 0.0), "a ramp"),
        (np.sin(0.1 * TIMES), "a sine"),
        (np.cumsum(np.random.default_rng(0).normal(0, 1, 400)), "it moves all the time, as in a closed loop or by a "
         "test signal"),
    ],
)  # fmt: skip
def test_names_of_experiments(u, name):
    assert Record(TIMES, u, np.cumsum(np.random.default_rng(1).normal(0, 1, 400))).experiment == name


def test_warm_up_is_not_noise():
    t, u, y = step_record(noise=0.1)
    warm = Record(t, u, y - 20 * np.exp(-t / 8.0))
    assert not warm.at_rest
    assert warm.noise.deviation == pytest.approx(0.1, rel=0.4)
    still = Record(t, u, np.round(step_record()[2]))
    assert still.noise.deviation == pytest.approx(1 / np.sqrt(12))


@pytest.mark.parametrize(("limit", "said"), [(1.0, True), (np.inf, False)])
def test_input_at_a_limit_is_doubted(limit, said):
    moving = np.cumsum(np.random.default_rng(2).normal(0, 0.1, 400))
    u = np.minimum(moving + 3.0 * ((TIMES > 50) & (TIMES < 120)), limit)
    doubts = Record(TIMES, u, np.cumsum(np.random.default_rng(1).normal(0, 1, 400))).doubts
    assert any("the input stays at 1, its largest value, for" in doubt for doubt in doubts) == said


def first_order(noise, decimals=None, count=200):
    """Return a step response from 20 to 40 with a lag of 20 samples and a dead time of 5 samples."""
    t = np.arange(float(count))
    y = 20 + 20 * -np.expm1(-np.maximum(t - 25, 0) / 20)
    y = y + np.random.default_rng(0).normal(0, noise, t.size)
    return t, np.where(t < 20, 40.0, 50.0), y if decimals is None else np.round(y, decimals)


K = np.arange(200)
SPOILT = {  # a sensor at the end of its range, a lost sensor, and a logger that ends with zeros
    "clipped": lambda y: np.minimum(y, 30.0),
    "frozen": lambda y: y[np.where((K >= 40) & (K < 100), 40, K)],
    "frozen at the end": lambda y: y[np.minimum(K, 50)],
    "last row 0": lambda y: np.append(y[:-1], 0.0),
    "last rows 0": lambda y: np.append(y[:-2], [0.0, 0.0]),
}


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.2])
@pytest.mark.parametrize("decimals", [None, 1])
def test_sensor_errors_are_named(noise, decimals):
    t, u, y = first_order(noise, decimals)
    assert Record(t, u, y).outlier_note == ""
    for kind, spoil in SPOILT.items():
        made_up = spoil(y)
        record = Record(t, u, made_up)
        said = "far from its neighbours" if "row" in kind else "stands still"
        assert said in record.outlier_note, kind
        assert record.outlier_note in record.doubts
        with pytest.raises(ValueError, match=r"outliers='drop'"):
            pidalab.identification.fit(record)
        left = Record(t, u, made_up, outliers="drop")
        assert left.outlier_note == ""
        assert left.doubts[0].startswith("left out: ")
        assert {value for at, value in zip(left.t, left.y, strict=True) if value != y[int(at)]} == set()
        assert Record(t, u, made_up, outliers="keep").t.size == t.size


@pytest.mark.parametrize("levels", [1, 0])
def test_output_at_rest_is_not_a_lost_sensor(levels):
    """The output is constant before a step, after settling, and around a pulse. No sample is dropped."""
    t = np.arange(300.0)
    y = np.round(20 + 15 * -np.expm1(-np.maximum(t - 30, 0) / 12), levels)
    assert Record(t, np.where(t < 20, 0.0, 1.0), y).outlier_note == ""
    pulse = y - np.interp(t - 60, t, y, left=20) + 20
    assert Record(t, np.where((t > 20) & (t < 80), 1.0, 0.0), pulse).outlier_note == ""


@pytest.mark.parametrize("steps", [25, 50, 100, 200])
def test_rounded_peak_is_not_a_lost_sensor(steps):
    """Near its extrema a slow oscillation is constant because of rounding."""
    t = np.arange(300.0)
    late = np.maximum(t - 25, 0)
    y = 1 - np.exp(-late / 100) * (np.cos(late / 25) + 0.25 * np.sin(late / 25))
    assert Record(t, np.where(t < 20, 0.0, 1.0), np.round(steps * y / np.ptp(y))).outlier_note == ""
