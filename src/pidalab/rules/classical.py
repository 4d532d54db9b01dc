r"""The rules that everybody knows: SIMC, AMIGO, lambda tuning, both rules of Ziegler and Nichols, Chien-Hrones-Reswick.

Each starts from the model that its authors start from: a lag with dead time, an integrator with dead time, for SIMC's
PID a second lag, or the ultimate gain and period. All of them give PI or PID controllers in standard form with a filter
on the derivative, of a tenth of the derivative time; none knows the second derivative.

==========================  =================================================================  ===========
function                    source                                                             models
==========================  =================================================================  ===========
`simc`                      Skogestad, Simple analytic rules for model reduction and PID       lags, also
                            controller tuning, J. Process Control 13 (2003) 291-309            integrating
`improved_simc`             Grimholt and Skogestad, Optimal PI and PID control of first-order  the same
                            plus delay processes and evaluation of the original and improved
                            SIMC rules, J. Process Control 70 (2018) 36-46
`amigo`                     Åström and Hägglund, Revisiting the Ziegler-Nichols step response  `fopdt`,
                            method for PID control, J. Process Control 14 (2004) 635-650       `ipdt`
`lambda_tuning`             Åström and Hägglund, Advanced PID Control, ISA 2006, section 6.5   `fopdt`
`ziegler_nichols_step`      Ziegler and Nichols, Optimum settings for automatic controllers,   `fopdt`,
                            Trans. ASME 64 (1942) 759-768, process reaction curve              `ipdt`
`ziegler_nichols_ultimate`  the same, ultimate sensitivity                                     any
`chien_hrones_reswick`      Chien, Hrones and Reswick, On the automatic control of             `fopdt`
                            generalized passive systems, Trans. ASME 74 (1952) 175-185
==========================  =================================================================  ===========
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pidalab import _check
from pidalab._names import KINDS
from pidalab.controllers import PIDA, HighOrderPID
from pidalab.loop import Loop
from pidalab.process import Process, require_process
from pidalab.roots import roots
from pidalab.rules._design import Design
from pidalab.rules._models import integrator, lag_with_delay, lags, require_delay

WITHOUT_ACCELERATION = KINDS[:2]
Settings = tuple[float, float, float]  # kp, ti, td
INSIDE_BORDER = 0.999  # of the gain at the border, which is to be stable
# share of imaginary part up to which poles count as real: a multiple lag splits by rounding
OSCILLATING = 0.05
# times that a zero's time may be longer than a lag which it is taken together with
CLOSE_LAG = 1.6 * (1 - 1e-9)
MOST_REDUCTIONS, SAME_DELAY = 40, 1e-12  # of a model until its effective dead time stays, to such a share
# of PI and PID: gain times a = K L/T, ti in units of L after a load and of T after a set point, td in units of L
CHIEN_HRONES_RESWICK = {
    ("load", 0): ((0.6, 4.0, 0.0), (0.95, 2.4, 0.42)),
    ("load", 20): ((0.7, 2.3, 0.0), (1.2, 2.0, 0.42)),
    ("setpoint", 0): ((0.35, 1.2, 0.0), (0.6, 1.0, 0.5)),
    ("setpoint", 20): ((0.6, 1.0, 0.0), (0.95, 1.4, 0.47)),
}


def simc(model: Process, kind: str = "PID", closed_loop_time: float | None = None, n: float = 10) -> Design:
    r"""SIMC: a PI or PID controller from lags, brought to one or two by the half rule.

    .. math:: k_c = \frac{\tau_1}{K (\tau_c + \theta)}, \quad \tau_I = \min(\tau_1, 4 (\tau_c + \theta)), \quad
              \tau_D = \tau_2

    in series form; an integrator counts as a lag without end. Half of the largest lag that is left out goes to the last
    lag that is kept, the other half, all smaller lags and zeros in the right half-plane go to the dead time. A zero in
    the left half-plane is taken together with a lag beside it (rules T1 to T3). A dead time alone gets an integral
    controller, two integrators a PID controller with :math:`\tau_I = \tau_D = 4 (\tau_c + \theta)` and
    :math:`k_c = 1/(4 K (\tau_c + \theta)^2)`.

    ==================  ==================
    Skogestad (2003)    here
    ==================  ==================
    θ                   `delay` of the model after the half rule
    τ_c                 `closed_loop_time`
    ==================  ==================

    Parameters
    ----------
    model : Process
        Real stable lags, real zeros other than 0, at most two integrators; dead time.
    kind : {"PI", "PID"}, optional
        Which controller.
    closed_loop_time : float, optional
        Time constant that the closed loop should have, above 0; by default the effective dead time, as recommended.
    n : float, optional
        Ratio of derivative time and its filter.

    Returns
    -------
    Design
        Its `info`: ``gain``, ``lags`` and ``delay`` of the model after the half rule, and ``closed_loop_time``.

    Raises
    ------
    ValueError
        For a model without dead time in any sense (a single lag and no `closed_loop_time`), a PI controller of two
        integrators, and outside what is allowed above.

    Examples
    --------
    >>> import pidalab
    >>> C = pidalab.rules.classical.simc(pidalab.fopdt(1.0, lag=4.0, delay=1.0), kind="PI").controller
    >>> C.kp, C.ti
    (2.0, 4.0)
    """
    _check.choice("kind", kind, WITHOUT_ACCELERATION)
    reduced = _half_rule(model, 2 if kind == "PID" else 1)
    wanted = _closed_loop_time(closed_loop_time, reduced.delay)
    info = {"gain": reduced.gain, "lags": reduced.lags, "delay": reduced.delay, "closed_loop_time": wanted}
    lags, reach = reduced.lags, wanted + reduced.delay
    source = "Skogestad (2003), eqs. (10), (11), (23) to (25)"
    if reduced.integrators == 2:
        if kind == "PI":
            raise ValueError(
                f"kind must be 'PID' for two integrators, found 'PI': none is stable with {model!r}"
            )
        controller: Any = _from_series(1 / (4 * reduced.gain * reach**2), 4 * reach, 4 * reach, n)
    elif not lags and not reduced.integrators:
        controller = HighOrderPID([1 / (reduced.gain * reach), 0.0], filter_time=0.0, filter_order=0)
    else:
        kc, ti = _series_pi(reduced, reach)
        second = lags[-1] if len(lags) + reduced.integrators == 2 else 0.0
        controller = _from_series(kc, ti, second, n)
    return Design(model, controller, source=source, info=info)


def improved_simc(model: Process, closed_loop_time: float | None = None, n: float = 10) -> Design:
    r"""Improved SIMC: the PI controller of SIMC with a derivative time of a third of the dead time, in series form.

    .. math:: k_c = \frac{\tau_1}{K (\tau_c + \theta)}, \quad \tau_I = \min(\tau_1, 4 (\tau_c + \theta)), \quad
              \tau_D = \frac{\theta}{3}

    A dead time alone gets a PI controller, :math:`k_i = 1/(K (\tau_c + \theta))` and :math:`k_p = k_i\,\theta/3`.

    Parameters
    ----------
    model : Process
        As for `simc`, with at most one integrator; dead time. The half rule brings it to one lag.
    closed_loop_time : float, optional
        τ_c, above 0; by default half of the effective dead time, which the derivative allows.
    n : float, optional
        Ratio of derivative time and its filter.

    Returns
    -------
    Design
        Its `info`: ``gain``, ``lags`` and ``delay`` of the model after the half rule, and ``closed_loop_time``.

    Raises
    ------
    ValueError
        As `simc`, and for two integrators.

    Notes
    -----
    The rule is that of the abstract of Grimholt and Skogestad (2018); the rest of the paper was not at hand. The
    default of τ_c is ours: without filter a lag with dead time then has Ms from 1.65 to 1.73, about as with `simc`.

    Examples
    --------
    >>> import pidalab
    >>> C = pidalab.rules.classical.improved_simc(pidalab.fopdt(1.0, lag=4.0, delay=1.5)).controller
    >>> print(f"{C.kp:.4f} {C.ti:.4f} {C.td:.4f}")
    2.0000 4.5000 0.4444
    """
    reduced = _half_rule(model, 1)
    if reduced.integrators > 1:
        raise ValueError(
            f"model must have at most one integrator for classical.improved_simc, found {model!r}"
        )
    wanted = _closed_loop_time(closed_loop_time, reduced.delay / 2)
    reach, third = wanted + reduced.delay, reduced.delay / 3
    info = {"gain": reduced.gain, "lags": reduced.lags, "delay": reduced.delay, "closed_loop_time": wanted}
    source = "Grimholt and Skogestad (2018), improved SIMC"
    if reduced.lags or reduced.integrators:
        return Design(model, _from_series(*_series_pi(reduced, reach), third, n), source=source, info=info)
    controller = HighOrderPID([1 / (reduced.gain * reach), third / (reduced.gain * reach)], 0.0, 0)
    return Design(model, controller, source=source, info=info)


def _closed_loop_time(asked: float | None, usual: float) -> float:
    if asked is not None:
        return _check.real("closed_loop_time", asked, above=0.0)
    if usual == 0:
        raise ValueError(
            "closed_loop_time must be given to classical.simc: the model has no effective dead time to take it from; "
            "in pidalab.tune give the sample_time, half of which is dead time"
        )
    return usual


def _series_pi(reduced: Reduced, reach: float) -> tuple[float, float]:
    """Gain and integral time of SIMC for one lag, or for an integrator: a lag without end, eq. (25)."""
    first, velocity = (math.inf, reduced.gain)
    if not reduced.integrators:
        first, velocity = reduced.lags[0], reduced.gain / reduced.lags[0]
    return 1 / (velocity * reach), min(first, 4 * reach)


def _from_series(kc: float, ti: float, td: float, n: float) -> PIDA:
    """Controller in standard form of one in series form."""
    factor = 1 + td / ti
    return PIDA(kc * factor, ti * factor, td / factor, 0.0, n)


def amigo(model: Process, kind: str = "PID") -> Design:
    r"""AMIGO: PI or PID controller with a maximum sensitivity near 1.4, fitted by its authors to 134 processes.

    Parameters
    ----------
    model : Process
        `fopdt` or `ipdt`, with dead time above 0.
    kind : {"PI", "PID"}, optional
        Which controller.

    Returns
    -------
    Design

    Raises
    ------
    ValueError
        For another model, or one without dead time.

    Notes
    -----
    The PI rule keeps Ms near 1.4 on lag-dominated and balanced processes; its authors warn that the PID rule is
    conservative where the dead time dominates.

    Examples
    --------
    >>> import pidalab
    >>> C = pidalab.rules.classical.amigo(pidalab.fopdt(1.0, lag=1.0, delay=1.0)).controller
    >>> print(f"{C.kp:.2f} {C.ti:.4f} {C.td:.4f}")
    0.65 1.0909 0.3846
    """
    integrating, gain, lag, delay = _lag_or_integrator(model)
    if integrating:
        pi = 0.35 / (gain * delay), 13.4 * delay, 0.0
        pid = 0.45 / (gain * delay), 8 * delay, 0.5 * delay
    else:
        kp = (0.15 + (0.35 - delay * lag / (delay + lag) ** 2) * lag / delay) / gain
        ti = 0.35 * delay + 13 * delay * lag**2 / (lag**2 + 12 * delay * lag + 7 * delay**2)
        pi = kp, ti, 0.0
        kp = (0.2 + 0.45 * lag / delay) / gain
        ti = (0.4 * delay + 0.8 * lag) / (delay + 0.1 * lag) * delay
        pid = kp, ti, 0.5 * delay * lag / (0.3 * delay + lag)
    return _design(model, kind, pi, pid, "Åström and Hägglund (2004), AMIGO")


def lambda_tuning(model: Process, kind: str = "PI", closed_loop_time: float | None = None) -> Design:
    r"""Lambda tuning: the lag is cancelled, and the closed loop gets a time constant of one's choice.

    .. math:: \text{PI: } k_p = \frac{T}{K(\lambda + L)},\; t_i = T; \qquad
              \text{PID: } k_p = \frac{T + L/2}{K(\lambda + L/2)},\; t_i = T + \frac L2,\; t_d = \frac{TL}{2T + L}

    Parameters
    ----------
    model : Process
        `fopdt`.
    kind : {"PI", "PID"}, optional
        Which controller.
    closed_loop_time : float, optional
        λ, above 0; by default the lag, the "aggressive" choice of the book.

    Returns
    -------
    Design

    Raises
    ------
    ValueError
        For another model.

    Examples
    --------
    >>> import pidalab
    >>> C = pidalab.rules.classical.lambda_tuning(pidalab.fopdt(2.0, lag=3.0, delay=1.0)).controller
    >>> C.kp, C.ti
    (0.375, 3.0)
    """
    gain, (lag,) = lags(model, 1)
    wanted = lag if closed_loop_time is None else _check.real("closed_loop_time", closed_loop_time, above=0.0)
    half = model.delay / 2
    pi = lag / (gain * (wanted + model.delay)), lag, 0.0
    pid = (lag + half) / (gain * (wanted + half)), lag + half, lag * half / (lag + half)
    source = "Åström and Hägglund (2006), section 6.5, lambda tuning"
    return _design(model, kind, pi, pid, source, closed_loop_time=wanted)


def ziegler_nichols_step(model: Process, kind: str = "PID") -> Design:
    r"""Ziegler and Nichols' first rule, from the steepest tangent of a step response: fast, and little damped.

    Parameters
    ----------
    model : Process
        `fopdt` or `ipdt` with dead time above 0; its tangent has the slope R = K/T, or the velocity gain.
    kind : {"PI", "PID"}, optional
        Which controller.

    Returns
    -------
    Design

    Raises
    ------
    ValueError
        For another model, or one without dead time.

    Examples
    --------
    >>> import pidalab
    >>> C = pidalab.rules.classical.ziegler_nichols_step(pidalab.fopdt(1.0, lag=4.0, delay=1.0)).controller
    >>> print(f"{C.kp:.1f} {C.ti:.1f} {C.td:.1f}")
    4.8 2.0 0.5
    """
    integrating, gain, lag, delay = _lag_or_integrator(model)
    slope = gain if integrating else gain / lag
    share = 1 / (slope * delay)
    pi, pid = (0.9 * share, delay / 0.3, 0.0), (1.2 * share, 2 * delay, delay / 2)
    return _design(model, kind, pi, pid, "Ziegler and Nichols (1942), process reaction curve")


def ziegler_nichols_ultimate(process: Process, kind: str = "PID") -> Design:
    r"""Ziegler and Nichols' second rule, from the gain and the period at the border of stability.

    Parameters
    ----------
    process : Process
        Stable or integrating, with a phase that reaches -180 degrees.
    kind : {"PI", "PID"}, optional
        Which controller.

    Returns
    -------
    Design
        Its `info`: ``ultimate_gain`` and ``ultimate_period``.

    Raises
    ------
    ValueError
        For a process whose phase never reaches -180 degrees: no gain makes it oscillate. For an unstable one, and for
        one that is unstable under every gain, such as a double integrator: there is no border of stability.

    Examples
    --------
    >>> import pidalab
    >>> design = pidalab.rules.classical.ziegler_nichols_ultimate(pidalab.lags(3))
    >>> print(f"{design.ultimate_gain:.3f} {design.ultimate_period:.4f} {design.controller.kp:.2f}")
    8.000 3.6276 4.80
    """
    from pidalab.reduction import ultimate_frequency

    require_process("process", process)
    try:
        w = ultimate_frequency(process)
    except ValueError:
        if process.den[-1] != 0:
            raise
        w = _oscillation(process)  # several integrators have borders of other turns
    ultimate, period = float(1 / abs(process(1j * w))) * math.copysign(1.0, process.gain()), 2 * math.pi / w
    pi, pid = (0.45 * ultimate, period / 1.2, 0.0), (0.6 * ultimate, period / 2, period / 8)
    source = "Ziegler and Nichols (1942), ultimate sensitivity"
    return _design(process, kind, pi, pid, source, ultimate_gain=ultimate, ultimate_period=period)


def chien_hrones_reswick(model: Process, test: str = "load", overshoot: int = 0, kind: str = "PID") -> Design:
    r"""Chien, Hrones and Reswick's rule: the fastest response without overshoot, or with 20 % of it.

    With :math:`a = K L/T`, as it is quoted after Åström and Hägglund, PID Controllers, 2nd ed., ISA 1995, section 4.2:

    ========  =========  ========  =====  =========  =====  ======
    step      overshoot  PI: a kp  ti     PID: a kp  ti     td
    ========  =========  ========  =====  =========  =====  ======
    load      0 %        0.6       4 L    0.95       2.4 L  0.42 L
    load      20 %       0.7       2.3 L  1.2        2 L    0.42 L
    setpoint  0 %        0.35      1.2 T  0.6        T      0.5 L
    setpoint  20 %       0.6       T      0.95       1.4 T  0.47 L
    ========  =========  ========  =====  =========  =====  ======

    Parameters
    ----------
    model : Process
        `fopdt` with dead time L above 0, lag T and gain K.
    test : {"load", "setpoint"}, optional
        Which step the response is to.
    overshoot : {0, 20}, optional
        In per cent.
    kind : {"PI", "PID"}, optional
        Which controller.

    Returns
    -------
    Design

    Raises
    ------
    ValueError
        For another model, one without dead time, and another test, overshoot or kind.

    Notes
    -----
    The original paper was not at hand. All eight settings are as an independent public program quotes the table, those
    for the set point as several do. Copies with more digits have ti = 1.16 T (set point 0 %, PI), ti = 1.357 T and
    td = 0.473 L (set point 20 %, PID), ti = 2.357 L (load 0 %, PID); German textbooks round 1.357 T to 1.35 T.

    The authors had an analogue computer and the model of a lag and a dead time. With that model, a filter of td/10, and
    T/L from 4 to 50, exact simulation gives for 0 %: at most 2 % after the set point, and after the load 0 % (PI) and
    up to 9 % (PID) of the largest deviation. For 20 %: 11.6 % (PI) and 27 to 39 % (PID) after the set point, and after
    the load 9 to 40 % (PI) and 5 to 11 % (PID). So the percentages are names rather than promises.

    Examples
    --------
    >>> import pidalab
    >>> model = pidalab.fopdt(1.0, lag=4.0, delay=1.0)
    >>> C = pidalab.rules.classical.chien_hrones_reswick(model, "setpoint", 0, "PI").controller
    >>> print(f"{C.kp:.1f} {C.ti:.1f}")
    1.4 4.8
    """
    _check.choice("test", test, ("load", "setpoint"))
    if overshoot not in (0, 20):
        raise ValueError(f"overshoot must be 0 or 20, found {overshoot!r}")
    gain, lag, delay = lag_with_delay(model)
    unit = delay if test == "load" else lag
    table = CHIEN_HRONES_RESWICK[test, overshoot]
    pi, pid = ((share * lag / (gain * delay), ti * unit, td * delay) for share, ti, td in table)
    source = f"Chien, Hrones and Reswick (1952), {test}, {overshoot} % overshoot"
    return _design(model, kind, pi, pid, source)


def _design(model: Process, kind: str, pi: Settings, pid: Settings, source: str, **info: Any) -> Design:
    """Return the design with kp, ti and td for a kind."""
    _check.choice("kind", kind, WITHOUT_ACCELERATION)
    kp, ti, td = pi if kind == "PI" else pid
    return Design(model, PIDA(kp, ti, td), source=source, info=info)


def _oscillation(process: Process) -> float:
    """Return the frequency at which an integrating process oscillates at the border of stability, or raise."""
    from pidalab.robustness.margins import phase_crossovers
    from pidalab.robustness.poles import is_stable

    sign = math.copysign(1.0, process.gain())
    found = phase_crossovers(Loop(process, sign))
    # at the border: a little less gain is stable
    borders = [
        w for w in found.tolist() if is_stable(Loop(process, sign * INSIDE_BORDER / abs(process(1j * w))))
    ]
    if not borders:
        raise ValueError(
            "process must have a border of stability under feedback by a gain alone: "
            + ("its phase never reaches -180 degrees" if not found.size else "no gain makes it stable")
            + f"; found {process!r}"
        )
    return float(borders[0])


def _lag_or_integrator(model: Process) -> tuple[bool, float, float, float]:
    """Return whether the model integrates, its gain, its lag (infinite for an integrator) and its dead time."""
    require_process("model", model)
    if len(model.den) != 2 or model.den[-1] != 0:
        return False, *lag_with_delay(model)
    gain, delay = integrator(model)
    require_delay(model)
    return True, gain, math.inf, delay


class Reduced(NamedTuple):
    """What the half rule leaves of a model."""

    gain: float  # static, or that of so many integrators
    lags: tuple[float, ...]
    delay: float
    integrators: int


def _half_rule(model: Process, keep: int) -> Reduced:
    """Bring a model to as many lags and integrators as are to be kept, and an effective dead time.

    Which rule serves a zero in the left half-plane depends on the effective dead time, which depends on the rule: they
    are gone through until it stays. More than one may stay, and the paper does not say where to begin: here with the
    dead time of the model, or where it has none with that of its lags alone, which leads to its examples. Where it goes
    round in a circle, the longest is taken, for the sake of caution.
    """
    require_process("model", model)
    den = np.trim_zeros(model.den, "b")
    integrators = model.den.size - den.size
    poles, zeros = roots(den), roots(model.num)
    found = np.concatenate([poles, zeros])
    if integrators > 2 or np.any(poles.real >= 0) or np.any(np.abs(found.imag) > OSCILLATING * np.abs(found)):
        raise ValueError(
            f"model must have real zeros, real stable poles and at most two integrators, found {model!r}"
        )
    if model.num[-1] == 0:
        raise ValueError(f"model must have no zero at 0, found num = {model.num.tolist()}")
    gain, slow = float(model.num[-1] / den[-1]), sorted((-1 / poles.real).tolist(), reverse=True)
    leads = sorted((-1 / zeros.real[zeros.real < 0]).tolist(), reverse=True)
    dead = model.delay + float(np.sum(1 / zeros.real[zeros.real > 0]))
    tried: list[Reduced] = []
    delay = dead or _halved(gain, slow, integrators, dead, keep).delay
    for _ in range(MOST_REDUCTIONS):
        tried.append(_halved(*_without_leads(gain, slow, leads, integrators, delay), dead, keep))
        if abs(tried[-1].delay - delay) <= SAME_DELAY * delay:
            return tried[-1]
        delay = tried[-1].delay
    return max(tried[len(tried) // 2 :], key=lambda reduced: reduced.delay)


def _without_leads(
    gain: float, lags: list[float], leads: list[float], integrators: int, delay: float
) -> tuple[float, list[float], int]:
    """Replace each zero in the left half-plane, and a lag beside it, by a gain and perhaps a shorter lag.

    These are the rules T1 to T3 of Skogestad (2003), section 2.2. An integrator counts as a lag without end.
    """
    lags = list(lags)
    for lead in leads:
        longer = min((lag for lag in lags if lag >= lead), default=math.inf)
        shorter = max((lag for lag in lags if lag < lead), default=0.0)
        near = shorter > 0 and lead / shorter < min(longer / lead, CLOSE_LAG)
        if near or (math.isinf(longer) and not integrators):  # T1, T1a, T1b
            lags.remove(shorter)
            gain *= lead / shorter if shorter >= delay else max(lead / delay, 1.0)
            continue
        kept = min(longer, max(5 * delay, lead))  # T3; it is the lead itself in T2
        rest = kept - lead
        if math.isinf(longer):
            integrators -= 1
            gain *= kept
        else:
            lags.remove(longer)
            gain *= kept / longer
        lags += [rest] if rest > 0 else []
    return gain, sorted(lags, reverse=True), integrators


def _halved(gain: float, lags: list[float], integrators: int, dead: float, keep: int) -> Reduced:
    """Give half of the largest lag left out to the smallest one kept, the rest and all others to the dead time."""
    split = max(keep - integrators, 0)
    kept, rest = lags[:split], lags[split:]
    if rest:
        if kept:  # to an integrator it makes no difference
            kept[-1] += rest[0] / 2
        dead += sum(rest) - rest[0] / 2
    return Reduced(gain, tuple(kept), dead, integrators)
