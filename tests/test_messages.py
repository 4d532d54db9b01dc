"""Check the messages of each function: argument, found value, allowed values. Other tests match no wording."""

import math
from functools import partial

import control
import matplotlib.pyplot as plt
import numpy as np
import pytest

import pidalab
from pidalab import (
    PIDA,
    AsymmetricPlant,
    HighOrderPID,
    Loop,
    NonInteractivePIDA,
    Process,
    SeriesPIDA,
    areas,
    digital,
    fopdt,
    identification,
    ipdt,
    lags,
    plots,
    reduction,
    robustness,
    sopdt,
)
from pidalab.comparison import at_equal_terms
from pidalab.forms import IdealGains
from pidalab.loop import open_loop
from pidalab.process import require_no_zero_at_origin
from pidalab.roots import roots
from pidalab.rules import (
    automatic_reset,
    classical,
    direct,
    haalman,
    itae,
    magnitude_optimum as mo,
    mrdp,
)
from pidalab.rules.registry import RULES, find
from pidalab.simulation.exact import simulate_until_settled, unit_step_responses

P, CHAIN, SECOND = lags(4), lags(3), sopdt(1.0, 1.5, 1.0, 1.0)
L, C = Loop(P, 0.5), PIDA(1.5, 2.0, 0.3, 0.1)
T, W = np.linspace(0.0, 20.0, 201), np.logspace(-1, 1, 20)
ANSWER = pidalab.step_response(L, T)
UNIT, LAG, DEAD = ipdt(1.0, delay=1.0), fopdt(1.0, 1.0, 1.0), fopdt(1.0, 1.0, 0.0)
STATIC, UNSTABLE, ZERO = Process([1.0], [1.0]), Process([1.0], [1.0, -1.0]), Process([1.0, 0.0], [1.0, 1.0])
DESIGN, REDUCED = classical.simc(LAG), reduction.to_sopdt(CHAIN)
RECORD = pidalab.Record(np.arange(40.0), np.arange(40.0) > 5, np.arange(40.0))
FIRST = control.tf([1.0], [1.0, 1.0])


def given(door, *arguments, **usual):
    """Return a function that prepares a call with usual arguments, of which some are changed."""
    return lambda **changed: partial(door, *arguments, **(usual | changed))


simulated = given(pidalab.simulate, loop=L, t=[0.0, 1.0, 2.0], setpoint=1.0)
PLAIN, RESET = Loop(UNIT, PIDA(0.4, 8.0)), SeriesPIDA(0.3, 0.0, 0.0, 1.0, 0.1, 1, limits=(-1.0, 1.0))
sampled = given(pidalab.simulate_sampled, loop=PLAIN, t=[0.0, 1.0, 2.0], setpoint=1.0)
RUNAWAY = {"loop": Loop(Process([1.0], [1.0, -1.0], 0.2), PIDA(0.1, 1.0)), "t": 0.5 * np.arange(4001)}
RUNAWAY["limits"] = (-1.0, 1.0)
asymmetric = given(AsymmetricPlant, main=FIRST, rise=1.0, fall=2.0)
PDA = SeriesPIDA(0.094, 0.45, 0.208, ti=0.648, filter_time=0.2, filter_order=4, limits=(-1.1, 0.1))
portrait = given(
    pidalab.portrait, loop=Loop(UNIT, PDA), parameters={"kp": [0.1, 0.2]}, t=0.02 * np.arange(1500), load=1.0
)
WIDE = 1.0 + np.arange(3000.0)
WIDE = {"kp": WIDE[:, None, None], "kd": WIDE[:, None], "ti": WIDE}
noise = given(pidalab.uniform_noise, t=0.05 * np.arange(241), amplitude=1.0, seed=0)
pida, series = given(PIDA, kp=2.0, ti=4.0), given(SeriesPIDA, kp=2.0, kd=1.0, ka=0.5, ti=4.0, filter_time=0.1)
high = given(HighOrderPID, gains=[0.5, 2.0, 1.0, 0.25], filter_time=0.1, filter_order=2)
PID = PIDA(1.0, 2.0, 0.5)
discretised, digital_pi = given(PID.discretise, sample_time=0.01), PIDA(1.3, 3.3).discretise(0.1)
filtered = given(PIDA(1.3, 3.3, 0.9).discretise, sample_time=0.07)
reset = given(automatic_reset.tune, model=UNIT, setting=automatic_reset.PIDA_1, n=4, filter_time=0.2)
poles = given(mrdp.tune, model=UNIT, m=2, n=3, te=0.5)
chr_rule, optimal = classical.chien_hrones_reswick, pidalab.optimal.load
HALF = Process([1.0], [1.0, 0.0, 1.0], 1.0)
TIMES = np.linspace(0.0, 40.0, 4001)
RISE = 1 - np.exp(-TIMES) * (1 + TIMES + TIMES**2 / 2 + TIMES**3 / 6)
point = given(identification.three_point, t=TIMES, y=RISE)
tangent = given(identification.ipdt_tangent, t=TIMES, y=RISE)
squares = given(identification.ipdt_least_squares, t=TIMES, y=RISE)
areas_of = given(areas.from_record, t=TIMES, u=np.ones(4001), y=RISE, count=4)
shortest = partial(robustness.smallest_filter_time, lambda time: Loop(UNIT, automatic_reset.tune(
    UNIT, automatic_reset.PI, n=4, filter_time=time).controller))  # fmt: skip
