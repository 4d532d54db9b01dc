"""Tune a controller for a process or a fitted model, and price in what the model does not know."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from pidalab import _check
from pidalab._check import Array
from pidalab.loop import Loop
from pidalab.plant.doubts import doubt
from pidalab.plant.fitting import Fit
from pidalab.plant.record import Record
from pidalab.plant.safety import Designer, LoopEvaluator, make_safe, refusal
from pidalab.process import Process, rational, require_no_zero_at_origin, sign_of_gain
from pidalab.requirements import Requirements
from pidalab.roots import roots
from pidalab.rules import Design
from pidalab.rules.registry import ORDER, Rule, find

# in one such sample a process that settles answers by 63 % or more, and little is left to control in the next; an
# integrator has no such time, and its other dynamics are at rest after ten times their longest one
LONGEST_SAMPLE, AT_REST = 1.0, 10.0
OTHER_UNIT = 100.0  # times faster or slower than the record: a sample time that may be in another unit


def require_sampling(process: Process, sample_time: float) -> None:
    """Refuse a sample time in which the process does all it ever does."""
    times = [1 / speed for speed in corner_frequencies(process)]
    poles = np.abs(roots(process.den))
    if np.isfinite(process.gain()):
        limit = LONGEST_SAMPLE * (float(np.sum(1 / poles)) + process.delay) if times else math.inf
        why = "all its lags and its dead time, after which it has answered by 63 % or more"
    else:
        limit = AT_REST * max(times, default=math.inf)
        why = f"{AT_REST:g} times its longest time (after which all but the integrator is at rest)"
    if sample_time > limit:
        raise ValueError(
            f"sample_time must be at most {limit:.4g} for this process, {why}, found {sample_time:g}"
        )


def doubt_unit(sample_time: float, recorded: float) -> list[str]:
    """Say where a sample time is so far from that of the record that it may be in another unit."""
    share = sample_time / recorded
    if 1 / OTHER_UNIT < share < OTHER_UNIT:
        return []
    return [doubt("time unit", sample_time=sample_time, share=share, recorded=recorded)]


def corner_frequencies(process: Process) -> Array:
    """Return the frequencies of poles and zeros, and that of the dead time."""
    found = np.abs(np.concatenate([roots(process.den), roots(process.num)]))
    return np.append(found[found > 0], [1 / process.delay] if process.delay else [])


# default limit of the gain from noise to u, in units of what the plant asks of u for a unit of y
LOUDEST = 10.0
QUIET = 0.01  # share of the input's step in a record that noise may make of u, in standard deviations
MOST_MS = 5.0
UNSEEN = 1e-3  # phase in rad that no model is known to
SPREAD = 20  # plants drawn from the uncertainty of a fit
DEAR = 1.5  # price of robustness in IAE that is doubted
SLOW = 0.5  # turn of the crossover in a sample, in rad, from which on a loop is too fast for its sampling


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
        The plant, or what `pidalab.identification.fit` made of a record.
    kind : {"PIDA", "PID", "PI"}, optional
        Which controller.
    ms : float, optional
        Largest maximum sensitivity, above 1: 1.4 is cautious, 2 fast. With a sample time, that of the sampled loop.
        Rules that do not know Ms (all but "optimal" and "haalman") ignore it; the value reached is in the result.
    noise_gain : float, optional
        Largest standard deviation of u per unit of that of white measurement noise, sampled with `sample_time`.
        Without it, a Fit whose record is noisy allows the noise to move u by 1 % of the record's step, and a Process
        allows a gain of 10 from noise to u, over all frequencies, per unit of what it asks of u for a unit of y.
    sample_time : float, optional
        Sample time of the controller that will run the design, by backward differences, above 0. Half of it is added to
        the dead time in the design, as holding does in the loop, and what is asked of the design is corrected until the
        sampled loop has the Ms that is wanted, to 0.1 %.
    rule : str, optional
        "optimal", the least IAE for loads; or a name of the registry, `pidalab.rules.registry`, such as "haalman" or
        "simc".
    spread : float, optional
        What the model may be wrong by, as a share: gain, time scale and dead time are varied by it, up and down. By
        default a Process is not varied, and a Fit by its own uncertainty and by 15 % of the gain, up or down, as at
        another working point or with a valve that sticks (`Fit.plants`). The worst of the twenty plants drawn from that
        is no bound: of random plants a few in a hundred were worse.
    output_filter : control.TransferFunction, optional
        A filter of your own (or the lag of a sensor) in series with the controller: the design knows it.
    ms_worst : float, optional
        Largest maximum sensitivity with any plant of the spread, above 1.

    Returns
    -------
    Design
        Its `info` has ``iae``, that of a load step in units of y times time; ``ms``; ``mks``, the largest gain from
        noise to u; with a sample time ``ms_sampled``. Over the spread, if there is one: ``ms_worst`` (of the sampled
        loop, with a sample time); ``iae_worst``, the IAE with the plant that has it; and ``price``, the IAE over that
        of the design without `ms_worst`. ``doubts`` is what a user should know, ``notes`` what was assumed.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, a rule that does not make this kind of controller, and what the rule itself refuses:
        a model outside its validity, or limits that nothing satisfies. Also for a loop that would be unstable with the
        model, or have a worst Ms above `ms_worst`, unless three times the IAE is enough to avoid it; and for a Fit that
        leaves more than noise and has fewer poles than `kind` has derivatives.

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
            f"ms must be at most {MOST_MS:g}, found {ms:g}: 1.4 is cautious, 2 is fast, and a larger one leaves a loop "
            "close to instability"
        )
    named = None if rule == "optimal" else find(rule, "optimal")
    if sample_time is not None:
        sample_time = _check.real("sample_time", sample_time, above=0.0)
    process = model.process if isinstance(model, Fit) else model
    if isinstance(process, Record):
        raise TypeError("model must be a Process or a Fit, found Record; fit one: identification.fit(record)")
    require_no_zero_at_origin("model", process)
    if sample_time is not None:
        require_sampling(process, sample_time)
    doubts: list[str] = []
    notes: list[str] = []
    if isinstance(model, Fit) and sample_time is not None:
        doubts += doubt_unit(sample_time, model.record.sampling)
    process = _without_unseen_delay(process, _fastest(process, rule, noise_gain, sample_time), doubts)
    # before the search, so that a spread out of range is refused at once
    plants = plants_within(model, process, spread)
    if plants and ms > ms_worst:
        raise ValueError(
            f"ms must be at most ms_worst, {ms_worst:g}, found {ms:g}: with the model, as with any other plant of the "
            "spread"
        )
    limits, remedy = Requirements(ms=ms, family=tuple(plants), ms_worst=ms_worst), _remedy(model)
    if len({sign_of_gain(plant) for plant in [process, *plants]}) > 1:
        raise ValueError(
            f"the sign of the gain is not settled, and no controller is stable with both signs: {remedy}"
        )
    designed, *others = (
        _seen_by_the_controller(plant, sample_time, output_filter) for plant in [process, *plants]
    )
    _known_dynamics(model, designed, kind, doubts)
    evaluator = LoopEvaluator(sample_time, output_filter)
    if named is None:
        noise = _noise_limits(model, designed, noise_gain, sample_time, notes)
        made, price = make_safe(
            _optimal(designed, others, kind), evaluator, process, replace(limits, **noise), remedy
        )
        if "sample_time" in made.active:
            doubts.append(doubt("fast filter", sample_time=made.info["sample_time"]))
    else:
        made, price = _by_rule(named, designed, kind, evaluator, process, limits, remedy)
        if noise_gain is not None:
            _check.real("noise_gain", noise_gain, above=0.0)
            doubts.append(doubt("noise unused", rule=rule))
        process = _without_unseen_delay(process, _highest_crossover(process, made), doubts)
    if price > DEAR:
        doubts.append(doubt("price", price=price, remedy=remedy))
    loop = evaluator.loop(made, process)
    info: dict[str, Any] = _iae_ms_mks(loop)
    reasons: list[str] = []  # why a sampled loop has no Ms
    if sample_time is not None:
        info["ms_sampled"], reason = evaluator.ms(made, process)
        reasons.append(reason)
        _doubt_sampling(loop, sample_time, doubts)
    if plants:
        info["ms_worst"], reason = evaluator.worst(made, plants)
        reasons.append(reason)
        # of one plant: to simulate all twenty would take longer than the search
        worst = max(plants, key=lambda plant: evaluator.ms(made, plant).ms)
        info["iae_worst"] = _iae_ms_mks(evaluator.loop(made, worst))["iae"]
        info["price"] = price
    info["notes"] = tuple(notes)
    info["doubts"] = (*doubts, *dict.fromkeys(filter(None, reasons)))
    return Design(process, made.controller, made.prefilter, loop.output_filter, made.source, info)


def _seen_by_the_controller(process: Process, sample_time: float | None, output_filter: Any) -> Process:
    """Return the process with the filter in series and the half sample that a held control signal waits."""
    num, den = rational("output_filter", 1.0 if output_filter is None else output_filter)
    delay = process.delay + (sample_time or 0.0) / 2
    return Process(np.convolve(process.num, num), np.convolve(process.den, den), delay)


def _remedy(model: Process | Fit) -> str:
    """What would make a model more certain."""
    if isinstance(model, Fit):
        return "a longer record, a larger step or several of them, or less noise would help"
    return "a smaller spread would help"


def _by_rule(
    rule: Rule,
    designed: Process,
    kind: str,
    evaluator: LoopEvaluator,
    process: Process,
    limits: Requirements,
    remedy: str,
) -> tuple[Design, float]:
    """A rule's design and its price; one that does not know Ms is taken as it is, or refused."""
    if rule.knows_ms:

        def make(asked: Requirements, near: Design | None) -> tuple[Design, list[str]]:
            binding = "ms_worst" if asked.family and asked.ms_worst < asked.ms else "ms"
            return rule.tune(designed, kind, replace(asked, ms=getattr(asked, binding))), [binding]

        return make_safe(make, evaluator, process, limits, remedy)
    made = rule.tune(designed, kind, limits)
    if math.isinf(evaluator.ms(made, process).ms):
        raise ValueError(
            f"the loop of the rule {rule.name!r} is unstable with the model itself: take another rule"
        )
    worst = evaluator.worst(made, limits.family).ms
    if worst > limits.ms_worst:
        raise refusal(limits, f"{remedy}, or the rule 'optimal', which knows Ms", worst)
    return made, 1.0


