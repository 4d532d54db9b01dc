"""Check both forms of kernels, plain and compiled in the background, which give the same digits."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
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
# The process has spent more than a second in plain forms.
WORKED = FIRST.replace("loop =", "from pidalab._compiled import TIER; TIER.spent = 2.0; loop =")
START = "from pidalab._compiled import compile_in_background; compile_in_background()"


def environment(**variables):
    """Return environment variables for a process without PIDALAB_COMPILE. None removes a variable."""
    given = os.environ | {"PIDALAB_COMPILE": ""} | {key: str(value) for key, value in variables.items()}
    return {name: value for name, value in given.items() if value != "None"}


def run(script, cwd=None, **variables):
    return subprocess.run(
        [sys.executable, "-c", script],
        env=environment(**variables),
        cwd=cwd,
        capture_output=True,
        text=True,
        check=True,
    )


def wait_until(condition, seconds=300):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "timed out"
        time.sleep(0.2)


def compilers(cache):
    """List the processes that compile into a cache."""
    wanted = f"NUMBA_CACHE_DIR={cache}".encode()
    processes = []
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if (
                wanted in (folder / "environ").read_bytes()
                and b"warm_up" in (folder / "cmdline").read_bytes()
            ):
                processes.append(int(folder.name))
    return processes


needs_proc = pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="needs Linux's /proc")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return the answers of a short and a longer process in a hostile folder, and the cache of the longer process."""
    cache, folder = tmp_path_factory.mktemp("cache"), tmp_path_factory.mktemp("logs")
    for name in ("numba.py", "random.py", "numpy.py", "pidalab.py"):
        trap = f"open({str(folder / 'was_run')!r}, 'w').close()\nraise ImportError('not this one')\n"
        (folder / name).write_text(trap, encoding="utf-8")
    # Like a command, the process starts elsewhere and changes to the folder.
    change = f"import os, sys, numpy, random; sys.path.remove('') if '' in sys.path else 0; os.chdir({str(folder)!r});"
    short = run(change + FIRST, NUMBA_CACHE_DIR=cache)
    assert not list(cache.iterdir())
    longer = run(change + WORKED, NUMBA_CACHE_DIR=cache)
    assert list(cache.glob("compiled-*/attempt-1"))
    wait_until(lambda: list(cache.glob("compiled-*/complete")))
    assert not (folder / "was_run").exists()
    return (short, longer), cache


def test_short_processes_stay_plain_and_long_ones_use_kept_code(made):
    """A short process never imports numba, with a full cache or an empty one."""
    answers, cache = made
    again = [run(script, NUMBA_CACHE_DIR=cache) for script in (FIRST, WORKED)]
    assert [answer.stderr for answer in (*answers, *again)] == [""] * 4
    values, imported = zip(*(answer.stdout.split() for answer in (*answers, *again)), strict=True)
    assert len(set(values)) == 1
    assert imported == ("False", "False", "False", "True")


@needs_proc
def test_killed_compiler_delays_the_next_attempt(tmp_path):
    """One of two processes starts a compiler at low priority. After kill -9 the next attempt waits."""
    starters = [
        subprocess.Popen([sys.executable, "-c", START], env=environment(NUMBA_CACHE_DIR=tmp_path))
        for _ in range(2)
    ]
    assert [starter.wait() for starter in starters] == [0, 0]
    wait_until(lambda: compilers(tmp_path), 10)
    (process,) = compilers(tmp_path)
    wait_until(lambda: os.getpriority(os.PRIO_PROCESS, process) > 0, 30)
    os.kill(process, signal.SIGKILL)
    wait_until(lambda: not compilers(tmp_path), 10)
    run(START, NUMBA_CACHE_DIR=tmp_path)
    assert not compilers(tmp_path)
    (attempt,) = tmp_path.glob("compiled-*/attempt-*")
    for later, started in ((500, 1), (700, 2)):  # seconds after the attempt began
        os.utime(attempt, (time.time() - later,) * 2)
        run(START, NUMBA_CACHE_DIR=tmp_path)
        assert len(list(tmp_path.glob("compiled-*/attempt-*"))) == started
    for process in compilers(tmp_path):
        os.kill(process, signal.SIGKILL)


