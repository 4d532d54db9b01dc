"""Each step of the exact engine against dense matrices: ring elements, stacks, what outputs read, what is refused."""

import math
from fractions import Fraction
from types import FunctionType, SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import expm

import pidalab
from pidalab._compiled import Kernel
from pidalab.simulation import ladder, ring, stacks
from pidalab.simulation.realisation import cut_at_delay
from pidalab.simulation.ring import DROPPED

ORDER, AGES = 3, 12
SYSTEMS = {"retarded": 0.0, "neutral": 0.02}  # by the size of the matrix that comes back at once


def as_loops(value, made):
    """What numba compiles, run by the interpreter, which tests each index; and so all that it calls."""
    if not isinstance(value, Kernel):
        return value
    if id(value) not in made:
        names = dict(value.function.__globals__)
        made[id(value)] = FunctionType(
            value.function.__code__, names, value.__name__, value.function.__defaults__
        )
        names.update({name: as_loops(one, made) for name, one in names.items()})
    return made[id(value)]


@pytest.fixture(scope="module", params=["arrays", "loops"])
def engine(request):
    """All functions of both modules, in one of their forms, neither compiled."""
    every, made = vars(ring) | vars(stacks), {}
    every = {name: one for name, one in every.items() if isinstance(one, Kernel)}
    return SimpleNamespace(
        **{
            name: one.python_form if request.param == "arrays" else as_loops(one, made)
            for name, one in every.items()
        }
    )


@pytest.fixture(params=SYSTEMS.values(), ids=SYSTEMS.keys())
def system(request):
    """Matrices of a cut loop: A, B, Cv, D, of three states and two channels."""
    rng = np.random.default_rng(3)
    A, B, Cv, D = (rng.normal(size=size) for size in ((3, 3), (3, 2), (2, 3), (2, 2)))
    A[0, 1] = B[1, 0] = 0.0
    return A, B, Cv, request.param * D


def toeplitz(system, ages=AGES):
    """The matrix of all states, the youngest first: each age is driven by itself and by all that are older."""
    A, B, Cv, D = system
    blocks = [A, *(B @ np.linalg.matrix_power(D, k) @ Cv for k in range(ages - 1))]
    out = np.zeros((ages * ORDER, ages * ORDER))
    for i in range(ages):
        for k in range(ages - i):
            out[i * ORDER : (i + 1) * ORDER, (i + k) * ORDER : (i + k + 1) * ORDER] = blocks[k]
    return out


