"""Judge code tasks: right programs pass, usual slips get a hint, and nothing else passes."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).resolve().parents[2] / "book" / "learn"))

import code_tasks


def second_difference(new, middle, old, h):
    return (new - 2 * middle + old) / h**2


def integral_of_error(t, e):
    return np.trapezoid(np.abs(e), t)


def half_rule(lags, delay):
    first, second, *others = sorted(lags, reverse=True)
    return first + second / 2, delay + second / 2 + sum(others)


def filtered_deviation(a):
    impulse = (1 - a) * a ** np.arange(5000)
    return np.sqrt(np.sum(impulse**2))


def limited_step(integral, e, gain):
    u = float(np.clip(integral + gain * e, -1, 1))
    return u, integral + (0.1 * e if u == integral + gain * e else 0)


def pi_increment(e, before, kp, ti, h):
    def u(integral, error):
        return kp * (error + integral / ti)

    return u(h * e, e) - u(0, before)


RIGHT = [second_difference, integral_of_error, half_rule, filtered_deviation, limited_step, pi_increment]


def words(answer, name, capsys):
    def asked(*arguments):
        return answer(*arguments)

    asked.__name__ = name
    code_tasks.judge(asked)
    return capsys.readouterr().out


@pytest.mark.parametrize("answer", RIGHT, ids=lambda answer: answer.__name__)
def test_only_right_programs_pass(answer, capsys):
    name = answer.__name__
    assert words(answer, name, capsys).startswith("Right")
    slip, word = code_tasks.SLIPS[name]
    assert word in words(slip, name, capsys)
    for wrong in (
        lambda *_: None,
        lambda *_: 0.0,
        lambda *_: "x",
        lambda *_: 1 / 0,
        lambda *x: 1.001 * np.array(answer(*x)),
    ):
        assert words(wrong, name, capsys).startswith("Not yet")


def test_an_unknown_name_lists_the_tasks(capsys):
    assert "half_rule" in words(half_rule, "halfrule", capsys)
