r"""Well-known rules: SIMC, AMIGO, lambda tuning, both rules of Ziegler and Nichols, Chien-Hrones-Reswick.

The rules give PI or PID controllers in standard form. By default, the time constant of the derivative filter is a tenth
of the derivative time.

==========================  =================================================================  ===========
function                    source                                                             models
==========================  =================================================================  ===========
`simc`                      Skogestad, Simple analytic rules for model reduction and PID       lags, also
                            controller tuning, J. Process Control 13 (2003) 291-309            integrating
`improved_simc`             Grimholt and Skogestad, Optimal PI and PID control of first-order  as `simc`
                            plus delay processes and evaluation of the original and improved
                            SIMC rules, J. Process Control 70 (2018) 36-46
`amigo`                     Åström and Hägglund, Revisiting the Ziegler-Nichols step response  `fopdt`,
                            method for PID control, J. Process Control 14 (2004) 635-650       `ipdt`
`lambda_tuning`             Åström and Hägglund, Advanced PID Control, ISA 2006, section 6.5   `fopdt`
`ziegler_nichols_step`      Ziegler and Nichols, Optimum settings for automatic controllers,   `fopdt`,
                            Trans. ASME 64 (1942) 759-768, process reaction curve              `ipdt`
`ziegler_nichols_ultimate`  the same paper, ultimate sensitivity                               any
`chien_hrones_reswick`      Chien, Hrones and Reswick, On the automatic control of             `fopdt`
                            generalized passive systems, Trans. ASME 74 (1952) 175-185
==========================  =================================================================  ===========
"""

from __future__ import annotations

import math
from typing import Any

from pidalab import _check
from pidalab._text import WITHOUT_ACCELERATION
from pidalab.controllers import PIDA
from pidalab.process import Process, require_process
from pidalab.rules._design import Design
from pidalab.rules._simc import improved_simc, simc
from pidalab.rules.models import integrator, lag_with_delay, lags, require_delay

__all__ = [
    "amigo",
    "chien_hrones_reswick",
    "improved_simc",
    "lambda_tuning",
    "simc",
    "ziegler_nichols_step",
    "ziegler_nichols_ultimate",
]

Settings = tuple[float, float, float]  # kp, ti, td
# Each entry holds the settings of PI and then the settings of PID. The three numbers are kp K L/T, then ti/L (load
# steps) or ti/T (set-point steps), then td/L.
CHIEN_HRONES_RESWICK = {
    ("load", 0): ((0.6, 4.0, 0.0), (0.95, 2.4, 0.42)),
    ("load", 20): ((0.7, 2.3, 0.0), (1.2, 2.0, 0.42)),
    ("setpoint", 0): ((0.35, 1.2, 0.0), (0.6, 1.0, 0.5)),
    ("setpoint", 20): ((0.6, 1.0, 0.0), (0.95, 1.4, 0.47)),
}


