"""Compare written C, structured text and Python with the reference, for random records."""

import dataclasses
import json
import math
import re
import shutil
import subprocess

import numpy as np
import pytest
from cases import CASES, STANDARD, record, reference
from st import Instance, read
from test_total import GCC as STRICT, compiler

import pidalab
from pidalab import PIDA, HighOrderPID
from pidalab.digital.program import INPUTS, program
from pidalab.plant.code.files import LANGUAGES, vector

RECORDS = {name: record(k, seed) for seed, (name, k) in enumerate(CASES.items())}
EXPECTED = {name: reference(k, RECORDS[name]) for name, k in CASES.items()}
MAIN = """
#include <stdio.h>
int main(void)
{
    double r, y, m, v, f, u;
    int which, manual, tracking, retuned;
    %s
    while (scanf("%%d %%lf %%lf %%d %%lf %%d %%lf %%lf %%d", &which, &r, &y, &manual, &m, &tracking, &v, &f,
        &retuned) == 9) {
        u = 0.0;
        %s
        printf("%%.17g\\n", u);
    }
    return 0;
}
"""
GCC = [*STRICT, "-Wdouble-promotion"]


def run_c(folder, precision, options=()):
    """Compile all cases into one program, run it on their records, and return the control signals by case."""
    starts, calls, names = "", "", list(CASES)
    for i, name in enumerate(names):
        starts += f"{name}_state s{i}; {name}_init(&s{i});\n    "
        real = f"({name}_real)"
        inputs = f"{real}r, {real}y, manual, {real}m, tracking, {real}v"
        inputs += f", {real}f" * CASES[name].feedforward + ", retuned" * CASES[name].tunable
        calls += f"if (which == {i}) u = (double){name}_step(&s{i}, {inputs});\n        "
    source = folder / f"{precision}.c"
    code = [k.c(name, precision=precision) for name, k in CASES.items()]
    source.write_text("\n".join(code) + MAIN % (starts, calls), encoding="utf-8")
    compiler()
    subprocess.run([*GCC, *options, str(source), "-o", str(folder / precision)], check=True, text=True)
    rows = []
    for i, name in enumerate(names):
        usual = {"feedforward": np.zeros(300), "retuned": np.zeros(300, dtype=bool)} | RECORDS[name]
        usual = {name: usual[name] for name in (*INPUTS, "feedforward", "retuned")}
        for row in zip(*(x.tolist() for x in usual.values()), strict=True):
            rows.append(" ".join([str(i), *(str(int(x)) if isinstance(x, bool) else repr(x) for x in row)]))
    out = subprocess.run(
        [str(folder / precision)], input="\n".join(rows), capture_output=True, text=True, check=True
    )
    values = np.array([float(line) for line in out.stdout.split()])
    ends = np.cumsum([EXPECTED[name].size for name in names])
    return dict(zip(names, np.split(values, ends[:-1]), strict=True))


@pytest.mark.parametrize("options", [(), ("-std=gnu99", "-O3", "-march=native")])
def test_c_in_double_precision_equals_the_reference(tmp_path, options):
    """The compiler options in the head exclude fused multiply-add instructions, so no bit depends on the processor."""
    assert "-ffp-contract=off" in CASES["zoh"].c()
    found = run_c(tmp_path, "double", options)
    for name, u in EXPECTED.items():
        np.testing.assert_array_equal(found[name], u, err_msg=name)


def test_c_in_single_precision(tmp_path):
    found = run_c(tmp_path, "single")
    for name, u in EXPECTED.items():
        assert np.max(np.abs(found[name] - u)) < 1e-5 * np.ptp(u), name