def _doubt_sampling(loop: Loop, sample_time: float, doubts: list[str]) -> None:
    """Say where the sample time is too long for the loop, or for its filters."""
    from pidalab.robustness.margins import gain_crossovers

    turn = sample_time * float(gain_crossovers(loop).max(initial=0.0))
    if turn > SLOW:
        doubts.append(
            doubt("long sample", sample_time=sample_time, turn=turn, better=SLOW / turn * sample_time)
        )
    fastest = float(np.abs(roots(loop.controller.fraction()[1])).max(initial=0.0))
    if fastest * sample_time > 1 + UNSEEN:
        doubts.append(doubt("filter lost", filter_time=1 / fastest, sample_time=sample_time))


def _noise_limits(
    model: Process | Fit,
    designed: Process,
    noise_gain: float | None,
    sample_time: float | None,
    notes: list[str],
) -> dict[str, Any]:
    """Return the limits of noise; without one given, a default, which is reported."""
    if noise_gain is None and isinstance(model, Fit) and model.noise > 0 and model.record.steps:
        moved = abs(model.record.steps[0].after - model.record.steps[0].before)
        noise_gain, sample_time = QUIET * moved / model.noise, sample_time or model.record.sampling
        notes.append(
            f"noise gain at most {noise_gain:.3g}, from the record: noise moves u by 1 % of its step of {moved:g}"
        )
    elif noise_gain is None:
        mks = LOUDEST * _asked_of_u(designed)
        notes.append(
            f"gain from noise to u at most {mks:.3g} at any frequency (mks), since no limit was given"
        )
        return {"mks": mks}  # without noise the half sample in `designed` is enough
    elif sample_time is None:
        raise ValueError("sample_time must be given with noise_gain: sampled noise has no size without it")
    return {"noise_gain": noise_gain, "sample_time": sample_time}


