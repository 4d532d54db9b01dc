"""Compiled code: kept between processes, announced when it is made, silent where it cannot be kept, and not needed."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import pidalab

SCRIPT = """
from pidalab import _compiled
from pidalab._compiled import compiled
{before}
from pidalab.simulation.ring import shortened
import numpy as np
print(shortened(np.array([[1.0, 1.0, 0.0]]), 0.0)[0])
"""


def run(folder, before=""):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder), "PYTHONPATH": os.pathsep.join(sys.path)}
    script = SCRIPT.format(before=before)
    return subprocess.run(
        [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True
    )


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A folder with the code that a first process compiled, and what that process said."""
    folder = tmp_path_factory.mktemp("kept")
    return folder, run(folder)


def test_the_first_call_is_announced_and_later_processes_are_silent(kept):
    folder, first = kept
    second = run(folder)
    assert first.stdout == second.stdout == "[1. 1.]\n"
    assert first.stderr.startswith("pidalab: compiling for this machine")
    assert first.stderr.count("\n") == 1
    assert second.stderr == ""


def test_a_change_of_a_neighbouring_file_compiles_anew(kept, tmp_path):
    folder = shutil.copytree(
        kept[0], tmp_path / "kept"
    )  # the code of a changed file takes the place of the other
    assert run(folder).stderr == ""
    changed = "_compiled._changed = lambda folder: (('ring.py', 1.0, 1),)"
    assert "compiling" in run(folder, changed).stderr


def answers():
    """Numbers of every part of the library that is compiled."""
    loop = pidalab.Loop(pidalab.lags(3, delay=0.4), pidalab.PIDA(1.5, 2.5, 0.8, 0.2, n=10, m=10))
    neutral = pidalab.Loop(pidalab.Process([0.3, 1.0], [1.0, 1.0], 0.5), pidalab.PIDA(0.4, 2.0))
    series = pidalab.SeriesPIDA(0.3, 0.1, 0.02, ti=1.0, filter_time=0.1, filter_order=3, limits=(-0.5, 0.9))
    limited = pidalab.Loop(pidalab.ipdt(1.0, delay=0.55), series)
    digital = pidalab.Loop(limited.process, series.discretise(0.05, limits=(-0.5, 0.9)))
    t = np.linspace(0.0, 12.0, 241)
    runs = [pidalab.simulate(one, t, setpoint=1.0, load=0.3) for one in (loop, neutral)]
    runs += [pidalab.simulate_sampled(one, t, setpoint=1.0, load=0.3) for one in (limited, digital)]
    margins = [pidalab.margins(one) for one in (loop, neutral)]
    sets = pidalab.portrait(limited, {"kp": [0.2, 0.4]}, t, setpoint=1.0)
    tuned = pidalab.rules.haalman.tune(pidalab.sopdt(1.0, 2.0, 1.0, 0.5), ms=1.6, kind="PID").controller
    best = pidalab.optimal.load(loop.process, order=1, ms=1.6)
    return {
        "responses": [x[i] for r in runs for x in (r.y, r.u) for i in (5, 60, 240)],
        "margins": [x for m in margins for x in (m.ms, m.gm, m.pm)],
        "portrait": [*sets.iae, *sets.itae, *sets.tv_u],
        "rule": [tuned.kp, tuned.ti, tuned.td],
        "optimum": [best.iae],
    }


def test_without_numba_the_digits_are_the_same(tmp_path):
    (tmp_path / "numba.py").write_text("raise ImportError('no numba here')")
    script = "import json, sys; from test_compiled import answers; json.dump(answers(), sys.stdout)"
    path = os.pathsep.join([str(tmp_path), str(Path(__file__).parent), *sys.path])
    done = subprocess.run(
        [sys.executable, "-c", script],
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == "pidalab: numba is not installed; the same digits within rounding, slower\n"
    plain, compiled = json.loads(done.stdout), answers()
    for name, values in compiled.items():
        # a search ends where its steps are small
        digits = 1e-6 if name == "optimum" else 1e-9
        assert plain[name] == pytest.approx(values, rel=digits, abs=1e-11), name
