"""One call that tunes: all rules and the optimum behind one door, with what the model does not know priced in."""

from __future__ import annotations

import math
from itertools import product
from typing import Any

import numpy as np

from pidalab import _check
from pidalab._check import Array
from pidalab.identification import Fit
from pidalab.loop import Loop
from pidalab.process import Process, rational, require_gain
from pidalab.record import Record
from pidalab.roots import roots
from pidalab.rules import Design
from pidalab.rules.registry import ORDER, find

LOUDEST = (
    10.0  # default limit of the gain from noise to u, in units of what the plant asks of u for a unit of y
)
QUIET = 0.01  # share of the input's step in a record that noise may make of u, in standard deviations
AT_REST = 10.0  # longest times of the process that pass until it is at rest: slower sampling sees nothing but its gain
UNSEEN = 1e-3  # phase in rad that no model is known to
SPREAD = 20  # plants drawn from the uncertainty of a fit


def tune(
    model: Process | Fit,
    kind: str = "PIDA",
    ms: float = 1.6,
    noise_gain: float | None = None,
    sample_time: float | None = None,
    rule: str = "optimal",
    spread: float | None = None,
    output_filter: Any = None,
) -> Design:
    r"""Tune a PI, PID or PIDA controller.

    Parameters
    ----------
    model : Process or Fit
        The plant, or what `pidalab.identification.fit` made of a record.
    kind : {"PIDA", "PID", "PI"}, optional
        Which controller.
    ms : float, optional
        Largest maximum sensitivity, above 1: 1.4 is cautious, 2 fast. Rules that do not know Ms ignore it; the value
        reached is in the result.
    noise_gain : float, optional
        Largest standard deviation of u per unit of that of white measurement noise, sampled with `sample_time`.
        Without it, a Fit whose record is noisy allows the noise to move u by 1 % of the record's step, and a Process
        allows a gain of 10 from noise to u, over all frequencies, per unit of what it asks of u for a unit of y.
    sample_time : float, optional
        Sample time of the controller that will run the design, above 0: half of it is added to the dead time in the
        design, as holding does in the loop.
    rule : str, optional
        "optimal", the least IAE for loads; or a name of the registry, `pidalab.rules.registry`, such as "haalman" or
        "simc".
    spread : float, optional
        What the model may be wrong by, as a share: gain, time scale and dead time are varied by it, up and down. By
        default a Fit is varied by its own uncertainty, a Process not at all. The worst of the twenty plants drawn from
        that is no bound: of a hundred random plants of three lags four were worse, by about 1 % of Ms.
    output_filter : control.TransferFunction, optional
        A filter of your own (or the lag of a sensor) in series with the controller: the design knows it.

    Returns
    -------
    Design
        Its `info`: ``iae``, that of a load step in units of y times time; ``ms``; ``mks``, the largest gain from noise
        to u; ``ms_worst`` and ``iae_worst`` over the spread, if there is one (infinite where a plant of the spread is
        unstable); ``doubts``, what a user should know.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, a rule that does not make this kind of controller, and what the rule itself refuses:
        a model outside its validity, or limits that nothing satisfies.

    Examples
    --------
    >>> import pidalab
    >>> design = pidalab.tune(pidalab.lags(3, delay=1.0), kind="PI", ms=1.6, spread=0.1)
    >>> design.ms <= 1.6 * (1 + 1e-6) < design.ms_worst
    True
    """
    _check.choice("kind", kind, ORDER)
    ms = _check.real("ms", ms, above=1.0)
    named = None if rule == "optimal" else find(rule, "optimal")
    if sample_time is not None:
        sample_time = _check.real("sample_time", sample_time, above=0.0)
    process = model.process if isinstance(model, Fit) else model
    if isinstance(process, Record):
        raise TypeError("model must be a Process or a Fit, found Record; fit one: identification.fit(record)")
    require_gain("model", process)
    slowest = max((1 / speed for speed in _corners(process)), default=math.inf)
    if sample_time is not None and sample_time > AT_REST * slowest:
        raise ValueError(
            f"sample_time must be at most {AT_REST * slowest:.4g} for this process, {AT_REST:g} times its longest time "
            f"(after which it is at rest), found {sample_time:g}"
        )
    doubts: list[str] = []
    process = _without_unseen_delay(process, _fastest(process, rule, noise_gain, sample_time), doubts)
    # before the search, so that a spread out of range is refused at once
    plants = plants_within(model, process, spread)
    designed = _seen_by_the_controller(process, sample_time, output_filter)
    if named is None:
        made = _optimal(model, designed, kind, ms, noise_gain, sample_time, doubts)
    else:
        made = named.tune(designed, kind, ms)
        if noise_gain is not None:
            doubts.append(f"the rule {rule!r} does not know noise: noise_gain was not used")
        process = _without_unseen_delay(process, _highest_crossover(process, made), doubts)
    _doubt_unknown_dynamics(designed, kind, doubts)
    loop = Loop(process, made.controller, _in_series(made.output_filter, output_filter), made.prefilter)
    info = {**_measured(loop), **_worst(loop, plants), "doubts": tuple(doubts)}
    return Design(process, made.controller, made.prefilter, loop.output_filter, made.source, info)


