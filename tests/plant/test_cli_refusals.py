"""Check refusals of the command line: one printable line names the argument and the remedy."""

import json
import math

import pytest
from click.testing import CliRunner

import pidalab
from pidalab.plant.cli import main
from pidalab.plant.code.files import checksum
from pidalab.plant.ultimate import relay_oscillation

K = pidalab.PIDA(2.0, 4.0).discretise(0.5)
LOOP = ("simulate", "--den", "1,1", "--until", "9")
EVIL = "\x1b]0;title\x07\x1b[2J\u202e\nMargins\n  Ms = 1.2 \x9b31m"
QUICK = ("--sample-time", 1, "--kind", "PI", "--rule", "simc", "--model", "fopdt")


def run(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def control_characters(text):
    return [x for x in text if not x.isprintable() and x != "\n"]


def test_foreign_names_reach_a_terminal_as_text(tmp_path):
    stored = json.loads(K.json()) | {"controller": EVIL}
    stored["checksum"] = checksum(stored)
    path = tmp_path / "controller.json"
    path.write_text(json.dumps(stored), encoding="utf-8")
    shown = run(*LOOP, "--controller", path)
    assert (shown.exit_code, control_characters(shown.output)) == (0, [])
    assert [line for line in shown.output.splitlines() if line[:1].strip()] == ["Loop", "Margins", "Measures"]
    assert not control_characters(repr(pidalab.digital.from_json(json.dumps(stored))))
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
        assert not control_characters(done.output), command
        assert done.exit_code == (0 if ".txt" in str(command[-1]) else 1)


@pytest.fixture
def files(tmp_path, monkeypatch):
    """Write a record of a step from 40 to 47, and a controller, to the current folder."""
    monkeypatch.chdir(tmp_path)
    rows = (f"{k},{40 if k < 10 else 47},{20 + 10 * (1 - 0.8 ** max(0, k - 12)):.3f}" for k in range(60))
    (tmp_path / "step.csv").write_text("\n".join(["t,u,y", *rows]), encoding="utf-8")
    (tmp_path / "k.json").write_bytes(K.json().encode("utf-8-sig"))  # as some editors save it
    return tmp_path


TUNE, CHECK = ("tune", "step.csv", *QUICK), ("check", "step.csv", "--kp", 1)
MESSAGES = [  # exit status, part of the message, command
    (1, "more memory than there is", (*LOOP, "--kp", 1, "--delay", 1e300)),
    (1, "rule must be a file", ("benchmark", "no.py:f")),
    (1, "no column 'pressure'", (*TUNE, "--y", "pressure")),
    (1, "ms must be above 1", (*TUNE, "--ms", 0.9)),
    (1, "ms must be at most 5", (*TUNE, "--ms", 50)),
    (1, "from 40 to 47, found 50 to 100", (*TUNE, "--u-min", 50, "--u-max", 100)),
    (1, "found 100 to 0", (*TUNE, "--u-min", 100, "--u-max", 0)),
    (1, "found 40 to 40", (*TUNE, "--u-min", 40, "--u-max", 40)),
    (1, "found nan to inf", (*TUNE, "--u-min", "nan")),
    (1, "found -inf to 45", (*TUNE, "--u-max", 45)),
    (1, "lag must be finite", (*CHECK, "--ti", 5, "--filter", "nan")),
    (2, "--filter", (*CHECK, "--ti", 5, "--filter", -1)),
    (2, "--until", (*LOOP[:-1], 0, "--kp", 1)),
    (2, "--b", (*TUNE, "--b", 5)),
    (2, "--rate-limit", (*TUNE, "--rate-limit", 0)),
    (2, "--anti-windup", (*TUNE, "--anti-windup", "on")),
    (2, "--sample-time", ("tune", "step.csv")),
    (2, "nowhere.csv", ("tune", "nowhere.csv", "--sample-time", 1)),
    (2, "--num", ("compare", "--num", "one", "--den", "1,1")),
    (2, "--delay", (*LOOP, "--kp", 1, "--delay", "x")),
    (2, "give --kp", LOOP),
    (2, "--u-min", (*LOOP, "--kp", 1, "--u-min", 0)),
    (2, "--u-max", (*LOOP, "--kp", 1, "--u-max", 1)),
    (2, "--until must be at most 1e+07 samples", (*LOOP, "--kp", 1, "--sample-time", 1e-9)),
    (2, "--ti", CHECK),
    (2, "give --ku and --tu", ("rule", "--ku", 2)),
    *((2, f"leave out {x}", (*LOOP, "--controller", "k.json", x, 1)) for x in ("--kp", "--ti", "--td")),
    *((2, f"leave out {x}", (*LOOP, "--controller", "k.json", x, 1)) for x in ("--ta", "--n", "--m")),
    (2, "leave out --sample-time", (*LOOP, "--controller", "k.json", "--sample-time", 1)),
    (2, "'--out': must be a name", (*TUNE, "--out", "")),
    (2, "'--out': must be a name", ("report", "step.csv", "--sample-time", 1, "--out", "")),
    (2, "'--out': must be a name", (*LOOP, "--kp", 1, "--out", "")),
    (2, "'--out': must be a name", ("benchmark", "rule.py:tune", "--out", "")),
]


@pytest.mark.parametrize(("status", "message", "command"), MESSAGES, ids=lambda x: None)
def test_messages(files, monkeypatch, status, message, command):
    monkeypatch.setattr("pidalab.plant.tuning.make_safe", lambda *_: pytest.fail("searched"))
    before = sorted(files.iterdir())
    done = run(*command)
    assert (done.exit_code, message in done.stderr) == (status, True), done.output
    assert isinstance(done.exception, SystemExit), repr(done.exception)
    assert status == 2 or len(done.stderr.strip().splitlines()) == 1
    assert sorted(files.iterdir()) == before


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"t,u\n1,2", "must be the JSON of a digital controller"),
        (K.json().encode("utf-16"), "codec can't decode"),
        (K.json().replace("0.25", "0.26").encode(), "changed by hand"),
    ],
)
def test_file_that_is_not_a_controller_is_named(files, content, message):
    assert run(*LOOP, "--controller", "k.json").exit_code == 0
    (files / "mine.json").write_bytes(content)
    done = run(*LOOP, "--controller", files / "mine.json")
    assert done.exit_code == 1
    assert all(text in done.stderr for text in ("--controller", "mine.json", message))


