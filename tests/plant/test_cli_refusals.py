"""Whatever a file or an argument says: one line of ours, which a terminal only prints."""

import json
import math
import re

import pytest
from click.testing import CliRunner

import pidalab
from pidalab.plant.cli import main
from pidalab.plant.code.files import checksum
from pidalab.plant.ultimate import relay_oscillation

K = pidalab.PIDA(2.0, 4.0).discretise(0.5)
LOOP = ("simulate", "--den", "1,1", "--until", "9")
EVIL = "\x1b]0;title\x07\x1b[2J\u202e\nMargins\n  Ms = 1.2 \x9b31m"


def run(*arguments):
    return CliRunner().invoke(main, [str(x) for x in arguments])


def acts(text):
    """What a terminal would act on, or hide."""
    return [x for x in text if not x.isprintable() and x != "\n"]


def test_names_of_others_reach_a_terminal_as_text(tmp_path):
    stored = json.loads(K.json()) | {"controller": EVIL}
    stored["checksum"] = checksum(stored)
    path = tmp_path / "controller.json"
    path.write_text(json.dumps(stored), encoding="utf-8")
    shown = run(*LOOP, "--controller", path)
    assert shown.exit_code == 0
    assert not acts(shown.output)
    assert [line for line in shown.output.splitlines() if line[:1].strip()] == ["Loop", "Margins", "Measures"]
    try:
        (tmp_path / f"{EVIL}.csv").write_text("", encoding="utf-8")
        (tmp_path / f"{EVIL}.json").write_text("", encoding="utf-8")
    except OSError:
        pytest.skip("files here can have no names with such characters")
    for command in (
        ("tune", tmp_path / f"{EVIL}.csv", "--sample-time", 1),
        (*LOOP, "--controller", tmp_path / f"{EVIL}.json"),
        (*LOOP, "--kp", 1, "--out", tmp_path / f"{EVIL}.csv"),
        (*LOOP, "--kp", 1, "--out", tmp_path / f"{EVIL}.txt"),
    ):
        done = run(*command)
        assert not acts(done.output), command
        assert done.exit_code == (0 if ".txt" in str(command[-1]) else 1)
    assert not acts(repr(pidalab.digital.from_json(json.dumps(stored)))), "in a program, too"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"t,u\n1,2", "must be the JSON of a digital controller"),
        (K.json().encode("utf-16"), "codec can't decode"),
        (K.json().replace("0.25", "0.26").encode(), "changed by hand"),
    ],
)
def test_a_file_that_is_no_controller_is_named(tmp_path, content, said):
    path = tmp_path / "mine.json"
    path.write_bytes(content)
    done = run(*LOOP, "--controller", path)
    assert done.exit_code == 1
    assert "--controller" in done.stderr
    assert "mine.json" in done.stderr
    assert said in done.stderr
    path.write_bytes(K.json().encode("utf-8-sig"))  # as some editors save it
    assert run(*LOOP, "--controller", path).exit_code == 0


@pytest.mark.parametrize(
    "option", ["--kp=1", "--ti=7", "--td=1", "--ta=1", "--n=5", "--m=5", "--sample-time=0.5"]
)
def test_a_controller_of_a_file_takes_no_gains_beside_it(tmp_path, option):
    path = tmp_path / "controller.json"
    path.write_text(K.json(), encoding="utf-8")
    done = run(*LOOP, "--controller", path, option)
    assert done.exit_code == 2
    assert f"leave out {option.partition('=')[0]}" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((*LOOP, "--kp", "1", "--delay", "1e300"), "more memory than there is"),
        (("tclab", "--duration", "inf"), "duration must be finite"),
        (("tclab", "--duration", "nan"), "duration must be finite"),
        (("tclab", "--sample-time", "0"), "sample_time must be above 0"),
        (("tclab", "--duration", "1e12"), "more memory than there is"),
        (("benchmark", "no.py:f"), "rule must be a file"),
    ],
)
def test_arguments_beyond_all_measure_are_one_line(arguments, said):
    done = run(*arguments)
    assert done.exit_code == 1
    assert isinstance(done.exception, SystemExit), repr(done.exception)
    assert len(done.stderr.strip().splitlines()) == 1
    assert said in done.stderr


