"""Judge the gains of a running loop by its log, and suggest other gains."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from pidalab import _check
from pidalab._text import KINDS
from pidalab.comparison.judging import DesignRow, text_table
from pidalab.controllers import HighOrderPID
from pidalab.controllers.base import Controller
from pidalab.loop import Loop
from pidalab.plant.doubts import doubt, with_doubts
from pidalab.plant.fitting import Fit, fit
from pidalab.plant.fitting.uncertainty import rough, samples_per_error
from pidalab.plant.record import Record
from pidalab.plant.record.cleaning import FEWEST
from pidalab.plant.reporting import measure_candidate, tuned_row
from pidalab.plant.safety import LoopEvaluator
from pidalab.process import Process, sign_of_gain
from pidalab.relative_noise import sampled_noise
from pidalab.rules import Design
from pidalab.simulation.exact import simulate

# For each suggested set of gains: limit of Ms, and limit of the noise gain divided by the present noise gain.
SETS = {"calmer": (1.4, 0.5), "same noise": (1.6, 1.0), "faster": (1.8, 2.0)}
PLANTS_JUDGED = 60  # number of plants; with fewer, their largest Ms is too often below the true Ms
# A fit with a load is used only if it reduces the deviation of the residuals to less than this share.
CLEARER = 0.8
CLEAR_MOVE = 20.0  # the output must move by this number of standard deviations of the noise
COLOURED = 3.0  # if `samples_per_error` is at least this, the residuals are not white noise
EXPLAINED = 0.8  # a doubt is given if the share from `explained_by` is below this
MOST_STEPPED = 5000  # the controller is run for at most this number of samples
FED_BACK = 0.05  # a doubt is given if slow disturbances cause this share of the variance of u, or more
CHECK_COLUMNS = {
    "IAE load": "iae_load",
    "Ms": "ms_sampled",
    "worst Ms": "ms_worst",
    "rel. noise": "relative_noise",
}


@dataclass(frozen=True, eq=False)
class Check:
    """A judgement of running gains. ``print`` shows it.

    Attributes
    ----------
    fit : Fit
        Model of the plant.
    design : Design
        The running gains, with their filter.
    sample_time : float
        Sample time of the running controller and of the suggested controllers, in the log's unit of time.
    ms : float
        Maximum sensitivity Ms of the running gains in a sampled loop with the model. It is infinite if this loop is
        unstable.
    interval : tuple of float
        Smallest and largest Ms of the running gains with the model and with `plants`.
    plants : tuple of Process
        Plants that the log does not rule out.
    ms_worst : float
        Largest Ms that a suggested set of gains may have with any one of `plants`.
    doubts : tuple of str
        Reservations about the judgement.
    """

    fit: Fit
    design: Design
    sample_time: float
    ms: float
    interval: tuple[float, float]
    plants: tuple[Process, ...]
    ms_worst: float
    doubts: tuple[str, ...]

    @cached_property
    def rows(self) -> tuple[DesignRow, ...]:
        """Rows for the running gains, for the best gains, and for three suggested sets of gains.

        The best gains have the same kind, Ms and noise gain as the running gains.
        """
        gains = self.design.controller.gains()
        kind = KINDS[2 if gains.ka else 1 if gains.kd else 0]
        now = measure_candidate(self.design, "now", kind, self.fit)
        now = now._replace(ms_worst=self.interval[1], ms_sampled=self.ms)
        rows, noise = [now], math.nan
        if now.applies:
            noise = sampled_noise(self.design.loop(self.fit.process), self.sample_time)[0]
        asked: dict[str, tuple[Process | Fit, float, float]] = {}
        if not math.isnan(noise) and math.isfinite(self.ms):
            asked["best like it"] = self.fit.process, self.ms, noise
        for name, (ms, share) in SETS.items():
            asked[name] = self.fit, min(ms, self.ms_worst), share * noise
        h, evaluator = self.sample_time, LoopEvaluator(self.sample_time, None)
        for name, (plant, ms, gain) in asked.items():
            limits = {"ms": ms, "ms_worst": self.ms_worst, "noise_gain": None if math.isnan(gain) else gain}
            row = tuned_row(name, kind, plant, self.fit, sample_time=h, **limits)
            if row.design is not None:
                row = row._replace(ms_worst=evaluator.worst(row.design, self.plants).ms)
            rows.append(row)
        return tuple(rows)

    @property
    def loss(self) -> float:
        """By how many per cent the IAE of a load step is larger with the running gains than with the best gains.

        The best gains are those of `rows`. The loss is negative if the running gains are better than all gains that the
        search found. This is possible, since the search uses no filter faster than the sample time. If the search found
        no gains, the loss is nan.
        """
        iae = {row.rule: row.iae for row in self.rows}
        return 100 * (iae["now"] / iae.get("best like it", math.nan) - 1)

    def __str__(self) -> str:
        low, high = (f"{ms:.2f}" if math.isfinite(ms) else "unstable" for ms in self.interval)
        ms = f"Ms {self.ms:.2f}" if math.isfinite(self.ms) else "an unstable loop"
        lines = [f"these gains: {ms}; {low} to {high} with the plants that the log does not rule out"]
        if not math.isnan(self.loss):
            than, kind = f"{self.loss:.0f} % above" if self.loss >= 0.5 else "not above", self.rows[0].kind
            lines.append(f"their IAE for a load is {than} that of the best {kind} of the same Ms and noise")
        lines += text_table(self.rows, {"rule": 14}, CHECK_COLUMNS, 12, self._gains)
        return with_doubts("\n".join(lines), self.doubts)

    def _gains(self, row: DesignRow) -> str:
        """Return suggested gains as text. The text begins with (their IAE) / (IAE of the running gains)."""
        k = None if row.design is None else row.design.controller
        if row.design is self.design or not isinstance(k, HighOrderPID):
            return ""
        values = {name: value for name, value in k.gains().standard()._asdict().items() if value}
        said = ", ".join(f"{name} = {value:.4g}" for name, value in values.items())
        share = row.iae / self.rows[0].iae
        times = "" if math.isnan(share) else f"×{share:.2f}: "
        return f"{times}{said}, filter {k.filter_time:.3g} of order {k.filter_order}"


def check(
    record: Record | Fit,
    controller: Controller,
    *,
    output_filter: Any = None,
    sample_time: float | None = None,
    ms_worst: float = 2.0,
    model: str = "auto",
) -> Check:
    r"""Judge the gains of a running loop by its log, or by an experiment with its plant.

    A model from u to y is fitted to the log, in open or closed loop. The log must contain a change of the set point,
    a step of the load or a bump of u that is large compared with the noise.

    Parameters
    ----------
    record : Record or Fit
        The log, or a fit of it.
    controller : controller
        The running controller, with integral action and gains in units of u per unit of y.
    output_filter : control.TransferFunction, optional
        A filter in series with the controller, such as the filter of the measurement.
    sample_time : float, optional
        Sample time of the controller, above 0. By default the sample time of the log.
    ms_worst : float, optional
        Limit of Ms for the suggested sets. Each set must keep it with every plant that the log does not rule out.
    model : str, optional
        Model to fit, as for `pidalab.identification.fit`.

    Returns
    -------
    Check
        Its `rows` are computed on first use. They contain three suggested sets: *calmer* (half the present noise
        gain, Ms at most 1.4), *same noise* (the present noise gain, Ms at most 1.6) and *faster* (twice the present
        noise gain, Ms at most 1.8).

    Raises
    ------
    TypeError, ValueError
        If no model can be fitted to the log, or if the gains have the wrong sign or no integral action.

    Notes
    -----
    In closed loop, white noise does not bias the fit from u to y. Slow disturbances pull the model towards -1/C, where
    C is the controller. If they cause much of the movement of u, a doubt says so.

    Examples
    --------
    >>> import numpy as np, pidalab
    >>> plant, running = pidalab.fopdt(2.0, 12.0, 4.0), pidalab.PIDA(kp=0.6, ti=12.0)
    >>> t = np.arange(120.0)
    >>> noise = np.random.default_rng(0).normal(0.0, 0.02, t.size)
    >>> loop = pidalab.Loop(plant, running.discretise(1.0))
    >>> log = pidalab.simulate_sampled(loop, t, load=np.where(t < 20, 0.0, 1.0), noise=noise)
    >>> found = pidalab.check(pidalab.Record(t, log.u, log.y + noise), running)
    >>> found.interval[0] < pidalab.margins(loop).ms < found.interval[1]
    True
    """
    if not isinstance(controller, Controller):
        raise TypeError(f"controller must be a continuous controller, found {type(controller).__name__}")
    gains = controller.gains()
    if gains.ki == 0:
        raise ValueError(
            "controller must have integral action: without it a load leaves a steady-state error"
        )
    worst = _check.real("ms_worst", ms_worst, above=1.0)
    fitted = record if isinstance(record, Fit) else _fitted(record, model)
    process, log = fitted.process, fitted.record
    doubts = [*log.doubts, *fitted.doubts]
    if gains.ki * sign_of_gain(process) < 0:
        raise ValueError(
            f"controller must have gains of the same sign as the plant, found kp = {gains.kp:.4g} for a plant of gain "
            f"{fitted.parameters['gain']:.3g}: the output would run away. If the sign is right, the fitted gain is "
            "wrong: record u as limited by the actuator, and change the set point during the record"
        )
    share, better = explained_by(controller, output_filter, log)
    if share < EXPLAINED:
        known = better * gains.kp > 0
        said = f"; a proportional gain near {better:.3g} explains it better" if known else ""
        doubts.append(doubt("other gains", share=100 * share, better=said))
    if sample_time is None:
        sample_time = log.sampling
        doubts.append(doubt("log's sample time", sample_time=sample_time))
    sample_time = _check.real("sample_time", sample_time, above=0.0)
    running = Design(process, controller, output_filter=output_filter, source="the gains that run")
    evaluator, plants = LoopEvaluator(sample_time, None), tuple(fitted.spread(PLANTS_JUDGED))
    loops = [evaluator.ms(running, plant) for plant in (process, *plants)]
    sizes = [loop.ms for loop in loops]
    doubts += sorted({loop.reason for loop in loops if loop.reason})
    if math.isinf(sizes[0]):
        doubts.append(doubt("unstable"))
    else:
        doubts += _biased(fitted, running.loop(process))
    interval = min(sizes), max(sizes)
    return Check(fitted, running, sample_time, sizes[0], interval, plants, worst, tuple(doubts))


def explained_by(controller: Controller, output_filter: Any, log: Record) -> tuple[float, float]:
    """Return the share of the sample-to-sample changes of u that a controller explains, and the best gain.

    The best gain is the proportional gain of a least-squares fit from the changes of y to the changes of u. Both
    results are nan if u is constant in most samples, as in open loop, or if the sample time of the log is too long for
    the controller.

    Notes
    -----
    The controller is run with the logged output and without the set point, which is unknown. A constant set point
    would add a constant to the change of the computed signal in each sample. Subtracting the running median removes
    this constant. Samples at the largest or smallest u are left out, since u may have been limited there. A log may
    store u one sample late, so the comparison is repeated with u shifted by one sample, and the better result counts.
    """
    u, y = log.u[:MOST_STEPPED], log.y[:MOST_STEPPED]
    free = (u > log.u.min()) & (u < log.u.max())
    free = free[1:] & free[:-1]
    du = rough(np.diff(u))
    size = float(np.median(np.abs(du[free]))) if free.sum() > FEWEST else 0.0
    if size == 0:
        return math.nan, math.nan
    try:
        digital = controller.discretise(log.sampling, "backward", output_filter)
    except ValueError:  # the sample time of the log is too long for this controller
        return math.nan, math.nan
    own = np.array([digital.step(float(y[0]), float(value)) for value in y])
    expected, dy = rough(np.diff(own)), rough(np.diff(y))
    results = []
    for later in (0, 1):
        use, end = free[later:], du.size - later
        logged, computed, moved = (x[use] for x in (du[later:], expected[:end], dy[:end]))
        share = max(0.0, 1.0 - float(np.median(np.abs(logged - computed)) / size) ** 2)
        square = float(moved @ moved)
        results.append((share, -float(logged @ moved) / square if square else math.nan))
    return max(results, key=lambda result: result[0])


def _fitted(record: Record, model: str) -> Fit:
    """Fit the plant. Also fit a step of the load if this makes the residuals much smaller."""
    fits: list[Fit] = []
    refusal = None
    for load in (False, True):
        if fits and samples_per_error(fits[0].residuals) < COLOURED:
            break
        try:
            fits.append(fit(record, model, load=load))
        except ValueError as failed:
            refusal = refusal or failed
    if not fits:
        moved = f" by {CLEAR_MOVE * record.noise.deviation:.2g} or more" if record.noise.deviation else ""
        raise ValueError(
            f"no model can be fitted to the log: {refusal}. A check needs a change of the set point, a step of the "
            f"load or a bump of u that moves the output{moved}, and time to settle"
        )
    plain, loaded = fits[0], fits[-1]
    return loaded if loaded.deviation < CLEARER * plain.deviation else plain


def _biased(fitted: Fit, loop: Loop) -> list[str]:
    """Return a doubt if slow disturbances cause much of the movement of u through the controller."""
    record, residuals = fitted.record, fitted.residuals
    if samples_per_error(residuals) < COLOURED:
        return []
    t = np.linspace(0.0, float(np.ptp(record.t)), residuals.size)
    share = float(np.var(simulate(loop, t, noise=residuals).u) / np.var(record.u))
    return [doubt("slow disturbances", share=100 * min(share, 1.0))] if share >= FED_BACK else []
