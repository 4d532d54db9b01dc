"""Any input at all: the signal stays a number within its limits, and the next good sample goes on from there.

A sample with a signal that is no number is left out, in all languages alike. So a run with bad samples is the run
without them, sample for sample: that is the trajectory that it returns to.
"""

import math
import os
import shutil
import subprocess

import numpy as np
import pytest
from cases import CASES
from st import Instance, read

from pidalab import PIDA, HighOrderPID
from pidalab.digital import from_json
from pidalab.digital.program import INPUTS, MORE, program

BAD = (math.nan, math.inf, -math.inf, 1e308, -1e308, 1e30)
SIGNALS = ("setpoint", "measurement", "manual_value", "track_value", "feedforward")
N = 1500
MAIN = """
#include <stdio.h>
int main(void)
{
    double r, y, m, v, f;
    int manual, tracking, retuned;
    loop_state s;
    loop_init(&s);
    while (scanf("%%lf %%lf %%d %%lf %%d %%lf %%lf %%d", &r, &y, &manual, &m, &tracking, &v, &f, &retuned) == 8) {
        double u = loop_step(&s, r, y, manual != 0, m, tracking != 0, v%s%s);
        printf("%%.17g %%d %%d\\n", u, (int)s.fault, (int)s.at_limit);
    }
    return 0;
}
"""
WARNINGS = ["-Wall", "-Wextra", "-Werror", "-pedantic", "-Wconversion", "-Wshadow"]
GCC = ["gcc", "-std=c99", "-O1", *WARNINGS, "-ffp-contract=off"]


def compiler():
    """gcc, or a skip that says so; where everything has to be there its lack is a failure."""
    if shutil.which("gcc") is None:
        if os.environ.get("CI"):
            pytest.fail("no gcc: the written C cannot be judged")
        pytest.skip("no gcc: the written C is judged elsewhere")


