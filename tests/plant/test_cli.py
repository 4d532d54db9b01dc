"""Run the command line: a record becomes code, and options and printed numbers are those of the library."""

import importlib.util
import inspect
import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner
from test_total import compiler

import pidalab
from pidalab.digital import from_json
from pidalab.plant.cli import main
from pidalab.plant.reporting import REPORT_COLUMNS
from pidalab.rules.registry import RULES

ROOT = Path(__file__).parents[2]
SPEC = importlib.util.spec_from_file_location("records", ROOT / "studies" / "records.py")
records = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(records)
CODE = ["controller.c", "controller.json", "controller.py", "controller.st", "report.html"]


def run(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def succeed(*arguments):
    result = run(*arguments)
    assert result.exit_code == 0, result.output
    return result.stdout


def numbers(text):
    return [float(x) for x in re.findall(r"(?<![\w.])-?\d+\.?\d*(?:e[+-]?\d+)?", text)]


def read(path):
    return path.read_text(encoding="utf-8")


def controller_in(folder):
    return from_json(read(folder / "controller.json"))


def save(path, header, *columns):
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="")
    return path


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    """Return a historian's file of a plant with three lags that is not in the book."""
    path = tmp_path_factory.mktemp("plant") / "step.csv"
    path.write_text(records.plant_record(seed=8), encoding="utf-8")
    return path


def first_order(count):
    """Return a file with the step response of a lag, with times in seconds."""
    t = np.arange(float(count))
    y = 20 + 10 * -np.expm1(-np.maximum(t - 13, 0) / 6) + np.random.default_rng(0).normal(0, 0.02, t.size)
    return t, np.where(t < 10, 40, 45), y


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return save(tmp_path_factory.mktemp("plain") / "step *µ.csv", "t,u,y", *first_order(60))


QUICK = ("--kind", "PI", "--rule", "simc", "--model", "fopdt", "--ms-worst", 3, "--sample-time", 1)


def test_book_record_matches_its_script():
    assert read(records.DATA / "plant_record.csv") == records.plant_record()


def test_record_becomes_code_that_is_safe_on_the_true_plant(record, tmp_path):
    columns = ("--time", "time", "--u", "valve", "--y", "temperature")
    limits = ("--u-min", 0, "--u-max", 100)
    options = ("--kind", "PIDA", "--ms", 1.6, "--sample-time", 0.2, *limits)
    printed = succeed("tune", record, *columns, *options, "--out", tmp_path)
    for text in ("Safe?", "Gains", "Before the start", "Margins, sampled every 0.2", "Model", "Record"):
        assert text in printed
    assert "no vendor block for: ideal, series, parallel (these blocks have no acceleration" in printed
    assert "noise gain at most" in printed
    worst, sampled = (float(re.search(rf"{name}: (\S+)", printed)[1]) for name in ("worst Ms", "Ms sampled"))
    loop = pidalab.Loop(records.PLANT, controller_in(tmp_path))
    assert pidalab.margins(loop).ms <= worst <= 2.0
    assert sampled == pytest.approx(1.6, abs=0.01)
    heads = [read(tmp_path / file).count("Doubt ") for file in CODE[:4]]
    assert len(set(heads)) == 1
    compiler()
    program = tmp_path / "test"
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-DPIDA_SELFTEST"]
    subprocess.run(["gcc", *flags, "-o", program, tmp_path / "controller.c", "-lm"], check=True)
    subprocess.run([program], check=True)
    compile(read(tmp_path / "controller.py"), "controller.py", "exec")
    assert "FUNCTION_BLOCK" in read(tmp_path / "controller.st")
    page = read(tmp_path / "report.html")
    assert (page.count("<svg"), "<script" in page, "src=" in page) == (1, False, False)
    plant = ("--num", "2.3", "--den", "360,198,29,1", "--delay", 8)
    loop = succeed("simulate", *plant, "--controller", tmp_path / "controller.json", "--until", 300)
    assert numbers(loop.split("output at the end")[1])[0] == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(
    ("stamps", "unit", "date"),
    [
        (["2026-03-05 11:{:02}:00"], "s", "2026-03-05 11:00"),
        (["t (s)", "{}"], "s", ""),
        (["t [min]", "{}"], "min", ""),
        (["t", "{}"], "", ""),
    ],
    ids=["dates", "seconds", "minutes", "unknown"],
)
def test_head_of_code_has_unit_and_date_of_the_record(tmp_path, stamps, unit, date):
    t, u, y = first_order(60)
    *title, form = stamps
    rows = [f"{form.format(int(k))},{a},{b}" for k, a, b in zip(t, u, y, strict=True)]
    (tmp_path / "step.csv").write_text("\n".join([f"{(title or ['t'])[0]},u,y", *rows]), encoding="utf-8")
    step = pidalab.Record.read_csv(tmp_path / "step.csv")
    assert (step.time_unit, step.date) == (unit, date)
    printed = succeed("tune", tmp_path / "step.csv", *QUICK[:-1], step.sampling, "--out", tmp_path)
    head = read(tmp_path / "controller.c")[:2000]
    assert f"Sample time: {step.sampling!r}{f' {unit}' if unit else ', in the same time unit as the'}" in head
    assert ("recorded 2026-03-05" in head) is bool(date)
    assert ("if the record's unit of time is the second" in printed) is not bool(unit)