def dense(element, ages=AGES):
    """The matrix of a ring element, 1 added."""
    out = np.eye(ages * ORDER)
    for i in range(ages):
        for k in range(min(ages - i, element.shape[1] // ORDER)):
            block = element[:, k * ORDER : (k + 1) * ORDER].T
            out[i * ORDER : (i + 1) * ORDER, (i + k) * ORDER : (i + k + 1) * ORDER] += block
    return out


def coefficients(element):
    """The largest number of each coefficient."""
    return np.abs(element).reshape(ORDER, -1, ORDER).max(axis=(0, 2))


def test_an_element_is_the_exponential_and_as_long_as_it_matters(engine, system):
    matrix = toeplitz(system, 40)
    norm = float(np.abs(matrix).sum(axis=0).max())
    rungs, low = engine.ladder(*system, norm, 0.7, 2, 40)
    assert norm * 0.7 * 2.0**low <= 0.5 < norm * 0.7 * 2.0 ** (low + 1)
    assert len(rungs) == 2 - low + 1
    for p, rung in enumerate(rungs):
        exact = expm(0.7 * 2.0 ** (low + p) * matrix)
        np.testing.assert_allclose(dense(rung, 40), exact, rtol=0, atol=1e-12 * np.abs(exact).max())
        sizes = coefficients(rung)
        np.testing.assert_array_equal(engine.sizes(rung), sizes)
        assert p == 0 or sizes[-1] > DROPPED * sizes.max()
    assert len(coefficients(rungs[1])) < len(coefficients(rungs[-1]))
    assert len(coefficients(rungs[0])) <= 15 + 25 * system[3].any()  # one age more in each of 14 terms
    none, _ = engine.ladder(*system, 1e300, 10.0, 2, 40)
    assert len(none) == 0  # leaves the range of numbers


@pytest.mark.parametrize("tau", [0.7 * 5, 0.7 * 5.3, 0.7 * 0.01, 0.7 * 7])
def test_the_exponential_over_any_time_comes_from_the_rungs(engine, system, tau):
    norm = float(np.abs(toeplitz(system)).sum(axis=0).max())
    rungs, low = engine.ladder(*system, norm, 0.7, 1, AGES)
    found, exact = dense(engine.transition(rungs, 0.7, low, tau, AGES, *system)), expm(tau * toeplitz(system))
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-11 * np.abs(exact).max())


@pytest.mark.parametrize(
    ("step", "top", "tau"), [(1.0, 0, 1.618), (0.3, 1, 0.7), (0.01, 5, 0.5), (0.1, 0, 0.1)]
)
def test_a_time_is_made_of_rungs_that_are_longer_than_its_rounding(step, top, tau):
    """Shorter ones would take back what rounding left, and some of 1e-30 of the time never end with it.

    In place of elements: the durations that they have together, and the shortest.
    """
    run, low, dust = as_loops(ring.transition, {}), -60, 8 * 2.0**-52 * tau
    run.__globals__.update(
        product=lambda rung, out, _: np.array([[rung[0, 0] + out[0, 0], min(rung[0, 1], out[0, 1])]]),
        taylor=lambda rest, *_: np.array([[rest, rest]]),
    )
    rungs = [np.full((1, 2), step * 2.0**p) for p in range(low, top + 1)]
    ((whole, shortest),) = run(rungs, step, low, tau, 1, *np.zeros((4, 1, 1)))
    assert abs(whole - tau) <= dust < shortest


def element(rng, ages, fading):
    """A ring element whose coefficients fade by a factor."""
    return np.concatenate([rng.normal(size=(ORDER, ORDER)) * fading**k for k in range(ages)], axis=1)


@pytest.mark.parametrize(("ages", "fading"), [((1, 1), 1.0), ((2, 5), 0.7), ((6, 3), 1e-6), ((6, 6), 1e-9)])
@pytest.mark.parametrize("most", [4, AGES])
def test_a_product_is_that_of_matrices_and_lacks_what_does_not_matter_alone(engine, ages, fading, most):
    rng = np.random.default_rng(7)
    first, second = (element(rng, one, fading) for one in ages)
    found = engine.product(first, second, most)
    # states are rows: what acts last stands on the right
    exact = dense(second) @ dense(first) - np.eye(AGES * ORDER)
    whole = np.concatenate([exact[:ORDER, k * ORDER : (k + 1) * ORDER].T for k in range(AGES)], axis=1)
    kept, sizes = found.shape[1] // ORDER, coefficients(whole)
    np.testing.assert_allclose(found, whole[:, : found.shape[1]], rtol=1e-12, atol=1e-14 * sizes.max())
    length = min(most, sum(ages) - 1)
    assert kept <= length
    assert kept == length or sizes[kept:length].max() <= DROPPED * sizes.max() * (1 + 1e-9)
    assert kept == 1 or coefficients(found)[-1] > DROPPED * sizes.max()


@pytest.mark.parametrize("drops", [0, 1, 3])
def test_the_last_coefficients_go_where_they_are_below_a_share(engine, drops):
    whole = np.concatenate([np.full((2, 2), x) for x in (1.0, 1e-30, 0.5, *[1e-27] * drops)], axis=1)
    found = engine.shortened(whole, DROPPED)
    np.testing.assert_array_equal(found, whole[:, :6])
    np.testing.assert_array_equal(engine.shortened(np.zeros((2, 6)), DROPPED), np.zeros((2, 2)))
    np.testing.assert_array_equal(engine.shortened(whole, 0.6), whole[:, :2])


@pytest.mark.parametrize("ages", [1, 4, AGES])
def test_a_stack_moves_on_as_its_matrix_says(engine, system, ages):
    rng = np.random.default_rng(5)
    stack, rung = rng.normal(size=ages * ORDER), engine.taylor(0.1, AGES, *system)
    youngest_first = stack.reshape(ages, ORDER)[::-1].ravel()
    exact = (dense(rung, ages) @ youngest_first).reshape(ages, ORDER)[::-1].ravel()
    for keep in {1, (ages + 1) // 2, ages}:
        found = engine.advanced(stack, ORDER, rung, keep)
        np.testing.assert_allclose(found, exact[-keep * ORDER :], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_the_series_of_derivatives_carries_a_stack(engine, system, share):
    """States at ten multiples of the dead time, each carried on by a share of a span: as the exponential does."""
    rng = np.random.default_rng(11)
    states, delta, terms = rng.normal(size=(10, ORDER)), 0.2, np.zeros((26, 10 * ORDER))
    delayed = np.zeros((26, 2))
    places, numbers = engine.nonzero(system[0])
    for k in range(10):
        terms[0, k * ORDER : (k + 1) * ORDER] = states[k]
        engine.derive(terms, k * ORDER, delta, system[0], places, numbers, *system[1:], delayed)
    exact = expm(share * delta * toeplitz(system, 10)) @ states[::-1].ravel()
    exact = exact.reshape(10, ORDER)[::-1].ravel()
    for start in (0, 4 * ORDER):
        found = engine.summed(terms, start, 10 * ORDER, share)
        np.testing.assert_allclose(found, exact[start:], rtol=1e-11, atol=1e-11)
    few = terms[:3]  # fewer than four at a time
    by_hand = few[0] + share * few[1] + share**2 * few[2]
    np.testing.assert_allclose(engine.summed(few, 0, 10 * ORDER, share), by_hand, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("run", [1, 2, 5, 8])
@pytest.mark.parametrize("through", [False, True], ids=["apart", "through"])
def test_what_outputs_read_at_times_in_succession(engine, system, run, through):
    """The rows of the outputs, times powers of the matrix of one step; the oldest ages are left out where they fade."""
    rng = np.random.default_rng(13)
    Cv, D = system[2:]
    C, direct = rng.normal(size=(3, ORDER)), through * rng.normal(size=(3, 2))
    rungs = [engine.taylor(0.05, AGES, *system)]
    for _ in range(3):
        rungs.append(engine.product(rungs[-1], rungs[-1], AGES))
    found = engine.output_rows(C, direct, Cv, D, AGES, run, [np.zeros((1, 1)), *rungs], 1)
    row = np.zeros((3, AGES, ORDER))
    row[:, 0] = C
    for age in range(1, AGES):
        row[:, age] = direct @ np.linalg.matrix_power(D, age - 1) @ Cv
    row, step = row.reshape(3, -1), dense(rungs[0])
    exact = np.concatenate(
        [row @ np.linalg.matrix_power(step, m) for m in range(run)]
    )  # (times and outputs, ages)
    kept = found.shape[0] // ORDER
    youngest_first = found.reshape(kept, ORDER, -1)[::-1].reshape(kept * ORDER, -1).T
    scale = np.abs(exact).max()
    np.testing.assert_allclose(youngest_first, exact[:, : kept * ORDER], rtol=1e-10, atol=1e-13 * scale)
    rest = exact[:, kept * ORDER :]
    assert not rest.size or np.abs(rest).max() <= 1e-20 * scale
    of_each = np.abs(youngest_first).reshape(run, 3, kept, ORDER).max(axis=(0, 3))
    assert kept == 1 or np.any(of_each[:, -1] > DROPPED * of_each.max(axis=1))


def test_what_outputs_read_does_not_depend_on_their_units(engine, system):
    """y in units of 1e30 and u in units of 1e-30 read as many ages, by the same numbers."""
    rng = np.random.default_rng(23)
    C, direct = rng.normal(size=(3, ORDER)), rng.normal(size=(3, 2))
    rungs = [engine.taylor(0.01, 40, *system)]
    rungs.append(engine.product(*rungs * 2, 40))
    units = np.array([2.0**-100, 1.0, 2.0**100])
    plain, other = (
        engine.output_rows(unit[:, None] * C, unit[:, None] * direct, *system[2:], 40, 3, rungs, 0)
        for unit in (np.ones(3), units)
    )
    assert 1 < plain.shape[0] // ORDER < 40
    np.testing.assert_array_equal(other, plain * np.tile(units, 3))


@pytest.mark.parametrize(("step", "delay"), [(0.1, 0.7), (0.1, 0.3), (0.3, 1.0), (1.0, 0.37), (1e-3, 1 / 3)])
def test_the_first_time_after_each_dead_time(engine, step, delay):
    """By fractions of the numbers as they were meant, where a time and a multiple may be the same."""
    exact = [Fraction(x).limit_denominator(1000) for x in (step, delay)]
    for k in range(60):
        assert engine.first_time(k, step, delay) == math.ceil(k * exact[1] / exact[0]), k


def test_ages_that_runs_need_are_those_of_their_binary_digits_and_never_fewer_than_before(engine):
    rungs = [np.zeros((2, 2 * reach)) for reach in (9, 4, 6, 3)]
    found = engine.ages_needed(5, rungs, 2, 1, 9)
    #                          0  1  2   3     4  5: 4 + 1   6: 4 + 2   7           8 is above the highest rung
    by_digits = [5, 5 + 3, 5 + 5, 5 + 8, 5 + 2, 5 + 5, 5 + 7, 5 + 10, 5, 5 + 3]
    assert found.tolist() == np.maximum.accumulate(by_digits).tolist()


@pytest.mark.parametrize(("rows", "columns"), [(3, 2), (4, 5), (7, 8), (2, 1)])
def test_sums_of_rows_are_products_of_matrices(engine, rows, columns):
    """For odd and even numbers of rows, and for some of the columns of an array."""
    rng = np.random.default_rng(17)
    factors, table = rng.normal(size=(rows, rows + 2)), rng.normal(size=(rows + 3, columns + 2))
    out = np.ones(columns)
    engine.add_rows(out, factors[0, :rows], table, 2, 1)
    expected = 1.0 + factors[0, :rows] @ table[2 : 2 + rows, 1 : 1 + columns]
    np.testing.assert_allclose(out, expected, rtol=1e-12, atol=1e-13)
    out, expected = (np.ones((rows + 1, columns + 3)) for _ in range(2))
    engine.add_product(out, (2, columns), factors, 1, rows, table, 3)
    expected[:rows, 2 : 2 + columns] += factors[:, 1 : 1 + rows] @ table[3 : 3 + rows, :columns]
    np.testing.assert_allclose(out, expected, rtol=1e-12, atol=1e-13)
    np.testing.assert_array_equal(engine.tops(-table), np.abs(table).max(axis=0))
    for wide in (columns, columns + 4):
        out, expected, other = (
            *(np.ones((rows, columns + 2)) for _ in range(2)),
            rng.normal(size=(rows, wide)),
        )
        engine.add(out, other)
        expected[:, : min(wide, columns + 2)] += other[:, : columns + 2]
        np.testing.assert_array_equal(out, expected)


CUT = cut_at_delay(pidalab.Loop(pidalab.fopdt(1.0, 1.0, 0.5), pidalab.PIDA(0.5, 2.0)), "r")


@pytest.mark.parametrize(
    ("status", "numbers"),
    [
        (ladder.TOO_MANY, ("spans 4.2 dead times",)),
        (ladder.TOO_DEEP, ("at most 1000 dead times", "found 4;")),
        (ladder.TOO_LARGE, ("leaves the range of numbers",)),
    ],
)
def test_what_cannot_be_followed_is_refused_with_its_numbers(monkeypatch, status, numbers):
    """Eight times in steps of 0.3 are 4.2 dead times of 0.5."""
    assert CUT.x0.shape[0] == 4
    monkeypatch.setattr(ladder, "_responses", lambda *_: (None, 77, status))
    with pytest.raises(ValueError) as refused:  # noqa: PT011  # its numbers follow
        ladder.responses(CUT, 8, 0.3, 4.0)
    for number in numbers:
        assert number in str(refused.value)
    assert isinstance(refused.value, ladder.ManyDeadTimes) is (status == ladder.TOO_MANY)


@pytest.mark.parametrize(
    ("n", "step", "td"),
    [(60, 0.03, 0.0), (30, 0.31, 0.0), (25, 0.03, 0.1)],
    ids=["inside_dead_times", "across_them", "to_the_first_time"],
)
def test_work_is_followed_to_the_last_multiplication_that_is_allowed(n, step, td):
    """All multiplications of stacks, or of states at the multiples of the dead time, are counted as they are made."""
    cut = cut_at_delay(pidalab.Loop(pidalab.fopdt(1.0, 1.0, 0.5), pidalab.PIDA(0.5, 2.0, td, n=100)), "rd")
    given = (cut, step, n, ladder._intervals(cut, n, step), ladder.norm_over(cut, n, step))
    run, made = as_loops(ladder._responses, {}), {"inside": 0, "across": 0}
    names = run.__globals__
    advanced, transition, climb = names["advanced"], names["transition"], names["ladder"]

    def counting(stack, order, rung, keep):
        made["inside"] += stack.size * rung.shape[1]
        return advanced(stack, order, rung, keep)

    def sizing(*arguments):
        whole = transition(*arguments)
        made["across"] = given[-2] * cut.x0.shape[1] * whole.size
        return whole

    def climbing(*arguments):
        # the highest rung is the longest that fits into a dead time: what is carried on by it is not longer
        top = arguments[-2]
        assert 0.5 * cut.delay < step * 2.0**top <= cut.delay
        return climb(*arguments)

    names.update(advanced=counting, transition=sizing, ladder=climbing)
    found, _, status = run(*given)
    assert status == ladder.DONE
    np.testing.assert_allclose(found, ladder.responses(cut, n, step, given[-1]), rtol=1e-12, atol=1e-13)
    most = max(made.values())
    for allowed, then in ((most, ladder.DONE), (most - 1, ladder.TOO_MANY)):
        names["MAX_WORK"] = allowed
        assert run(*given)[2] == then


@pytest.mark.parametrize(
    ("loop", "step", "allowed"),
    [
        (pidalab.Loop(pidalab.fopdt(1.0, 1.0, 0.3713), pidalab.PIDA(0.1, 0.9, 0.3, 0.02)), 0.3713, 30),
        (pidalab.Loop(pidalab.fopdt(1.0, 1.0, 0.5), pidalab.PIDA(0.5, 2.0)), 0.51 * 0.5, 17),
    ],
    ids=["farther_inside_a_dead_time", "farther_across_it"],
)
def test_what_is_remembered_is_followed_over_as_many_dead_times_as_allowed(monkeypatch, loop, step, allowed):
    """Inside a dead time the first loop remembers more than 60 others, across one 28; the second one 15 and 17."""
    cut = cut_at_delay(loop, "r")

    def respond(intervals):
        n = math.ceil(intervals * cut.delay / step) + 1
        assert ladder._intervals(cut, n, step) == intervals
        return ladder.responses(cut, n, step, ladder.norm_over(cut, n, step))

    monkeypatch.setattr(ladder, "_responses", ladder._responses.python_form)
    without_limit = respond(allowed)
    for names in (vars(ladder), ladder._responses.__globals__):
        monkeypatch.setitem(names, "MAX_STACK", allowed * cut.x0.shape[0])
    np.testing.assert_array_equal(respond(allowed), without_limit)
    with pytest.raises(ValueError, match=rf"at most {allowed} dead times .* found {allowed + 1}; shorten t"):
        respond(allowed + 1)


def test_dead_times_that_end_within_the_times_are_counted_to_rounding():
    """A time as close to a multiple as rounding is that multiple."""
    cut = CUT._replace(delay=0.3)
    assert [ladder._intervals(cut, n, 0.1) for n in (1, 3, 4, 6, 7, 10)] == [0, 0, 1, 1, 2, 3]
    assert ladder._intervals(CUT._replace(delay=0.0), 10, 0.1) == 0
    most = int(ladder.MAX_ANCHORS) // CUT.x0.shape[0]
    assert ladder._intervals(CUT, most, 0.5) == most - 1
    with pytest.raises(ladder.ManyDeadTimes, match=r"spans 2\.5e\+06 dead times"):
        ladder._intervals(CUT, most + 1, 0.5)


@pytest.mark.parametrize("n", [2, 40])
def test_the_norm_bounds_the_matrix_of_all_ages(n):
    """No column of the matrix of all states that follow each other has a larger sum."""
    rng = np.random.default_rng(19)
    A, B, Cv, D = (rng.normal(size=size) for size in ((3, 3), (3, 2), (2, 3), (2, 2)))
    cut = CUT._replace(A=A, B=B, Cv=Cv, D=0.3 * D, delay=0.5)
    ages = ladder._intervals(cut, n, 0.5) + 1
    exact = np.abs(toeplitz((A, B, Cv, 0.3 * D), ages)).sum(axis=0).max()
    bound = ladder.norm_over(cut, n, 0.5)
    assert exact <= bound * (1 + 1e-12)
    through = np.abs(Cv) + sum(
        np.linalg.matrix_power(np.abs(0.3 * D), k) @ np.abs(Cv) for k in range(1, 2 * ages)
    )
    assert bound <= (np.abs(A) + np.abs(B) @ through).sum(axis=0).max() * (1 + 1e-12)
