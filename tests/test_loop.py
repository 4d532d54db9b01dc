"""Compare a loop's transfer functions with block algebra at random complex frequencies."""

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
    for transfer, expected in ((LOOP.L, L), (LOOP.S, 1 / (1 + L)), (LOOP.T, L / (1 + L))):
        np.testing.assert_allclose(transfer(POINTS), expected, rtol=1e-11)


@pytest.mark.parametrize(
    ("process", "y_of_d", "u_of_r"),
    [(pidalab.fopdt(4.0, 2.0, 1.0), 0.0, 0.25), (pidalab.ipdt(4.0, 1.0), 0.0, 0.0)],
)
def test_transfer_functions_at_a_pole_of_a_block_are_their_limits(process, y_of_d, u_of_r):
    """At s = 0 controller and plant may be infinite, and the closed loop is finite."""
    loop = pidalab.Loop(process, pidalab.PIDA(0.1, 8.0), FILTER, PREFILTER)
    answers = {"y": (1.0, y_of_d, -1.0), "u": (u_of_r, -1.0, -u_of_r), "e": (0.0, -y_of_d, 1.0)}
    for output, expected in answers.items():
        assert [loop.transfer(output, source, 0.0) for source in "rdn"] == pytest.approx(expected, abs=1e-15)
    # Without integral action an integrator leaves an error after a load step.
    alone = pidalab.Loop(pidalab.ipdt(4.0, 1.0), 0.1)
    assert alone.transfer("y", "d", [0.0, 1e-9j]) == pytest.approx(10.0)


@pytest.mark.parametrize(
    "controller",
    [2, 2.0, np.float64(2.0), control.tf([2.0], [1.0])],
    ids=repr,
)
def test_numbers_and_transfer_functions_are_controllers(controller):
    np.testing.assert_allclose(pidalab.Loop(PROCESS, controller).L(POINTS), 2 * PROCESS(POINTS), rtol=1e-13)


def test_repr_names_what_is_there():
    assert (
        repr(pidalab.Loop(pidalab.ipdt(1.0, 1.0), 0.5)) == "Loop(Process(num=[1], den=[1, 0], delay=1), 0.5)"
    )
    assert "prefilter=" in repr(LOOP)
    assert "output_filter=" in repr(LOOP)


@pytest.mark.parametrize("name", ["process", "blocks", "open_loop", "new"])
def test_a_loop_is_immutable(name):
    """A partial change would give wrong results: the new dead time with the old gain."""
    loop = pidalab.Loop(PROCESS, 0.5)
    with pytest.raises(AttributeError, match="a Loop cannot be changed; make a new one"):
        setattr(loop, name, pidalab.ipdt(5.0, 2.0))
    with pytest.raises(TypeError, match="item assignment"):
        loop.blocks["process"] = loop.blocks["controller"]
    with pytest.raises(ValueError, match="read-only"):
        loop.open_loop[0][0] = 2.0


def test_a_loop_can_be_pickled_and_copied():
    for other in (pickle.loads(pickle.dumps(LOOP)), copy.deepcopy(LOOP)):
        np.testing.assert_array_equal(other.L(POINTS), LOOP.L(POINTS))
        assert other.process == LOOP.process


@pytest.mark.parametrize(
    ("process", "controller"),
    [
        (pidalab.Process([-1.0], [1.0, 2.0]), 1.0),  # a lag: its first coefficients alone are -1
        (pidalab.Process([-1.0], [1.0], delay=0.5), control.tf([0.5], [1.0, 1.0])),
        (pidalab.Process([-1.0], [1.0], delay=0.5), 1.0),
    ],
)
def test_only_a_direct_feedthrough_of_minus_one_is_ill_posed(process, controller):
    require_well_posed(pidalab.Loop(process, controller))
    with pytest.raises(ValueError, match="ill-posed"):
        require_well_posed(pidalab.Loop(pidalab.Process([-1.0, 3.0], [1.0, 2.0]), 1.0))


def test_limits_are_those_of_the_controller_seen_from_rest():
    """A valve that rests at 40 % can close by 40 % and open by 60 %."""
    valve = pidalab.PIDA(1.0, 2.0).discretise(0.1, limits=(0.0, 100.0), bias=40.0)
    assert pidalab.Loop(pidalab.lags(2), valve).limits == pytest.approx((-40.0, 60.0))
    series = pidalab.SeriesPIDA(1.0, 0.5, 0.0, 2.0, 0.1, 2, limits=(-1.0, 3.0))
    assert pidalab.Loop(pidalab.lags(2), series).limits == (-1.0, 3.0)
    assert pidalab.Loop(pidalab.lags(2), pidalab.PIDA(1.0, 2.0)).limits == (-np.inf, np.inf)


@pytest.mark.parametrize("delay", [0.0, 0.5, 20.0])
def test_frequencies_of_a_plot_in_closed_form(delay):
    """They span from a decade below the slowest corner to one above the fastest, at most two turns of the dead time."""
    loop = pidalab.Loop(
        pidalab.Process([3.0, 1.0], [4.0, 5.0, 1.0], delay), control.tf([1.0], [0.02, 1.0, 0.0])
    )
    corners = [1.0, 0.25, 1 / 3, 50.0] + ([1 / delay] if delay else [])
    w = loop.frequency_response().omega
    top = 10 * max(corners)
    assert w[0] == pytest.approx(0.1 * min(corners))
    assert np.all(np.diff(w) > 0)
    assert np.max(np.diff(np.log(w))) <= np.log(w[-1] / w[0]) / 999 * (1 + 1e-9)
    if delay:
        assert w[-1] == pytest.approx(min(top, 4 * np.pi / delay))
        assert np.max(np.diff(w)) <= 0.1 / delay * (1 + 1e-9)
        assert 1000 + 0.9 * (w[-1] - w[0]) * delay / 0.1 < w.size <= 1001 + (w[-1] - w[0]) * delay / 0.1
    else:
        assert w[-1] == pytest.approx(top)
        assert w.size == 1000


def test_a_digital_controller_has_no_transfer_function_in_s():
    k = CONTROLLER.discretise(0.1)
    loop = pidalab.Loop(PROCESS, k, prefilter=PREFILTER)
    assert loop.digital is k
    assert LOOP.digital is None
    assert loop.automatic_reset is None
    assert loop.block("process", 2.0) == PROCESS.rational_part()(2.0)
    assert loop.block("prefilter", 2.0) == PREFILTER(2.0)
    for ask in (lambda: loop.L(1j), lambda: loop.open_loop, lambda: loop.block("controller", 1j)):
        with pytest.raises(TypeError, match="digital"):
            ask()
    assert pickle.loads(pickle.dumps(loop)).digital == k
    assert pidalab.Loop(PROCESS, CONTROLLER.discretise(0.1, prefilter=PREFILTER)).prefilter is None


def test_a_process_without_dead_time_is_a_filter():
    loop = pidalab.Loop(PROCESS, CONTROLLER, prefilter=pidalab.lags(2, lag=0.2))
    assert loop.block("prefilter", 1j) == pytest.approx(1 / (0.2j + 1) ** 2)