def test_report_compares_candidates(record, tmp_path):
    page = tmp_path / "report.html"
    options = ("--rule", "simc", "--ms-worst", 2.2, "--sample-time", 0.2)
    printed = succeed("report", record, *options, "--out", page)
    assert "PID against PI" in printed
    assert "for the rule 'simc'" in printed
    assert "PI, PID and PIDA for step.csv" in read(page)


def test_compare_and_benchmark_pass_their_options_on(monkeypatch, tmp_path):
    asked = []

    def compared(process, **options):
        asked.append((process.num.tolist(), process.den.tolist(), process.delay, options))
        return "a table"

    def ranked(rule, name, model, plants, executor):
        asked.append((rule(3), name, model, plants))
        raise ValueError("stop")

    monkeypatch.setattr("pidalab.compare", compared)
    monkeypatch.setattr("pidalab.benchmark", ranked)
    plant = ("compare", "--num", "2", "--den", "1,3,3,1", "--delay", 1)
    assert succeed(*plant, "--rule", "simc", "--rule", "optimal", "--ms", 1.4) == "a table\n"
    succeed(*plant, "--noise-gain", 3, "--sample-time", 0.1)
    (tmp_path / "rule.py").write_text("def tune(process): return 2 * process\n", encoding="utf-8")
    command = ("benchmark", f"{tmp_path / 'rule.py'}:tune")
    assert run(*command, "--model", "first_order", "--plant", "P2 T=1", "--plant", "P4 n=4").exit_code == 1
    assert run(*command, "--name", "mine").exit_code == 1
    limits = {"ms": 1.6, "noise_gain": None, "sample_time": None, "rules": None}
    assert asked == [
        ([2.0], [1.0, 3.0, 3.0, 1.0], 1.0, limits | {"ms": 1.4, "rules": ("simc", "optimal")}),
        ([2.0], [1.0, 3.0, 3.0, 1.0], 1.0, limits | {"noise_gain": 3.0, "sample_time": 0.1}),
        (6, "tune", "first_order", ("P2 T=1", "P4 n=4")),
        (6, "mine", "process", None),
    ]


@pytest.fixture(scope="module")
def closed_loop(tmp_path_factory):
    running = pidalab.PIDA(kp=0.6, ti=12.0)
    loop = pidalab.Loop(pidalab.fopdt(2.0, 12.0, 4.0), running.discretise(1.0))
    t = np.arange(150.0)
    noise = np.random.default_rng(0).normal(0.0, 0.02, t.size)
    run = pidalab.simulate_sampled(loop, t, setpoint=np.where(t < 20, 0.0, 1.0), noise=noise)
    return save(tmp_path_factory.mktemp("loop") / "log.csv", "t,u,y", t, run.u, run.y + noise)


def test_check_judges_the_gains_of_a_log(closed_loop):
    options = ("--kp", 0.6, "--ti", 12, "--sample-time", 1, "--filter", 0.5, "--model", "fopdt")
    printed = succeed("check", closed_loop, *options)
    low, high = map(float, re.search(r"these gains: Ms \S+; (\S+) to (\S+) with", printed).groups())
    running = pidalab.PIDA(kp=0.6, ti=12.0)
    filtered = pidalab.Loop(pidalab.fopdt(2.0, 12.0, 4.0), running, pidalab.fopdt(1.0, 0.5, 0.0))
    assert low <= pidalab.max_sensitivity(filtered)[0] + 0.1 <= high + 0.1
    for name in ("now", "best like it", "calmer", "same noise", "faster"):
        assert re.search(rf"^  {name} ", printed, flags=re.MULTILINE)


