"""Check every task of the book: printed answers are right, wrong ones get a hint, and pages match the library."""

import math
import random
import re
from itertools import product

import numpy as np
import pytest
from book_tasks import Judge, parts_of, tasks_of_the_book

import pidalab
from pidalab.rules import automatic_reset, haalman

TASKS = tasks_of_the_book()
BY_LABEL = {task.label: task for task in TASKS}
QUICK = [task for task in TASKS if not task.data.get("search")]


def named(tasks):
    return pytest.mark.parametrize("task", tasks, ids=lambda task: task.label)


@pytest.fixture(scope="module")
def page():
    return Judge()


# --- the loops of a task, made by the library ------------------------------------------------------------------------


def plant_of(plant, given):
    """Return the process that the data of a task describe."""
    known = {
        "lags3": pidalab.lags(3, delay=1.0),
        "unequal": pidalab.Process([1.0], np.poly([-0.2, -1.0, -2.0]) / 0.4, delay=0.5),
        "huba-ipdt": pidalab.ipdt(1.0, delay=1.0),
    }
    if isinstance(plant, str):
        return known[plant]

    def value(x):
        if isinstance(x, list):
            return math.prod(map(value, x))
        return given[x] if isinstance(x, str) else x

    lags = [lag for lag in map(value, plant.get("lags", [])) if lag]
    den = np.atleast_1d(np.poly([-1 / lag for lag in lags])) * math.prod(lags)
    den = [*den, 0.0] if plant.get("integrating") else den
    return pidalab.Process([value(plant.get("gain", 1.0))], den, delay=value(plant.get("delay", 0.0)))


def controller_of(loop):
    ki, kp = loop["kp"] / loop["ti"], loop["kp"]
    gains = [ki, kp, kp * loop.get("td", 0.0), kp * loop.get("ta", 0.0)]
    order = 2 if loop.get("ta") else 1 if loop.get("td") else 0
    filtered = loop.get("n", order + 1) if loop.get("Tf") else 0
    return pidalab.HighOrderPID(gains[: order + 2], loop.get("Tf", 0.0), filtered)


@named([task for task in QUICK if "edge" not in task.data])  # near the edge of stability rounding shows
def test_facts_match_the_library(page, task):
    """Compare each loop of a task that is continuous and has no limits."""
    data = task.data
    given = data["key"] if data["kind"] == "design" else {}
    judged = [
        *data.get("limits", {}),
        *data.get("least", {}),
        data.get("by"),
        data.get("best", {}).get("fact"),
    ]
    judged = {name.split(".")[-1] for name in judged if name}
    plants, items = data.get("plants") or {"": data.get("plant")}, data.get("options") or data.get("items")
    for plant, item in product(plants.values(), items or [{}]):
        plant, loop = item.get("plant", plant), {**data.get("loop", {}), **item.get("loop", {}), **given}
        if not plant or not {"kp", "ti"} <= set(loop) or {"u0", "sampled", "rule"} & set(loop):
            continue
        parts = {key: value for key, value in loop.items() if key not in given}
        asked = {"kind": "design", "plant": plant, "loop": parts}
        of_library = pidalab.Loop(plant_of(plant, given), controller_of(loop))
        margins = pidalab.margins(of_library)
        expected = [margins.ms, margins.gm, margins.pm, margins.dm]
        assert page.facts(asked, given, "ms", "gm", "pm", "dm") == pytest.approx(expected, rel=1e-9)
        if "noise" in judged:
            noise = pidalab.relative_noise_gain(of_library)
            assert page.facts(asked, given, "noise") == pytest.approx([noise], rel=1e-6)
        if "iae" in judged:
            iae = pidalab.load_response(of_library, np.linspace(0, 150, 60001)).iae()
            assert page.facts(asked, given, "iae") == pytest.approx([iae], rel=1e-5)


# --- keys and wrong answers ------------------------------------------------------------------------------------------


def test_every_lecture_has_two_tasks():
    assert len(BY_LABEL) == len(TASKS)
    lectures = [task.page for task in TASKS if re.match(r"task-\d", task.label)]
    assert sorted(map(lectures.count, set(lectures))) == [2] * 6


