"""The command line: a record becomes code that compiles; what is wrong is one line and an exit status."""

import json
import subprocess

import numpy as np
import pytest
from click.testing import CliRunner

import pidalab
from pidalab.cli import main


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    """A step of a plant with three lags, with noise, in a file."""
    t = np.arange(0.0, 80.0, 0.25)
    y = np.interp(t - 10.0, t, pidalab.open_loop_step(pidalab.lags(3, delay=2.0), t).y, left=0.0)
    y = 20.0 + 10.0 * y + np.random.default_rng(1).normal(0.0, 0.02, t.size)
    u = np.where(t < 10.0, 40.0, 45.0)
    path = tmp_path_factory.mktemp("plant") / "step.csv"
    rows = [f"{a},{b},{c}" for a, b, c in zip(t.tolist(), u.tolist(), y.tolist(), strict=True)]
    path.write_text("\n".join(["time,valve,level", *rows]))
    return path


def run(*arguments):
    return CliRunner().invoke(main, [str(one) for one in arguments])


def test_a_record_becomes_code_that_compiles_and_a_report(record, tmp_path):
    columns = ("--time", "time", "--u", "valve", "--y", "level")
    result = run(
        "tune",
        record,
        *columns,
        "--kind",
        "PID",
        "--sample-time",
        0.2,
        "--u-min",
        0,
        "--u-max",
        100,
        "--out",
        tmp_path,
    )
    assert result.exit_code == 0, result.output
    for said in (
        "Record",
        "Model",
        "Controller",
        "Margins, continuous",
        "Margins, sampled every 0.2",
        "worst Ms",
    ):
        assert said in result.stdout
    program = tmp_path / "test"
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-DPIDA_SELFTEST"]
    subprocess.run(["gcc", *flags, "-o", program, tmp_path / "controller.c", "-lm"], check=True)
    subprocess.run([program], check=True)
    compile((tmp_path / "controller.py").read_text(), "controller.py", "exec")
    assert "FUNCTION_BLOCK" in (tmp_path / "controller.st").read_text()
    assert json.loads((tmp_path / "controller.json").read_text())
    report = (tmp_path / "report.html").read_text()
    assert report.count("<svg") == 1
    assert "<script" not in report
    assert "src=" not in report


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--y", "pressure"), "pressure"),
        (("--ms", 0.9), "ms must be"),
        (("--rule", "haalman", "--model", "sopdt", "--kind", "PID"), "output filter"),
    ],
)
def test_what_is_refused_is_one_line_and_status_1(record, options, said):
    result = run("tune", record, "--sample-time", 0.2, *options)
    assert result.exit_code == 1
    assert said in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1


def test_usage_is_status_2_and_help_has_an_example(record):
    assert run("tune", record).exit_code == 2
    assert run("tune", "nowhere.csv", "--sample-time", 1).exit_code == 2
    assert run("compare", "--num", "one", "--den", "1,1").exit_code == 2
    for command in ("tune", "compare"):
        assert f"pidalab {command} " in run(command, "--help").stdout.split("Example:")[1]


def test_compare_prints_the_table(monkeypatch):
    monkeypatch.setattr("pidalab.comparison.candidates._best", lambda *_: iter(()))
    result = run("compare", "--num", 1, "--den", "1,2,1", "--delay", 1, "--sample-time", 0.1)
    assert result.exit_code == 0, result.output
    assert "simc" in result.stdout
    assert run("compare", "--num", 1, "--den", "1,1", "--ms", 0.5).exit_code == 1