def test_what_a_benchmark_writes_is_asked_about_before(tmp_path, monkeypatch):
    (tmp_path / "rule.py").write_text("def tune(process): return None\n", encoding="utf-8")
    folder = tmp_path / "out"
    asked = []

    class Found:
        def __str__(self):
            return "the ranking"

        def csv(self, path):
            path.write_text("rows", encoding="utf-8")
            return path

        def latex(self):
            return "table"

        def plot(self):
            from matplotlib.figure import Figure

            return Figure()

    def judged(*given):
        asked.append(given)
        return Found()

    monkeypatch.setattr("pidalab.comparison.benchmarking.benchmark", judged)
    command = ("benchmark", f"{tmp_path / 'rule.py'}:tune", "--out", folder)
    assert run(*command).exit_code == 0
    assert sorted(path.name for path in folder.iterdir()) == [
        "benchmark.csv",
        "benchmark.svg",
        "benchmark.tex",
    ]
    (folder / "benchmark.tex").write_text("mine", encoding="utf-8")
    done = run(*command)
    assert (done.exit_code, "benchmark.tex" in done.stderr, "--force" in done.stderr) == (1, True, True)
    assert (len(asked), (folder / "benchmark.tex").read_text(encoding="utf-8")) == (1, "mine")
    assert run(*command, "--force").exit_code == 0
    assert (folder / "benchmark.tex").read_text(encoding="utf-8") == "table"


@pytest.mark.parametrize(
    "option", ["--setpoint=nan", "--cooling=0", "--ms=1", "--cooling=nan", "--setpoint=inf"]
)
def test_the_board_is_not_heated_for_an_option_that_is_refused(monkeypatch, option):
    monkeypatch.setattr("pidalab.plant.heater.Lab.step_test", lambda *_, **__: pytest.fail("heated"))
    done = run("tclab", option)
    assert done.exit_code == 1
    assert f"{option.partition('=')[0]} must be" in done.stderr


@pytest.fixture
def step(tmp_path):
    """A record of a step from 40 to 47."""
    path = tmp_path / "log.csv"
    rows = (f"{k},{40 if k < 10 else 47},{20 + min(max(0, k - 12), 9)}" for k in range(40))
    path.write_text("\n".join(rows), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--u-min", 50, "--u-max", 100), "runs from 40 to 47, found 50 and 100"),
        (("--u-min", 100, "--u-max", 0), "runs from 40 to 47, found 100 and 0"),
        (("--u-min", 40, "--u-max", 40), "found 40 and 40"),
        (("--u-min", "nan"), "found nan and inf"),
        (("--u-max", 45), "runs from 40 to 47, found -inf and 45"),
        (("--full-output", 0), "--full-output must not be 0"),
        (("--full-output", "nan"), "--full-output must be finite"),
    ],
)
def test_limits_of_the_code_are_checked_before_the_search(step, monkeypatch, options, said):
    monkeypatch.setattr("pidalab.plant.fitting.fit", lambda *_: pytest.fail("fitted"))
    done = run("tune", step, "--sample-time", 1, *options)
    assert (done.exit_code, said in done.stderr) == (1, True), done.output


def test_an_empty_name_is_no_place_to_write_to(step, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.iterdir())
    for command in (
        ("tune", step, "--sample-time", 1),
        ("report", step, "--sample-time", 1),
        (*LOOP, "--kp", 1),
        ("tclab",),
        ("benchmark", "rule.py:tune"),
    ):
        done = run(*command, "--out", "")
        assert done.exit_code == 2
        assert "'--out': must be a name, found an empty one" in done.stderr
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--ti", 5, "--filter", -1), "--filter must be at least 0, found -1"),
        (("--ti", 5, "--filter", "nan"), "--filter must be finite"),
        (
            ("--firmware", "klipper", "--ki", 1, "--kd", -1),
            "p, i and d must have one sign, found 1, 1 and -1",
        ),
        (("--firmware", "klipper", "--ki", -1), "p, i and d must have one sign, found 1, -1 and 0"),
    ],
)
def test_gains_of_a_running_loop_are_checked_by_name(step, options, said):
    done = run("check", step, "--kp", 1, *options)
    assert (done.exit_code, said in done.stderr) == (1, True), done.output


PI = ("--kind", "PI", "--sample-time", 1)
ROWS = [(k, 40 if k < 30 else 47, round(20 + 10 * (1 - 0.9 ** max(0, k - 32)), 3)) for k in range(120)]


def text(rows, head="time,u,y", form="{},{},{}"):
    return "\n".join([head, *(form.format(*row) for row in rows)])