@named(TASKS)
def test_the_printed_answer_is_right(page, task):
    key = task.data["key"]
    verdict = page.judge(task.data, key)
    assert verdict["right"], verdict["say"]
    numbers = {float(x) for x in re.findall(r"\d+(?:\.\d+)?", task.parts.answer)}
    if task.data["kind"] in ("number", "design"):
        assert {float(x) for x in key.values()} <= numbers, "the worked answer does not print the key"


@named(TASKS)
def test_wrong_answers_are_explained(page, task):
    data = task.data
    assert len(data["wrong"]) >= (1 if data.get("search") else 2)
    for wrong in data["wrong"]:
        verdict = page.judge(data, wrong["given"])
        assert not verdict["right"]
        assert wrong["word"] in verdict["say"], verdict["say"]


@named(TASKS)
def test_text_is_judged_as_its_number(page, task):
    data = task.data
    if data["kind"] in ("number", "design"):
        key = {name: str(value).replace(".", ",") for name, value in data["key"].items()}
        assert page.judge(data, key)["right"]
        for text in ("", "one", "1.2.3", "1e400", "--1", "1/0", "1 000"):
            verdict = page.judge(data, {**key, next(iter(key)): text})
            assert verdict.get("refused"), text


# --- results by hand, or by another method of the library ------------------------------------------------------------


def key_of(label):
    return next(iter(BY_LABEL[label].data["key"].values()))


def answer_of(page, label):
    data = BY_LABEL[label].data
    return data["value"] if "value" in data else page.facts(data, {}, data["of"])[0]


def reset_overshoot(way):
    model = pidalab.ipdt(1.0, delay=1.0)
    series = automatic_reset.tune(model, automatic_reset.PIDA_1, n=4, filter_time=0.2).controller
    C = series if way == "reset" else pidalab.HighOrderPID(list(series.gains()), 0.2, 4)
    run = pidalab.simulate_sampled(
        pidalab.Loop(model, C),
        0.01 * np.arange(4001),
        1.0,
        limits=(-0.1, 0.1),
        anti_windup={"none": None, "clamping": "clamping", "reset": None}[way],
    )
    return run.overshoot()


BY_HAND = {
    "task-1-1": lambda: 3 / 1.2,
    "task-3-1": lambda: (lambda ms: ms / (ms - 1))(
        pidalab.max_sensitivity(
            pidalab.Loop(pidalab.lags(3, delay=1.0), pidalab.HighOrderPID([0.4, 1.2, 1.2, 0.4], 0.1, 3))
        )[0]
    ),
    "task-5-1": lambda: 1 + 1 / (2 * 0.2),
    "task-6-2": lambda: abs(13.2 - 2 * np.pi / 0.5),
    "task-haalman2024-2": lambda: np.exp(-1),
    "task-heo2023-1": lambda: 2 * 0.2 / 0.1**2,
    "task-huba2018-1": lambda: np.exp(-1),
    "task-huba2024-2": lambda: 0.0,
    "task-vrancic2021-1": lambda: 2.5 / (0.4 * 2),
}


@pytest.mark.parametrize("label", BY_HAND)
def test_answers_match_the_derivation(page, label):
    assert answer_of(page, label) == pytest.approx(BY_HAND[label](), rel=2e-3, abs=1e-3)


def test_cancelled_lags_match_the_rule(page):
    C = haalman.tune(plant_of("unequal", {}), ms=1.6).controller
    times = BY_LABEL["task-haalman2024-1"].data["near"]
    assert [times[name] for name in ("ti", "td", "ta")] == pytest.approx([C.ti, C.td, C.ta], rel=1e-4)


def test_facts_of_sampled_and_limited_loops_match_the_library(page):
    for label, given in (("task-6-1", {"h": 0.2}), ("task-5-2", {"Tt": 1.5}), ("task-5-2", {"Tt": 5.486})):
        data = BY_LABEL[label].data
        names = list(data["limits"])
        true = [fact(data, {**data["loop"], **given}, given, name) for name in names]
        assert page.facts(data, given, *names) == pytest.approx(true, rel=1e-6, abs=1e-6)


