"""Judge the six short programs of the lectures by their results on random cases.

For each task the reader writes one function, which has the name of the task.
"""

from collections.abc import Callable, Iterator
from inspect import signature
from typing import Any

import numpy as np

Case = tuple[tuple[Any, ...], Any]  # arguments, expected result
CASES = 20


def second_difference(random: np.random.Generator) -> Iterator[Case]:
    """Lecture 1: the second derivative of three samples."""
    h, y = random.uniform(0.05, 1), random.normal(size=3)
    yield (*y, h), (y[0] - 2 * y[1] + y[2]) / h**2


def integral_of_error(random: np.random.Generator) -> Iterator[Case]:
    """Lecture 2: the IAE of a record, by the trapezoidal rule."""
    t = np.cumsum(random.uniform(0.1, 1, 5))
    e = random.normal(size=5)
    yield (t, e), float(np.sum(np.diff(t) * (abs(e[1:]) + abs(e[:-1])) / 2))


def half_rule(random: np.random.Generator) -> Iterator[Case]:
    """Lecture 3: one lag and a dead time in place of many lags."""
    lags = np.sort(random.uniform(0.1, 5, 4))[::-1]
    delay = random.uniform(0, 2)
    yield (
        (list(lags), delay),
        (lags[0] + lags[1] / 2, delay + lags[1] / 2 + lags[2:].sum()),
    )


def filtered_deviation(random: np.random.Generator) -> Iterator[Case]:
    """Lecture 4: the standard deviation of white noise after a first-order filter."""
    a = random.uniform(0.05, 0.95)
    yield (a,), np.sqrt((1 - a) / (1 + a))


def limited_step(random: np.random.Generator) -> Iterator[Case]:
    """Lecture 5: one step of an integrator that stops while the actuator is at a limit."""
    integral, e, gain = random.normal(0, 2, 3)
    u = integral + gain * e
    limited = min(max(u, -1), 1)
    yield (
        (integral, e, gain),
        (limited, integral + 0.1 * e if limited == u else integral),
    )


def pi_increment(random: np.random.Generator) -> Iterator[Case]:
    """Lecture 6: the change of u in one sample of a PI controller, by backward differences."""
    e, before = random.normal(size=2)
    kp, ti, h = random.uniform(0.1, 5, 3)
    yield (e, before, kp, ti, h), kp * (e - before) + kp * h / ti * e


# For each task, a function with the usual mistake, and a hint.
SLIPS: dict[str, tuple[Callable[..., Any], str]] = {
    "second_difference": (
        lambda new, middle, old, h: (new - 2 * middle + old) / h,
        "You divide by h once. The second difference is a difference of differences, so divide by h².",
    ),
    "integral_of_error": (
        lambda t, e: float(np.sum(np.diff(t) * (e[1:] + e[:-1]) / 2)),
        "That is the integral of e itself, where swings cancel. Take the absolute value first.",
    ),
    "half_rule": (
        lambda lags, delay: (lags[0], delay + sum(lags[1:])),
        "You add the whole second lag to the dead time. Half of it goes to the lag, half to the dead time.",
    ),
    "filtered_deviation": (
        lambda a: (1 - a) / (1 + a),
        "That is the ratio of the variances. The standard deviation is its square root.",
    ),
    "limited_step": (
        lambda integral, e, gain: (
            min(max(integral + gain * e, -1), 1),
            integral + 0.1 * e,
        ),
        "u is right, but the integral still changes while u is at a limit. Keep it constant then.",
    ),
    "pi_increment": (
        lambda e, before, kp, ti, h: kp * (e - before) + h / ti * e,
        "The integral part lacks the gain: in this form kp multiplies both parts.",
    ),
}
TASKS = {
    task.__name__: task
    for task in (
        second_difference,
        integral_of_error,
        half_rule,
        filtered_deviation,
        limited_step,
        pi_increment,
    )
}


def same(found: Any, expected: Any) -> bool:
    """Return True if two results have the same shape and agree to nine digits."""
    try:
        found, expected = (
            np.asarray(found, dtype=float),
            np.asarray(expected, dtype=float),
        )
    except (TypeError, ValueError):
        return False
    return found.shape == expected.shape and np.allclose(
        found, expected, rtol=1e-9, atol=1e-12
    )


def shown(value: Any) -> str:
    """Format numbers with four digits."""
    if isinstance(value, tuple | list | np.ndarray):
        return "(" + ", ".join(shown(each) for each in value) + ")"
    return f"{value:.4g}" if isinstance(value, int | float | np.number) else repr(value)


def judge(answer: Callable[..., Any]) -> None:
    """Print whether the function is right on random cases, with a hint if it is not.

    Parameters
    ----------
    answer : callable
        The reader's function, under the name that the task gives.
    """
    name = answer.__name__
    if name not in TASKS:
        print(f"There is no task called {name!r}; the tasks are {', '.join(TASKS)}.")
        return
    random = np.random.default_rng(3)
    cases = [case for _ in range(CASES) for case in TASKS[name](random)]
    try:
        found = [answer(*arguments) for arguments, _ in cases]
    except Exception as error:
        print(f"Not yet: your function stops with {type(error).__name__}: {error}.")
        return
    expected = [value for _, value in cases]
    if all(map(same, found, expected)):
        print(f"Right, on {CASES} random cases.")
        return
    slip, word = SLIPS[name]
    if all(
        same(value, slip(*arguments))
        for value, (arguments, _) in zip(found, cases, strict=True)
    ):
        print(f"Not yet. {word}")
    elif all(value is None for value in found):
        print("Not yet: your function returns nothing. End it with a return statement.")
    else:
        (arguments, right), wrong = next(
            (case, f)
            for case, f in zip(cases, found, strict=True)
            if not same(f, case[1])
        )
        given = ", ".join(
            f"{key} = {shown(each)}"
            for key, each in zip(signature(answer).parameters, arguments, strict=False)
        )
        print(
            f"Not yet. For {given} it should return {shown(right)}, but it returns {shown(wrong)}."
        )
