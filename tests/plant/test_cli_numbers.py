"""The command line: options reach the library, defaults are promises, numbers printed are those of the library."""

import inspect
import re
from types import SimpleNamespace
from typing import ClassVar

import click
import numpy as np
import pytest
from click.testing import CliRunner

import pidalab
from pidalab.plant import vendor
from pidalab.plant.cli import main, recorded
from pidalab.plant.cli.dialogue import csv_of
from pidalab.plant.cli.recorded import _no_limits
from pidalab.plant.heater import Lab
from pidalab.plant.reporting import REPORT_COLUMNS
from pidalab.rules.registry import RULES

DEFAULTS = {  # scripts of users rest on them
    "tune": {
        "kind": "PIDA",
        "rule": "optimal",
        "time": "0",
        "u": "1",
        "y": "2",
        "skip": 0,
        "model": "auto",
        "deadband": 0,
    },
    "report": {"rule": "optimal", "time": "0", "u": "1", "y": "2", "skip": 0, "model": "auto"},
    "check": {
        "kd": 0,
        "full_output": 1,
        "lag": 0,
        "td": 0,
        "ta": 0,
        "time": "0",
        "u": "1",
        "y": "2",
        "skip": 0,
    },
    "compare": {"num": "1", "delay": 0},
    "simulate": {"num": "1", "delay": 0, "td": 0, "ta": 0, "setpoint": 1, "load": 0},
    "tclab": {"power": 50, "setpoint": 40, "load": 60, "duration": 900, "cooling": 1200, "sample_time": 1},
    "benchmark": {"model": "process", "workers": 2},
}
LIBRARY = {  # defaults of the same name in the library
    "tune": (pidalab.tune, ("ms", "ms_worst")),
    "report": (pidalab.report, ("ms", "ms_worst")),
    "compare": (pidalab.compare, ("ms",)),
    "tclab": (pidalab.report, ("ms",)),
    "simulate": (pidalab.PIDA, ("n", "m")),
    "check": (pidalab.PIDA, ("n", "m")),
}


def run(*arguments):
    return CliRunner().invoke(main, [str(one) for one in arguments])


def numbers(text):
    return [float(x) for x in re.findall(r"(?<![\w.])-?\d+\.?\d*(?:e[+-]?\d+)?", text)]


@pytest.mark.parametrize("command", DEFAULTS)
def test_defaults_are_as_promised_and_those_of_the_library(command):
    found = {param.name: param.default for param in main.commands[command].params}
    assert {name: found[name] for name in DEFAULTS[command]} == DEFAULTS[command]
    function, names = LIBRARY.get(command, (pidalab.benchmark, ()))
    own = inspect.signature(function).parameters
    assert {name: found[name] for name in names} == {name: own[name].default for name in names}
    flags = [param for param in main.commands[command].params if getattr(param, "is_flag", False)]
    assert not any(param.default is True for param in flags)


def test_every_command_is_there_and_has_help_on_one_page():
    assert sorted(main.commands) == sorted([*DEFAULTS, "rule", "rules"])
    for command in main.commands:
        for flag in ("-h", "--help"):
            text = run(command, flag).stdout
            assert text.startswith(f"Usage: main {command}")
            assert max(map(len, text.splitlines())) <= 110
        assert command == "rules" or "[default:" in text
    assert re.fullmatch(r"main, version \S+\n", run("--version").stdout)


def test_the_list_of_rules_has_each_with_its_kinds_and_source_in_columns():
    lines = run("rules").stdout.splitlines()
    assert len(lines) == len(RULES)
    for line, rule in zip(lines, RULES.values(), strict=True):
        assert re.fullmatch(
            rf"{re.escape(rule.name)} +{', '.join(rule.kinds)} +{re.escape(rule.source)}", line
        )
    assert (
        len(
            {
                line.index(rule.kinds[0], len(rule.name))
                for line, rule in zip(lines, RULES.values(), strict=True)
            }
        )
        == 1
    )


GAINS = {"kp": 1.5, "ti": 3.0, "td": 1.0, "ta": 0.4, "n": 8.0, "m": 6.0}
PLANT = ("--num", "2", "--den", "1, 3 3,1", "--delay", 0.7)
PROCESS = pidalab.Process([2.0], [1.0, 3.0, 3.0, 1.0], 0.7)
OPTIONS = [
    text for name, value in GAINS.items() for text in (f"--{name}", value / 2 if name == "kp" else value)
]
OWN = pidalab.PIDA(**GAINS | {"kp": 0.75})