def test_anti_windup_options_have_the_order_of_the_library(page):
    data = BY_LABEL["task-huba2024-1"].data
    overshoots = page.along(data, data["items"], "overshoot")
    library = [reset_overshoot(item["loop"]["way"]) for item in data["items"]]
    assert np.argsort(overshoots).tolist() == np.argsort(library).tolist() == data["key"]["order"]


def test_magnitude_optimum_is_unstable_where_the_library_says(page):
    from pidalab import areas
    from pidalab.rules import magnitude_optimum

    data = BY_LABEL["task-vrancic2021-2"].data
    stable = []
    for option in data["options"]:
        plant = plant_of(option["plant"], {})
        C = magnitude_optimum.tune(areas.from_process(plant, 8), 2, 3, 0.1).controller
        stable.append(pidalab.is_stable(pidalab.Loop(plant, C)))
    assert page.along(data, data["options"], "stable") == stable


@named([task for task in TASKS if "saving" in task.data.get("limits", {})])
def test_savings_match_the_library(page, task):
    asked = {**task.data, **task.data["key"]}
    plant = plant_of(asked["plant"], asked["key"])
    pid, pida = (optimum(plant, order, asked["ms"], asked["noise"]) for order in (1, 2))
    (saving,) = page.facts(task.data, asked["key"], "saving")
    assert saving == pytest.approx(1 - pida / pid, abs=0.005)


def test_loss_matches_the_library(page):
    data = BY_LABEL["task-lab-5"].data
    key, plant = data["key"], data["plants"]["the model"]
    expected = fact(data, key, key, "the model.iae") / optimum(plant_of(plant, key), 2, 1.4, 1.5)
    loss = page.facts({"kind": "design", "plant": plant, "loop": {}}, key, "loss")
    assert loss == pytest.approx([expected], rel=5e-3)


@named([BY_LABEL["task-3-2"], BY_LABEL["task-lab-4"]])
def test_iae_limit_is_a_tenth_above_the_optimum(task):
    data = task.data
    limits = {name.split(".")[-1]: limit for name, limit in data["limits"].items()}
    plant = plant_of(data["plants"]["B"] if "plants" in data else data["plant"], {})
    best = optimum(plant, 2, limits["ms"], limits["noise"])
    assert limits["iae"] == pytest.approx(1.1 * best, rel=2e-3)


# --- bad tasks are refused -------------------------------------------------------------------------------------------


def test_a_task_needs_four_parts():
    with pytest.raises(ValueError, match=r"four parts.*found 3"):
        parts_of("words\n---\nkind: number\n---\nhint")


@named([task for task in TASKS if task.data["kind"] == "number"])
def test_an_unexplained_number_gets_the_first_step(page, task):
    key = key_of(task.label)
    for answer, word in (
        (-7, "above 0" if key else "Too small"),
        (1e9, "Far too large" if key else "Too large"),
    ):
        said = page.judge(task.data, {"answer": answer})["say"]
        assert word in said
        assert task.data["first"] in said


def test_a_filter_may_be_too_long(page):
    assert "a smaller one the loop is stable" in page.judge(BY_LABEL["task-4-1"].data, {"Tf": 3.7})["say"]
    assert "too small" in page.judge(BY_LABEL["task-4-1"].data, {"Tf": 0.001})["say"]


# --- fifty right and wrong answers to each task, by the library -------------------------------------------------------

ANSWERS = 50
SIDE = (-4e-3, 5e-4)  # relative distances to a limit that the page ignores, since answers have three digits


def answers(data, count, seed):
    """Draw answers near the key and far from it."""
    rng = random.Random(seed)
    kind = data["kind"]
    if kind == "choice":
        reasons = range(len(data.get("reasons", [0])))
        return [{"choice": c, "reason": r} for c in range(len(data["options"])) for r in reasons]
    if kind == "order":
        items = list(range(len(data["items"])))
        orders = [rng.sample(items, len(items)) for _ in range(count)]
        return [{"order": order, "reason": rng.randrange(3)} for order in orders]
    spreads = [(0.0, 0.01, 0.05, 0.3, 1.5)[k % 5] for k in range(count)]
    return [
        {name: x * math.exp(rng.gauss(0, spread)) if x else spread for name, x in data["key"].items()}
        for spread in spreads
    ]


