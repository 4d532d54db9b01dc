"""The command line: a record becomes code that compiles; what is wrong is one line and an exit status."""

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from test_total import compiler

import pidalab
from pidalab.digital import from_json
from pidalab.plant.cli import main

ROOT = Path(__file__).parents[2]
SPEC = importlib.util.spec_from_file_location("plant_record", ROOT / "studies" / "plant_record.py")
plant_record = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(plant_record)
TRUE = plant_record.TRUE


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    """A historian's file of a plant with three lags, not the one of the book."""
    path = tmp_path_factory.mktemp("plant") / "step.csv"
    path.write_text(plant_record.text(seed=8), encoding="utf-8")
    return path


def test_the_record_of_the_book_is_what_its_script_writes():
    assert plant_record.FILE.read_text(encoding="utf-8") == plant_record.text()


def run(*arguments):
    return CliRunner().invoke(main, [str(one) for one in arguments])


def test_a_messy_record_becomes_code_whose_loop_with_the_true_plant_is_as_robust_as_was_said(
    record, tmp_path
):
    columns = ("--time", "time", "--u", "valve", "--y", "temperature")
    limits = ("--u-min", 0, "--u-max", 100, "--full-output", 100)
    result = run(
        "tune", record, *columns, "--kind", "PIDA", "--ms", 1.6, "--sample-time", 0.2, *limits, "--out", tmp_path
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    for said in ("Safe?", "Gains", "Before the start", "Margins, sampled every 0.2", "Model", "Record"):
        assert said in result.stdout
    assert "klipper, betaflight (these blocks have no acceleration term" in result.stdout
    worst = float(re.search(r"worst Ms: (\S+)", result.stdout)[1])
    controller = from_json((tmp_path / "controller.json").read_text(encoding="utf-8"))
    assert pidalab.margins(pidalab.Loop(TRUE, controller)).ms <= worst <= 2.0
    assert "Ms sampled: 1.6 " in result.stdout or "Ms sampled: 1.59" in result.stdout
    assert "price: 1" in result.stdout
    doubts = re.findall(r"Doubt (.*)", (tmp_path / "controller.c").read_text(encoding="utf-8"))
    assert "noise gain at most" in result.stdout  # an assumption, and no doubt
    for file in ("controller.st", "controller.py", "controller.json"):
        assert (tmp_path / file).read_text(encoding="utf-8").count("Doubt ") == len(doubts)
    compiler()
    program = tmp_path / "test"
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-DPIDA_SELFTEST"]
    subprocess.run(["gcc", *flags, "-o", program, tmp_path / "controller.c", "-lm"], check=True)
    subprocess.run([program], check=True)
    compile((tmp_path / "controller.py").read_text(encoding="utf-8"), "controller.py", "exec")
    assert "FUNCTION_BLOCK" in (tmp_path / "controller.st").read_text(encoding="utf-8")
    report = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert report.count("<svg") == 1
    assert "<script" not in report
    assert "src=" not in report
    # what was written runs in the next command
    plant = ("--num", "2.3", "--den", "360,198,29,1", "--delay", 8)
    found = run("simulate", *plant, "--controller", tmp_path / "controller.json", "--until", 300)
    assert "Ms = 1." in found.stdout
    assert "output at the end 1" in found.stdout or "output at the end 0.99" in found.stdout


def test_report_sets_candidates_side_by_side(record, tmp_path):
    page = tmp_path / "report.html"
    # a rule knows no Ms, so the limit of the worst one is wider
    result = run("report", record, "--rule", "simc", "--ms-worst", 2.2, "--sample-time", 0.2, "--out", page)
    assert result.exit_code == 0, result.output
    assert "PID against PI" in result.stdout
    assert "for the rule 'simc'" in result.stdout
    assert "PI, PID and PIDA for step.csv" in page.read_text(encoding="utf-8")


def test_simulate_is_the_engine(tmp_path):
    out = tmp_path / "response.csv"
    plant = ("--den", "1,3,3,1", "--delay", 1)
    result = run("simulate", *plant, "--kp", 1.3, "--ti", 3, "--until", 20, "--out", out)
    assert result.exit_code == 0, result.output
    t, _, y, u = np.loadtxt(out, delimiter=",", skiprows=1).T
    loop = pidalab.Loop(pidalab.lags(3, delay=1.0), pidalab.PIDA(1.3, 3.0))
    response = pidalab.step_response(loop, t)
    assert np.allclose([y, u], [response.y, response.u], atol=1e-9)
    assert f"IAE {response.iae():.6g}" in result.stdout
    assert f"Ms = {pidalab.margins(loop).ms:.4g}" in result.stdout
    limited = run(
        "simulate", *plant, "--kp", 1.3, "--ti", 3, "--until", 20, "--sample-time", 0.1, "--u-max", 1.1
    )
    assert "largest |u| 1.1" in limited.stdout


def test_compare_judges_the_rules_that_are_named_and_else_all(monkeypatch):
    asked = []

    def judged(process, **options):
        asked.append((process, options))
        return "a table"

    monkeypatch.setattr("pidalab.comparison.compare", judged)
    plant = ("compare", "--num", "2", "--den", "1,3,3,1", "--delay", 1)
    assert run(*plant, "--rule", "simc", "--rule", "optimal", "--ms", 1.4).stdout == "a table\n"
    assert run(*plant, "--noise-gain", 3, "--sample-time", 0.1).exit_code == 0
    (process, first), (_, second) = asked
    assert (process.num.tolist(), process.den.tolist(), process.delay) == ([2.0], [1.0, 3.0, 3.0, 1.0], 1.0)
    assert first == {"rules": ("simc", "optimal"), "ms": 1.4, "noise_gain": None, "sample_time": None}
    assert second == {"rules": None, "ms": 1.6, "noise_gain": 3.0, "sample_time": 0.1}


def test_benchmark_asks_for_the_plants_that_are_named_and_else_for_all(monkeypatch, tmp_path):
    (tmp_path / "rule.py").write_text("def tune(process): return None\n", encoding="utf-8")
    asked = []

    def judged(rule, name, model, plants, executor):
        asked.append((rule.__name__, name, model, plants))
        raise ValueError("that is all")

    monkeypatch.setattr("pidalab.comparison.benchmarking.benchmark", judged)
    command = ("benchmark", f"{tmp_path / 'rule.py'}:tune", "--model", "first_order")
    assert run(*command, "--plant", "P2 T=1", "--plant", "P4 n=4").exit_code == 1
    assert run(*command, "--name", "mine").exit_code == 1
    first = ("tune", None, "first_order", ("P2 T=1", "P4 n=4"))
    assert asked == [first, ("tune", "mine", "first_order", None)]


def test_tclab_goes_from_step_test_to_loops(tmp_path, monkeypatch):
    report = pidalab.report  # taken before its home is patched, wherever it was first used

    def quick(*arguments, **options):
        return report(*arguments, kinds="PI", **options)

    monkeypatch.setattr("pidalab.plant.reporting.report", quick)
    result = run("tclab", "--duration", 600, "--out", tmp_path)
    assert result.exit_code == 0, result.output
    assert "Closed loops, simulated" in result.stdout
    assert np.loadtxt(tmp_path / "PI.csv", delimiter=",", skiprows=1).shape == (1201, 5)
    assert "<svg" in (tmp_path / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "gains",
    [("--kp", 0.6, "--ti", 12), ("--firmware", "klipper", "--kp", 0.6 * 255, "--ki", 0.05 * 255)],
    ids=["times", "klipper"],
)
def test_check_judges_the_gains_of_a_log(tmp_path, gains):
    running = pidalab.PIDA(kp=0.6, ti=12.0)
    loop = pidalab.Loop(pidalab.fopdt(2.0, 12.0, 4.0), running.discretise(1.0))
    t = np.arange(150.0)
    noise = np.random.default_rng(0).normal(0.0, 0.02, t.size)
    log = pidalab.simulate_sampled(loop, t, setpoint=np.where(t < 20, 0.0, 1.0), noise=noise)
    path = tmp_path / "log.csv"
    np.savetxt(path, np.column_stack([t, log.u, log.y + noise]), delimiter=",", header="t,u,y", comments="")
    result = run("check", path, *gains, "--sample-time", 1, "--filter", 0.5, "--model", "fopdt")
    assert result.exit_code == 0, result.output
    low, high = map(float, re.search(r"these gains: Ms \S+; (\S+) to (\S+) with", result.stdout).groups())
    filtered = pidalab.Loop(loop.process, running, pidalab.fopdt(1.0, 0.5, 0.0))
    assert low <= pidalab.max_sensitivity(filtered)[0] + 0.1 <= high + 0.1
    for name in ("now", "best like it", "calmer", "same noise", "faster"):
        assert re.search(rf"^  {name} ", result.stdout, flags=re.MULTILINE)
    assert run("check", path, "--kp", -0.6, "--ti", 12, "--model", "fopdt").exit_code == 1
    # as the firmware writes them, beside the sets as times
    firmware = re.findall(
        r"^  (now|faster) .*pid_Kp = \S+, pid_Ki = \S+, pid_Kd", result.stdout, re.MULTILINE
    )
    assert firmware == (["now", "faster"] if "klipper" in gains else [])
    both = run("check", path, "--firmware", "klipper", "--kp", 0.6, "--ti", 12)
    assert both.exit_code == 2
    assert "or --firmware with --kp, --ki" in both.output


def test_an_unsafe_design_is_refused_and_nothing_is_written(record, tmp_path):
    options = ("--kind", "PI", "--sample-time", 0.2, "--rule", "ziegler-nichols", "--spread", 0.4)
    result = run("tune", record, *options, "--out", tmp_path / "out")
    assert result.exit_code == 1
    assert "the model is too uncertain for this controller" in result.stderr
    assert not (tmp_path / "out").exists()


def test_doubts_of_limits_filter_and_sample_time_are_at_the_head_of_all_code(record, tmp_path):
    options = ("--kind", "PID", "--rule", "magnitude optimum", "--model", "sopdt", "--ms-worst", 9)
    result = run("tune", record, *options, "--sample-time", 20, "--out", tmp_path)
    assert result.exit_code == 0, result.output
    for name in ("controller.c", "controller.st", "controller.py", "controller.json"):
        head = (tmp_path / name).read_text(encoding="utf-8")[:3000]
        for said in (
            "--u-min and --u-max not given",
            "is long for this loop",
            "faster than the sample of 20",
        ):
            assert said in head, (name, said)


@pytest.mark.parametrize(
    ("options", "said"), [(("--y", "pressure"), "pressure"), (("--ms", 0.9), "ms must be")]
)
def test_what_is_refused_is_one_line_and_status_1(record, options, said):
    result = run("tune", record, "--sample-time", 0.2, *options)
    assert result.exit_code == 1
    assert said in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1


def test_designs_with_an_output_filter_and_with_a_prefilter_become_code(record, tmp_path):
    options = ("--sample-time", 0.2, "--kind", "PID")
    kept = run("tune", record, *options, "--model", "sopdt", "--rule", "haalman")
    assert kept.exit_code == 0, kept.output
    rising = tmp_path / "rising.csv"  # an integrator, as far as the record goes
    rising.write_text("\n".join(record.read_text(encoding="utf-8").splitlines()[:70]), encoding="utf-8")
    # a short part of a record says little, and the rule knows no Ms
    loose = ("--rule", "mrdp", "--ms-worst", 4)
    filtered = run("tune", rising, *options, "--model", "ipdt", *loose, "--out", tmp_path)
    assert filtered.exit_code == 0, filtered.output
    assert "Prefilter of the set point: [" in (tmp_path / "controller.c").read_text(encoding="utf-8")
    assert (
        pidalab.digital.from_json((tmp_path / "controller.json").read_text(encoding="utf-8")).prefilter
        is not None
    )


def test_usage_is_status_2_and_help_has_an_example(record):
    assert run("tune", record).exit_code == 2
    assert run("tune", "nowhere.csv", "--sample-time", 1).exit_code == 2
    assert run("compare", "--num", "one", "--den", "1,1").exit_code == 2
    assert run("simulate", "--den", "1,1", "--until", 9).exit_code == 2
    assert run("simulate", "--den", "1,1", "--kp", 1, "--until", 9, "--u-max", 1).exit_code == 2
    long = run("simulate", "--den", "1,1", "--kp", 1, "--until", 30, "--sample-time", 1e-9)
    assert long.exit_code == 2
    assert "--until must be at most 1e+07 samples of 1e-09, found 30" in long.stderr
    assert run("tclab", "--power", 500).exit_code == 2
    for command in ("tune", "report", "check", "compare", "simulate", "tclab"):
        assert re.search(rf"Examples?:\n\s+pidalab {command}\b", run(command, "--help").stdout)


def test_a_bad_row_is_named(record, tmp_path):
    lines = record.read_text(encoding="utf-8").splitlines()
    bad = tmp_path / "bad.csv"
    bad.write_text("\n".join([*lines[:60], lines[60].replace(";", ";x"), *lines[61:]]), encoding="utf-8")
    result = run("tune", bad, "--sample-time", 0.2)
    assert result.exit_code == 1
    assert "row 61" in result.stderr


def test_options_of_reading(tmp_path):
    """Blanks, no times, a line above, a step before the first row, a wild value: each has its option."""
    t = np.arange(150.0)
    y = np.round(20 + 2 * -np.expm1(-np.maximum(t - 5, 0) / 12) + 0.02 * np.sin(1.7 * t**2), 2)
    y[90] = -9999
    path = tmp_path / "log.txt"
    path.write_text("measured in May, by hand\n" + "\n".join(f"{row}  1.0" for row in y), encoding="utf-8")
    options = ("--u", 1, "--y", 0, "--period", 1, "--skip", 1, "--delimiter", r"\s+", "--sample-time", 1)
    design = ("--kind", "PI", "--rule", "simc", "--model", "fopdt")
    assert "--u-before" in run("tune", path, *options, *design).stderr
    assert "row 92 (y = -9999)" in run("tune", path, *options, *design, "--u-before", 0).stderr
    done = run("tune", path, *options, *design, "--u-before", 0, "--outliers", "drop")
    assert done.exit_code == 0, done.output
    assert "step from 0 to 1 at 0" in done.stdout
    assert "left out: far from its neighbours: row 92" in done.stdout


def test_a_controller_changed_by_hand_is_refused(tmp_path):
    path = tmp_path / "controller.json"
    path.write_text(
        pidalab.PIDA(2.0, 4.0).discretise(0.5).json().replace('"new": 0.25', '"new": 0.26'), encoding="utf-8"
    )
    result = run("simulate", "--den", "1,1", "--controller", path, "--until", 9)
    assert result.exit_code == 1
    assert "changed by hand" in result.stderr


def test_no_board_is_one_line(monkeypatch):
    monkeypatch.setattr("tclab.tclab.list_ports.comports", lambda: [])
    result = run("tclab", "--connected")
    assert result.exit_code == 1
    assert result.stderr.strip() == "Error: No Arduino device found."


QUICK = ("--kind", "PI", "--rule", "simc", "--model", "fopdt", "--ms-worst", 3, "--sample-time", 1)


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """A clean record of one lag, in seconds: 60 rows."""
    path = tmp_path_factory.mktemp("plain") / "step *µ.csv"
    t = np.arange(60.0)
    y = 20 + 10 * -np.expm1(-np.maximum(t - 13, 0) / 6) + np.random.default_rng(0).normal(0, 0.02, t.size)
    np.savetxt(
        path, np.column_stack([t, np.where(t < 10, 40, 45), y]), delimiter=",", header="t,u,y", comments=""
    )
    return path


def written(folder):
    """The controller that a folder has."""
    return from_json((folder / "controller.json").read_text(encoding="utf-8"))


def test_options_of_the_code_reach_it(plain, tmp_path):
    """By default the weights are those that the book advises; what is given is what the code has."""
    assert run("tune", plain, *QUICK, "--out", tmp_path / "usual").exit_code == 0
    usual = written(tmp_path / "usual")
    assert (usual.weights, usual.rate_limit, usual.deadband) == ((0.5, 0.0), np.inf, 0.0)
    assert (usual.bias, usual.limits, usual.anti_windup) == (40.0, (-np.inf, np.inf), "reset")
    assert usual.y_offset == pytest.approx(20.0, abs=0.02)
    options = ("--b", 0.75, "--c", 0.25, "--rate-limit", 2, "--deadband", 0.1, "--anti-windup", "clamping")
    options = (*options, "--u-min", 1, "--u-max", 99, "--feedforward", "--tunable", "--float")
    assert run("tune", plain, *QUICK, *options, "--out", tmp_path / "own").exit_code == 0
    own = written(tmp_path / "own")
    assert (own.weights, own.rate_limit, own.deadband) == ((0.75, 0.25), 2.0, 0.1)
    assert (own.limits, own.anti_windup, own.feedforward, own.tunable) == (
        (1.0, 99.0),
        "clamping",
        True,
        True,
    )
    for folder, kind in (("usual", "double"), ("own", "float")):
        assert f"_REAL {kind}\n" in (tmp_path / folder / "controller.c").read_text(encoding="utf-8")
    none = run("tune", plain, *QUICK, "--anti-windup", "none", "--out", tmp_path / "none")
    assert none.exit_code == 0
    assert written(tmp_path / "none").anti_windup is None


@pytest.mark.parametrize(
    "option",
    [
        ("--b", 5),
        ("--b", -0.1),
        ("--c", 1.1),
        ("--rate-limit", 0),
        ("--deadband", -1),
        ("--anti-windup", "on"),
    ],
)
def test_an_option_out_of_range_is_refused_by_its_name(plain, option):
    result = run("tune", plain, *QUICK, *option)
    assert result.exit_code == 2
    assert option[0] in result.stderr


def test_an_edited_controller_stays_and_a_full_disk_leaves_the_old_set(plain, tmp_path, monkeypatch):
    command = ("tune", plain, *QUICK, "--out", tmp_path)
    assert run(*command).exit_code == 0
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert sorted(before) == [
        "controller.c",
        "controller.json",
        "controller.py",
        "controller.st",
        "report.html",
    ]
    assert run(*command).exit_code == 0  # the same again
    edited = b"/* mine */" + before["controller.c"]
    (tmp_path / "controller.c").write_bytes(edited)
    refused = run(*command)
    assert refused.exit_code == 1
    assert "controller.c" in refused.stderr
    assert "--force" in refused.stderr
    assert (tmp_path / "controller.c").read_bytes() == edited

    def full(_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr("os.fsync", full)
        cut = run(*command, "--b", 1, "--force")
    assert (cut.exit_code, "No space left" in cut.stderr) == (1, True)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before | {"controller.c": edited}
    assert run(*command, "--force").exit_code == 0
    assert (tmp_path / "controller.c").read_bytes() == before["controller.c"]


def test_a_response_and_a_report_stay_unless_they_may_be_replaced(plain, tmp_path):
    commands = {
        "r.csv": ("simulate", "--den", "1,1", "--kp", 1, "--ti", 1, "--until", 9),
        "r.html": (
            "report",
            plain,
            "--rule",
            "simc",
            "--model",
            "fopdt",
            "--ms-worst",
            3,
            "--sample-time",
            1,
        ),
    }
    for name, command in commands.items():
        (tmp_path / name).write_text("mine", encoding="utf-8")
        assert name in run(*command, "--out", tmp_path / name).stderr
        assert (tmp_path / name).read_text(encoding="utf-8") == "mine"
        assert run(*command, "--out", tmp_path / name, "--force").exit_code == 0
        assert (tmp_path / name).read_text(encoding="utf-8") != "mine"


def test_the_board_is_not_heated_for_files_that_are_there(tmp_path, monkeypatch):
    (tmp_path / "PID.csv").write_text("mine", encoding="utf-8")
    monkeypatch.setattr("pidalab.plant.heater.Lab.step_test", lambda *_, **__: pytest.fail("heated"))
    result = run("tclab", "--out", tmp_path)
    assert (result.exit_code, "PID.csv" in result.stderr) == (1, True)


def test_text_of_a_file_and_its_name_reach_written_files_as_plain_text(plain, tmp_path):
    line = 'end of log *"""/ int x = 1; /* "*/""; print("x"); "*/"" <script>'
    path = tmp_path / "a'b<i>c.csv"
    path.write_text(plain.read_text(encoding="utf-8") + line + "\n", encoding="utf-8")
    result = run("tune", path, *QUICK, "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    for file in (tmp_path / "out").iterdir():
        text = file.read_text(encoding="utf-8")
        assert "end of log int x 1 print x script" in text
        for mark in ('print("x")', "int x = 1", "<script", "<i>", "a'b"):
            assert mark not in text, (file.name, mark)


def test_a_console_that_lacks_characters_gets_others(tmp_path):
    """Windows prints what is piped in its code page 1252, which has no Greek and few mathematical signs."""
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