def test_code_states_doubts_about_limits_filter_and_sample_time(record, tmp_path):
    options = ("--kind", "PID", "--rule", "magnitude optimum", "--model", "sopdt", "--ms-worst", 9)
    succeed("tune", record, *options, "--sample-time", 20, "--out", tmp_path)
    for name in CODE[:4]:
        head = read(tmp_path / name)[:3000]
        for text in ("--u-min and --u-max not given", "is long for this loop", "sample time of 20"):
            assert text in head, (name, text)


def test_options_of_reading(tmp_path):
    """Options exist for blanks, missing times, a line above, a step before the first row, and an outlier."""
    t = np.arange(150.0)
    y = np.round(20 + 2 * -np.expm1(-np.maximum(t - 5, 0) / 12) + 0.02 * np.sin(1.7 * t**2), 2)
    y[90] = -9999
    path = tmp_path / "log.txt"
    path.write_text("measured in May, by hand\n" + "\n".join(f"{row}  1.0" for row in y), encoding="utf-8")
    options = ("--u", 1, "--y", 0, "--period", 1, "--skip", 1, "--delimiter", r"\s+", "--sample-time", 1)
    command = ("tune", path, *options, "--kind", "PI", "--rule", "simc", "--model", "fopdt")
    assert "--u-before" in run(*command).stderr
    assert "row 92 (y = -9999)" in run(*command, "--u-before", 0).stderr
    printed = succeed(*command, "--u-before", 0, "--outliers", "drop")
    assert "step from 0 to 1 at 0" in printed
    assert "left out: far from its neighbours: row 92" in printed


def test_options_of_the_code_reach_it(plain, tmp_path):
    succeed("tune", plain, *QUICK, "--out", tmp_path / "usual")
    usual = controller_in(tmp_path / "usual")
    assert (usual.weights, usual.rate_limit, usual.deadband) == ((0.5, 0.0), np.inf, 0.0)
    assert (usual.bias, usual.limits, usual.anti_windup) == (40.0, (-np.inf, np.inf), "reset")
    assert usual.y_offset == pytest.approx(20.0, abs=0.02)
    options = ("--b", 0.75, "--c", 0.25, "--rate-limit", 2, "--deadband", 0.1, "--anti-windup", "clamping")
    options = (*options, "--u-min", 1, "--u-max", 99, "--feedforward", "--tunable", "--float")
    succeed("tune", plain, *QUICK, *options, "--out", tmp_path / "own")
    own = controller_in(tmp_path / "own")
    assert (own.weights, own.rate_limit, own.deadband, own.limits) == ((0.75, 0.25), 2.0, 0.1, (1.0, 99.0))
    assert (own.anti_windup, own.feedforward, own.tunable) == ("clamping", True, True)
    assert "feedforward" in read(tmp_path / "own" / "controller.c")
    for folder, kind in (("usual", "double"), ("own", "float")):
        assert f"_REAL {kind}\n" in read(tmp_path / folder / "controller.c")
    succeed("tune", plain, *QUICK, "--anti-windup", "none", "--out", tmp_path / "none")
    assert controller_in(tmp_path / "none").anti_windup is None


def test_output_files_are_replaced_only_on_request(plain, tmp_path, monkeypatch):
    ranking = SimpleNamespace(
        csv=lambda: "rows",
        latex=lambda: "table",
        plot=lambda: pidalab.report(pidalab.lags(3), kinds="PI", rule="simc").plot(),
    )
    monkeypatch.setattr("pidalab.benchmark", lambda *_: ranking)
    (tmp_path / "rule.py").write_text("def tune(process): return None\n", encoding="utf-8")
    report = ("report", plain, "--rule", "simc", "--model", "fopdt", "--ms-worst", 3, "--sample-time", 1)
    for out, name, command in (
        (".", "controller.c", ("tune", plain, *QUICK)),
        ("r.csv", "r.csv", ("simulate", "--den", "1,1", "--kp", 1, "--ti", 1, "--until", 9)),
        ("r.html", "r.html", report),
        (".", "benchmark.tex", ("benchmark", f"{tmp_path / 'rule.py'}:tune")),
    ):
        (tmp_path / name).write_text("mine", encoding="utf-8")
        assert name in run(*command, "--out", tmp_path / out).stderr
        assert read(tmp_path / name) == "mine"
        succeed(*command, "--out", tmp_path / out, "--force")
        assert read(tmp_path / name) != "mine"
    assert {"benchmark.csv", "benchmark.svg"} <= {path.name for path in tmp_path.iterdir()}