def truth(data, given):
    """Return True or False if an answer is right or wrong by the library, None if it is too near to a limit."""
    if data["kind"] == "number":
        key, off = data.get("value", data["key"]["answer"]), data.get("error", 0)
        tolerance = off or data["within"] * abs(key)
        distance = abs(given["answer"] - key)
        return None if abs(distance - tolerance) < 0.1 * tolerance + 1e-3 else distance < tolerance
    if data["kind"] in ("choice", "order"):
        right = given[data["kind"]] == data["key"][data["kind"]]
        return right and ("reasons" not in data or given["reason"] == data["key"]["reason"])
    if "near" in data:
        shares = [abs(given[name] / x - 1) / data["within"] for name, x in data["near"].items()]
        return None if any(abs(share - 1) < 0.05 for share in shares) else max(shares) < 1
    loop = {**data.get("loop", {}), **given}
    if "edge" in data:
        shorter = [{**loop, "Tf": share * loop["Tf"]} for share in (1, 0.97)]
        loops = [pidalab.Loop(plant_of(data["plant"], each), controller_of(each)) for each in shorter]
        return [pidalab.is_stable(each) for each in loops] == [True, False]
    verdict, sides = True, ((1, data.get("limits", {})), (-1, data.get("least", {})))
    for side, name, limit in [(side, *each) for side, limits in sides for each in limits.items()]:
        room = side * (limit - fact(data, loop, given, name)) / limit
        if SIDE[0] < room < SIDE[1]:
            return None
        verdict = verdict and room > 0
    return verdict


def fact(data, loop, given, name):
    """Return one fact of a loop by the library, infinite for an unstable loop."""
    where, _, which = name.rpartition(".")
    plant, C = plant_of(data["plants"][where] if where else data["plant"], given), controller_of(loop)
    if "u0" in loop:
        way = {"anti_windup": "back-calculation", "tracking_time": loop["Tt"]}
        C = C.discretise(loop["h"], limits=(-loop["u0"], loop["u0"]), **way)
        run = pidalab.simulate_sampled(pidalab.Loop(plant, C), loop["h"] * np.arange(3001), 1.0)
        return run.overshoot() if which == "overshoot" else run.iae()
    run_loop = pidalab.Loop(plant, C.discretise(loop["h"]) if loop.get("sampled") else C)
    if not pidalab.is_stable(run_loop):
        return math.inf
    if which == "noise":
        return pidalab.relative_noise_gain(run_loop)
    if which == "iae":
        end = 40 * (plant.den[-2] / plant.den[-1] + plant.delay)
        return pidalab.load_response(run_loop, np.linspace(0, end, 4001)).iae()
    return getattr(pidalab.margins(run_loop), which)


def optimum(plant, order, ms, noise):
    limit = noise * pidalab.noise_scale(plant).gain
    return pidalab.optimal.load(plant, order, ms=ms, noise_gain=limit).iae


@named(QUICK)
def test_fifty_answers_are_judged_as_by_the_library(page, task):
    data, judged = task.data, {True: 0, False: 0}
    for given in answers(data, ANSWERS, task.label):
        true = truth(data, given)
        if true is None:
            continue
        verdict = page.judge(data, given)
        assert verdict["right"] is true, (given, verdict["say"])
        assert verdict["say"]
        judged[true] += 1
    assert min(judged.values()) >= 1


@pytest.mark.parametrize("share", [0.978, 0.987, 0.991])
def test_the_edge_of_stability_is_approached_from_the_stable_side(page, share):
    verdict = page.judge(BY_LABEL["task-4-1"].data, {"Tf": 0.0227 * share})
    assert not verdict["right"]
    assert "the loop is unstable" in verdict["say"]