def _optimal(designed: Process, others: list[Process], kind: str) -> Designer:
    """Return the search for the least IAE, with the family as the controller sees it."""
    from pidalab import optimal

    def make(asked: Requirements, near: Design | None) -> tuple[Design, Any]:
        seen = replace(asked, family=tuple(others) if asked.family else ())
        found = optimal.least_iae(designed, ORDER[kind], seen, near)
        return found, found.active

    return make


def _without_unseen_delay(process: Process, fastest: float, doubts: list[str]) -> Process:
    """Leave out a dead time that a loop cannot notice which acts up to a frequency, and say so."""
    if not 0 < process.delay * fastest < UNSEEN:
        return process
    doubts.append(doubt("short delay", delay=process.delay, phase=UNSEEN))
    return Process(process.num, process.den)


def _highest_crossover(process: Process, made: Design) -> float:
    """Return the highest frequency at which the gain of a design's loop is 1, 0 if there is none."""
    from pidalab.robustness.margins import gain_crossovers

    return float(gain_crossovers(Loop(process, made.controller, made.output_filter)).max(initial=0.0))


def _fastest(process: Process, rule: str, noise_gain: float | None, sample_time: float | None) -> float:
    """Return the highest frequency at which a loop can act: by its sampling, or by the default limit of noise."""
    if sample_time is not None:
        return 1 / sample_time
    plain = Process(process.num, process.den)
    corners = corner_frequencies(plain)
    if rule != "optimal" or noise_gain is not None or not corners.size:
        return math.inf
    # |T| is at most |P| times the gain from noise to u
    w = np.geomspace(1e-4 * corners.min(), 1e4 * corners.max(), 4801)
    acts = LOUDEST * _asked_of_u(plain) * np.abs(plain(1j * w)) >= 1
    return math.inf if acts[-1] else float(w[np.flatnonzero(acts).max(initial=0)])


