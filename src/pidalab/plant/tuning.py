"""Tune a controller for a process or a fitted model, robust to the uncertainty of the model."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from pidalab import _check, optimal
from pidalab._check import Array
from pidalab.loop import Loop
from pidalab.plant.doubts import doubt
from pidalab.plant.fitting import Fit
from pidalab.plant.record import Record
from pidalab.plant.safety import Designer, LoopEvaluator, make_safe, refusal
from pidalab.process import Process, rational, require_no_zero_at_origin, sign_of_gain
from pidalab.requirements import Requirements
from pidalab.robustness.margins import gain_crossovers, max_control_sensitivity, max_sensitivity
from pidalab.robustness.poles import is_stable
from pidalab.roots import roots
from pidalab.rules import Design
from pidalab.rules.registry import ORDER, Rule, find
from pidalab.simulation.exact import load_iae

# Largest ratio of the sample time to the slowest time constant or dead time of an integrating plant.
AT_REST = 10.0
OTHER_UNIT = 100.0  # if the sample times of design and record differ by this ratio, their units may differ
DEFAULT_MKS = 10.0  # default limit of (gain from noise to u) / `_gain_needed`
# Default limit of (standard deviation of u from noise) / (input step in the record).
DEFAULT_NOISE_SHARE = 0.01
MOST_MS = 5.0
PHASE_UNKNOWN = 1e-3  # a phase shift below this, in rad, is negligible, since no model is so accurate
SPREAD = 20  # number of plants drawn from the uncertainty of a fit
PRICE_WARNING = 1.5  # a doubt is given if the price of robustness is above this
REMEDIES = (  # advice if the model is too uncertain: the first for a Process, the second for a Fit
    "a smaller spread would help",
    "a longer record, a larger step or several of them, or less noise would help",
)
LONG_TURN = 0.5  # the sample time is too long if sample_time * (crossover frequency) is above this, in rad


def require_sampling(process: Process, sample_time: float) -> None:
    """Raise an error if the sample time is too long for the process."""
    poles, corners = np.abs(roots(process.den)), corner_frequencies(process)
    if not np.isfinite(process.gain()):
        limit = AT_REST / corners.min() if corners.size else math.inf
        why = f"{AT_REST:g} times its slowest time constant or dead time (after which only the integrator still moves)"
    else:
        limit = float(np.sum(1 / poles)) + process.delay if corners.size else math.inf
        why = "the sum of its lags and its dead time (after which the response has reached 63 % or more)"
    if sample_time > limit:
        raise ValueError(
            f"sample_time must be at most {limit:.4g} for this process, {why}, found {sample_time:g}"
        )


def corner_frequencies(process: Process) -> Array:
    """Return the corner frequencies of poles and zeros and the reciprocal of the dead time, in rad per time unit."""
    speeds = np.abs(np.concatenate([roots(process.den), roots(process.num)]))
    return np.append(speeds[speeds > 0], [1 / process.delay] if process.delay else [])


def tune(
    model: Process | Fit,
    kind: str = "PIDA",
    *,
    ms: float = 1.6,
    noise_gain: float | None = None,
    sample_time: float | None = None,
    rule: str = "optimal",
    spread: float | None = None,
    output_filter: Any = None,
    ms_worst: float = 2.0,
) -> Design:
    r"""Tune a PI, PID or PIDA controller.

    Parameters
    ----------
    model : Process or Fit
        The plant, or the fit of a record.
    kind : {"PIDA", "PID", "PI"}, optional
        Kind of controller.
    ms : float, optional
        Limit of the maximum sensitivity, which must be above 1. A limit of 1.4 is cautious, and 2 is fast. With a
        sample time, the limit applies to the sampled loop. Rules other than "optimal" and "haalman" ignore the limit.
        The result contains the Ms reached.
    noise_gain : float, optional
        Limit of (standard deviation of u) / (standard deviation of the measurement noise). The noise is white: each
        sample has a new value. By default the noise of a Fit may give u a standard deviation of 1 % of the input step
        in the record. For a Process, or a Fit without noise or steps, the gain from noise to u is limited instead: at
        any frequency it is at most 10/\|P(0)\|. (For an integrator, P(0) is replaced by P at the frequency where the
        phase of P has fallen by 45°.)
    sample_time : float, optional
        Sample time of the digital controller (backward differences), above 0. Half a sample time is added to the dead
        time, to account for the hold. The design is corrected until the sampled loop has the requested Ms, to 0.1 %.
    rule : str, optional
        "optimal" (the least IAE after a load step), or a name of `pidalab.rules.registry`, such as "haalman" or "simc".
    spread : float, optional
        Relative error by which gain, time scale and dead time are raised and lowered. By default a Process is not
        varied. The parameters of a Fit are varied by their uncertainty, and the gain also by 15 %, up or down
        (`Fit.plants`). Twenty such plants are drawn at random. The worst of them is not a bound: a few in a hundred
        plants are worse.
    output_filter : control.TransferFunction, optional
        A filter in series with the controller, such as the lag of a sensor. The design takes it into account.
    ms_worst : float, optional
        Limit of the maximum sensitivity with any plant within the spread, above 1.

    Returns
    -------
    Design
        Its `info` has ``iae`` (of a load step, in units of y times time), ``ms`` and ``mks`` (largest gain from noise
        to u). With a sample time it also has ``ms_sampled``. If the plant is varied, it also has ``ms_worst`` (of the
        sampled loop if there is a sample time), ``iae_worst`` (with the plant that has this Ms) and ``price``: the IAE
        divided by the IAE of the design without the limit `ms_worst`. ``doubts`` are reservations, and ``notes`` are
        assumptions.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of range, the rule does not make this kind of controller, the model is outside the
        validity of the rule, no controller meets the limits, the loop is unstable with the model, the price exceeds 3,
        or a Fit with a large model error has fewer poles than `kind` has derivatives.

    Examples
    --------
    >>> import pidalab
    >>> design = pidalab.tune(pidalab.lags(3, delay=1.0), kind="PI", ms=1.6, spread=0.1)
    >>> print(f"{design.ms:.2f} {design.ms_worst:.2f} {design.price:.2f}")
    1.60 1.78 1.00
    """
    _check.choice("kind", kind, ORDER)
    ms, ms_worst = _check.real("ms", ms, above=1.0), _check.real("ms_worst", ms_worst, above=1.0)
    if ms > MOST_MS:
        raise ValueError(
            f"ms must be at most {MOST_MS:g}, found {ms:g}: 1.4 is cautious, 2 is fast, and a larger ms leaves a loop "
            "close to instability"
        )
    named = None if rule == "optimal" else find(rule, "optimal")
    process = model.process if isinstance(model, Fit) else model
    if isinstance(process, Record):
        raise TypeError("model must be a Process or a Fit, found Record; use identification.fit(record)")
    require_no_zero_at_origin("model", process)
    if sample_time is not None:
        sample_time = _check.real("sample_time", sample_time, above=0.0)
        require_sampling(process, sample_time)
    doubts: list[str] = []
    notes: list[str] = []
    if isinstance(model, Fit) and sample_time is not None:
        recorded = model.record.sampling
        if not 1 / OTHER_UNIT < (share := sample_time / recorded) < OTHER_UNIT:
            doubts.append(doubt("time unit", sample_time=sample_time, share=share, recorded=recorded))
    process = _without_short_delay(process, _fastest(process, rule, noise_gain, sample_time), doubts)
    # Compute the plants before the search, so that a value of `spread` out of range raises an error at once.
    plants = plants_within(model, process, spread)
    if plants and ms > ms_worst:
        raise ValueError(
            f"ms must be at most ms_worst, {ms_worst:g}, found {ms:g}: the limit ms_worst applies to the model, too"
        )
    limits = Requirements(ms=ms, family=tuple(plants), ms_worst=ms_worst)
    remedy = REMEDIES[isinstance(model, Fit)]
    if len({sign_of_gain(plant) for plant in [process, *plants]}) > 1:
        raise ValueError(
            f"the sign of the gain is not known, and no controller is stable with both signs: {remedy}"
        )
    designed, *others = (_as_designed_for(plant, sample_time, output_filter) for plant in [process, *plants])
    _known_dynamics(model, designed, kind, doubts)
    evaluator = LoopEvaluator(sample_time, output_filter)
    if named is None:
        noise = _noise_limits(model, designed, noise_gain, sample_time, notes)
        designer = _optimal(designed, others, kind)
        made, price = make_safe(designer, evaluator, process, replace(limits, **noise), remedy)
        if "sample_time" in made.active:
            doubts.append(doubt("fast filter", sample_time=made.info["sample_time"]))
    else:
        made, price = _by_rule(named, designed, kind, evaluator, process, limits, remedy)
        if noise_gain is not None:
            _check.real("noise_gain", noise_gain, above=0.0)
            doubts.append(doubt("noise unused", rule=rule))
        crossovers = gain_crossovers(Loop(process, made.controller, made.output_filter))
        process = _without_short_delay(process, float(crossovers.max(initial=0.0)), doubts)
    if price > PRICE_WARNING:
        doubts.append(doubt("price", price=price, remedy=remedy))
    loop = evaluator.loop(made, process)
    info: dict[str, Any] = _iae_ms_mks(loop)
    reasons = ["", ""]  # say why a sampled loop has no Ms
    if sample_time is not None:
        info["ms_sampled"], reasons[0] = evaluator.ms(made, process)
        _doubt_sampling(loop, sample_time, doubts)
    if plants:
        info["ms_worst"], reasons[1] = evaluator.worst(made, plants)
        # Simulate only the worst plant. Simulating all twenty would take longer than the search.
        worst = max(plants, key=lambda plant: evaluator.ms(made, plant).ms)
        info |= {"iae_worst": _iae_ms_mks(evaluator.loop(made, worst))["iae"], "price": price}
    info |= {"notes": tuple(notes), "doubts": (*doubts, *dict.fromkeys(filter(None, reasons)))}
    return Design(process, made.controller, made.prefilter, loop.output_filter, made.source, info)


def _as_designed_for(process: Process, sample_time: float | None, output_filter: Any) -> Process:
    """Return the process with the filter in series, and with half a sample of dead time for the hold."""
    num, den = rational("output_filter", 1.0 if output_filter is None else output_filter)
    delay = process.delay + (sample_time or 0.0) / 2
    return Process(np.convolve(process.num, num), np.convolve(process.den, den), delay)


def _by_rule(
    rule: Rule,
    designed: Process,
    kind: str,
    evaluator: LoopEvaluator,
    process: Process,
    limits: Requirements,
    remedy: str,
) -> tuple[Design, float]:
    """Return a rule's design and its price. The design of a rule that ignores Ms is accepted unchanged or refused."""
    if rule.knows_ms:

        def make(request: Requirements, near: Design | None) -> tuple[Design, list[str]]:
            active = "ms_worst" if request.family and request.ms_worst < request.ms else "ms"
            return rule.tune(designed, kind, replace(request, ms=getattr(request, active))), [active]

        return make_safe(make, evaluator, process, limits, remedy)
    made = rule.tune(designed, kind, limits)
    if math.isinf(evaluator.ms(made, process).ms):
        raise ValueError(
            f"the loop of the rule {rule.name!r} is unstable with the model itself: take another rule"
        )
    worst = evaluator.worst(made, limits.family).ms
    if worst > limits.ms_worst:
        raise refusal(limits, f"{remedy}, or the rule 'optimal', which keeps Ms", worst)
    return made, 1.0