@pytest.mark.parametrize(
    ("content", "options", "said"),
    {
        "another period": (text(ROWS), ("--period", 2), "period = 2 contradicts the file's own times"),
        "a clock for u": (text([(k, 21 * k, y) for k, _, y in ROWS]), (), "u rises or falls evenly"),
        "a counter for u": (text([(k**1.2, k, y) for k, _, y in ROWS]), (), "number of the sample"),
        "the output for u": (text([(k, 2 * y + 1, y) for k, _, y in ROWS]), (), "u is a copy of y"),
        "two runs": (text(ROWS + ROWS), (), "at row 122, from 119 to 0: the file holds 2 runs"),
        "no such run": (text(ROWS + ROWS), ("--run", 3), "run must be at most 2"),
        "a large Ms": (text(ROWS), ("--ms", 50), "ms must be at most 5"),
        "a word": (text(ROWS).replace("\n50,47", "\n50,open"), (), "row 52, column 1"),
    }.values(),
)
def test_what_a_log_cannot_mean_is_refused_with_the_remedy(tmp_path, content, options, said):
    path = tmp_path / "log.csv"
    path.write_text(content, encoding="utf-8")
    done = run("tune", path, *PI, "--rule", "simc", "--model", "fopdt", *options)
    assert (done.exit_code, said in done.stderr) == (1, True), done.output


@pytest.mark.parametrize(
    ("content", "options"),
    {
        "unavailable": (text(ROWS).replace("\n50,47,28.499", "\n50,47,unavailable"), ()),
        "states": (text([(k, "on" if u > 40 else "off", y) for k, u, y in ROWS]), ()),
        "blanks after thousands": (
            text([(k, u, f"1 {100 + y:.3f}".replace(".", ",")) for k, u, y in ROWS], form="{};{};{}"),
            ("--delimiter", ";"),
        ),
        "brackets": (
            text(ROWS, " Sample Time   Command  Encoder 1 Pos", "{}  {}  {};")
            .replace("\n0 ", "\n[ 0 ")
            .replace(" Sample Time", "Sample Time")
            + "]",
            ("--time", 0, "--y", "Encoder 1 Pos"),
        ),
        "second run": (text(ROWS + ROWS), ("--run", 2)),
        "not in order": (text([*ROWS[:60], ROWS[61], ROWS[60], *ROWS[62:]]), ()),
        "a counter beside a period": (text(ROWS, "sample,u,y"), ("--period", 2, "--sample-time", 2)),
    }.values(),
)
def test_logs_are_read_as_they_are(tmp_path, content, options):
    path = tmp_path / "log.csv"
    path.write_text(content, encoding="utf-8")
    done = run("tune", path, *PI, "--rule", "simc", "--model", "fopdt", "--ms-worst", 4, *options)
    assert done.exit_code == 0, done.output
    assert "Safe?" in done.stdout


def test_hold_out_at_or_below_0_is_no_model(tmp_path, monkeypatch):
    """In tune and check alike."""
    monkeypatch.setattr("pidalab.plant.fitting.Fit.holdout", -0.09)
    path = tmp_path / "log.csv"
    path.write_text(text(ROWS), encoding="utf-8")
    for command in (("tune", path, *PI), ("check", path, "--kp", 1, "--ti", 10)):
        done = run(*command, "--model", "fopdt")
        assert (done.exit_code, "the hold-out data" in done.stderr) == (1, True), done.output


def test_rules_from_ultimate_gain_and_period(tmp_path):
    done = run("rule", "--ku", 8.502, "--tu", 3.721)
    (line,) = (line for line in done.stdout.splitlines() if re.match("Ziegler-Nichols +PID", line))
    assert [float(x) for x in line.split()[2:5]] == pytest.approx([5.101, 1.8605, 0.4651], rel=1e-3)
    assert float(line.split()[6]) > 2
    assert run("rule", "--ku", 2).exit_code == 2


@pytest.mark.parametrize(("low", "high"), [(-1.0, 1.0), (-0.7, 1.3)])
def test_a_relay_record_is_measured_right_with_its_bias(low, high):
    h, lag = 0.01, 5.0
    y, u, x, waiting = [], [], 0.0, [0.0] * 100
    for _ in range(6000):
        y.append(x)
        u.append(high if x < 0 else low)
        waiting.append(u[-1])
        x += (waiting.pop(0) - x) * -math.expm1(-h / lag)
    wave = relay_oscillation([h * k for k in range(6000)], u, y)
    plant = pidalab.fopdt(1.0, lag, 1.0)(2j * math.pi / wave.tu)
    assert wave.ku == pytest.approx(1 / abs(plant), rel=5e-3)
    assert (wave.bias == pytest.approx(0.5, abs=0.01)) is (low == -high)