def test_c_tests_itself(tmp_path):
    """The self-test passes in both precisions, and fails with an error of 0.1 % in a gain."""
    code = CASES["tustin"].c("level")
    spoilt = re.sub(r"(PART_1_GAIN_0 = \(level_real\))1\.3;", r"\g<1>1.3013;", code)
    assert spoilt != code
    single = CASES["tustin"].c("level", precision="single")
    passing = ((single, "single", 0), (code, "float", 0), (single, "double", 0))
    for text, precision, status in (*passing, (spoilt, "double", 1)):
        (tmp_path / "level.c").write_text(text, encoding="utf-8")
        compiler()
        real = [] if precision == "single" else [f"-DLEVEL_REAL={precision}"]
        options = ["-DLEVEL_SELFTEST", *real, str(tmp_path / "level.c")]
        subprocess.run([*GCC, *options, "-o", str(tmp_path / "level"), "-lm"], check=True)
        run = subprocess.run([str(tmp_path / "level")], capture_output=True, text=True, check=False)
        assert run.returncode == status, run.stdout


@pytest.mark.parametrize("precision", ["double", "single"])
def test_c_compiles_for_arm(tmp_path, precision):
    arm = shutil.which("arm-none-eabi-gcc") or pytest.skip("arm-none-eabi-gcc is not installed")
    warnings = [option for option in GCC if option.startswith("-W")]
    cpu = ["-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"]
    for name, k in CASES.items():
        source = tmp_path / f"{name}.c"
        source.write_text(k.c(name, precision=precision), encoding="utf-8")
        subprocess.run(
            [arm, "-std=c99", "-O2", *warnings, *cpu, "-c", str(source), "-o", str(source) + ".o"], check=True
        )


@pytest.mark.parametrize("name", CASES)
def test_structured_text_equals_the_reference(name):
    blocks = read(CASES[name].structured_text(name))
    block, found = Instance(blocks, name), []
    for row in zip(*(x.tolist() for x in RECORDS[name].values()), strict=True):
        found.append(block(**dict(zip(RECORDS[name], row, strict=True))).control)
    np.testing.assert_array_equal(found, EXPECTED[name])
    assert Instance(blocks, f"{name}_selftest")().worst == 0.0


def test_structured_text_in_single_precision():
    k, rows = CASES["backward"], RECORDS["backward"]
    text = k.structured_text("level").replace("LREAL", "REAL")
    block, found = Instance(read(text), "level", np.float32), []
    for row in zip(*(x.tolist() for x in rows.values()), strict=True):
        found.append(float(block(**dict(zip(rows, row, strict=True))).control))
    assert np.max(np.abs(found - EXPECTED["backward"])) < 1e-5 * np.ptp(EXPECTED["backward"])


@pytest.mark.parametrize("name", CASES)
def test_python_equals_the_reference(name):
    space = {}
    exec(CASES[name].python("level_loop"), space)
    block = space["LevelLoop"]()
    found = [block.step(*row) for row in zip(*(x.tolist() for x in RECORDS[name].values()), strict=True)]
    np.testing.assert_array_equal(found, EXPECTED[name])
    assert space["selftest"]() == 0.0


@pytest.mark.parametrize("name", CASES)
def test_json_has_the_numbers_of_the_code(name):
    k = CASES[name]
    content = json.loads(k.json(note="made for a test"))
    assert content["coefficients"] == k.coefficients
    assert content["about"][-1] == "made for a test"
    code = k.c(name)
    for constant, value in k.coefficients.items():
        where = "s->" if constant in program(k).gains else f"{name.upper()}_"
        assert f"{where}{constant} = ({name}_real){value!r};" in code
    rows = content["test"]
    expected = rows.pop("control")
    assert reference(k, {x: np.array(values) for x, values in rows.items()}).tolist() == expected


def test_head():
    loop = pidalab.Loop(pidalab.lags(3, delay=1.0), STANDARD)
    margins = pidalab.margins(loop)
    about = {"margins": margins, "time_unit": "min", "record": "oven.csv", "date": "2026-05-03 14:00"}
    for code in (getattr(CASES["zoh"], language)(**about) for language in LANGUAGES):
        assert f"Controller: {STANDARD!r}" in code
        assert "Sample time: 0.1 min" in code
        assert "Record: oven.csv, recorded 2026-05-03 14:00" in code
        assert f"written by pidalab {pidalab.__version__}." in code
        assert "Method: zoh, anti-windup: back-calculation" in code
        assert f"Ms = {margins.ms:.4g}" in code
    anonymous = dataclasses.replace(CASES["zoh"], source="")
    assert "not named" in anonymous.python()