def rows_of(k, seed, n=N, share=0.02):
    """Random signals about the working point, a share of each of which is bad; gains that are bad in spells."""
    rng = np.random.default_rng(seed)
    span = 3.0
    rows = {
        "setpoint": k.y_offset + rng.uniform(-span, span, n),
        "measurement": k.y_offset + rng.uniform(-span, span, n),
        "manual": np.repeat(rng.random(n // 10 + 1) < 0.15, 10)[:n],
        "manual_value": k.bias + rng.uniform(-9.0, 9.0, n),
        "tracking": rng.random(n) < 0.1,
        "track_value": k.bias + rng.uniform(-5.0, 5.0, n),
        "feedforward": rng.uniform(-1.0, 1.0, n),
        "retuned": rng.random(n) < 0.05,
    }
    for name in SIGNALS:
        rows[name] = np.where(rng.random(n) < share, rng.choice(BAD, n), rows[name])
    rows = {name: rows[name] for name in program(k).inputs}
    return [dict(zip(rows, (x.item() for x in row), strict=True)) for row in zip(*rows.values(), strict=True)]


def needed(row):
    """Whether a sample has all signals it needs, said in other words than in the code."""
    names = ["setpoint", "measurement", *(["feedforward"] if "feedforward" in row else [])]
    names += ["manual_value"] if row["manual"] else []
    names += ["track_value"] if row["tracking"] else []
    return all(math.isfinite(row[name]) and abs(row[name]) <= 1e9 for name in names)


def by_step(k, row):
    if row.get("retuned"):
        k.retune(k)
    manual = row["manual_value"] if row["manual"] else None
    track = row["track_value"] if row["tracking"] else None
    more = {"feedforward": row["feedforward"]} if "feedforward" in row else {}
    return k.step(row["setpoint"], row["measurement"], manual, track, **more)


@pytest.fixture(scope="module", params=CASES)
def run(request):
    """A controller, signals for it, and what `step` makes of them."""
    k = CASES[request.param]
    rows = rows_of(k, sum(map(ord, request.param)))
    k.reset()
    return k, rows, [(by_step(k, row), k.fault, k.at_limit) for row in rows]


def test_it_stays_within_its_limits_and_says_what_it_left_out(run):
    k, rows, found = run
    low, high = k.limits
    u = np.array([each[0] for each in found])
    assert np.isfinite(u).all()
    assert np.all((low <= u) & (u <= high))
    assert [each[1] for each in found] == [not needed(row) for row in rows]
    assert 0.03 < np.mean([each[1] for each in found]) < 0.3
    before = k.bias
    for row, (signal, fault, _) in zip(rows, found, strict=True):
        if fault and not (row["manual"] and abs(row["manual_value"]) <= 1e9):
            assert signal == before
        before = signal


def test_bad_samples_are_as_if_they_had_not_been(run):
    """But in manual, where the operator drives the signal whatever the sensor says."""
    k, rows, found = run
    kept = [
        (row, each)
        for row, each in zip(rows, found, strict=True)
        if not row["manual"] and not row.get("retuned")
    ]
    # a run of its own over the samples out of manual, with the bad ones and without
    outputs = []
    for chosen in (kept, [pair for pair in kept if needed(pair[0])]):
        k.reset()
        outputs.append([by_step(k, row) for row, _ in chosen])
    good = [needed(row) for row, _ in kept]
    assert not all(good)
    assert np.array(outputs[0])[good].tolist() == outputs[1]


def test_python_and_structured_text_do_the_same(run):
    k, rows, found = run
    space = {}
    exec(k.python("loop"), space)
    block = space["Loop"]()
    for row, expected in zip(rows, found, strict=True):
        assert (block.step(**row), block.fault, block.at_limit) == expected
    block = Instance(read(k.structured_text("loop")), "loop")
    for row, expected in zip(rows, found, strict=True):
        block(**row)
        assert (block.control, block.fault, block.at_limit) == expected
    read_back = from_json(k.json())
    for row, expected in zip(rows, found, strict=True):
        assert by_step(read_back, row) == expected[0]


def test_c_does_the_same(run, tmp_path):
    compiler()
    k, rows, found = run
    more = (", f" * k.feedforward, ", retuned != 0" * k.tunable)
    (tmp_path / "loop.c").write_text(k.c("loop") + MAIN % more, encoding="utf-8")
    subprocess.run([*GCC, str(tmp_path / "loop.c"), "-o", str(tmp_path / "loop")], check=True)
    names = (*INPUTS, *MORE)
    usual = {"feedforward": 0.0, "retuned": False}
    values = [[(usual | row)[name] for name in names] for row in rows]
    lines = [" ".join(str(int(x)) if isinstance(x, bool) else repr(x) for x in row) for row in values]
    ran = subprocess.run(
        [str(tmp_path / "loop")], input="\n".join(lines), capture_output=True, text=True, check=True
    )
    values = [line.split() for line in ran.stdout.splitlines()]
    assert [(float(u), fault == "1", limit == "1") for u, fault, limit in values] == found


@pytest.mark.parametrize("name", ["integral_tustin", "fed_clamping", "tuned_reset"])
def test_gains_that_are_none_hold_it_too(name):
    """Written to the running code, as a program or an operator may do; with good gains again it goes on."""
    k = CASES[name]
    space = {}
    exec(k.python("loop"), space)
    low, high = k.limits
    for gain, usual in program(k).gains.items():
        block = space["Loop"]()
        for y in (0.0, 0.1, 0.2):
            before = block.step(1.0, y)
        for bad in (*BAD, 1e10, -0.5 if gain.endswith(("NEW", "OLD")) and gain.startswith("PART") else 1e99):
            setattr(block, gain, bad)
            assert block.step(1.0, 0.3) == before
            assert block.fault
        setattr(block, gain, usual)
        assert low <= block.step(1.0, 0.25) <= high
        assert not block.fault
        assert abs(block.step(1.0, 0.25) - before) < 2.0


def test_a_loop_settles_within_twenty_samples_of_the_last_bad_one():
    """The plant goes on while the controller holds; afterwards both loops are the same again, to a thousandth."""
    k = PIDA(1.2, 1.0).discretise(0.2, limits=(-5.0, 5.0))
    ends = []
    for bad in (False, True):
        k.reset(r=0.0, y=0.0)
        y, rng = 0.0, np.random.default_rng(5)
        for i in range(200):
            measured = rng.choice(BAD) if bad and 100 <= i < 140 and i % 3 else y
            y += 0.2 * (k.step(1.0, measured) - y)
        ends.append(y)
        assert abs(y - 1.0) < 1e-3
    assert abs(ends[1] - ends[0]) < 1e-3


def test_a_first_call_that_tracks_starts_there():
    for code in (PIDA(2.0, 4.0, 1.0), PIDA(1.0, 3.0), HighOrderPID([0.4, 1.3, 0.6], 0.3, 3)):
        k = code.discretise(0.5, limits=(0.0, 100.0), bias=40.0)
        assert k.step(300.0, 310.0, track=20.0) == 20.0
        k.reset()
        assert [k.step(310.0, 310.0, track=20.0) for _ in range(3)] == [20.0] * 3
        assert k.step(310.0, 310.0) == 20.0


def test_manual_drives_the_signal_while_the_sensor_is_broken_and_hands_over_without_a_bump():
    k = PIDA(2.0, 4.0).discretise(0.5, limits=(0.0, 100.0), bias=40.0)
    assert k.step(1.0, 1.0) == 40.0
    assert k.step(1.0, math.nan) == 40.0
    assert k.step(1.0, math.nan, manual=70.0) == 70.0
    assert k.step(1.0, math.nan, manual=170.0) == 100.0
    assert k.at_limit
    assert k.step(1.0, math.nan, manual=math.nan) == 100.0
    assert k.step(1.0, math.nan) == 100.0  # back in automatic, still without a measurement
    assert k.step(1.0, 1.0) == 100.0  # and with one: it goes on from there
    assert k.step(1.0, 1.5) == pytest.approx(100.0 - 1.0 - 0.125)


@pytest.mark.parametrize("limits", [(0.0, 100.0), (-1.0, 1.0), (10.0, 90.0)])
@pytest.mark.parametrize("h", [1.0, 30.0, 90.0])
def test_clamping_does_not_lock(h, limits):
    """A growth of the integral within one sample may be more than the whole range."""
    low, high = limits
    for target in (1e3, -1e3):
        k = PIDA(5.0, 100.0).discretise(h, limits=limits, anti_windup="clamping", bias=0.5 * (low + high))
        k.step(0.0, 0.0)
        found = [k.step(target, 0.0) for _ in range(400)]
        assert found[-1] == (high if target > 0 else low)
        back = [k.step(-target, 0.0) for _ in range(400)]
        assert back[-1] == (low if target > 0 else high)


def test_the_lock_of_clamping_that_was_seen():
    for b in (1.0, 0.0):
        k = PIDA(5, 100).discretise(30.0, limits=(0, 100), anti_windup="clamping", b=b)
        assert [k.step(95.0, 20.0) for _ in range(400)][-1] == 100.0


@pytest.mark.parametrize("name", ["plain_pi", "tuned_reset", "prefilter_tustin", "fed_pd"])
def test_reset_starts_anew_in_every_language(name):
    k = CASES[name]
    k.reset()
    expected = [k.step(0.3, y) for y in (0.0, 0.5, 0.1)]
    space = {}
    exec(k.python("loop"), space)
    block, text = space["Loop"](), Instance(read(k.structured_text("loop")), "loop")
    for start in range(3):
        found = []
        for i, y in enumerate((0.0, 0.5, 0.1)):
            text(setpoint=0.3, measurement=y, reset=bool(start and i == 0))
            found.append((block.step(0.3, y), text.control))
        assert found == [(u, u) for u in expected]
        block.reset()
    assert "void loop_reset(loop_state *s)" in k.c("loop")
