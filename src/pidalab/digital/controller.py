"""The digital controller: states, step, transfer function, and written code."""

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
from pidalab.digital.program import Program, constants, program

if TYPE_CHECKING:  # python-control is imported only for a transfer function.
    import control


@dataclass(frozen=True, kw_only=True, repr=False)
class DigitalController(Parameters):
    r"""A controller as difference equations, with limits, anti-windup, manual mode and tracking.

    Create one with ``controller.discretise(sample_time, method)``. At each sample

    .. math:: u_k = \operatorname{sat}(\mathrm{bias} + p_k + i_k), \qquad
              i_k = i_{k-1} + \gamma_0\,\varepsilon_k + \gamma_1\,\varepsilon_{k-1},

    where p is the sum of the outputs of the paths and :math:`\varepsilon` the error. A feedforward signal, if any, is
    added to the argument of sat. With automatic reset,

    .. math:: i_k = i_{k-1} + \gamma_0\,p_k + \gamma_1\,(u_{k-1} - \mathrm{bias} - f_{k-1} - i_{k-1}),

    where f is the feedforward signal.

    In manual mode the control signal is the given value, and the integral tracks this value. ``step`` stores its states
    in the object; simulations do not change these states.

    Parameters
    ----------
    sample_time : float
        Time from sample to sample.
    method : str
        Discretisation method.
    paths : tuple of FilterChain
        Chains of lags in parallel. Their gains are in units of the signals.
    integrates : bool
        True if the controller has integral action.
    from_signal : bool
        True if the integral is an automatic reset, which integrates the signal of the paths.
    growth : tuple of float
        :math:`\gamma_0, \gamma_1`.
    back_calculation_gain, tracking_gain : float
        Gains of two corrections of the integral. `back_calculation_gain` multiplies the limited minus the unlimited
        control signal. `tracking_gain` multiplies the tracked signal minus the control signal.
    anti_windup : str or None
        Treatment of the integral while the control signal is at a limit.
    weights : tuple of float
        Set-point weights b and c of the proportional and derivative parts.
    limits : tuple of float
        Lower and upper limit of the control signal.
    rate_limit : float
        Largest change of the control signal in a unit of time.
    deadband : float
        Largest error that counts as zero.
    bias, y_offset : float
        Control signal and measurement at the working point.
    source : str
        The continuous controller, as text.
    prefilter : Prefilter or None
        Filter of the set point.
    feedforward : bool
        True if ``step`` takes a signal that is added before the limits.
    tunable : bool
        True if the gains may change while the controller runs.

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
        """Leave out the compiled step, which is compiled again when needed."""
        return {name: value for name, value in vars(self).items() if name != "_run"}

    @cached_property
    def _states(self) -> SimpleNamespace:
        return SimpleNamespace(**self._program.states)

    @cached_property
    def coefficients(self) -> dict[str, float]:
        """Return the constants of the written code by name.

        ==========================  ==============================================================================
        name                        meaning
        ==========================  ==============================================================================
        PART_1_WEIGHT               set-point weight of the first path
        PART_1_NEW, PART_1_OLD      coefficients of the present and the previous input in each lag
                                    (PART_1_NEW_2 in the second lag, if the lags differ)
        PART_1_GAIN_k               gain on the k-th difference of the states of this path
        INTEGRAL_NEW, INTEGRAL_OLD  gains of the integral, the two numbers in `growth`
        BACK_CALCULATION_GAIN       gain from (limited - unlimited control signal) to the integral
        TRACKING_GAIN               gain from (tracked signal - u) to the integral
        BIAS, Y_OFFSET              working point
        LOWEST, HIGHEST             limits of the control signal
        LARGEST_CHANGE              largest change of the control signal from one sample to the next
        DEADBAND                    largest error that counts as zero
        PREFILTER_MOVE_i_j          gain from (state j - v) to the change of prefilter state i in a sample, where v
                                    is r (backward), the mean of the last two r (tustin) or the previous r (zoh)
        PREFILTER_OUT_i             gain from (state i - r) to the filtered set point
        LARGEST_SIGNAL              size of an input above which the sample is skipped
        LARGEST_GAIN                size of a variable gain above which the sample is skipped
        ==========================  ==============================================================================

        Constants that are 0 or have no effect do not appear.

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
        """Return the states at the working point, for a simulation that stores the states itself.

        Returns
        -------
        dict of str to float
            States by their names in the written code.

        Examples
        --------
        >>> import pidalab
        >>> pidalab.PIDA(kp=2.0, ti=4.0).discretise(0.5, bias=3.0).at_rest()
        {'started': True, 'fault': False, 'at_limit': False, 'follow': False, 'integral_part': 0.0, 'carry': 0.0,
        'control': 3.0}
        """
        return vars(self._started(self.y_offset, self.y_offset, self.bias))

    def reset(self, r: float | None = None, y: float | None = None, u: float | None = None) -> None:
        """Restart at rest at the given r and y, or at the r and y of the next call of ``step``.

        Parameters
        ----------
        r, y : float, optional
            Set point and measurement at which the controller rests. Give both or neither.
        u : float, optional
            Control signal to start with. It is limited to `limits`. By default `bias`.

        Raises
        ------
        TypeError, ValueError
            If a signal is not a finite number, or if only one of r and y is given.

        Examples
        --------
        >>> import pidalab
        >>> k = pidalab.PIDA(kp=2.0, ti=4.0).discretise(0.5)
        >>> k.reset(r=0.0, y=0.0)
        >>> k.step(r=1.0, y=0.0)
        2.25
        """
        if (r is None) != (y is None):
            raise ValueError(f"r and y must be given together, or neither, found r = {r!r} and y = {y!r}")
        u = self.bias if u is None else _check.real("u", u)
        if r is not None and y is not None:
            r, y = _check.real("r", r), _check.real("y", y)
        self.__dict__["_states"] = self._started(r, y, min(max(u, self.limits[0]), self.limits[1]))
        self.__dict__.pop("_retuned", None)

    def _started(self, r: float | None, y: float | None, u: float) -> SimpleNamespace:
        """Return the states before the first sample, or the states at rest if r and y are given."""
        states = SimpleNamespace(**{**self._program.states, "control": u})
        if r is not None:
            self._run(states, r, y)
        return states

    def retune(self, other: DigitalController) -> None:
        """Replace the gains by the gains of another controller, without a bump and without restarting.

        The control signal keeps its value in the next sample.

        Parameters
        ----------
        other : DigitalController
            A controller with the same sample time, actions and number of filters.

        Raises
        ------
        TypeError, ValueError
            If one of the two controllers is not tunable, or if they differ in more than their gains.

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
                f"other must be tunable, with the form and sample time of {self!r}, found {other!r}"
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
        """Advance the controller by one sample, exactly as the written code does.

        The first call starts without a bump: filters and integral are at rest at the given signals, and the call
        returns `bias`. Without integral action the first call returns bias + p. To start at rest at the working point,
        as `pidalab.simulate_sampled` does, call ``reset(r=y_offset, y=y_offset)`` first.

        A sample with a signal that is NaN, infinite or beyond 1e9 in size is skipped, and ``fault`` is True. Filters
        and integral keep their values. The step returns `manual` if it is given and valid, and otherwise the last
        control signal. The next valid sample continues with the kept values. After a skipped sample with a valid
        `manual`, the integral first follows this signal, so that there is no bump.

        Parameters
        ----------
        r, y : float
            Set point and measurement.
        manual : float, optional
            Control signal in manual mode. By default the mode is automatic.
        track : float, optional
            Signal that has acted on the plant since the last sample, if it differs from the returned signal: the output
            of a selector, an operator's command or the position of the actuator. In the first call, a controller with
            integral action starts from this signal instead of `bias`.
        feedforward : float, optional
            Signal to add to the control signal. Only for a controller that was discretised with ``feedforward=True``.

        Returns
        -------
        float
            The control signal, which is within its limits even in manual mode.

        Raises
        ------
        TypeError, ValueError
            If a signal is not a real number, or if feedforward is given but was not declared.

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
            raise ValueError(
                f"feedforward needs a controller discretised with feedforward=True, found {feedforward!r}"
            )
        further += [self.__dict__.pop("_retuned", False)] * self.tunable
        return self._run(self._states, r, y, *acts[0], *acts[1], *further)

    @property
    def fault(self) -> bool:
        """True if the last sample was skipped because of an invalid signal."""
        return bool(self._states.fault)

    @property
    def at_limit(self) -> bool:
        """True if `limits` or `rate_limit` changed the latest control signal."""
        return bool(self._states.at_limit)

    def __call__(self, z: ArrayLike) -> Any:
        """Evaluate the transfer function from -y to u at complex z, in units of the signals.

        The prefilter is not included; ``k.prefilter(z)`` evaluates it.
        """
        points = _check.complex_array("z", z)
        signal = sum((path(points) for path in self.paths), np.zeros_like(points))
        if not self.integrates:
            return signal
        growth = (self.growth[0] * points + self.growth[1]) / (points - 1)
        return signal * (1 + growth) if self.from_signal else signal + growth

    def transfer_function(self) -> control.TransferFunction:
        """Return the transfer function from the error to the control signal, with b = c = 1 and without limits.

        For any weights and prefilter, the negative of this function is the transfer function from the measurement to u.

        Returns
        -------
        control.TransferFunction
            In z, with the sample time. Gains are in units of the signals.

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
            signal += control.TransferFunction(*path.num_den(), self.sample_time)
        if not self.integrates:
            return signal
        growth = control.TransferFunction(self.growth, [1.0, -1.0], self.sample_time)
        return signal * (1 + growth) if self.from_signal else signal + growth

    def c(self, name: str = "pida", *, precision: str = "double", **head: Any) -> str:
        """Write the controller in C99.

        Parameters
        ----------
        name : str, optional
            Prefix of all names, such as ``<name>_init``, ``<name>_step`` and ``<name>_state``, in small letters.
        precision : {"double", "single"}, optional
            Type of the real numbers: ``double`` or ``float``.
        **head : optional
            Entries of the comment at the top: ``margins`` (of the loop), ``note`` (a text), ``time_unit`` (of the
            sample time), ``record`` (name of the record to which the model was fitted) and ``date`` (of this record).
            Only letters, digits and usual punctuation marks of the texts are kept.

        Returns
        -------
        str
            A complete file, with a self-test if ``<NAME>_SELFTEST`` is defined.

        Raises
        ------
        TypeError, ValueError
            If the precision or an entry of the head is unknown, or if the name is a keyword or not an identifier.

        Examples
        --------
        >>> import pidalab
        >>> code = pidalab.PIDA(kp=2.0, ti=4.0).discretise(0.5).c(name="level")
        >>> "level_real level_step(level_state *s" in code
        True
        """
        return self._written("c", name, precision=precision, **head)

    def structured_text(self, name: str = "pida", **head: Any) -> str:
        """Write the controller as a FUNCTION_BLOCK of IEC 61131-3, and a second block that tests the first.

        Parameters
        ----------
        name : str, optional
            Name of the block, in small letters.
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
        """Write the controller as a Python module without imports, which MicroPython runs as well.

        Parameters
        ----------
        name : str, optional
            Name of the class, in small letters and underscores.
        **head : optional
            As in `c`.

        Returns
        -------
        str
            A module with a class and a function ``selftest``.

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
        """Write parameters, coefficients and a test vector as JSON.

        Parameters
        ----------
        **head : optional
            As in `c`.

        Returns
        -------
        str
            JSON in which infinite limits are null.

        Examples
        --------
        >>> import json, pidalab
        >>> json.loads(pidalab.PIDA(kp=2.0, ti=4.0).discretise(0.5).json())["coefficients"]["INTEGRAL_NEW"]
        0.25
        """
        from pidalab.plant.code.files import as_json

        return as_json(self, **head)

    def __repr__(self) -> str:
        now = vars(self) | dict(zip("bc", self.weights, strict=True))
        usual = {"b": 1.0, "c": 1.0, "limits": (-math.inf, math.inf), "rate_limit": math.inf}
        usual |= {"anti_windup": "reset", **dict.fromkeys(("deadband", "bias", "y_offset"), 0.0)}
        usual |= {"prefilter": None, "feedforward": False, "tunable": False}
        extras = "".join(f", {name}={now[name]!r}" for name, value in usual.items() if now[name] != value)
        # The source may come from a file, so text with unprintable characters, such as line breaks, is quoted.
        source = self.source if self.source.isprintable() else repr(self.source)
        return f"{source or 'controller'}.discretise({self.sample_time:.10g}, {self.method!r}{extras})"


@lru_cache(maxsize=64)
def _function(k: DigitalController) -> Callable[..., float]:
    """Return the step of a controller as a function. Equal controllers share the function."""
    return languages.function(program(k))


def _signal(name: str, value: Any) -> float:
    """Convert a signal to a float, which may be NaN."""
    return value if isinstance(value, float) else _check.real(name, value)