def _doubt_sampling(loop: Loop, sample_time: float, doubts: list[str]) -> None:
    """Add a doubt if the sample time is too long for the loop or for the filters of the controller."""
    turn = sample_time * float(gain_crossovers(loop).max(initial=0.0))
    if turn > LONG_TURN:
        better = LONG_TURN / turn * sample_time
        doubts.append(doubt("long sample", sample_time=sample_time, turn=turn, better=better))
    fastest = float(np.abs(roots(loop.controller.fraction()[1])).max(initial=0.0))
    if fastest * sample_time > 1 + PHASE_UNKNOWN:
        doubts.append(doubt("filter lost", filter_time=1 / fastest, sample_time=sample_time))


def _noise_limits(
    model: Process | Fit, designed: Process, noise_gain: float | None, h: float | None, notes: list[str]
) -> dict[str, Any]:
    """Return the limits of noise. Add a note if a default is used."""
    if noise_gain is not None and h is None:
        raise ValueError(
            "sample_time must be given with noise_gain: the noise gain depends on the sample time"
        )
    if noise_gain is not None:
        return {"noise_gain": noise_gain, "sample_time": h}
    if isinstance(model, Fit) and model.noise > 0 and model.record.steps:
        moved = abs(model.record.steps[0].after - model.record.steps[0].before)
        most = DEFAULT_NOISE_SHARE * moved / model.noise
        notes.append(
            f"noise gain at most {most:.3g}: the noise of the record then moves u by at most 1 % (standard "
            f"deviation) of the recorded step of u, {moved:g}"
        )
        return {"noise_gain": most, "sample_time": h or model.record.sampling}
    mks = DEFAULT_MKS * _gain_needed(designed)
    notes.append(f"gain from noise to u at most {mks:.3g} at any frequency (mks), since no limit was given")
    return {"mks": mks}