def _seen_by_the_controller(process: Process, sample_time: float | None, output_filter: Any) -> Process:
    """Return the process with the filter in series and the half sample that a held control signal waits."""
    num, den = rational("output_filter", 1.0 if output_filter is None else output_filter)
    delay = process.delay + (sample_time or 0.0) / 2
    return Process(np.convolve(process.num, num), np.convolve(process.den, den), delay)


def _in_series(first: Any, second: Any) -> Any:
    """Return both filters as one, None for none."""
    if first is None or second is None:
        return second if first is None else first
    import control

    (a, b), (c, d) = rational("output_filter", first), rational("output_filter", second)
    return control.TransferFunction(np.convolve(a, c), np.convolve(b, d))


def _optimal(
    model: Process | Fit,
    designed: Process,
    kind: str,
    ms: float,
    noise_gain: float | None,
    sample_time: float | None,
    doubts: list[str],
) -> Design:
    """Least IAE under Ms and a limit for noise; without one given, a default that is said."""
    from pidalab import optimal

    mks = None
    if noise_gain is None and isinstance(model, Fit) and model.noise > 0 and model.record.steps:
        moved = abs(model.record.steps[0].after - model.record.steps[0].before)
        noise_gain, sample_time = QUIET * moved / model.noise, sample_time or model.record.sampling
        doubts.append(
            f"noise_gain = {noise_gain:.3g}, from the record: noise moves u by 1 % of its step of {moved:g}"
        )
    elif noise_gain is None:
        mks = LOUDEST * _asked_of_u(designed)
        doubts.append(f"no limit for noise was given: mks = {mks:.3g} is allowed")
    elif sample_time is None:
        raise ValueError("sample_time must be given with noise_gain: sampled noise has no size without it")
    # without noise the half sample in `designed` is enough
    sampled = None if noise_gain is None else sample_time
    found = optimal.load(designed, ORDER[kind], ms, mks, noise_gain, sampled)
    if "sample_time" in found.active:
        doubts.append(
            f"the filter is as fast as the sample, {sample_time:g}, allows: with faster sampling it would be faster"
        )
    return found


def _without_unseen_delay(process: Process, fastest: float, doubts: list[str]) -> Process:
    """Leave out a dead time that a loop cannot notice which acts up to a frequency, and say so."""
    if not 0 < process.delay * fastest < UNSEEN:
        return process
    doubts.append(
        f"the dead time of {process.delay:.3g} is left out: where the loop can act, it turns the phase by less "
        f"than {UNSEEN:g} rad"
    )
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
    corners = _corners(plain)
    if rule != "optimal" or noise_gain is not None or not corners.size:
        return math.inf
    # |T| is at most |P| times the gain from noise to u
    w = np.geomspace(1e-4 * corners.min(), 1e4 * corners.max(), 4801)
    acts = LOUDEST * _asked_of_u(plain) * np.abs(plain(1j * w)) >= 1
    return math.inf if acts[-1] else float(w[np.flatnonzero(acts).max(initial=0)])