def test_console_without_some_characters(tmp_path):
    """On Windows a pipe has code page 1252, without Greek and most mathematical signs."""
    own = {"PYTHONPATH": str(ROOT / "src"), "PYTHONIOENCODING": "cp1252", "PATH": "/usr/bin:/bin"}
    command = [sys.executable, "-m", "pidalab"]
    path = tmp_path / "Ω≤.csv"
    try:
        os.fsencode(path)
    except UnicodeEncodeError:
        pytest.skip("files here can have no names with such characters")
    response = ("simulate", "--den", "1,1", "--kp", "1", "--ti", "1", "--until", "9", "--out", str(path))
    done = subprocess.run([*command, *response], capture_output=True, env=own, check=True, cwd=ROOT)
    assert done.stdout.decode("cp1252").splitlines()[-1].endswith("??.csv")
    assert path.exists()
    helped = subprocess.run([*command, "--help"], capture_output=True, env=own, check=True, cwd=ROOT)
    assert b"Usage: pidalab [OPTIONS]" in helped.stdout


LIBRARY = {  # defaults of the same name in the library
    "tune": (pidalab.tune, ("ms", "ms_worst", "kind", "rule")),
    "report": (pidalab.report, ("ms", "ms_worst", "rule")),
    "compare": (pidalab.compare, ("ms",)),
    "simulate": (pidalab.PIDA, ("n", "m", "td", "ta")),
    "check": (pidalab.PIDA, ("n", "m", "td", "ta")),
    "benchmark": (pidalab.benchmark, ("model",)),
}


@pytest.mark.parametrize("command", LIBRARY)
def test_defaults_are_those_of_the_library(command):
    defaults = {param.name: param.default for param in main.commands[command].params}
    function, names = LIBRARY[command]
    own = inspect.signature(function).parameters
    assert {name: defaults[name] for name in names} == {name: own[name].default for name in names}


def test_every_command_has_help_with_an_example():
    assert sorted(main.commands) == sorted([*LIBRARY, "rule", "rules"])
    for command in main.commands:
        for flag in ("-h", "--help"):
            text = run(command, flag).stdout
            assert text.startswith(f"Usage: main {command}")
            assert max(map(len, text.splitlines())) <= 110
        assert command == "rules" or "[default:" in text
        assert command in ("rules", "benchmark") or re.search(rf"Examples?:\n\s+pidalab {command}\b", text)
    assert re.fullmatch(r"main, version \S+\n", run("--version").stdout)
    for line, rule in zip(run("rules").stdout.splitlines(), RULES.values(), strict=True):
        assert re.fullmatch(
            rf"{re.escape(rule.name)} +{', '.join(rule.kinds)} +{re.escape(rule.source)}", line
        )


GAINS = {"kp": 0.75, "ti": 3.0, "td": 1.0, "ta": 0.4, "n": 8.0, "m": 6.0}
PLANT = ("--num", "2", "--den", "1, 3 3,1", "--delay", 0.7)
PROCESS, OWN = pidalab.Process([2.0], [1.0, 3.0, 3.0, 1.0], 0.7), pidalab.PIDA(**GAINS)
OPTIONS = [text for name, value in GAINS.items() for text in (f"--{name}", value)]


@pytest.mark.parametrize("digital", [False, True])
def test_simulate_takes_each_option_and_prints_each_measure(tmp_path, digital):
    out = tmp_path / "new" / "r.csv"
    steps = ("--setpoint", 2, "--load", -0.5, "--until", 40)
    more = ("--sample-time", 0.25, "--u-min", -0.2, "--u-max", 1.8) if digital else ()
    printed = succeed("simulate", *PLANT, *OPTIONS, *steps, *more, "--out", out)
    head, *rows = read(out).splitlines()
    signals = dict(zip(head.split(","), np.array([numbers(row) for row in rows]).T, strict=True))
    if digital:
        loop, t = pidalab.Loop(PROCESS, OWN.discretise(0.25)), 0.25 * np.arange(161)
        expected = pidalab.simulate_sampled(loop, t, setpoint=2.0, load=-0.5, limits=(-0.2, 1.8))
        assert (signals["u"].min() >= -0.2, signals["u"].max()) == (True, 1.8)
    else:
        loop = pidalab.Loop(PROCESS, OWN)
        expected = pidalab.simulate(loop, np.linspace(0.0, 40.0, 2001), setpoint=2.0, load=-0.5)
    assert [*signals] == ["t", "r", "y", "u"]
    for name, values in signals.items():
        np.testing.assert_allclose(values, getattr(expected, name), rtol=1e-8, atol=1e-8)
    by_hand = [
        *(getattr(expected, name)(40.0) for name in ("iae", "itae", "ise")),
        *(40.0, expected.tv("u", 40.0), np.max(np.abs(expected.u)), np.max(np.abs(expected.y))),
        *(expected.y[-1], expected.u[-1], expected.overshoot(), 2, expected.settling_time(0.02)),
    ]
    measures = numbers(printed.split("Measures")[1].split("written")[0])
    assert measures == pytest.approx(by_hand, rel=2e-3, abs=1e-6)
    for text in (str(pidalab.margins(loop)).splitlines()[0], repr(loop).splitlines()[0], f"written: {out}"):
        assert text in printed


