"""Both forms of compiled functions: the plain one answers first, the other is made beside it, with the same digits."""

import json
import os
import subprocess
import sys
import time
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import pidalab

FIRST = """
import sys
import pidalab
loop = pidalab.Loop(pidalab.lags(3, delay=1.0), pidalab.PIDA(1.0, 3.0, 1.0, 0.3))
print(pidalab.load_response(loop, [0.0, 4.5, 9.0]).y[2].round(9), "numba" in sys.modules)
"""


def environment(**variables):
    """The variables of this process, without a wish for one of the forms; None takes one away."""
    given = (
        os.environ
        | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "PIDALAB_COMPILE": ""}
        | variables
    )
    return {name: value for name, value in given.items() if value is not None}


def run(script, **variables):
    return subprocess.run(
        [sys.executable, "-c", script],
        env=environment(**variables),
        capture_output=True,
        text=True,
        check=True,
    )


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A first answer from an empty cache, and the cache once a process beside it has filled it."""
    cache = tmp_path_factory.mktemp("cache")
    first = run(FIRST, NUMBA_CACHE_DIR=str(cache))
    assert list(cache.glob("*.lock"))
    for _ in range(600):
        if not list(cache.glob("*.lock")):
            break
        time.sleep(0.5)
    return first, cache


def test_the_first_answer_waits_for_no_compilation_and_later_ones_use_it(made):
    """Nobody says a word that a notebook would store."""
    first, cache = made
    assert first.stderr == ""
    value, waited = first.stdout.split()
    assert waited == "False"
    assert len(list(cache.glob("compiled-*"))) == 1
    later = run(FIRST, NUMBA_CACHE_DIR=str(cache))
    assert later.stderr == ""
    assert later.stdout.split() == [value, "True"]


def test_what_is_made_beside_the_first_answer_is_all_that_the_library_calls(made):
    """After it no function of ours is compiled any more, whatever is called."""
    script = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from numba.core import event
from test_compiled import answers
class Listener(event.Listener):
    def on_start(self, event):
        function = event.data["dispatcher"].py_func
        assert not function.__module__.startswith("pidalab."), function
    def on_end(self, event):
        pass
event.register("numba:compile", Listener())
answers()
"""
    run(script, NUMBA_CACHE_DIR=str(made[1]), PIDALAB_COMPILE="1")


@cache
def answers(search=True):
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
    noise = [pidalab.noise_gain(one, sample_time=0.01) for one in (loop, limited)]
    tuned = pidalab.rules.haalman.tune(pidalab.sopdt(1.0, 2.0, 1.0, 0.5), ms=1.6, kind="PID").controller
    best = [pidalab.optimal.load(loop.process, order=1, ms=1.6).iae] if search else []
    return {
        "responses": [x[i] for r in runs for x in (r.y, r.u) for i in (5, 60, 240)],
        "margins": [x for m in margins for x in (m.ms, m.gm, m.pm)],
        "portrait": [*sets.iae, *sets.itae, *sets.tv_u],
        "noise": noise,
        "rule": [tuned.kp, tuned.ti, tuned.td],
        "optimum": best,
    }


@pytest.mark.parametrize("without", ["numba", "wish", "switch"])
def test_both_forms_give_the_same_digits(without, tmp_path):
    """Plain without numba, by our own variable and by numba's; and nothing is said."""
    variables = {
        "numba": {"PIDALAB_COMPILE": "1"},
        "wish": {"PIDALAB_COMPILE": "0"},
        "switch": {"NUMBA_DISABLE_JIT": "1"},
    }[without]
    if without == "numba":
        (tmp_path / "numba.py").write_text("raise ImportError('no numba here')", encoding="utf-8")
    path = os.pathsep.join([str(tmp_path), str(Path(__file__).parent), *filter(None, sys.path)])
    search = without == "numba"  # once: its plain form takes ten seconds
    script = f"import json, sys; from test_compiled import answers; json.dump(answers({search}), sys.stdout)"
    done = run(script, **variables, PYTHONPATH=path)
    assert done.stderr == ""
    plain, compiled = json.loads(done.stdout), answers(search)
    for name, values in compiled.items():
        # a search ends where its steps are small
        digits = 1e-6 if name == "optimum" else 1e-9
        assert plain[name] == pytest.approx(values, rel=digits, abs=1e-11), name