def _asked_of_u(process: Process) -> float:
    """Return 1/|P| where the phase has fallen by 45 degrees from rest, or at rest for a process that settles."""
    gain = process.gain()
    if math.isfinite(gain):
        return 1 / abs(gain)
    corners = corner_frequencies(process)
    if not corners.size:
        raise ValueError(
            "noise_gain and sample_time must be given for integrators without lag and dead time: nothing else limits "
            "the speed of their loop"
        )
    w = np.geomspace(1e-4 * corners.min(), 1e4 * corners.max(), 4801)
    value = process(1j * w)
    turned = np.unwrap(np.angle(value))
    k = int(np.argmax(turned <= turned[0] - np.pi / 4))
    return float(1 / np.abs(value[k]))


def _known_dynamics(model: Process | Fit, process: Process, kind: str, doubts: list[str]) -> None:
    """Doubt a derivative beyond the poles of the model; refuse it where the record shows that some are missing."""
    known = len(process.den) - 1
    if known >= ORDER[kind]:
        return
    short = f"the model has {known} pole(s), and a {kind} acts on dynamics beyond them"
    if isinstance(model, Fit) and model.incomplete:
        raise ValueError(
            f"{short}, which the record shows to be there (a model error of {model.model_error:.3g}, noise "
            f"{model.noise:.3g}) and does not settle: take a lower kind, or step the input several times, further and "
            "from rest"
        )
    doubts.append(doubt("few poles", known=known, kind=kind))


def _iae_ms_mks(loop: Loop) -> dict[str, float]:
    """Ms, mks and the IAE of a load step; nan and infinity for an unstable loop."""
    from pidalab.robustness import max_control_sensitivity
    from pidalab.robustness.margins import max_sensitivity
    from pidalab.robustness.poles import is_stable
    from pidalab.simulation.exact import load_iae

    if not is_stable(loop):
        return {"iae": math.inf, "ms": math.inf, "mks": math.inf}
    return {"iae": load_iae(loop), "ms": max_sensitivity(loop)[0], "mks": max_control_sensitivity(loop)[0]}


def plants_within(model: Process | Fit, process: Process, spread: float | None) -> list[Process]:
    """Return plants in which the model may be wrong: by a share, or as the record of a fit leaves them."""
    if spread is None:
        return model.plants(SPREAD + 1)[1:] if isinstance(model, Fit) else []
    share = _check.real("spread", spread, above=0.0)
    if share >= 1:
        raise ValueError(f"spread must be a share below 1, found {spread!r}")
    return perturbed_plants(process, share)


def perturbed_plants(process: Process, share: float) -> list[Process]:
    """Return the eight plants whose gain, time scale of poles and zeros, and dead time are off by a share.

    Parameters
    ----------
    process : Process
        The plant as it is thought to be.
    share : float
        What it may be wrong by, from 0 to below 1.

    Returns
    -------
    list of Process
        Each of the three lower or higher.

    Examples
    --------
    >>> import pidalab
    >>> from pidalab.plant.tuning import perturbed_plants
    >>> [round(float(plant.gain()), 1) for plant in perturbed_plants(pidalab.fopdt(1.0, 2.0, 1.0), 0.2)]
    [0.8, 0.8, 0.8, 0.8, 1.2, 1.2, 1.2, 1.2]
    """
    found = []
    for gain, time, delay in product((1 - share, 1 + share), repeat=3):
        num, den = (c * time ** np.arange(c.size - 1.0, -1.0, -1.0) for c in (process.num, process.den))
        found.append(Process(gain * num, den, delay * process.delay))
    return found