def amigo(model: Process, kind: str = "PID") -> Design:
    r"""Design a PI or PID controller by AMIGO, for a maximum sensitivity near 1.4.

    Parameters
    ----------
    model : Process
        `fopdt` or `ipdt` with dead time above 0.
    kind : {"PI", "PID"}, optional
        Kind of controller.

    Returns
    -------
    Design

    Raises
    ------
    ValueError
        If the model is neither a `fopdt` nor an `ipdt`, or has no dead time.

    Notes
    -----
    The authors fitted the rule to 134 processes. If the dead time does not dominate, the PI controllers keep Ms near
    1.4. If the dead time dominates, the PID controllers are conservative, as the authors warn.

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


def lambda_tuning(model: Process, kind: str = "PI", *, closed_loop_time: float | None = None) -> Design:
    r"""Design by lambda tuning, which cancels the lag and gives the closed loop a chosen time constant λ.

    .. math:: \text{PI: } k_p = \frac{T}{K(\lambda + L)},\; t_i = T; \qquad
              \text{PID: } k_p = \frac{T + L/2}{K(\lambda + L/2)},\; t_i = T + \frac L2,\; t_d = \frac{TL}{2T + L}

    Parameters
    ----------
    model : Process
        `fopdt` with gain K, lag T and dead time L.
    kind : {"PI", "PID"}, optional
        Kind of controller.
    closed_loop_time : float, optional
        λ, above 0. The default is the lag, which the source calls the aggressive choice.

    Returns
    -------
    Design

    Raises
    ------
    ValueError
        If the model is not a `fopdt`.

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
    r"""Design by the first rule of Ziegler and Nichols, from the steepest tangent of a step response.

    The closed loop is fast and has little damping.

    Parameters
    ----------
    model : Process
        `fopdt` or `ipdt` with dead time above 0. The slope of the tangent is gain/lag (`fopdt`) or the velocity gain
        (`ipdt`).
    kind : {"PI", "PID"}, optional
        Kind of controller.

    Returns
    -------
    Design

    Raises
    ------
    ValueError
        If the model is neither a `fopdt` nor an `ipdt`, or has no dead time.

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
    r"""Design by the second rule of Ziegler and Nichols, from ultimate gain and period.

    Parameters
    ----------
    process : Process
        Stable or integrating process with a phase that reaches -180 degrees.
    kind : {"PI", "PID"}, optional
        Kind of controller.

    Returns
    -------
    Design
        Its `info` has ``ultimate_gain`` and ``ultimate_period``.

    Raises
    ------
    ValueError
        If the process has no ultimate gain: the phase never reaches -180 degrees, the process is unstable, or every
        gain makes the loop unstable (as with a double integrator).

    Examples
    --------
    >>> import pidalab
    >>> design = pidalab.rules.classical.ziegler_nichols_ultimate(pidalab.lags(3))
    >>> print(f"{design.ultimate_gain:.3f} {design.ultimate_period:.4f} {design.controller.kp:.2f}")
    8.000 3.6276 4.80
    """
    from pidalab.reduction import ultimate_frequency

    w = ultimate_frequency(process)
    ultimate, period = float(1 / abs(process(1j * w))) * math.copysign(1.0, process.gain()), 2 * math.pi / w
    pi, pid = (0.45 * ultimate, period / 1.2, 0.0), (0.6 * ultimate, period / 2, period / 8)
    source = "Ziegler and Nichols (1942), ultimate sensitivity"
    return _design(process, kind, pi, pid, source, ultimate_gain=ultimate, ultimate_period=period)


def chien_hrones_reswick(model: Process, test: str = "load", overshoot: int = 0, kind: str = "PID") -> Design:
    r"""Design by the rule of Chien, Hrones and Reswick, for the fastest response with an overshoot of 0 % or 20 %.

    Åström and Hägglund, PID Controllers, 2nd ed., ISA 1995, section 4.2, quote these settings. They define
    :math:`a = K L/T`.

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
        Kind of step for which the controller is designed.
    overshoot : {0, 20}, optional
        Overshoot in per cent.
    kind : {"PI", "PID"}, optional
        Kind of controller.

    Returns
    -------
    Design

    Raises
    ------
    ValueError
        If the model is not a `fopdt` or has no dead time, or if test, overshoot or kind is unknown.

    Notes
    -----
    The original paper was not available. An independent public program gives all eight settings of this table (four of
    PI and four of PID). Several sources agree on the four settings for set-point steps. Sources with more digits give
    ti = 1.16 T (set point 0 %, PI), ti = 1.357 T and td = 0.473 L (set point 20 %, PID), and ti = 2.357 L (load 0 %,
    PID).

    The authors of the rule used an analogue computer. We simulated a lag with dead time exactly, for T/L from 4 to 50
    and a filter time constant of td/10. The table shows the simulated overshoot. For load steps, the overshoot is in
    per cent of the largest deviation.

    ========  =========  ============  ============
    step      overshoot  PI            PID
    ========  =========  ============  ============
    load      0 %        0 %           up to 9 %
    load      20 %       9 to 40 %     5 to 11 %
    setpoint  0 %        at most 2 %   at most 2 %
    setpoint  20 %       11.6 %        27 to 39 %
    ========  =========  ============  ============

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
    """Return the design with the settings kp, ti and td of the requested kind."""
    _check.choice("kind", kind, WITHOUT_ACCELERATION)
    kp, ti, td = pi if kind == "PI" else pid
    return Design(model, PIDA(kp, ti, td), source=source, info=info)


def _lag_or_integrator(model: Process) -> tuple[bool, float, float, float]:
    """Return whether the model integrates, its gain, its lag (infinite for an integrator) and its dead time."""
    require_process("model", model)
    if len(model.den) != 2 or model.den[-1] != 0:
        return False, *lag_with_delay(model)
    gain, delay = integrator(model)
    require_delay(model)
    return True, gain, math.inf, delay