def test_unsafe_design_is_refused_and_nothing_is_written(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(text(ROWS), encoding="utf-8")
    options = ("--kind", "PI", "--sample-time", 1, "--rule", "ziegler-nichols", "--spread", 0.4)
    done = run("tune", path, *options, "--out", tmp_path / "out")
    assert (done.exit_code, "the model is too uncertain" in done.stderr) == (1, True), done.output
    assert not (tmp_path / "out").exists()


ROWS = [(k, 40 if k < 30 else 47, round(20 + 10 * (1 - 0.9 ** max(0, k - 32)), 3)) for k in range(120)]


def text(rows, head="time,u,y", form="{},{},{}"):
    return "\n".join([head, *(form.format(*row) for row in rows)])


def unclipped(high=100.0):
    """Write a log of an on-off loop in whole degrees, whose first control signals are not clipped."""
    y, rows = 22.0, []
    for k in range(400):
        shown = round(y)
        asked = 300.0 * ((25 if k < 50 else 30) - shown)
        rows.append((k, asked if k < 12 else min(max(asked, 0.0), high), shown))
        y += (22.0 + 0.12 * min(max(asked, 0.0), high) - y) / 110.0
    return rows


@pytest.mark.parametrize(
    ("content", "options", "message"),
    {
        "another period": (text(ROWS), ("--period", 2), "period = 2 contradicts the file's own times"),
        "a clock for u": (text([(k, 21 * k, y) for k, _, y in ROWS]), (), "u rises or falls evenly"),
        "a counter for u": (text([(k**1.2, k, y) for k, _, y in ROWS]), (), "number of the sample"),
        "the output for u": (text([(k, 2 * y + 1, y) for k, _, y in ROWS]), (), "u is a copy of y"),
        "two runs": (text(ROWS + ROWS), (), "at row 122, from 119 to 0: the file holds 2 runs"),
        "no such run": (text(ROWS + ROWS), ("--run", 3), "run must be at most 2"),
        "a word": (text(ROWS).replace("\n50,47", "\n50,open"), (), "row 52, column "),
        "an unclipped output": (text(unclipped()), ("--model", "sopdt"), "did not reach the plant"),
    }.values(),
)
def test_impossible_logs_are_refused_with_the_remedy(tmp_path, content, options, message):
    path = tmp_path / "log.csv"
    path.write_text(content, encoding="utf-8")
    done = run("tune", path, *QUICK, *options)
    assert (done.exit_code, message in done.stderr) == (1, True), done.output


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
            text(ROWS, "Sample Time   Command  Encoder 1 Pos", "{}  {}  {};").replace("\n0 ", "\n[ 0 ") + "]",
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
    done = run("tune", path, *QUICK, "--ms-worst", 4, *options)
    assert (done.exit_code, "Safe?" in done.stdout) == (0, True), done.output


def test_model_without_prediction_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("pidalab.plant.fitting.Fit.holdout", -0.09)
    path = tmp_path / "log.csv"
    path.write_text(text(ROWS), encoding="utf-8")
    for command in (("tune", path, "--sample-time", 1), ("check", path, "--kp", 1, "--ti", 10)):
        done = run(*command, "--model", "fopdt")
        assert (done.exit_code, "the hold-out data" in done.stderr) == (1, True), done.output


@pytest.mark.parametrize(("low", "high"), [(-1.0, 1.0), (-0.7, 1.3)])
def test_relay_record_is_measured_right_with_its_bias(low, high):
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
