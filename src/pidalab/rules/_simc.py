"""SIMC: PI and PID from lags, zeros, integrators and dead time, which the half rule brings to one lag or two."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pidalab import _check
from pidalab._text import WITHOUT_ACCELERATION
from pidalab.controllers import PIDA, HighOrderPID
from pidalab.process import Process, require_process
from pidalab.roots import roots
from pidalab.rules._design import Design

# share of imaginary part up to which poles count as real: a multiple lag splits by rounding
OSCILLATING = 0.05
# times that a zero's time may be longer than a lag which it is taken together with
CLOSE_LAG = 1.6 * (1 - 1e-9)
MOST_REDUCTIONS, SAME_DELAY = 40, 1e-12  # of a model until its effective dead time stays, to such a share


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
