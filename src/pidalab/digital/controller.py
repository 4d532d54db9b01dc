"""The digital controller: its numbers, its states, its transfer function; the wing writes its code."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from pidalab import _check
from pidalab.digital import languages
from pidalab.digital.parameters import Parameters
from pidalab.digital.program import constants, program
from pidalab.digital.statements import Program

if TYPE_CHECKING:  # only who asks for a transfer function waits for python-control
    import control


@dataclass(frozen=True, kw_only=True, repr=False)
class DigitalController(Parameters):
    r"""A controller as a computer runs it: difference equations with limits, anti-windup, modes and units.

    Make one with ``controller.discretise(sample_time, method)``. At each sample

    .. math:: u_k = \operatorname{sat}(\mathrm{bias} + p_k + i_k), \qquad
              i_k = i_{k-1} + \gamma_0\,\varepsilon_k + \gamma_1\,\varepsilon_{k-1},

    where p is the sum of the paths and :math:`\varepsilon` the error; with automatic reset it is p, and before p what
    the limits made of it. What a limit cuts off is taken back from the integral, `anti_windup` says how.

    It starts at the first measurement without a bump: with the control signal `bias`, and with filters at rest. (One
    without integral action starts with its own signal.) In manual mode it gives the signal it is told, and the integral
    follows so that it goes on from there. A sample with a signal that is no number is left out: it holds. ``step``
    keeps states in the object itself; simulations have their own.

    Parameters
    ----------
    sample_time : float
        Time from sample to sample.
    method : str
        How it was discretised.
    paths : tuple of Path
        Chains of lags and the gains on their differences, in the units of the signals.
    integrates : bool
        Whether there is integral action.
    from_signal : bool
        Whether the integral is an automatic reset, which grows by what the paths make of the error.
    growth : tuple of float
        :math:`\gamma_0, \gamma_1`.
    back_calculation_gain, tracking_gain : float
        Shares of what a limit cut off, and of the difference to a tracked signal, that the integral takes up.
    anti_windup : str or None
        What the integral does at a limit.
    weights : tuple of float
        Weights b and c of the set point in proportional and derivative parts.
    limits : tuple of float
        Of the control signal.
    rate_limit : float
        Of the control signal, in a unit of time.
    deadband, bias, y_offset : float
        In the units of the signals: error that counts as zero, control signal and measurement at the working point.
    source : str
        What was discretised.
    prefilter : Prefilter or None
        Filter of the set point.
    feedforward : bool
        Whether it takes a signal that is added before the limits.
    tunable : bool
        Whether its gains may change while it runs.

    Examples
    --------
    >>> import pidalab
    >>> k = pidalab.PIDA(kp=2.0, ti=4.0).discretise(0.5, limits=(0.0, 10.0), bias=5.0)
    >>> [k.step(r=1.0, y=y) for y in (1.0, 0.5, 0.0, 0.0)]
    [5.0, 6.125, 7.375, 7.625]
    >>> k.reset(u=3.0)
    >>> k.step(r=1.0, y=0.0), k.step(r=1.0, y=0.0, manual=8.0), k.step(r=1.0, y=0.0)
    (3.0, 8.0, 8.25)
    """

    @cached_property
    def _program(self) -> Program:
        """The step as statements, with its constants and states."""
        return program(self)

    @cached_property
    def _run(self) -> Callable[..., float]:
        return _function(self)

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the function that runs, which is made again when it is needed."""
        return {name: value for name, value in vars(self).items() if name != "_run"}

    @cached_property
    def _states(self) -> SimpleNamespace:
        return SimpleNamespace(**self._program.states)

    @cached_property
    def coefficients(self) -> dict[str, float]:
        """Constants of the written code, by their names there.

        The paths are counted from 1, in the order of `paths`: ``PART_1_WEIGHT`` weighs the set point, ``PART_1_NEW``
        and ``PART_1_OLD`` are the shares of the input now and one sample ago in each lag (``PART_1_NEW_2`` of the
        second, where lags differ), ``PART_1_GAIN_k`` is the gain on the k-th difference. ``INTEGRAL_NEW`` and
        ``INTEGRAL_OLD`` say how the integral grows with the error now and one sample ago, ``BACK_CALCULATION_GAIN``
        which share it takes back of what a limit cut off, and ``TRACKING_GAIN`` which share it takes up of the
        difference to a tracked signal. ``BIAS`` and ``Y_OFFSET`` are the working point; ``LOWEST``, ``HIGHEST`` and
        ``LARGEST_CHANGE`` (in a sample) the limits; ``DEADBAND`` is what counts as no error. ``PREFILTER_MOVE_i_j``
        says how state i of a prefilter moves with the distance of state j from the set point, and
        ``PREFILTER_OUT_i`` what the distance of state i adds to the set point. Samples with signals
        beyond ``LARGEST_SIGNAL`` are left out, as are those with gains beyond ``LARGEST_GAIN`` where these may change.
        What is 0, or acts on nothing, is left out.

        Examples
        --------
        >>> import pidalab
        >>> k = pidalab.PIDA(kp=2.0, ti=4.0).discretise(0.5, limits=(0.0, 10.0))
        >>> for name, value in k.coefficients.items():
        ...     print(name, value)
        PART_1_GAIN_0 2.0
        INTEGRAL_NEW 0.25
        BACK_CALCULATION_GAIN 0.1111111111111111
        TRACKING_GAIN 0.1111111111111111
        LOWEST 0.0
        HIGHEST 10.0
        LARGEST_SIGNAL 1000000000.0
        """
        return constants(self)

    def at_rest(self) -> dict[str, float]:
        """Return the states at rest at the working point, for a simulation that has its own.

        Returns
        -------
        dict of str to float
            By the names they have in the code.

        Examples
        --------
        >>> import pidalab
        >>> pidalab.PIDA(kp=2.0, ti=4.0).discretise(0.5, bias=3.0).at_rest()
        {'started': True, 'fault': False, 'at_limit': False, 'follow': False, 'integral_part': 0.0, 'carry': 0.0,
        'control': 3.0}
        """
        return vars(self._started(self.y_offset, self.y_offset, self.bias))

    def reset(self, r: float | None = None, y: float | None = None, u: float | None = None) -> None:
        """Set the states: to a start at the next measurement, or to rest at given signals.

        Parameters
        ----------
        r, y : float, optional
            Set point and measurement at which everything rests; both or neither.
        u : float, optional
            Control signal to start with, within the limits; `bias` by default.

        Raises
        ------
        TypeError, ValueError
            For a signal that is not a finite number, or one of r and y alone.

        Examples
        --------
        >>> import pidalab
        >>> k = pidalab.PIDA(kp=2.0, ti=4.0).discretise(0.5)
        >>> k.reset(r=0.0, y=0.0)
        >>> k.step(r=1.0, y=0.0)
        2.25
        """
        if (r is None) != (y is None):
            raise ValueError(
                f"r and y must be given together, or none of them, found r = {r!r} and y = {y!r}"
            )
        u = self.bias if u is None else _check.real("u", u)
        if r is not None and y is not None:
            r, y = _check.real("r", r), _check.real("y", y)
        self.__dict__["_states"] = self._started(r, y, min(max(u, self.limits[0]), self.limits[1]))
        self.__dict__.pop("_retuned", None)

    def _started(self, r: float | None, y: float | None, u: float) -> SimpleNamespace:
        """Return states before the first sample, or after one at which everything rests."""
        states = SimpleNamespace(**{**self._program.states, "control": u})
        if r is not None:
            self._run(states, r, y)
        return states

    def retune(self, other: DigitalController) -> None:
        """Take over the gains of another controller while it runs, without a bump.

        The control signal stays for the next sample, and goes on from there: the integral takes up the difference.

        Parameters
        ----------
        other : DigitalController
            Of the same kind: sample time, actions and filters with other values.

        Raises
        ------
        TypeError, ValueError
            For a controller that is not tunable, and for one of another kind.

        Examples
        --------
        >>> import pidalab
        >>> k, other = (pidalab.PIDA(kp, ti=4.0).discretise(0.5, tunable=True) for kp in (2.0, 6.0))
        >>> before = k.step(r=0.0, y=0.0), k.step(r=1.0, y=0.0)
        >>> k.retune(other)
        >>> before, k.step(r=1.0, y=0.0), k.step(r=1.0, y=0.0)
        ((0.0, 2.25), 2.25, 3.0)
        """
        if not isinstance(other, DigitalController):
            raise TypeError(f"other must be a DigitalController, found {type(other).__name__}")
        gains = other._program.gains
        alike = gains.keys() == self._program.gains.keys() and other.sample_time == self.sample_time
        if not (self.tunable and alike):
            raise ValueError(
                "other must be a tunable controller of the same kind and sample time as this tunable one, found "
                f"{other!r} for {self!r}"
            )
        vars(self._states).update(gains)
        self.__dict__["_retuned"] = True

    def step(
        self,
        r: float,
        y: float,
        manual: float | None = None,
        track: float | None = None,
        feedforward: float = 0.0,
    ) -> float:
        """Advance by one sample; runs what `python` writes, and C and structured text repeat.

        The first call starts without a bump: it returns `bias`, and filters and integral rest at the given signals.
        `pidalab.simulate_sampled` starts from rest at the working point instead. For the same start here, call
        ``reset(r=y_offset, y=y_offset)`` first.

        A sample with a signal that is NaN, infinite or beyond 1e9 in size is skipped: states and control signal keep
        their values, ``fault`` is True, and the next good sample continues from there.

        Parameters
        ----------
        r, y : float
            Set point and measurement.
        manual : float, optional
            Control signal in manual mode; None in automatic mode.
        track : float, optional
            Signal that acted since the last sample in place of the one that was returned: that of a selector, of an
            operator at the actuator, or the position of the actuator. At the first sample it starts there.
        feedforward : float, optional
            Signal that is added, of a controller that was discretised with ``feedforward=True``.

        Returns
        -------
        float
            The control signal, within its limits also in manual mode.

        Raises
        ------
        TypeError, ValueError
            For a signal that is no float, and for feedforward that was not asked for.

        Examples
        --------
        >>> import math, pidalab
        >>> k = pidalab.PIDA(kp=2.0, ti=4.0).discretise(0.5, limits=(0.0, 5.0), bias=1.0)
        >>> k.step(r=2.0, y=2.0), k.step(r=9.0, y=2.0), k.step(r=9.0, y=2.0, track=4.0)
        (1.0, 5.0, 5.0)
        >>> k.at_limit, k.step(r=2.0, y=math.nan), k.fault
        (True, 5.0, True)
        """
        r, y = _signal("r", r), _signal("y", y)
        given = (("manual", manual), ("track", track))
        acts = [(x is not None, 0.0 if x is None else _signal(name, x)) for name, x in given]
        further: list[float] = [_signal("feedforward", feedforward)] * self.feedforward
        if feedforward and not self.feedforward:
            raise ValueError("feedforward must be asked for: discretise(..., feedforward=True)")
        further += [self.__dict__.pop("_retuned", False)] * self.tunable
        return self._run(self._states, r, y, *acts[0], *acts[1], *further)

    @property
    def fault(self) -> bool:
        """Whether the last sample was left out, for a signal that is no number."""
        return bool(self._states.fault)

    @property
    def at_limit(self) -> bool:
        """Whether a limit of range or rate cut something off the signal of the last sample."""
        return bool(self._states.at_limit)

    def __call__(self, z: ArrayLike) -> Any:
        """Evaluate the transfer function from -y to u at complex z, in the units of the signals.

        The prefilter is left out: ``k.prefilter(z)``.
        """
        at = _check.complex_array("z", z)
        signal = sum((path(at) for path in self.paths), np.zeros_like(at))
        if not self.integrates:
            return signal
        growth = (self.growth[0] * at + self.growth[1]) / (at - 1)
        return signal * (1 + growth) if self.from_signal else signal + growth

    def transfer_function(self) -> control.TransferFunction:
        """Return the controller within its limits, from the error to the control signal, with b = c = 1.

        That is also the way from the measurement, with the sign changed, whatever weights and prefilter of the set
        point are.

        Returns
        -------
        control.TransferFunction
            In z, with the sample time, in the units of the signals.

        Examples
        --------
        >>> import pidalab
        >>> C = pidalab.PIDA(kp=2.0, ti=4.0).discretise(0.5).transfer_function()
        >>> C.num[0][0].tolist(), C.den[0][0].tolist(), C.dt
        ([2.25, -2.0], [1.0, -1.0], 0.5)
        """
        import control

        signal = control.TransferFunction([0.0], [1.0], self.sample_time)
        for path in self.paths:
            signal += control.TransferFunction(*path.fraction(), self.sample_time)
        if not self.integrates:
            return signal
        growth = control.TransferFunction(self.growth, [1.0, -1.0], self.sample_time)
        return signal * (1 + growth) if self.from_signal else signal + growth

    def c(self, name: str = "pida", *, precision: str = "double", **head: Any) -> str:
        """Write the controller in C99.

        Parameters
        ----------
        name : str, optional
            Prefix of all names: ``<name>_init``, ``<name>_step``, ``<name>_state``; small letters.
        precision : {"double", "single"}, optional
            Type of the real numbers: ``double`` or ``float``.
        **head : optional
            For the comment at the top: ``margins`` of the loop, further lines ``note``, ``time_unit`` of the sample
            time, ``record`` and its ``date``. Of the texts, letters, digits and usual punctuation marks are kept.

        Returns
        -------
        str
            A file that compiles by itself, with a self-test under ``<NAME>_SELFTEST``.

        Raises
        ------
        TypeError, ValueError
            For an unknown precision or entry of the head, and for a name that is not an identifier or is a keyword.

        Examples
        --------
        >>> import pidalab
        >>> code = pidalab.PIDA(kp=2.0, ti=4.0).discretise(0.5).c(name="level")
        >>> "level_real level_step(level_state *s" in code
        True
        """
        return self._written("c", name, precision=precision, **head)

    def structured_text(self, name: str = "pida", **head: Any) -> str:
        """Write the controller as a FUNCTION_BLOCK of IEC 61131-3, with a second block that tests it.

        Parameters
        ----------
        name : str, optional
            Name of the block; small letters.
        **head : optional
            As in `c`.

        Returns
        -------
        str
            Structured text. For single precision, replace LREAL by REAL.

        Raises
        ------
        TypeError, ValueError
            As in `c`.

        Examples
        --------
        >>> import pidalab
        >>> code = pidalab.PIDA(kp=2.0, ti=4.0).discretise(0.5).structured_text(name="level")
        >>> "FUNCTION_BLOCK level" in code
        True
        """
        return self._written("structured_text", name, **head)

    def python(self, name: str = "pida", **head: Any) -> str:
        """Write the controller as a Python module without imports, also for MicroPython.

        Parameters
        ----------
        name : str, optional
            Name of the class, in small letters and underscores.
        **head : optional
            As in `c`.

        Returns
        -------
        str
            A module with a class and a ``selftest``.

        Raises
        ------
        TypeError, ValueError
            As in `c`.

        Examples
        --------
        >>> import pidalab
        >>> space = {}
        >>> exec(pidalab.PIDA(kp=2.0, ti=4.0).discretise(0.5).python(name="level"), space)
        >>> space["Level"]().step(1.0, 1.0), space["selftest"]()
        (0.0, 0.0)
        """
        return self._written("python", name, **head)

    def _written(self, language: str, name: str, **options: Any) -> str:
        from pidalab.plant.code.files import written

        return written(self, language, name, **options)

    def json(self, **head: Any) -> str:
        """Write parameters, coefficients and test vector as JSON.

        Parameters
        ----------
        **head : optional
            As in `c`.

        Returns
        -------
        str
            JSON; infinite limits are null.

        Examples
        --------
        >>> import json, pidalab
        >>> json.loads(pidalab.PIDA(kp=2.0, ti=4.0).discretise(0.5).json())["coefficients"]["INTEGRAL_NEW"]
        0.25
        """
        from pidalab.plant.code.files import as_json

        return as_json(self, **head)

    def __repr__(self) -> str:
        own = vars(self) | dict(zip("bc", self.weights, strict=True))
        usual = {"b": 1.0, "c": 1.0, "limits": (-math.inf, math.inf), "rate_limit": math.inf}
        usual |= {"anti_windup": "reset", **dict.fromkeys(("deadband", "bias", "y_offset"), 0.0)}
        usual |= {"prefilter": None, "feedforward": False, "tunable": False}
        extras = "".join(f", {name}={own[name]!r}" for name, value in usual.items() if own[name] != value)
        # its name may come out of a file: only what can be printed on one line stays as it is
        source = self.source if self.source.isprintable() else repr(self.source)
        return f"{source or 'controller'}.discretise({self.sample_time:.10g}, {self.method!r}{extras})"


@lru_cache(maxsize=64)
def _function(k: DigitalController) -> Callable[..., float]:
    """Return the step of a controller as a function, the same for equal ones."""
    return languages.function(program(k))


def _signal(name: str, value: Any) -> float:
    """Return a signal as a float, which may be no number."""
    return value if isinstance(value, float) else _check.real(name, value)