@pytest.mark.parametrize("digital", [False, True])
def test_simulate_takes_each_option_and_prints_each_measure(tmp_path, digital):
    out = tmp_path / "new" / "r.csv"
    steps = ("--setpoint", 2, "--load", -0.5, "--until", 40)
    more = ("--sample-time", 0.25, "--u-min", -0.2, "--u-max", 1.8) if digital else ()
    result = run("simulate", *PLANT, *OPTIONS, *steps, *more, "--out", out)
    assert result.exit_code == 0, result.output
    head, *rows = out.read_text(encoding="utf-8").splitlines()
    assert head == "t,r,y,u"
    t, r, y, u = np.array([numbers(row) for row in rows]).T
    if digital:
        loop = pidalab.Loop(PROCESS, OWN.discretise(0.25))
        expected = pidalab.simulate_sampled(
            loop, 0.25 * np.arange(161), setpoint=2.0, load=-0.5, limits=(-0.2, 1.8)
        )
        assert (u.min() >= -0.2, u.max()) == (True, 1.8)
    else:
        loop = pidalab.Loop(PROCESS, OWN)
        expected = pidalab.simulate(loop, np.linspace(0.0, 40.0, 2001), setpoint=2.0, load=-0.5)
    for found, name in ((t, "t"), (r, "r"), (y, "y"), (u, "u")):
        np.testing.assert_allclose(found, getattr(expected, name), rtol=1e-8, atol=1e-8)
    said = numbers(result.stdout.split("Measures")[1].split("written")[0])
    by_hand = [
        *(getattr(expected, name)(40.0) for name in ("iae", "itae", "ise")),
        *(40.0, expected.tv("u", 40.0), np.max(np.abs(expected.u)), np.max(np.abs(expected.y))),
        *(expected.y[-1], expected.u[-1], expected.overshoot(), 2, expected.settling_time(0.02)),
    ]
    assert said == pytest.approx(by_hand, rel=2e-3, abs=1e-6)
    assert str(pidalab.margins(loop)).splitlines()[0] in result.stdout
    assert repr(loop).splitlines()[0] in result.stdout
    assert f"written: {out}" in result.stdout


def test_a_response_may_be_shorter_than_a_unit_or_a_sample_and_end_before_it_settles(tmp_path):
    out = tmp_path / "r.csv"
    early = run("simulate", *PLANT, *OPTIONS, "--until", 0.9, "--out", out)
    assert early.exit_code == 0, early.output
    assert "no overshoot" in early.stdout
    assert "not settled to 2 %" in early.stdout
    assert float(out.read_text(encoding="utf-8").splitlines()[-1].split(",")[0]) == 0.9
    two = run("simulate", *PLANT, "--kp", 0.5, "--until", 0.1, "--sample-time", 1, "--out", out, "--force")
    assert two.exit_code == 0, two.output
    assert len(out.read_text(encoding="utf-8").splitlines()) == 1 + 2
    still = run("simulate", *PLANT, *OPTIONS, "--until", 9, "--setpoint", 0, "--load", 1)
    assert "overshoot" not in still.stdout
    for wrong in (0, -1):
        refused = run("simulate", *PLANT, *OPTIONS, "--until", wrong)
        assert (refused.exit_code, "--until must be above 0" in refused.stderr) == (1, True)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (("--kp", 1, "--controller"), "--controller"),
        (("--sample-time", 1, "--controller"), "--controller"),
        ((), "--kp"),
        (("--kp", 1, "--u-min", 0), "--u-min"),
        (("--kp", 1, "--u-max", 1), "--u-max"),
        (("--kp", 1, "--delay", "x"), "--delay"),
        (("--kp", 1, "--num", "1;2"), "--num"),
    ],
    ids=str,
)
def test_simulate_says_which_options_do_not_go_together(tmp_path, options, named):
    file = tmp_path / "controller.json"
    file.write_text(OWN.discretise(0.5).json(), encoding="utf-8")
    options = (*options, file) if "--controller" in options else options
    result = run("simulate", "--den", "1,1", "--until", 9, *options)
    assert (result.exit_code, named in result.stderr) == (2, True)
    assert run("simulate", "--den", "1,1", "--until", 9, "--controller", file).exit_code == 0


def test_columns_of_a_file_keep_ten_digits():
    assert csv_of({"a": [1 / 3, 2e10], "b b": [0.0, -1.0]}) == "a,b b\n0.3333333333,0\n2e+10,-1\n"