@pytest.mark.parametrize("language", LANGUAGES)
def test_notes_keep_their_punctuation(language):
    note = "Warning: 2 gaps; the longest, 4 ± 1, begins at 30 (kp/ki = 0.5). It's 20 % of 3 min [kW]"
    for k in CASES.values():
        code = getattr(k, language)(note=note)
        assert note in re.sub(r"\n[ *]*", " ", code)


@pytest.mark.parametrize("name", CASES)
def test_test_vector_reaches_both_limits(name):
    k = CASES[name]
    inputs = vector(k)
    assert {end for end in k.limits if math.isfinite(end)} <= set(inputs["control"])
    assert np.flatnonzero(inputs["manual"]).tolist() == [10, 11, 12]  # a spell by hand
    assert np.flatnonzero(inputs["tracking"]).tolist() == [17]


@pytest.mark.parametrize("method", ["backward", "tustin", "zoh"])
def test_retuning_is_bumpless(method):
    old, new = (HighOrderPID(gains, lag, 2).discretise(0.1, method, tunable=True)
                for gains, lag in (([0.4, 1.3, 0.3], 0.2), ([2.0, 4.0, 1.0], 0.4)))  # fmt: skip
    space = {}
    exec(old.python("loop"), space)
    code = space["Loop"]()
    before = [(old.step(1.0, y), code.step(1.0, y))[0] for y in (0.0, 0.1, 0.2, 0.25)][-1]
    old.retune(new)
    for name, value in program(new).gains.items():
        setattr(code, name, value)
    found = [old.step(1.0, 0.3) for _ in range(3)]
    assert found == [code.step(1.0, 0.3, retuned=k == 0) for k in range(3)]
    assert found[0] == before
    # At rest again, the integral grows with the new gains.
    settled = [old.step(1.0, 0.3) for _ in range(200)][-2:]
    assert np.diff(settled) == pytest.approx(2.0 * 0.1 * 0.7)


@pytest.mark.parametrize(
    ("call", "error", "name"),
    [
        (lambda k: k.retune(PIDA(1.0, 2.0, 0.5).discretise(0.1, tunable=True)), ValueError, "other"),
        (lambda k: k.retune(PIDA(1.0, 2.0).discretise(0.1)), ValueError, "other"),
        (lambda k: PIDA(1.0, 2.0).discretise(0.1).retune(k), ValueError, "other"),
        (lambda k: k.retune(PIDA(1.0, 2.0)), TypeError, "other"),
        (lambda k: PIDA(1.0, math.inf).discretise(0.1, tunable=True), ValueError, "tunable"),
        (lambda k: PIDA(1.0, 2.0).discretise(0.1, feedforward=1), TypeError, "feedforward"),
        (lambda k: k.step(0.0, 0.0, feedforward=1.0), ValueError, "feedforward"),
        *((lambda k, x=x: k.c(x), ValueError, "name")
          for x in ("", "Level", "two__bars", "while", "control", "2nd", "a b", "end_", 3)),
        (lambda k: k.json(note=1.0), TypeError, "note"),
        (lambda k: k.c(precision="half"), ValueError, "precision"),
        (lambda k: k.python(notes=""), TypeError, "notes"),
    ],
)  # fmt: skip
def test_refusals(call, error, name):
    with pytest.raises(error, match=name):
        call(PIDA(1.0, 2.0).discretise(0.1, tunable=True))


def test_feedforward_is_added_before_the_limits():
    k = PIDA(1.0, 2.0).discretise(0.1, limits=(0.0, 5.0), bias=1.0, feedforward=True)
    k.reset(r=0.0, y=0.0)
    assert [k.step(0.0, 0.0, feedforward=f) for f in (0.0, 2.0, 9.0, 0.0)][:3] == [1.0, 3.0, 5.0]
    assert k.step(0.0, 0.0, manual=4.0, feedforward=2.0) == k.step(0.0, 0.0, feedforward=2.0) == 4.0


def test_numbers_of_structured_text():
    for text in ("0.5", "-2.0", "1.0E-7", "-1.25E-7", "1.0E22", "3.5E300"):
        assert LANGUAGES["structured_text"].number(float(text)) == text