def _optimal(designed: Process, others: list[Process], kind: str) -> Designer:
    """Return a function that searches for the least IAE. The loop must also be safe with `others`."""

    def make(request: Requirements, near: Design | None) -> tuple[Design, Any]:
        family = tuple(others) if request.family else ()
        optimum = optimal.least_iae(designed, ORDER[kind], replace(request, family=family), near)
        return optimum, optimum.active

    return make


def _without_short_delay(process: Process, fastest: float, doubts: list[str]) -> Process:
    """Leave out a dead time that is negligible up to the frequency `fastest`, and add a doubt."""
    if not 0 < process.delay * fastest < PHASE_UNKNOWN:
        return process
    doubts.append(doubt("short delay", delay=process.delay, phase=PHASE_UNKNOWN))
    return Process(process.num, process.den)


def _fastest(process: Process, rule: str, noise_gain: float | None, sample_time: float | None) -> float:
    """Return the highest frequency at which a loop can act, given its sample time or the default limit of noise.

    The frequency is in rad per time unit. It is infinite if neither the sample time nor the default limit applies.
    """
    if sample_time is not None:
        return 1 / sample_time
    plain = Process(process.num, process.den)
    corners = corner_frequencies(plain)
    if rule != "optimal" or noise_gain is not None or not corners.size:
        return math.inf
    # |T| is |P| times the gain from noise to u. The loop acts only where |P| times the limit of this gain reaches 1.
    w = _grid(corners)
    acts = DEFAULT_MKS * _gain_needed(plain) * np.abs(plain(1j * w)) >= 1
    return math.inf if acts[-1] else float(w[np.flatnonzero(acts).max(initial=0)])