@pytest.mark.parametrize(
    ("low", "high", "named"),
    [
        (0, 1, []),
        (-np.inf, 1, ["--u-min"]),
        (0, np.inf, ["--u-max"]),
        (-np.inf, np.inf, ["--u-min", "--u-max"]),
    ],
)
def test_limits_that_are_missing_are_named_and_no_others(low, high, named):
    found = _no_limits(low, high)
    assert re.findall(r"--u-m\w+", "".join(found)) == named
    assert len(found) == bool(named)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A clean record of one lag, with columns in another order and times of its own."""
    path = tmp_path_factory.mktemp("log") / "log.csv"
    t = np.arange(80.0)
    y = 20 + 10 * -np.expm1(-np.maximum(t - 13, 0) / 6) + np.random.default_rng(0).normal(0, 0.02, t.size)
    table = np.column_stack([y, np.where(t < 10, 40, 45), t])
    np.savetxt(path, table, delimiter=",", header="y,u,t", comments="")
    return path


READ = ("--time", "t", "--u", 1, "--y", "y")
RULE = ("--rule", "simc", "--ms-worst", 3, "--spread", 0.1, "--noise-gain", 5, "--sample-time", 2)
ASKED = {"rule": "simc", "ms_worst": 3.0, "spread": 0.1, "noise_gain": 5.0, "sample_time": 2.0}


@pytest.fixture(scope="module")
def reported(log):
    record = pidalab.Record.read_csv(log, time="t", u="u", y="y")
    return pidalab.report(pidalab.identification.fit(record, "fopdt"), kinds=("PI", "PID"), ms=1.5, **ASKED)


def test_what_tune_prints_is_what_the_library_says(log, reported):
    result = run(
        "tune", log, *READ, *RULE, "--model", "fopdt", "--ms", 1.5, "--kind", "PI", "--u-min", 0, "--b", 0.7
    )
    assert result.exit_code == 0, result.output
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
        assert " ".join(text.split()) in " ".join(result.stdout.split())
    for name, x in REPORT_COLUMNS.items():
        (said,) = re.findall(rf"^  {re.escape(name)}: (\S+)", result.stdout, re.MULTILINE)
        assert float(said) == pytest.approx(getattr(row, x), rel=1e-3, nan_ok=True)
    assert "--u-max not given" in result.stdout
    assert "--u-min" not in result.stdout
    assert "Sections" not in result.stdout
    assert "klipper" not in result.stdout


def test_what_report_prints_and_writes_is_what_the_library_says(log, reported, tmp_path, monkeypatch):
    monkeypatch.setattr("pidalab.plant.noise_curves.trade_off", lambda *_: pytest.fail("not asked for"))
    out = tmp_path / "new" / "page.html"
    result = run("report", log, *READ, *RULE, "--model", "fopdt", "--ms", 1.5, "--out", out)
    assert result.exit_code == 0, result.output
    for name, x in REPORT_COLUMNS.items():
        (line,) = re.findall(rf"^  {re.escape(name)} +([\d.].*)$", result.stdout, re.MULTILINE)
        assert numbers(line) == pytest.approx([getattr(row, x) for row in reported.rows], rel=1e-3)
    assert " ".join(str(reported.fit).split()) in " ".join(result.stdout.split())
    assert reported.verdict in result.stdout.replace("\n  ", "\n")
    assert "log.csv" in out.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "options",
    [
        (),
        ("--ti", 5, "--ki", 1),
        ("--ti", 5, "--kd", 1),
        ("--ki", 1),
        ("--firmware", "klipper"),
        ("--firmware", "klipper", "--ti", 5),
        ("--firmware", "klipper", "--ki", 1, "--ti", 5),
        ("--firmware", "klipper", "--ki", 1, "--td", 5),
        ("--firmware", "klipper", "--ki", 1, "--ta", 5),
    ],
    ids=str,
)
def test_gains_are_times_or_numbers_of_a_firmware_and_no_mixture(log, options):
    result = run("check", log, *READ, "--kp", 1, *options)
    assert (result.exit_code, "--firmware with --kp, --ki" in result.output) == (2, True)


def test_gains_that_run_are_those_that_are_given():
    times = {"td": 0.5, "ta": 0.1, "n": 7.0, "m": 6.0}
    own = recorded._running(None, 1.0, {"kp": 2.0, "ti": 5.0, "ki": None, "kd": 0.0, **times})
    assert own == pidalab.PIDA(2.0, 5.0, **times)
    none = dict.fromkeys(times, 0.0)
    numbers = {"kp": 22.2, "ti": None, "ki": 1.08, "kd": 114.0}
    klipper = recorded._running("klipper", 100.0, numbers | none)
    assert klipper == pidalab.PIDA.from_firmware("klipper", 22.2, 1.08, 114.0, 100.0)


def test_sets_to_try_are_numbers_of_the_firmware_where_it_has_them():
    designs = [pidalab.PIDA(2.0, 8.0, 1.0), pidalab.PIDA(2.0, 8.0, 1.0, 0.2), None]
    rows = [
        SimpleNamespace(rule=rule, design=one and pidalab.rules.Design(PROCESS, one))
        for rule, one in zip(("now", "PIDA", "refused"), designs, strict=True)
    ]
    (line,) = recorded._as_firmware(SimpleNamespace(rows=rows), "klipper", 100.0).splitlines()
    assert line.startswith("now ")
    form = vendor.firmware_form(designs[0].gains(), "klipper", 100.0)
    assert numbers(line) == pytest.approx(list(form.values()), rel=1e-3)


class Watched(Lab):
    """A simulated board that says it is one on the desk."""

    calls: ClassVar[list] = []

    def __init__(self, connected=False, seed=0):
        super().__init__(False, seed)
        self.calls.append(("connected", connected))

    def hold(self, power=0.0, duration=1200.0):
        self.calls.append(("hold", power, duration))

    def step_test(self, power, duration, sample_time):
        self.calls.append(("step", power, duration, sample_time))
        return super().step_test(power, duration, sample_time=sample_time)


@pytest.mark.parametrize("connected", [False, True])
def test_tclab_goes_as_it_is_told_and_its_table_is_what_its_files_say(tmp_path, monkeypatch, connected):
    plain = pidalab.plant.reporting.report

    def quick(record, ms, sample_time):
        fitted = pidalab.identification.fit(record, "fopdt")
        asked = {"rule": "simc", "kinds": ("PI", "PIDA"), "spread": 0.1, "ms_worst": 9.0}
        return plain(fitted, ms=ms, sample_time=sample_time, **asked)

    monkeypatch.setattr("pidalab.plant.reporting.report", quick)
    monkeypatch.setattr("pidalab.plant.heater.Lab", Watched)
    Watched.calls = []
    told = (
        "--power",
        45,
        "--setpoint",
        35,
        "--load",
        30,
        "--duration",
        400,
        "--sample-time",
        2,
        "--cooling",
        70,
    )
    result = run("tclab", *told, "--out", tmp_path, *["--connected"][: int(connected)])
    assert result.exit_code == 0, result.output
    cooled = [("hold", 0.0, 70.0)] * connected
    assert Watched.calls == [
        ("connected", connected),
        ("step", 45.0, 400.0, 2.0),
        ("connected", connected),
        *cooled,
    ]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["PI.csv", "report.html"]  # simc makes no PIDA
    t, r, load, y, u = np.loadtxt(tmp_path / "PI.csv", delimiter=",", skiprows=1).T
    np.testing.assert_array_equal(t, np.arange(0.0, 802.0, 2.0))
    assert set(r) == {35.0}
    np.testing.assert_array_equal(load, np.where(t < 400.0, 0.0, 30.0))
    assert (u.min() >= 0.0, u.max() <= 100.0) == (True, True)
    where = "at the board" if connected else "simulated"
    table = result.stdout.split(f"{where}, after heater 2 went to 30 %\n")[1].split("written")[0]
    (line,) = re.findall(r"^  PI +(.*)$", table, re.MULTILINE)
    after = t >= 400.0
    error = np.abs(np.interp(np.arange(400.0, 800.0, 0.01), t, r - y))
    by_hand = [np.sum(error) * 0.01, np.sum(np.abs(np.diff(u[after])))]
    assert numbers(line) == pytest.approx(by_hand, rel=0.01)


@pytest.mark.parametrize(
    ("command", "option", "allowed", "refused"),
    [
        ("tune", "b", (0, 0.3, 1), (-0.01, 1.01)),
        ("tune", "c", (0, 0.3, 1), (-0.01, 1.01)),
        ("tune", "rate_limit", (1e-6, 0.5, 1e6), (0, -0.5)),
        ("tune", "deadband", (0, 1e-6, 0.5), (-1e-6,)),
        ("tclab", "power", (0, 0.5, 99.5, 100), (-0.01, 100.01)),
        ("tclab", "load", (0, 0.5, 99.5, 100), (-0.01, 100.01)),
    ],
)
def test_ranges_of_options_end_where_they_say(command, option, allowed, refused):
    (param,) = (one for one in main.commands[command].params if one.name == option)
    for value in allowed:
        assert param.type.convert(value, param, None) == value
    for value in refused:
        with pytest.raises(click.BadParameter):
            param.type.convert(value, param, None)