terms = given(at_equal_terms, DESIGN, LAG, ms=1.4, noise_gain=1.0, sample_time=0.05)
slow = pidalab.open_loop_step(sopdt(1.0, 1.0, 0.05, 0.0), np.linspace(0.0, 10.2, 511))

MESSAGES = {
    "blocks": [
        (lambda: P * C, r"a Process .* found PIDA; to connect process"),
        (lambda: C * P, r"a PIDA .* found Process; to connect process"),
        (lambda: np.array([1.0, 2.0]) * C, "found ndarray"),
        (lambda: P * np.nan, "the factor must be finite, found nan"),
        (lambda: L.S("1j"), "s must be complex numbers, found '1j'"),
        (lambda: P(math.inf), "s must be finite, found"),
        (lambda: digital_pi(math.inf), r"z must be finite, found \(inf"),
    ],
    "process": [
        (partial(Process, [1.0, 0.0], [1.0]), "the process must be proper, found degrees 1 of num and 0"),
        (partial(Process, [1.0], [0.0, 0.0]), "den must not be the zero polynomial"),
        (partial(Process.from_control, control.tf([1.0], [1.0, 0.5], 0.1)), r"sys .* found sample time 0\.1"),
        (partial(Process.from_control, control.ss([], [], [], [[2.0]])), "sys must be a transfer function"),
        (
            partial(Process.from_control, control.tf([1.0, 0.0], [1.0])),
            "sys must be proper, found degrees 1 of num and 0",
        ),
        (partial(Process.from_control, "1/s"), "sys must be a number, a controller or a transfer function,"),
        (partial(fopdt, 1.0, 0.0, 1.0), "lag must be above 0, found 0"),
        (partial(require_no_zero_at_origin, "model", ZERO), "model must have a static gain other than 0, or an int"),
        (partial(roots, np.ones(500)), "must be at most 400, found 499"),
        (partial(roots, np.random.default_rng(0).normal(size=120)), "the roots of a polynomial of degree 119 are"),
        (partial(pidalab.noise_scale, ipdt(1.0, delay=0.0)), "process"),
        (partial(pidalab.noise_scale, Process([2.0], [1.0])), "process"),
        (partial(pidalab.noise_scale, ZERO), "process"),
    ],
    "controllers": [
        (pida(kp=0.0), "kp must not be 0, found 0"),
        (partial(NonInteractivePIDA, 0, 4.0, 1.0, 1.0), "kc must not be 0"),
        (high(filter_time=0.0), "filter_time must be 0 if filter_order is 0, and above 0 otherwise, found"),
        (high(gains=[0.5, 2.0, 1.0, 0.25, 0.1], filter_order=3)().gains, "no PIDA form: derivatives go up to order 3"),
        (series(filter_order=2, limits=(1.0, 0.0)), r"limits must be .* lower < upper, found \(1\.0, 0\.0\)"),
        (IdealGains(1.0, 0.0, 1.0, 0.0).standard, "no standard form: kp is 0"),
        (IdealGains(1.0, 1.0, 1.0, -2.0).non_interactive, "no non-interactive form: .* 2 ta = -4 is negative"),
        (IdealGains(0.0, 1.0, 1.0, 0.0).series, "no series form: there is no integral action"),
        (IdealGains(1.0, 1.0, 1.0, 0.0).series, r"no series form: no zero is real and negative \(a PID needs ti"),
    ],
    "loop": [
        (partial(Loop, P, "PI"), "controller must be a number, a controller or a transfer"),
        (partial(Loop, P, DESIGN), r"controller must .* found Design; pass its \.controller"),
        (partial(Loop, FIRST, P), r"controller must not be a Process; the order is Loop\(process"),
        (partial(Loop, "P", C), "process must be a number, .* found str"),
        (partial(Loop, asymmetric()(), C), "process must be linear, found an AsymmetricPlant"),
        (partial(Loop, REDUCED, C), r"process must be a block of the loop, found .*; pass its \.process"),
        (partial(Loop, P, C, prefilter=control.tf([1.0], [1.0, -2.0])), "prefilter must be stable, found a pole at 2"),
        (partial(Loop, P, C, prefilter=lags(2, delay=0.5)), r"prefilter must have no dead time, found 0\.5"),
        (partial(Loop, P, C, output_filter=True), "output_filter must be a number, .* found bool"),
        (partial(Loop, P, digital_pi, FIRST), "output_filter must be None with a digital controller"),
        (
            partial(Loop, P, PID.discretise(0.1, prefilter=FIRST), prefilter=FIRST),
            "prefilter must be None: the digital controller has one, found",
        ),
        (partial(L.transfer, "x", "r", 1j), "output must be 'y', 'u' or 'e', found 'x'"),
        (partial(L.block, "plant", 1j), "name must be one of process, controller, output_filter, .* found 'plant'"),
        (partial(Loop(P, digital_pi).L, 1j), "controller must be continuous, found a digital one"),
        (partial(open_loop, P), r"loop must be a pidalab\.Loop, found Process"),
        (partial(open_loop, C), r"loop must be a pidalab\.Loop, found PIDA"),
        (partial(pidalab.margins, DESIGN), r"loop must be a pidalab\.Loop, found Design"),
    ],
    "response": [
        (partial(ANSWER.iae, 30.1), r"horizon must be within the record \(up to 20\), found 30\.1"),
        (partial(ANSWER.itae, origin=0.5), r"origin must not be after the start of the record \(0\), found 0\.5"),
        (partial(ANSWER.tv, "e"), "signal must be 'u' or 'y', found 'e'"),
        (pidalab.load_response(L, T).overshoot, "overshoot needs a final value other than 0"),
        (partial(slow.iae, math.inf), "horizon=inf needs a settled record: the error in the last"),
        (partial(ANSWER.settling_time, 2.0), "band must be a share between 0 and 1"),
        (partial(ANSWER.between, 0.5, 90.0), r"start and stop must be in order and from 0 to 20, found 0\.5 and 90"),
        (partial(ANSWER.against, pidalab.step_response(L, T[:-1])), "reference must have the same times, found"),
        (partial(pidalab.Response, [0.0, 1.0, 3.0], 1, 0, 0, 0, 0), r"t must be uniform with step 1\.5, found 1 at"),
        (partial(pidalab.Response, T, 1, 0, 0, T, 0, final="1"), "final must be a real number, found '1'"),
    ],
    "plots": [
        (lambda: plots.nyquist(plt.gca(), L, W), "loops must be a dictionary .* found Loop"),
        (lambda: plots.nyquist(None, {"a": L}, W), "ax must be one of .* found NoneType"),
        (lambda: plots.signal(plt.gcf(), {"a": ANSWER}, "y"), "ax must be one of matplotlib's Axes, found Figure"),
        (lambda: plots.nyquist(plt.gca(), {"a": L}, np.append(W, np.inf)), "frequencies must be finite, found inf at"),
        (
            lambda: plots.label_lines(plt.gca(), {"PI": 1.0}),
            r"keys of 'at' must be labels of lines in 'ax' \(.*\), found 'PI'",
        ),
    ],
    "simulate": [
        (simulated(t=[0.0, 1.0, 3.0]), "t must be uniform"),
        (simulated(t=np.arange(20).astype("timedelta64[s]")), "t must be an array of real numbers, found"),
        (simulated(setpoint=[1.0, 2.0]), r"setpoint must be .* as long as t \(3\), found shape \(2,\)"),
        (simulated(load=np.ma.masked_greater(np.arange(3.0), 1)), "load must be an array .* found masked values"),
        (simulated(loop=Loop(Process([-1.0, 2.0], [1.0, 3.0]), 1.0)), "the loop is ill-posed: .* exactly -1"),
        (simulated(loop=Loop(Process([1.0], [1.0, -1.0], 1.0), 0.5), t=[0.0, 2e3]), "loop overflows before t = "),
        (simulated(loop=Loop(fopdt(1.0, 1.0, 1e-6), 0.5), t=6 * T), r"t spans 1\.2e\+08 dead times, too many"),
        (
            simulated(loop=Loop(Process([1.0, 2.0], [1.0, 1.0], 1.0), 0.999), t=np.arange(2001.0)),
            r"t must span at most 1333 dead times for a loop with \|L\| near",
        ),
        (simulated(loop=Loop(LAG, RESET), load=9.0, t=T), r"u must stay within the controller's limits \(-1, 1\)"),
        (simulated(loop=Loop(P, digital_pi)), "controller must be continuous, found a digital one"),
        (partial(pidalab.simulate_ensemble, P, T, [1]), "loop must be a pidalab.Loop, found Process"),
        (partial(pidalab.simulate_ensemble, L, T, np.zeros(201)), r"noise must have .* \(shape \(k, n\)\), found no r"),
        (partial(simulate_until_settled, pidalab.load_response, L, 0.0), "horizon must be above 0, found 0"),
        (partial(simulate_until_settled, pidalab.load_response, Loop(P, 0), 3.0), "does not settle within"),
        (
            partial(simulate_until_settled, pidalab.load_response, Loop(fopdt(1.0, 1.0, 1e-9), PIDA(0.8, 1)), 20.0),
            r"the loop needs 2e\+10 dead times to settle, too many",
        ),
        (
            partial(unit_step_responses, Loop(Process([3.26], [1, 1], 0.0885), PIDA(0.0416, 0.731, 0.338, 0.0382,
                    n=120.3, m=1e5)), np.array([0.0, 0.567]), "rdn"),
            "rounding makes .* uncertain by .* of its largest value.* (time constant|more times)",
        ),
        (noise(amplitude=-1.0), r"amplitude must be at least 0, found -1\.0"),
        (noise(hold=0.07), r"hold must be a multiple of the step of t \(0\.05\), found 0\.07"),
        (noise(seed=-1), "seed must be a whole number, at least 0"),
    ],
    "simulate_sampled": [
        (sampled(limits=(1.0, 2.0)), "contain 0, the control signal at rest"),
        (sampled(loop=Loop(UNIT, RESET), t=T, limits=(2.0, 3.0)), r"found \(2\.0, 3\.0\) and \(-1\.0, 1\.0\) of the"),
        (sampled(plant=1.0), "plant must be a Process or an AsymmetricPlant, found float"),
        (sampled(plant=REDUCED), r"pass its \.process"),
        (sampled(plant=Process([1.0, 2.0], [1.0, 1.0])), "plant must have a dead time or no direct feedthrough in a"),
        (sampled(loop=Loop(UNIT, RESET)), "the sample time must be at most the filter's time constant,"),
        (sampled(loop=Loop(CHAIN, PIDA(1.0, 4.0, 1.0))), "the sample time must be at most the filter's time constant,"),
        (sampled(loop=Loop(CHAIN, 1.0, control.tf(1, [0.1, 1]))), "the sample time must be at most the filter's"),
        (sampled(loop=Loop(P, digital_pi), t=[0.0, 0.9]), r"t must have the step of the digital controller, 0\.1"),
        (sampled(**RUNAWAY), "loop overflows before t = "),
        (sampled(**RUNAWAY, pulse_widths=10), "loop overflows before t = "),
        (sampled(loop=Loop(UNIT, 0.5), anti_windup="clamping"), "anti_windup='clamping' needs one pole at 0"),
        (sampled(loop=Loop(UNIT, PIDA(0.4, 0.5)), anti_windup="conditioning"), "anti_windup='conditioning' needs"),
        (sampled(loop=Loop(UNIT, control.tf([1], [1, 0])), anti_windup="conditioning"), "anti_windup='conditioning'"),
        (sampled(anti_windup="on"), "anti_windup must be 'reset', .* or None, found 'on'"),
        (sampled(quanta=0.1), "quanta must be two numbers"),
        (sampled(quanta=(0.1, -0.1)), r"quanta\[1\] must be at least 0, found -0\.1"),
        (sampled(pulse_widths=10), r"limits must be finite with pulse_widths, found \(-inf, inf\)"),
        (sampled(pulse_widths=-1, limits=(-1, 1)), "pulse_widths must be a whole number, at least 0"),
        (sampled(pulse_widths=2, quanta=(0.0, 0.1), limits=(-1, 1)), r"quanta\[1\] must be 0 with pulse_widths"),
        (sampled(pulse_widths=2, plant=Process([1, 2], [1, 1], 1.0), limits=(-1, 1)), "linear plant"),
        (asymmetric(main=control.tf([1.0, 0.0], [1.0])), "main must be proper"),
        (partial(pidalab.noise_gain, Loop(CHAIN, 9.0), 0.01), "found poles in the closed right half-plane"),
        (partial(pidalab.noise_gain, Loop(CHAIN, PIDA(9, 4).discretise(0.5)), 0.5), "on or outside the unit circle"),
        (partial(pidalab.noise_gain, Loop(LAG, 0.5), 3.8e-6), r"sample_time must be at least 3\.81e-06, found"),
        (partial(pidalab.noise_gain, Loop(P, PIDA(1.5, 4.0, 1.0)), 0.5), r"sample time must be at most .*discretise"),
    ],
    "portrait": [
        (portrait(loop=PDA), "loop must be a pidalab.Loop, found SeriesPIDA"),
        (portrait(loop=Loop(UNIT, 0.5)), "loop must have a SeriesPIDA and no output filter, found"),
        (portrait(parameters=[1.0]), "parameters must be a mapping of arrays by name, found list"),
        (portrait(parameters={"Kp": [1.0]}), "parameters must be among kp, kd, .* found 'Kp'"),
        (portrait(parameters={"kp": []}), r"must hold at least one number, found shape \(0,\)"),
        (portrait(parameters={"kp": [1.0, 2.0], "kd": [1, 2, 3]}), r"broadcast together, found .*\(2,\)"),
        (portrait(parameters={"kp": [[1.0], [np.inf]]}), r"must be finite, found inf at index \(1, 0\)"),
        (portrait(parameters={"filter_time": [0.2, 0.01]}), "the sample time must be at most the filter's time"),
        (portrait(load=2.0), r"limits must contain the final u from -2 to -2, found \(-1\.1, 0\.1\)"),
        (portrait(prefilter=([1.0], [1.0, -1.0])), r"prefilter must be stable, found a pole at 1"),
        (portrait(prefilter=([1.0, 1.0], [1.0])), "prefilter must be proper, found 2 and 1"),
        (portrait(prefilter=([1.0], [0.0, 1.0])), "prefilter must have a denominator whose first and last"),
        (portrait(executor=4), "executor must be an Executor or None, found int"),
        (portrait(parameters=WIDE), r"parameters must have at most 1e\+07 sets, found shape \(3000,"),
        (
            portrait(loop=Loop(UNIT, SeriesPIDA(1.0, 0.0, 0.0, 1.0, 0.1, 1)), parameters={"ka": [0.1]}),
            "filter_order must be a whole number, at least 2, found 1",
        ),
    ],
    "robustness": [
        (partial(pidalab.margins, Loop(fopdt(1e300, 1.0, 1.0), 1e300)), "overflows"),
        (partial(pidalab.margins, Loop(Process([-1.0, 2.0], [1.0, 3.0]), 1.0)), "ill-posed"),
        (partial(pidalab.phase_crossovers, L, quietest=-1), "quietest must"),
        (
            partial(pidalab.margins, Loop(Process([1.0, 1.0], [1.0, 2.0]), digital_pi)),
            "plant must have a dead time or no direct feedthrough in a",
        ),
        (partial(pidalab.margins, Loop(fopdt(1, 1, 1e3), PID.discretise(5e-4))), r"must be at most 1e\+06 samples"),
        (partial(pidalab.gain_for_ms, Loop(P, digital_pi), 1.4), "controller must be continuous, found a digital one"),
        (partial(pidalab.gain_for_ms, Loop(ipdt(1.0, delay=0.0), 1.0), 1.4), "no gain of .* rises to ms = 1"),
        (partial(pidalab.bandwidth, Loop(UNIT, 2.0)), "unstable"),
        (partial(pidalab.relative_noise_gain, Loop(CHAIN, 9.0)), "stable"),
        (partial(shortest, lambda loop: False, longest=0.2), r"holds must be true at longest = 0\.2"),
        (partial(shortest, pidalab.is_stable, longest=0.2, shortest=0.3), "shortest must be below longest = 0.2"),
        (partial(robustness.circle, Loop(Process([1.0], [1.0, 0.0, 0.0], 1.0), 1.0)), "except one at 0; found 2 at 0"),
        (partial(robustness.popov, Loop(UNSTABLE, 2.0)), "poles of the forward path must be stable, except one at 0"),
        (partial(robustness.circle, Loop(UNIT, -1.0)), "the pole at 0 must have a positive residue, found -1"),
        (partial(robustness.popov, Loop(Process([1.0, 1.0], [1.0, 2.0], 1.0), 1.0)), "must be strictly proper"),
        (
            partial(pidalab.rightmost_poles, mrdp.tune(UNIT, 0, 1, te=1000.0).loop(), 5),
            "count must be at most 3, the number of poles right of -20, found 5",
        ),
    ],
    "reduction": [
        (partial(reduction.to_fopdt, "1/(s + 1)"), r"process must be a pidalab\.Process, found str"),
        (partial(reduction.to_fopdt, REDUCED), r"found SecondOrderModel; pass its \.process"),
        (partial(reduction.to_sopdt, HALF), "process must be stable, found an unstable one"),
        (partial(reduction.to_sopdt, UNIT), "process must be stable, found an integrating one"),
        (partial(reduction.to_fopdt, ZERO), "process must have a static gain other than 0"),
        (partial(reduction.ultimate_frequency, DEAD), "process must have a phase that falls below -pi: it never does"),
        (
            partial(reduction.ultimate_frequency, Process([1.0, 0.0, 0.25], [1.0, 3.0, 3.0, 1.0], 1.0)),
            r"the phase jumps at the zero at 0\.5j",
        ),
        (partial(reduction.ultimate_frequency, Process([1.0], [1.0, 0, 0], 1.0)), "at most one integrator, found 2"),
        (partial(reduction.to_fopdt, Process([1.0, -2.0, 1.0], [1.0, 2.0, 1.0])), r"must be below 1, found 1"),
        (partial(reduction.to_sopdt, fopdt(1.0, 2.0, 1.0)), r"process has no second-order model: \(tau wu\)\^4"),
        (
            partial(reduction.to_sopdt, Process([1], np.convolve([1, 0.3, 1], np.poly([-1.3, -3, -8])), 1.9)),
            r"process has no second-order model: damping\^2 must be at least",
        ),
    ],
    "rules": [
        (partial(haalman.pid, SECOND, ms=1.0), "ms must be"),
        (partial(haalman.pida, SECOND), r"constant numerator \(not 0\) and 3 stable poles"),
        (partial(haalman.pid, Process([1.0], [1.0, 1.0, 0.0])), "model .* two stable poles"),
        (partial(haalman.tune, CHAIN, kind="P"), "kind must be 'PIDA', 'PID' or 'PI', found 'P'"),
        (
            partial(haalman.output_filter, Process([1.0], np.convolve([1, 0.02, 1], [10, 1]), 0.1), PIDA(1.0, 10.0)),
            r"the loop must have one gain crossover, found \[0\.101, 0\.9466,",
        ),
        (partial(haalman.output_filter, CHAIN, FIRST), "controller must be a PIDA, found TransferFunction"),
        (partial(itae.tune, SECOND, kind="PI"), "kind must be 'PIDA' or 'PID', found 'PI'"),
        (partial(itae.tune, SECOND, test="noise"), "test must be 'setpoint' or 'load', found 'noise'"),
        (partial(itae.pid_load, sopdt(1, 1, 1, 0.0999)), r"of the model must be from 0\.1 to 2, found 0\.0999"),
        (partial(direct.load, sopdt(1, 1, 0.29, 1)), r"damping of the model must be from 0\.3 to 2, found 0\.29"),
        (partial(itae.factors, CHAIN), "model must have a constant numerator .* two stable poles"),
        (partial(itae.pid_setpoint, Process([1.0], [1.0, -1.0, 1.0], 1.0)), "two stable poles"),
        (partial(itae.load_factors, sopdt(1.0, 1.0, 1.0, 2.001)), r"of the model must be from 0\.1 to 2, found 2\.001"),
        (partial(direct.setpoint, Process([0.0], [1.0, 1.0, 1.0], 1.0)), r"constant numerator \(not 0\)"),
        (partial(direct.setpoint, sopdt(1, 1, 0.3, 0.1), 0.3), r"alpha_d must be smaller for this model, found 0\.3"),
        (partial(itae.imc_pid, SECOND), "one stable pole"),
        (partial(itae.imc_pid, DEAD), "model must have a dead time above 0"),
        (partial(itae.pida_setpoint, SECOND, factors=(0.3,)), "factors must be two numbers, f_d and f_a, found"),
        (partial(itae.pida_setpoint, SECOND, factors=(1.0, 0.6)), r"f_d must be between -3 and 1, found 1\.0"),
        (
            partial(itae.pida_load, sopdt(1, 1, 1, 1), factors=(0.99 / 1.005, 0.6)),
            r"f_d = 0\.985075 leads to r = 0\.01, for which the table fails",
        ),
        (partial(mo.tune, CHAIN, 30, 31, 0.01), "m must be at most 16, found 30"),
        (partial(mo.tune, "lags", 1, 1, 0.1), "model must be an array of real numbers"),
        (partial(mo.tune, [1.0, 4.0, 10.0, 20.0], 1, 1, 0.1), r"at least 2m \+ 4 = 6 areas for m = 1, found 4"),
        (partial(mo.tune, ZERO, 1, 1, 0.1), "static gain A_0 other than 0"),
        (partial(mo.tune, lags(1, 0.3), 2, 2, 0.1), "singular matrix"),
        (partial(mo.tune, areas.from_process(lags(1, 0.3), 8), 2, 2, 0.1), "ill-conditioned"),
        (partial(mo.tune, fopdt(1.0, 0.05, 1.0), 3, 4, 0.1), r"the loop of PID_4\^3 .* is unstable"),
        (partial(mo.tune_for_noise, P, 1, 1, 0.1, 0.002), "noise_gain = 0.1"),
        (partial(mo.tune_for_filter_noise, P, 0, 1, 10.0, 0.002), "noise_gain = 10 gives no filter time with"),
        (poles(model=LAG), "model must be an integrator with dead time"),
        (poles(m=200, n=201), "m must be at most 100, found 200"),
        (poles(m=0, n=0), "te must be above 0 with a filter and 0 without"),
        (poles(model=ipdt(1.0, 0.0), m=0, n=0, te=0.0), "must have a dead time"),
        (reset(model=ipdt(1.0, 0.0), weight=0.0), "model must have a dead time if weight is 0"),
        (reset(setting="PI"), r"setting must be a Setting, such as automatic_reset\.PIDA_1, found 'PI'"),
        (reset(weight=0.49), r"weight must be 0, or from 0\.5 to 1, found 0\.49"),
        (partial(automatic_reset.multiple_pole, 3), "m must be at most 2, found 3"),
        (partial(classical.simc, sopdt(1, 1, 0.4, 1)), "model .* real stable poles"),
        (partial(classical.simc, Process([1.0], [1.0, 1.996, 1.0])), "real stable poles"),  # imaginary parts of 6 %
        (partial(classical.simc, Process([1.0], [1.0, 0.0, 0.0, 0.0])), "at most two integrators"),
        (partial(classical.simc, Process([1.0], [1.0, 0.0, 0.0], 1.0), "PI"), "kind must be 'PID' .* found 'PI'"),
        (partial(classical.simc, Process([0.5, 0.2, 1.0], [1.0, 2.0, 1.0])), "real zeros"),
        (partial(classical.simc, Process([1.0, 0.0], [1.0, 2.0, 1.0])), "no zero at 0"),
        (partial(classical.simc, DEAD, "PI"), "closed_loop_time"),
        (partial(classical.simc, LAG, "P"), "kind must be 'PI' or 'PID', found 'P'"),
        (partial(classical.amigo, DEAD), "dead time above 0"),
        (partial(classical.ziegler_nichols_ultimate, lags(2)), "process"),
        (partial(classical.ziegler_nichols_ultimate, Process([1.0], [1.0, 1.0, 0.0])), "process must have a phase"),
        (partial(classical.ziegler_nichols_ultimate, Process([1.0], [1.0, -1.0, 0.0], 1.0)), "process must be"),
        (partial(chr_rule, UNIT), "one stable pole"),
        (partial(chr_rule, LAG, "load", 10), "overshoot must be 0 or 20, found 10"),
        (partial(mo.tune(areas.from_process(P, 8), m=2, n=3, filter_time=0.1).loop), "process must be given"),
        (partial(find, "best", "optimal"), "rule must be 'optimal', 'haalman', 'simc'.*, found 'best'"),
        (partial(RULES["imc"].tune, LAG, "PI"), "kind must be 'PID' for the rule 'imc', found 'PI'"),
    ],
    "areas": [
        (partial(areas.from_process, UNIT, 4), "process must have a static gain"),
        (partial(areas.from_process, UNSTABLE, 4), "stable, found a pole at 1"),
        (partial(areas.from_process, FIRST, 4), "found TransferFunction"),
        (partial(areas.from_process, lags(1, lag=1e200), 3), "areas or gains overflow"),
        (partial(areas.with_filter, [1.0], control.tf([1.0], [1.0, -2.0])), "block must be stable"),
        (areas_of(u=(TIMES < 9) * 1.0, start=(0.0, 0.0)), "u must not return to its first level"),
        (areas_of(y=RISE[:-1]), r"y must be a number or as long as t \(4001\), found shape \(4000,\)"),
        (areas_of(u=np.arange(4001) >= 3995), "y must have at least 16 samples after u first moves, found 5"),
        (areas_of(start=0.0), "start must be two numbers, the levels of u and y"),
        (partial(areas.from_record, RECORD, np.ones(40), count=4), "left out with a Record"),
        (partial(areas.from_record, TIMES, np.ones(4001), count=4), "u and y must be given, unless t is a Record"),
    ],
    "identification": [
        (point(y=np.full(4001, 3.0)), r"y never moves: it starts at 3 and ends at 3"),
        (
            point(y=1 - (np.exp(-TIMES) - 0.3 * np.exp(-TIMES / 0.3)) / 0.7),
            "y does not fit a third-order model with dead time: alpha must",
        ),
        (
            point(y=1 - 0.7 * np.exp(-2 * TIMES) - 0.3 * np.exp(-TIMES / 8)),
            "y does not fit a third-order model with dead time: L and tau",
        ),
        (point(crossing="nearest"), "crossing must be 'interpolated' or 'sampled', found 'nearest'"),
        (point(y=RISE[:-1]), r"y must be a number or as long as t \(4001\), found shape \(4000,\)"),
        (squares(y=np.full(4001, 2.0)), "y must change, found 2 at the start and 2 at the end"),
        (tangent(span=50.0), r"span must be shorter than the record \(40\), found 50"),
        (tangent(y=np.where(TIMES > 0, 1.0 + RISE, 0.0), span=1.0), "y does not fit an integrator with dead time"),
        (squares(rise=1.0), "rise must be below 1, found 1"),
        (squares(t=np.arange(4.0), y=np.arange(4.0)), "y must have at least 5 samples, found 4"),
        (partial(identification.three_point, RECORD, TIMES), "y and step must be left out with a Record"),
        (partial(identification.ipdt_least_squares, TIMES), "y must be given, unless t is a Record"),
    ],
    "discretise": [
        (discretised(method="euler"), "method must be 'backward', 'tustin' or 'zoh', found 'euler'"),
        (discretised(method="tustin", sample_time=0.11), r"at most 0\.1 .* found 0\.11: .*constant 0\.05"),
        (discretised(method="zoh", sample_time=0.06), r"at most 0\.05 .* take method='backward'"),
        (partial(SeriesPIDA(1, 1, 0, 1, 0.1, 1).discretise, 0.2, "zoh"), "filter of the stabiliser"),
        (discretised(tracking_time=1.0), "tracking_time needs anti_windup='back-calculation', found"),
        (partial(HighOrderPID([1.0, -2.0], 0.1, 1).discretise, 0.01), "anti_windup='reset' needs kp/ki above 0"),
        (discretised(limits=(1.0, 2.0)), r"bias must be within the limits \(1, 2\), found 0"),
        (partial(PIDA(1, math.inf, 0.5).discretise, 0.01, b=0.0, c=0.0), "the set point has no effect with b = 0"),
        (discretised(anti_windup=1), "anti_windup must be 'reset', .* or None, found 1"),
        (filtered(output_filter=control.tf([1.0], [1, 0.5, 1])), r"equal lags of gain 1, .* \[1\] / \[1, 0.5, 1\]"),
        (filtered(output_filter=control.tf([1.0, 3.0], [0.25, 1.0, 1.0])), "equal lags of gain 1"),
        (filtered(prefilter=control.tf([2.0], [1.0, 1.0])), "prefilter must have the static gain 1, found 2"),
        (filtered(prefilter=control.tf([1.0], [1.0, 0.0])), "prefilter must have the static gain 1, found inf"),
        (filtered(prefilter=control.tf([1.0], [-1.0, 1.0])), "prefilter must be stable, found a pole at 1"),
        (
            filtered(prefilter=control.tf([1.0], np.polymul([0.03, 1.0], [0.5, 1.0])), method="tustin"),
            r"sample_time must be at most 0\.06 with method='tustin', found",
        ),
        (partial(digital.discretise, [1.0], 0.1), r"parts must be the result of controller\.parts\(\), found \[1\.0\]"),
        (partial(digital_pi.step, 1.0, True), "y must be a real number"),
        (partial(digital_pi.reset, r=1.0), "r and y must be given together"),
    ],
    "optimal": [
        (partial(optimal, L, 1), "pass its .process"),
        (partial(optimal, LAG, 1, mks=0.5), r"mks must be above 1/\|P\(0\)\| = 1"),
        (partial(optimal, LAG, 1, disk=2.0), "disk must be below 2 .*, found 2"),
        (partial(optimal, LAG, 1, sample_time=2.0), "sample_time needs noise_gain"),
        (partial(optimal, LAG, 1, noise_gain=9.0, sample_time=1e3), "sample_time must"),
        (partial(optimal, Process([1.0], [1.0, 0.0]), 1, noise_gain=2.0), "process"),
        (partial(optimal, ZERO, 1), "static gain"),
        (partial(optimal, ipdt(1.0, 0.0), 1), "a lag or a dead time"),
        (partial(optimal, Process([1.0], [1.0, -1.0], 0.9), 1, ms=2.0), "ms <= 2; the nearest controller has ms = 4.0"),
    ],
    "comparison": [
        (terms(noise_gain=0.0), "noise_gain must be above 0"),
        (partial(at_equal_terms, LAG, LAG, 1.4, 1.0, 0.05), "design must be"),
        (terms(noise_gain=1e-9), r"ms = 1\.4 needs gains scaled by 0\.004, below 0\.01"),
        (partial(pidalab.compare, LAG, sample_time=-1.0), "sample_time"),
    ],
}  # fmt: skip


@pytest.mark.parametrize(
    ("call", "message"),
    [pytest.param(*row, id=f"{door}-{k}") for door, rows in MESSAGES.items() for k, row in enumerate(rows)],
)
def test_message(call, message):
    with pytest.raises((TypeError, ValueError, ArithmeticError, MemoryError), match=message):
        call()
    plt.close("all")