def test_short_responses(tmp_path):
    out = tmp_path / "r.csv"
    early = succeed("simulate", *PLANT, *OPTIONS, "--until", 0.9, "--out", out)
    assert "no overshoot" in early
    assert "not settled to 2 %" in early
    assert float(read(out).splitlines()[-1].split(",")[0]) == 0.9
    succeed("simulate", *PLANT, "--kp", 0.5, "--until", 0.1, "--sample-time", 1, "--out", out, "--force")
    assert len(read(out).splitlines()) == 1 + 2
    assert "overshoot" not in succeed(
        "simulate", *PLANT, *OPTIONS, "--until", 9, "--setpoint", 0, "--load", 1
    )


READ = ("--time", "t", "--u", 1, "--y", "y")
RULE = ("--rule", "simc", "--ms-worst", 3, "--spread", 0.1, "--noise-gain", 5, "--sample-time", 2)
ASKED = {"rule": "simc", "ms_worst": 3.0, "spread": 0.1, "noise_gain": 5.0, "sample_time": 2.0}


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """Return a record with columns in another order."""
    return save(tmp_path_factory.mktemp("log") / "log.csv", "y,u,t", *first_order(80)[::-1])


@pytest.fixture(scope="module")
def reported(log):
    record = pidalab.Record.read_csv(log, time="t", u="u", y="y")
    return pidalab.report(pidalab.identification.fit(record, "fopdt"), kinds=("PI", "PID"), ms=1.5, **ASKED)


def test_tune_prints_what_the_library_says(log, reported):
    options = ("--model", "fopdt", "--ms", 1.5, "--kind", "PI", "--u-min", 0, "--b", 0.7)
    printed = succeed("tune", log, *READ, *RULE, *options)
    row = reported.rows[0]
    digital = row.design.discretise(2.0, limits=(0.0, np.inf), bias=40.0, b=0.7)
    for text in (
        reported.fit.record.described(),
        repr(reported.process),
        reported.fit.described(),
        str(row.design.controller),
        str(pidalab.margins(row.design.loop())),
        str(pidalab.margins(pidalab.Loop(reported.process, digital))),
        *row.design.doubts,
    ):
        assert " ".join(text.split()) in " ".join(printed.split())
    for name, x in REPORT_COLUMNS.items():
        (value,) = re.findall(rf"^  {re.escape(name)}: (\S+)", printed, re.MULTILINE)
        assert float(value) == pytest.approx(getattr(row, x), rel=1e-3, nan_ok=True)
    assert ("--u-max not given" in printed, "--u-min" in printed) == (True, False)


def test_report_prints_what_the_library_says(log, reported, tmp_path):
    out = tmp_path / "new" / "page.html"
    printed = succeed("report", log, *READ, *RULE, "--model", "fopdt", "--ms", 1.5, "--out", out)
    for name, x in REPORT_COLUMNS.items():
        (line,) = re.findall(rf"^  {re.escape(name)} +([\d.].*)$", printed, re.MULTILINE)
        assert numbers(line) == pytest.approx([getattr(row, x) for row in reported.rows], rel=1e-3)
    assert " ".join(str(reported.fit).split()) in " ".join(printed.split())
    assert reported.verdict in printed.replace("\n  ", "\n")
    assert "log.csv" in read(out)


def test_rules_from_ultimate_gain_and_period(tmp_path):
    printed = succeed("rule", "--ku", 8.502, "--tu", 3.721)
    (line,) = (line for line in printed.splitlines() if re.match("Ziegler-Nichols +PID", line))
    assert [float(x) for x in line.split()[2:5]] == pytest.approx([5.101, 1.8605, 0.4651], rel=1e-3)
    assert float(line.split()[6]) > 2
    t = np.arange(0.0, 60.0, 0.01)
    wave = -0.5 * 4 / np.pi * np.sin(t)
    relay = save(tmp_path / "relay.csv", "t,u,y", t, np.sign(np.sin(t) + 1e-9), wave)
    printed = succeed("rule", relay)
    assert re.search(r"period 6\.28\d*, u at its upper level for 50 % of the time; ultimate gain 2", printed)