def _corners(process: Process) -> Array:
    """Return the frequencies of poles and zeros, and that of the dead time."""
    found = np.abs(np.concatenate([roots(process.den), roots(process.num)]))
    return np.append(found[found > 0], [1 / process.delay] if process.delay else [])


def _asked_of_u(process: Process) -> float:
    """Return 1/|P| where the phase has fallen by 45 degrees from rest, or at rest for a process that settles."""
    gain = process.gain()
    if math.isfinite(gain):
        return 1 / abs(gain)
    corners = _corners(process)
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


def _doubt_unknown_dynamics(process: Process, kind: str, doubts: list[str]) -> None:
    """Say where a derivative has no lag of the model to work on."""
    known = len(process.den) - 1
    if known < ORDER[kind]:
        doubts.append(
            f"the model has {known} pole(s): a {kind} leans on dynamics that it does not know; fit a model of higher "
            "order, or take a lower kind"
        )


def _measured(loop: Loop) -> dict[str, float]:
    """Ms, mks and the IAE of a load step; nan and infinity for an unstable loop."""
    from pidalab.robustness.control import max_control_sensitivity
    from pidalab.robustness.margins import max_sensitivity
    from pidalab.robustness.poles import is_stable

    if not is_stable(loop):
        return {"iae": math.inf, "ms": math.inf, "mks": math.inf}
    return {"iae": _load_iae(loop), "ms": max_sensitivity(loop)[0], "mks": max_control_sensitivity(loop)[0]}


def _load_iae(loop: Loop) -> float:
    """IAE of a unit step of the load, over a horizon that is doubled until the loop has settled."""
    from pidalab.robustness.poles import rightmost_poles
    from pidalab.simulation.exact import load_response
    from pidalab.simulation.settling import settled

    slowest = -float(np.max(rightmost_poles(loop).real))
    return settled(load_response, loop, 12.0 / slowest + 10.0 * loop.process.delay).iae(horizon=math.inf)


def plants_within(model: Process | Fit, process: Process, spread: float | None) -> list[Process]:
    """Return plants in which the model may be wrong: by a share, or as the record of a fit leaves them."""
    if spread is None:
        return model.spread(SPREAD) if isinstance(model, Fit) else []
    share = _check.real("spread", spread, above=0.0)
    if share >= 1:
        raise ValueError(f"spread must be a share below 1, found {spread!r}")
    return corners(process, share)


def corners(process: Process, share: float) -> list[Process]:
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
    >>> from pidalab.tuning import corners
    >>> [round(float(plant.gain()), 1) for plant in corners(pidalab.fopdt(1.0, 2.0, 1.0), 0.2)]
    [0.8, 0.8, 0.8, 0.8, 1.2, 1.2, 1.2, 1.2]
    """
    return [_varied(process, gain, time, delay, share) for gain, time, delay in product((-1, 1), repeat=3)]


def _varied(process: Process, gain: int, time: int, delay: int, share: float) -> Process:
    """Return the process with gain, time scale and dead time changed by a share, up or down."""

    def scaled(coefficients: Array) -> Array:
        return coefficients * (1 + time * share) ** np.arange(coefficients.size - 1.0, -1.0, -1.0)

    num = scaled(process.num) * (1 + gain * share)
    return Process(num, scaled(process.den), process.delay * (1 + delay * share))


def _worst(loop: Loop, plants: list[Process]) -> dict[str, float]:
    """Return the worst Ms and IAE over plants in place of the model."""
    if not plants:
        return {}
    measured = [
        _measured(Loop(plant, loop.controller, loop.output_filter, loop.prefilter)) for plant in plants
    ]
    return {f"{name}_worst": max(each[name] for each in measured) for name in ("ms", "iae")}
