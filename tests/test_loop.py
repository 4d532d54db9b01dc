"""Loop: its transfer functions against block algebra at random complex frequencies, and every refusal."""

import copy
import pickle

import control
import numpy as np
import pytest

import pidalab
from pidalab.loop import require_well_posed

RNG = np.random.default_rng(3)
POINTS = RNG.normal(size=20) + 1j * RNG.normal(size=20)
PROCESS = pidalab.Process([1.0, 3.0], [1.0, 2.0, 4.0], delay=0.4)
CONTROLLER = pidalab.PIDA(1.5, 2.0, 0.3, 0.1)
FILTER, PREFILTER = control.tf([1.0], [0.05, 1.0]), control.tf([0.5, 1.0], [2.0, 1.0])
LOOP = pidalab.Loop(PROCESS, CONTROLLER, FILTER, PREFILTER)


def solve(r, d, n, s):
    """Solve the block diagram as linear equations: y = P (u + d), u = C F (R r - y - n)."""
    P, C, R = PROCESS(s), CONTROLLER(s) * FILTER(s), PREFILTER(s)
    y, u = np.linalg.solve([[1, -P], [C, 1]], [P * d, C * (R * r - n)])
    return {"y": y, "u": u, "e": r - y}


@pytest.mark.parametrize("source", ["r", "d", "n"])
@pytest.mark.parametrize("output", ["y", "u", "e"])
def test_transfer_functions_solve_the_block_diagram(output, source):
    expected = [solve(*[float(source == name) for name in "rdn"], s)[output] for s in POINTS]
    np.testing.assert_allclose(LOOP.transfer(output, source, POINTS), expected, rtol=1e-10)


def test_loop_and_sensitivities():
    L = PROCESS(POINTS) * CONTROLLER(POINTS) * FILTER(POINTS)
    np.testing.assert_allclose(LOOP.L(POINTS), L, rtol=1e-12)
    np.testing.assert_allclose(LOOP.S(POINTS), 1 / (1 + L), rtol=1e-11)
    np.testing.assert_allclose(LOOP.T(POINTS), L / (1 + L), rtol=1e-11)
    np.testing.assert_allclose(LOOP.S(POINTS) + LOOP.T(POINTS), 1.0, rtol=1e-11)


def test_integral_action_has_no_error_at_zero_frequency():
    """S(0) = 0 and T(0) = 1: the limit, not a division by zero."""
    assert abs(LOOP.S(0.0)) == pytest.approx(0.0, abs=1e-12)
    assert abs(LOOP.T(0.0)) == pytest.approx(1.0)


def test_integral_action_has_no_error_near_zero_frequency():
    assert abs(LOOP.S(1e-9j)) < 1e-8
    assert LOOP.transfer("y", "r", 1e-9j) == pytest.approx(1.0, abs=1e-8)
    assert abs(LOOP.transfer("y", "d", 1e-9j)) < 1e-8


def test_closed_loop_is_that_of_python_control_without_dead_time():
    plant = control.tf([1.0, 3.0], [1.0, 2.0, 4.0])
    loop = pidalab.Loop(plant, CONTROLLER, FILTER)
    closed = control.feedback(plant * CONTROLLER.transfer_function() * FILTER)
    np.testing.assert_allclose(loop.T(POINTS), closed(POINTS), rtol=1e-9)
    np.testing.assert_allclose(loop.transfer("y", "r", POINTS), closed(POINTS), rtol=1e-9)


def test_block_is_the_rational_part():
    np.testing.assert_allclose(LOOP.block("process", POINTS), PROCESS.rational_part()(POINTS), rtol=1e-12)
    np.testing.assert_allclose(LOOP.block("prefilter", POINTS), PREFILTER(POINTS), rtol=1e-12)


@pytest.mark.parametrize(
    "controller",
    [2, 2.0, np.float64(2.0), control.tf([2.0], [1.0]), control.ss([], [], [], [[2.0]])],
    ids=repr,
)
def test_what_may_be_a_controller(controller):
    np.testing.assert_allclose(pidalab.Loop(PROCESS, controller).L(POINTS), 2 * PROCESS(POINTS), rtol=1e-13)