def _gain_needed(process: Process) -> float:
    """Return 1/|P| at frequency 0 or, for an integrator, at the frequency where the phase has fallen by 45°."""
    gain = process.gain()
    if math.isfinite(gain):
        return 1 / abs(gain)
    corners = corner_frequencies(process)
    if not corners.size:
        raise ValueError(
            "noise_gain and sample_time must be given for integrators without lag and dead time: nothing else limits "
            "the speed of their loop"
        )
    response = process(1j * _grid(corners))
    phase = np.unwrap(np.angle(response))
    return float(1 / np.abs(response[int(np.argmax(phase <= phase[0] - np.pi / 4))]))


def _grid(corners: Array) -> Array:
    return np.geomspace(1e-4 * corners.min(), 1e4 * corners.max(), 4801)


def _known_dynamics(model: Process | Fit, process: Process, kind: str, doubts: list[str]) -> None:
    """Add a doubt if `kind` has more derivatives than the model has poles.

    If the record shows that the plant has further dynamics, raise an error instead.
    """
    known = len(process.den) - 1
    if known >= ORDER[kind]:
        return
    if isinstance(model, Fit) and model.incomplete:
        raise ValueError(
            f"the model has {known} pole(s), and a {kind} also acts on faster dynamics. The record shows that "
            f"there are such dynamics (a model error of {model.model_error:.3g}, noise {model.noise:.3g}) but does not "
            "identify them: choose a controller with fewer derivatives, or record several larger steps, each from rest"
        )
    doubts.append(doubt("few poles", known=known, kind=kind))


def _iae_ms_mks(loop: Loop) -> dict[str, float]:
    """Return Ms, mks and the IAE of a load step. All three are infinite for an unstable loop."""
    if not is_stable(loop):
        return dict.fromkeys(("iae", "ms", "mks"), math.inf)
    return {"iae": load_iae(loop), "ms": max_sensitivity(loop)[0], "mks": max_control_sensitivity(loop)[0]}


def plants_within(model: Process | Fit, process: Process, spread: float | None) -> list[Process]:
    """Return the plants with which the design must be safe: those of `perturbed_plants`, or random plants of a fit."""
    if spread is None:
        return model.plants(SPREAD + 1)[1:] if isinstance(model, Fit) else []
    share = _check.real("spread", spread, above=0.0)
    if share >= 1:
        raise ValueError(f"spread must be below 1, found {spread!r}")
    return perturbed_plants(process, share)


def perturbed_plants(process: Process, share: float) -> list[Process]:
    """Return eight plants with a relative error of gain, of dead time, and of the time scale of poles and zeros.

    Parameters
    ----------
    process : Process
        The nominal plant.
    share : float
        Relative error, from 0 to below 1.

    Returns
    -------
    list of Process
        All combinations of lower and higher values.

    Examples
    --------
    >>> import pidalab
    >>> from pidalab.plant.tuning import perturbed_plants
    >>> [round(float(plant.gain()), 1) for plant in perturbed_plants(pidalab.fopdt(1.0, 2.0, 1.0), 0.2)]
    [0.8, 0.8, 0.8, 0.8, 1.2, 1.2, 1.2, 1.2]
    """
    plants = []
    for gain, time, delay in product((1 - share, 1 + share), repeat=3):
        num, den = (c * time ** np.arange(c.size - 1.0, -1.0, -1.0) for c in (process.num, process.den))
        plants.append(Process(gain * num, den, delay * process.delay))
    return plants
