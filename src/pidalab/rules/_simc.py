"""SIMC rules for PI and PID controllers, with a half rule that reduces the model to one or two lags."""

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

# A pole or zero p counts as real if abs(imag(p)) <= OSCILLATING * abs(p), since rounding makes multiple real poles
# complex.
OSCILLATING = 0.05
# A zero 1 + T s is paired with a shorter lag only if T / lag is below CLOSE_LAG.
CLOSE_LAG = 1.6 * (1 - 1e-9)
# The reduction ends when the relative change of the effective dead time is below SAME_DELAY, or after MOST_REDUCTIONS.
MOST_REDUCTIONS, SAME_DELAY = 40, 1e-12


def simc(
    model: Process, kind: str = "PID", *, closed_loop_time: float | None = None, n: float = 10
) -> Design:
    r"""Design a PI or PID controller by SIMC, after the half rule has reduced the model.

    .. math:: k_c = \frac{\tau_1}{K (\tau_c + \theta)}, \quad \tau_I = \min(\tau_1, 4 (\tau_c + \theta)), \quad
              \tau_D = \tau_2

    The controller is in series form. K is the gain of the reduced model without its integrators. The half rule keeps
    the largest lag τ_1 and, for PID, the second largest lag τ_2. It adds half of the largest neglected lag to the
    smallest kept lag. The effective dead time θ is the sum of the dead time, the other half of the largest neglected
    lag, all smaller lags, and the time constants of zeros in the right half-plane. A zero in the left half-plane is
    cancelled by a lag of similar size (rules T1 to T3). An integrator counts as an infinite lag. If the largest lag is
    an integrator, 1/K takes the place of :math:`\tau_1/K`. For a pure dead time the result is an integral controller.
    For a double integrator the result is a PID controller with :math:`\tau_I = \tau_D = 4 (\tau_c + \theta)` and
    :math:`k_c = 1/(4 K (\tau_c + \theta)^2)`.

    Parameters
    ----------
    model : Process
        Process with real stable lags, real zeros other than 0, at most two integrators, and dead time.
    kind : {"PI", "PID"}, optional
        Kind of controller.
    closed_loop_time : float, optional
        Time constant τ_c of the closed loop, above 0. By default θ, as the paper recommends.
    n : float, optional
        Derivative time divided by the time constant of the derivative filter.

    Returns
    -------
    Design
        Its `info` has ``gain``, ``lags`` and ``delay`` of the reduced model, and ``closed_loop_time``.

    Raises
    ------
    ValueError
        If the model does not have the structure above, if `kind` is "PI" for two integrators, or if `closed_loop_time`
        is missing for a model without effective dead time (such as a single lag).

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
            raise ValueError(f"kind must be 'PID' for two integrators, found 'PI' with {model!r}")
        controller: Any = _from_series(1 / (4 * reduced.gain * reach**2), 4 * reach, 4 * reach, n)
    elif not lags and not reduced.integrators:
        controller = HighOrderPID([1 / (reduced.gain * reach), 0.0], filter_time=0.0, filter_order=0)
    else:
        kc, ti = _series_pi(reduced, reach)
        second = lags[-1] if len(lags) + reduced.integrators == 2 else 0.0
        controller = _from_series(kc, ti, second, n)
    return Design(model, controller, source=source, info=info)


def improved_simc(model: Process, *, closed_loop_time: float | None = None, n: float = 10) -> Design:
    r"""Design a PID controller by improved SIMC, which adds a derivative time to the PI settings of SIMC.

    .. math:: k_c = \frac{\tau_1}{K (\tau_c + \theta)}, \quad \tau_I = \min(\tau_1, 4 (\tau_c + \theta)), \quad
              \tau_D = \frac{\theta}{3}

    The symbols are those of `simc`. The controller is in series form. For a pure dead time the result is a PI
    controller with :math:`k_i = 1/(K (\tau_c + \theta))` and :math:`k_p = k_i\,\theta/3`.

    Parameters
    ----------
    model : Process
        As for `simc`, but with at most one integrator. The half rule reduces the model to one lag.
    closed_loop_time : float, optional
        τ_c, above 0. By default half of the effective dead time.
    n : float, optional
        As for `simc`.

    Returns
    -------
    Design
        Its `info` is as for `simc`.

    Raises
    ------
    ValueError
        As for `simc`, or if the model has two integrators.

    Notes
    -----
    The rule is taken from the abstract of Grimholt and Skogestad (2018). The paper was not available. The default of
    τ_c is our choice. With this default and without filter, Ms for a lag with dead time is 1.65 to 1.73, similar to
    `simc`.

    Examples
    --------
    >>> import pidalab
    >>> C = pidalab.rules.classical.improved_simc(pidalab.fopdt(1.0, lag=4.0, delay=1.5)).controller
    >>> print(f"{C.kp:.4f} {C.ti:.4f} {C.td:.4f}")
    2.0000 4.5000 0.4444
    """
    reduced = _half_rule(model, 1)
    if reduced.integrators > 1:
        raise ValueError(f"model must have at most one integrator, found {model!r}")
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
            "closed_loop_time must be given: the model has no effective dead time (in pidalab.tune, give sample_time)"
        )
    return usual


def _series_pi(reduced: Reduced, reach: float) -> tuple[float, float]:
    """Return gain and integral time of SIMC for one lag or integrator, eq. (25)."""
    first, velocity = (math.inf, reduced.gain)
    if not reduced.integrators:
        first, velocity = reduced.lags[0], reduced.gain / reduced.lags[0]
    return 1 / (velocity * reach), min(first, 4 * reach)


def _from_series(kc: float, ti: float, td: float, n: float) -> PIDA:
    """Convert a controller from series form to standard form."""
    factor = 1 + td / ti
    return PIDA(kc * factor, ti * factor, td / factor, 0.0, n)


class Reduced(NamedTuple):
    """Model reduced by the half rule."""

    gain: float  # static gain without the integrators
    lags: tuple[float, ...]
    delay: float
    integrators: int


def _half_rule(model: Process, keep: int) -> Reduced:
    """Reduce a model to `keep` lags and integrators, and an effective dead time.

    Notes
    -----
    The effective dead time decides which of the rules T1 to T3 applies to a zero in the left half-plane. The rule in
    turn changes the effective dead time. Therefore the reduction is repeated until the effective dead time no longer
    changes. The result may depend on the initial value, which the paper does not give. We start from `dead`, the dead
    time plus the time constants of zeros in the right half-plane. If `dead` is 0, we start from the effective dead time
    of the lags alone. These values reproduce the examples of the paper. If the effective dead time still changes after
    `MOST_REDUCTIONS` reductions, the first half of the reductions is discarded. Of the second half, the reduction with
    the longest effective dead time is returned, because a longer dead time gives a more cautious controller.
    """
    require_process("model", model)
    den = np.trim_zeros(model.den, "b")
    integrators = model.den.size - den.size
    poles, zeros = roots(den), roots(model.num)
    both = np.concatenate([poles, zeros])
    if integrators > 2 or np.any(poles.real >= 0) or np.any(np.abs(both.imag) > OSCILLATING * np.abs(both)):
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
    """Replace each zero in the left half-plane, together with a lag of similar size, by a gain.

    Rule T3 keeps a part of the lag. Rules T1 to T3 are in section 2.2 of Skogestad (2003).
    """
    lags = list(lags)
    for lead in leads:
        longer = min((lag for lag in lags if lag >= lead), default=math.inf)
        shorter = max((lag for lag in lags if lag < lead), default=0.0)
        cancels = shorter > 0 and lead / shorter < min(longer / lead, CLOSE_LAG)
        if cancels or (math.isinf(longer) and not integrators):  # T1, T1a, T1b
            lags.remove(shorter)
            gain *= lead / shorter if shorter >= delay else max(lead / delay, 1.0)
            continue
        kept = min(longer, max(5 * delay, lead))  # rule T3; in rule T2 `kept` equals `lead`
        left_over = kept - lead
        if math.isinf(longer):
            integrators -= 1
            gain *= kept
        else:
            lags.remove(longer)
            gain *= kept / longer
        lags += [left_over] if left_over > 0 else []
    return gain, sorted(lags, reverse=True), integrators


def _halved(gain: float, lags: list[float], integrators: int, dead: float, keep: int) -> Reduced:
    """Add half of the largest neglected lag to the smallest kept lag, and the rest of the neglected lags to `dead`."""
    split = max(keep - integrators, 0)
    kept, neglected = lags[:split], lags[split:]
    if neglected:
        if kept:  # otherwise only integrators are kept, which do not change
            kept[-1] += neglected[0] / 2
        dead += sum(neglected) - neglected[0] / 2
    return Reduced(gain, tuple(kept), dead, integrators)