def test_repr_names_what_is_there():
    assert (
        repr(pidalab.Loop(pidalab.ipdt(1.0, 1.0), 0.5)) == "Loop(Process(num=[1], den=[1, 0], delay=1), 0.5)"
    )
    assert "prefilter=" in repr(LOOP)
    assert "output_filter=" in repr(LOOP)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"controller": "PI"}, TypeError, "controller must be a number, a pidalab controller or .* found str"),
        ({"controller": 1j}, TypeError, "controller must be a number, .* found complex"),
        ({"controller": control.tf([1.0, 0.0], [1.0])}, ValueError, "controller must be proper .* degrees 1 and 0"),
        ({"controller": np.nan}, ValueError, "controller.num must be finite, found nan"),
        ({"controller": control.tf([1.0], [1.0, 0.5], 0.1)}, ValueError, r"controller must be continuous .* 0\.1"),
        ({"output_filter": control.tf([1.0, 1.0], [1.0])}, ValueError, "output_filter must be proper"),
        ({"prefilter": control.tf([1.0], [1.0, -2.0])}, ValueError, "prefilter must be stable, found a pole at 2"),
        ({"prefilter": control.tf([1.0], [1.0, 0.0])}, ValueError, "prefilter must be stable, found a pole at 0"),
        ({"process": "P"}, TypeError, "process must be a number, .* found str"),
        ({"process": control.tf([1.0, 0.0, 0.0], [1.0, 1.0])}, ValueError, "process must be proper .* degrees 2 and 1"),
    ],
    ids=["text", "complex", "improper", "nan", "z", "filter", "prefilter", "integrates", "process", "degree"],
)  # fmt: skip
def test_loop_complains(arguments, error, message):
    with pytest.raises(error, match=message):
        pidalab.Loop(**({"process": PROCESS, "controller": CONTROLLER} | arguments))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: LOOP.transfer("x", "r", 1j), "output must be 'y', 'u' or 'e', found 'x'"),
        (lambda: LOOP.transfer("y", "v", 1j), "source must be 'r', 'd' or 'n', found 'v'"),
        (
            lambda: LOOP.block("plant", 1j),
            "name must be one of process, controller, output_filter, prefilter, found 'plant'",
        ),
    ],
    ids=["output", "source", "block"],
)
def test_unknown_names(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize(
    "name", ["process", "controller", "prefilter", "output_filter", "blocks", "open_loop", "new"]
)
def test_a_loop_does_not_change(name):
    """Half a change would be wrong in silence: the new dead time with the old gain."""
    loop = pidalab.Loop(PROCESS, 0.5)
    with pytest.raises(AttributeError, match="a Loop does not change; make a new one"):
        setattr(loop, name, pidalab.ipdt(5.0, 2.0))
    with pytest.raises(TypeError, match="does not support item assignment"):
        loop.blocks["process"] = loop.blocks["controller"]
    for num, den in (*loop.blocks.values(), loop.open_loop):
        for array in (num, den):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 2.0


def test_a_loop_travels():
    for other in (pickle.loads(pickle.dumps(LOOP)), copy.deepcopy(LOOP)):
        np.testing.assert_array_equal(other.L(POINTS), LOOP.L(POINTS))
        assert other.process == LOOP.process


def test_frequencies_of_a_plot_lie_around_the_corners():
    loop = pidalab.Loop(pidalab.Process([1.0], np.convolve([10.0, 1.0], [0.01, 1.0])), 1.0)
    w = loop.frequency_response().omega
    assert np.allclose([w[0], w[-1]], [0.01, 1000.0])


@pytest.mark.parametrize(
    ("process", "controller"),
    [
        (pidalab.Process([-1.0], [1.0, 2.0]), 1.0),  # a lag: its first coefficients alone are -1
        (pidalab.Process([-1.0], [1.0], delay=0.5), control.tf([0.5], [1.0, 1.0])),
        (pidalab.Process([-1.0], [1.0], delay=0.5), 1.0),
    ],
)
def test_minus_one_without_dead_time_and_at_once_is_ill_posed_and_nothing_else(process, controller):
    require_well_posed(pidalab.Loop(process, controller))
    with pytest.raises(ValueError, match="ill-posed"):
        require_well_posed(pidalab.Loop(pidalab.Process([-1.0, 3.0], [1.0, 2.0]), 1.0))


def test_limits_are_those_of_the_controller_seen_from_rest():
    """A valve of 0 to 100 % that rests at 40 % can close by 0.4 and open by 0.6 of its travel."""
    valve = pidalab.PIDA(1.0, 2.0).discretise(0.1, limits=(0.0, 100.0), bias=40.0, u_span=100.0)
    assert pidalab.Loop(pidalab.lags(2), valve).limits == pytest.approx((-0.4, 0.6))
    series = pidalab.SeriesPIDA(1.0, 0.5, 0.0, 2.0, 0.1, 2, limits=(-1.0, 3.0))
    assert pidalab.Loop(pidalab.lags(2), series).limits == (-1.0, 3.0)
    assert pidalab.Loop(pidalab.lags(2), pidalab.PIDA(1.0, 2.0)).limits == (-np.inf, np.inf)