@pytest.mark.parametrize(
    ("variables", "message"),
    [
        ({"NUMBA_DISABLE_JIT": 1}, "numba must be installed and not switched off"),
        ({"NUMBA_CACHE_DIR": "/dev/null/cache"}, "no compiled code"),
        ({}, "no compiled code"),
    ],
    ids=["off", "no folder", "nothing kept"],
)
def test_failed_compiler_reports_its_error(variables, message, tmp_path):
    """The compilation is not complete, and the error says why."""
    script = "import pidalab.warm_up as w; w.use_all = lambda: None; w.main()"
    with pytest.raises(subprocess.CalledProcessError) as failed:
        run(script, **{"NUMBA_CACHE_DIR": tmp_path} | variables)
    assert message in failed.value.stderr
    assert not list(tmp_path.rglob("complete"))


HOMES = {"no home": {"HOME": None, "XDG_CACHE_HOME": None}, "chosen": {"NUMBA_CACHE_DIR": "/dev/null/cache"}}


@pytest.mark.parametrize("home", HOMES)
def test_plain_forms_are_used_without_a_cache(home, tmp_path):
    """Without a writable folder plain forms are used, and no compiler is started."""
    nowhere = (
        "import os, pwd; from pathlib import Path; import pidalab._compiled as c; c.PACKAGE = Path('/dev/null/x');"
        "\ndef unknown(*_): raise KeyError\npwd.getpwuid = unknown\n"
    )
    check = (
        "\nfrom pidalab._compiled import TIER; assert not TIER.ready; import os; assert not os.listdir('.')"
    )
    answer = run(nowhere + WORKED + check, cwd=tmp_path, **HOMES[home])
    assert answer.stdout.split()[1] == "False"
    assert answer.stderr == ""


def test_background_compiles_all_kernels(made):
    """After the background compilation no function is compiled again."""
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
    run(script, NUMBA_CACHE_DIR=made[1], PIDALAB_COMPILE="1")


@cache
def answers(search=True):
    """Return numbers of every part of the library that is compiled."""
    loop = pidalab.Loop(pidalab.lags(3, delay=0.4), pidalab.PIDA(1.5, 2.5, 0.8, 0.2, n=10, m=10))
    neutral = pidalab.Loop(pidalab.Process([0.3, 1.0], [1.0, 1.0], 0.5), pidalab.PIDA(0.4, 2.0))
    series = pidalab.SeriesPIDA(0.3, 0.1, 0.02, ti=1.0, filter_time=0.1, filter_order=3, limits=(-0.5, 0.9))
    limited = pidalab.Loop(pidalab.ipdt(1.0, delay=0.55), series)
    digital = pidalab.Loop(limited.process, series.discretise(0.05, limits=(-0.5, 0.9)))
    t = np.linspace(0.0, 12.0, 241)
    runs = [pidalab.simulate(each, t, setpoint=1.0, load=0.3) for each in (loop, neutral)]
    runs += [pidalab.simulate_sampled(each, t, setpoint=1.0, load=0.3) for each in (limited, digital)]
    margins = [pidalab.margins(each) for each in (loop, neutral)]
    sets = pidalab.portrait(limited, {"kp": [0.2, 0.4]}, t, setpoint=1.0)
    noise = [pidalab.noise_gain(each, sample_time=0.01) for each in (loop, limited)]
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
    """Without numba, with PIDALAB_COMPILE=0 or with NUMBA_DISABLE_JIT, plain forms are used without a message."""
    variables = {
        "numba": {"PIDALAB_COMPILE": "1"},
        "wish": {"PIDALAB_COMPILE": "0"},
        "switch": {"NUMBA_DISABLE_JIT": "1"},
    }[without]
    if without == "numba":
        (tmp_path / "numba.py").write_text("raise ImportError('no numba here')", encoding="utf-8")
    path = os.pathsep.join([str(tmp_path), str(Path(__file__).parent), *filter(None, sys.path)])
    search = without == "numba"  # only once, since its plain form takes ten seconds
    script = f"import json, sys; from test_compiled import answers; json.dump(answers({search}), sys.stdout)"
    done = run(script, **variables, PYTHONPATH=path)
    assert done.stderr == ""
    plain, compiled = json.loads(done.stdout), answers(search)
    for name, values in compiled.items():
        # A search stops at small steps, which differ.
        digits = 1e-6 if name == "optimum" else 1e-9
        assert plain[name] == pytest.approx(values, rel=digits, abs=1e-11), name
