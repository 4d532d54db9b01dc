"""Generalized Haalman tuning: cancel the poles of the model, and choose the gain for a given Ms (haalman2024)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pidalab import _check
from pidalab.controllers import PIDA, Fraction
from pidalab.loop import Loop
from pidalab.process import Process, binomial
from pidalab.robustness.margins import gain_crossovers, gain_for_ms
from pidalab.rules._design import Design
from pidalab.rules.models import lags

if TYPE_CHECKING:
    import control

    from pidalab.identification import ThreePointModel

FILTER_RATIO = 0.05  # (time constant of the output filter) * (gain crossover frequency), eq. (9)


def pida(model: Process, ms: float = 1.4, *, n: float = 10, m: float | None = None) -> PIDA:
    """Design a PIDA controller for a third-order model with dead time.

    The integral, derivative and acceleration times cancel the poles of the model, eq. (8): ``ti = a1``, ``td = a2/a1``,
    ``ta = a3/a1``. With the gain from `pidalab.gain_for_ms`, the loop of model and filtered controller, eq. (2), has
    the maximum sensitivity `ms`.

    Use `output_filter` or a prefilter of the set point. Otherwise a unit step of the set point moves the control signal
    to kp (1 + n + m²/ta) at once. The output filter, eq. (9), raises Ms slightly above `ms`.

    Parameters
    ----------
    model : Process
        Process K / (a3 s³ + a2 s² + a1 s + 1) with stable poles and dead time (P̂ in the paper).
    ms : float, optional
        Maximum sensitivity of the loop, above 1. The paper uses 1.4 (cautious) and 2.0 (fast).
    n : float, optional
        Derivative time divided by the time constant of the derivative filter, above 0.
    m : float, optional
        ``ta/m`` is the time constant of the acceleration filter, so m has the unit of time. By default ``n td``, which
        makes the design independent of the unit of time. The paper uses 10 for processes with lags near 1.

    Returns
    -------
    PIDA

    Raises
    ------
    ValueError
        If the model does not have the structure above, or if no gain reaches `ms`.

    Examples
    --------
    >>> import pidalab
    >>> model = pidalab.Process([1.0], [0.905, 3.159, 3.37, 1.0], delay=0.826)
    >>> C = pidalab.rules.haalman.pida(model, ms=1.4, m=10)
    >>> print(f"kp = {C.kp:.3f}, ti = {C.ti:.3f}, td = {C.td:.3f}, ta = {C.ta:.3f}")
    kp = 1.298, ti = 3.370, td = 0.937, ta = 0.269
    """
    gain, (a3, a2, a1) = lags(model, order=3)
    ratio = _check.real("n", n, above=0.0) * a2 / a1 if m is None else m
    return _with_gain(model, PIDA(1 / gain, a1, a2 / a1, a3 / a1, n, ratio), ms)


def pid(model: Process, ms: float = 1.4, *, n: float = 10) -> PIDA:
    """Design a PID controller for a second-order model with dead time, as `pida` does, eq. (10).

    Parameters
    ----------
    model : Process
        Process with constant numerator, two stable poles and dead time.
    ms, n : float, optional
        As for `pida`.

    Returns
    -------
    PIDA

    Raises
    ------
    ValueError
        If the model does not have the structure above, or if no gain reaches `ms`.

    Examples
    --------
    >>> import pidalab
    >>> C = pidalab.rules.haalman.pid(pidalab.Process([1.0], [2.062, 2.875, 1.0], delay=1.12), ms=1.4)
    >>> print(f"kp = {C.kp:.3f}, ti = {C.ti:.3f}, td = {C.td:.3f}")
    kp = 0.906, ti = 2.875, td = 0.717
    """
    gain, (a2, a1) = lags(model, order=2)
    return _with_gain(model, PIDA(1 / gain, a1, a2 / a1, 0.0, n), ms)


def pi(model: Process, ms: float = 1.4) -> PIDA:
    """Design a PI controller for a first-order model with dead time, as `pida` does. Not in the paper.

    Parameters
    ----------
    model : Process
        Process with constant numerator, one stable pole and dead time, such as `fopdt`.
    ms : float, optional
        As for `pida`.

    Returns
    -------
    PIDA

    Raises
    ------
    ValueError
        If the model does not have the structure above, or if no gain reaches `ms`.

    Examples
    --------
    >>> import pidalab
    >>> C = pidalab.rules.haalman.pi(pidalab.fopdt(gain=1.0, lag=2.0, delay=1.0), ms=1.59049)
    >>> print(f"kp = {C.kp:.3f}, ti = {C.ti:.3f}")
    kp = 1.000, ti = 2.000
    """
    gain, (a1,) = lags(model, order=1)
    return _with_gain(model, PIDA(1 / gain, a1), ms)


def tune(
    model: Process | ThreePointModel,
    ms: float = 1.4,
    kind: str = "PIDA",
    *,
    n: float = 10,
    m: float | None = None,
) -> Design:
    """Design a controller with `pida`, `pid` or `pi`, and its output filter with `output_filter`.

    Parameters
    ----------
    model : Process or ThreePointModel
        Process with constant numerator, dead time, and three (PIDA), two (PID) or one (PI) stable poles. A
        `ThreePointModel` is refused if its `excess_gain` is above 0.25 (25 %). At some
        frequencies, the recorded process then has so much more gain than the model that its loop might be unstable.
    ms : float, optional
        Maximum sensitivity, above 1, of the loop without the output filter.
    kind : {"PIDA", "PID", "PI"}, optional
        Type of controller.
    n, m : float, optional
        As for `pida`.

    Returns
    -------
    Design
        Controller and output filter. `info` has ``ms_asked`` and the gain crossover frequency ``wgc`` (rad per time
        unit) of the loop without output filter. ``design.ms`` is Ms with output filter.

    Raises
    ------
    TypeError, ValueError
        As for `pida` and `output_filter`. Also if the kind is unknown, or if the `excess_gain` of a three-point model
        is too large.

    Examples
    --------
    >>> import pidalab
    >>> design = pidalab.rules.haalman.tune(pidalab.sopdt(1.0, tau=1.5, damping=1.0, delay=1.0), ms=1.4, kind="PID")
    >>> print(f"{design.controller.kp:.3f} {design.output_filter.time:.4f} {pidalab.margins(design.loop()).ms:.3f}")
    1.039 0.1436 1.461
    """
    _check.choice("kind", kind, ("PIDA", "PID", "PI"))
    model = _trusted(model)
    if kind == "PIDA":
        controller, equations = pida(model, ms, n=n, m=m), "eqs. (2), (8) and (9)"
    else:
        controller = pid(model, ms, n=n) if kind == "PID" else pi(model, ms)
        equations = {"PID": "eqs. (9) and (10)", "PI": "eqs. (8) and (9), for one lag"}[kind]
    smooth = output_filter(model, controller)
    return Design(
        model,
        controller,
        None,
        smooth,
        f"haalman2024, {equations}",
        {"ms_asked": float(ms), "wgc": smooth.wgc},
    )


class OutputFilter(NamedTuple):
    """Low-pass filter 1/(time s + 1)^order of the control signal, designed from the gain crossover frequency `wgc`."""

    time: float
    order: int
    wgc: float

    def transfer_function(self) -> control.TransferFunction:
        """Return the filter as a block for a `Loop`.

        Returns
        -------
        control.TransferFunction

        Examples
        --------
        >>> from pidalab.rules.haalman import OutputFilter
        >>> OutputFilter(time=0.5, order=2, wgc=0.1).transfer_function().den[0][0].tolist()
        [0.25, 1.0, 1.0]
        """
        import control

        return control.TransferFunction(*self.fraction())

    def fraction(self) -> Fraction:
        """Return numerator and denominator of the filter.

        Returns
        -------
        num, den : ndarray
            Descending powers of s.

        Examples
        --------
        >>> from pidalab.rules.haalman import OutputFilter
        >>> OutputFilter(time=0.5, order=2, wgc=0.1).fraction()[1].tolist()
        [0.25, 1.0, 1.0]
        """
        return np.ones(1), binomial(self.time, self.order)


def output_filter(model: Process, controller: PIDA) -> OutputFilter:
    """Design a low-pass filter of the control signal, with a corner at 20 times the gain crossover, eq. (9).

    Parameters
    ----------
    model : Process
        The model.
    controller : PIDA
        The filter is of second order if ``controller.ta`` is not 0, otherwise of first order.

    Returns
    -------
    OutputFilter
        Time constant ``0.05/wgc``, order, and gain crossover frequency ``wgc`` (rad per time unit).
        A `Loop` accepts the filter as a block.

    Raises
    ------
    TypeError, ValueError
        If the controller is of another type, or if the gain of the loop does not cross 1 exactly once.

    Examples
    --------
    >>> import pidalab
    >>> model = pidalab.Process([1.0], [0.905, 3.159, 3.37, 1.0], delay=0.826)
    >>> F = pidalab.rules.haalman.output_filter(model, pidalab.rules.haalman.pida(model, ms=1.4, m=10))
    >>> print(f"{F.time:.3f} {F.order} {F.wgc:.3f}")
    0.128 2 0.390
    """
    if not isinstance(controller, PIDA):
        raise TypeError(f"controller must be a PIDA, found {type(controller).__name__}")
    crossovers = gain_crossovers(Loop(model, controller))
    if crossovers.size != 1:
        raise ValueError(f"the loop must have one gain crossover, found {crossovers.round(4).tolist()}")
    return OutputFilter(float(FILTER_RATIO / crossovers[0]), 2 if controller.ta else 1, float(crossovers[0]))


def _trusted(model: Process | ThreePointModel) -> Process:
    """Return the process of a three-point model, or another model unchanged. Raise if model and record do not match."""
    if isinstance(model, Process) or not hasattr(model, "excess_gain"):
        return model  # type: ignore[return-value]
    from pidalab.identification.experiments import MOST_EXCESS_GAIN

    if model.excess_gain > MOST_EXCESS_GAIN:
        raise ValueError(
            f"model does not match its record: the gain of the record is up to {100 * model.excess_gain:.0f} % above "
            f"that of the model, and at most {100 * MOST_EXCESS_GAIN:g} % is allowed; use identification.fit, or pass "
            "model.process to tune anyway"
        )
    return model.process


def _with_gain(model: Process, unit: PIDA, ms: float) -> PIDA:
    """Scale the controller `unit` so that Ms of the loop is `ms`."""
    return gain_for_ms(Loop(model, unit), ms) * unit
