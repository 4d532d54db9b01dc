"""Run experiments with the Temperature Control Lab, a board with two heaters, real or simulated.

The package ``tclab`` (``pip install tclab``) drives the board and simulates it. The control signal is the power of
heater 1 in per cent, and the output is the temperature of thermistor 1 in degrees Celsius. Heater 2 is the load.
"""

from __future__ import annotations

import contextlib
import io
import random
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from pidalab import _check
from pidalab._check import Array
from pidalab.digital import DigitalController
from pidalab.plant.record import Record
from pidalab.response import Response


class Lab:
    """A Temperature Control Lab, real or simulated. A ``with`` block turns the heaters off at its end.

    Parameters
    ----------
    connected : bool, optional
        Use the board at a serial port. By default a board is simulated, with a temperature of 21 °C at the start.
    seed : int, optional
        Seed of the simulated noise.

    Raises
    ------
    ImportError
        If the package tclab is not installed.
    RuntimeError
        If no board is found at any port.

    Examples
    --------
    >>> from pidalab.plant.heater import Lab
    >>> with Lab() as lab:
    ...     record = lab.step_test(after=50.0, duration=600.0)
    >>> record.steps[0].after, bool(record.y[-1] > 45.0)
    (50.0, True)
    """

    def __init__(self, connected: bool = False, seed: int = 0) -> None:
        try:
            import tclab  # type: ignore[import-untyped]
        except ImportError:
            needed = "the Temperature Control Lab needs the package tclab, also for simulation"
            raise ImportError(f"{needed}: pip install tclab") from None
        self.connected = connected
        self._random = random.Random(_check.integer("seed", seed, at_least=0)).getstate()
        self._labtime = tclab.labtime
        with contextlib.nullcontext() if connected else _silent():
            self._device = tclab.TCLab() if connected else tclab.TCLabModel(synced=False)
        self._now = 0.0 if connected else self._device.tlast  # the simulated clock need not start at 0

    def __enter__(self) -> Lab:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Turn both heaters off and release the board.

        Examples
        --------
        >>> from pidalab.plant.heater import Lab
        >>> Lab().close()
        """
        with contextlib.nullcontext() if self.connected else _silent():
            self._device.close()

    def hold(self, power: float = 0.0, duration: float = 1200.0) -> None:
        """Hold heater 1 at a constant power with heater 2 off.

        Parameters
        ----------
        power : float, optional
            Power of heater 1, in per cent.
        duration : float, optional
            Duration in seconds.

        Raises
        ------
        TypeError, ValueError
            If the power is outside 0 to 100, or the duration is not above 0.

        Examples
        --------
        >>> from pidalab.plant.heater import Lab
        >>> Lab().hold(30.0, duration=600.0)
        """
        power = _power("power", power)
        duration = _check.real("duration", duration, above=0.0)
        self._run(np.array([0.0, duration / 2]), lambda k, measured: power, np.zeros(2))

    def step_test(
        self,
        after: float = 50.0,
        duration: float = 900.0,
        before: float = 0.0,
        rest: float = 60.0,
        sample_time: float = 1.0,
    ) -> Record:
        """Step heater 1 and record the temperature.

        Parameters
        ----------
        after : float, optional
            Power after the step, in per cent.
        duration : float, optional
            Seconds after the step.
        before : float, optional
            Power before the step, in per cent. If it is above 0, let the board settle at this power first, or use a
            long `rest`.
        rest : float, optional
            Seconds recorded before the step.
        sample_time : float, optional
            Seconds between samples.

        Returns
        -------
        Record

        Raises
        ------
        TypeError, ValueError
            If a power is outside 0 to 100, or a time is not above 0.

        Examples
        --------
        >>> from pidalab.plant.heater import Lab
        >>> print(Lab().step_test(duration=300.0).y.size)
        361
        """
        rest = _check.real("rest", rest, above=0.0)
        t = _times(sample_time, rest + _check.real("duration", duration, above=0.0))
        powers = np.where(t < rest, _power("before", before), _power("after", after))
        u, y = self._run(t, lambda k, measured: float(powers[k]), np.zeros(t.size))
        return Record(t, u, y)

    def closed_loop(
        self,
        controller: DigitalController,
        setpoint: ArrayLike,
        duration: float = 900.0,
        load: ArrayLike = 0.0,
    ) -> Response:
        """Control the temperature with heater 1 and a digital controller.

        Parameters
        ----------
        controller : DigitalController
            Controller that computes a power in per cent from a temperature in °C. It is reset before the run.
        setpoint : float or array_like, shape (n,)
            Set point in degrees Celsius: one value, or a value for each sample.
        duration : float, optional
            Duration in seconds.
        load : float or array_like, shape (n,), optional
            Power of heater 2 in per cent: one value, or a value for each sample.

        Returns
        -------
        Response
            The measured temperature as `y`, and the power of heater 2 as `d`.

        Raises
        ------
        TypeError, ValueError
            If the controller is not digital, or if a signal does not have one value for each sample.

        Examples
        --------
        >>> import pidalab
        >>> from pidalab.plant.heater import Lab
        >>> k = pidalab.PIDA(kp=4.0, ti=150.0).discretise(1.0, limits=(0.0, 100.0))
        >>> bool(Lab().closed_loop(k, 35.0, 600.0).y[-1] > 33.0)
        True
        """
        if not isinstance(controller, DigitalController):
            raise TypeError(
                f"controller must be a DigitalController, found {type(controller).__name__}; "
                "controller.discretise(sample_time, limits=(0, 100)) makes one"
            )
        t = _times(controller.sample_time, _check.real("duration", duration, above=0.0))
        r, d = _check.signal("setpoint", setpoint, t.size), _check.signal("load", load, t.size)
        controller.reset()
        u, y = self._run(t, lambda k, measured: controller.step(float(r[k]), measured), d)
        return Response(t=t, r=r, d=d, n=np.zeros(t.size), y=y, u=u)

    def _run(self, t: Array, heater: Callable[[int, float], float], load: Array) -> tuple[Array, Array]:
        """Read the temperature and set both heaters at each time.

        `heater` computes the power of heater 1 from the index of the sample and the temperature.
        """
        u, y = np.empty(t.size), np.empty(t.size)
        start = self._labtime.time() if self.connected else self._now
        for k, moment in enumerate(t):
            self._wait_until(start + moment)
            y[k] = self._temperature()
            # Q1 clips the power to the range from 0 to 100 %, and returns the clipped power.
            u[k] = self._device.Q1(heater(k, float(y[k])))
            self._device.Q2(float(load[k]))
        # Let the last control signal act for one sample.
        self._wait_until(start + t[-1] + t[1])
        return u, y

    def _wait_until(self, moment: float) -> None:
        if self.connected:
            self._labtime.sleep(max(0.0, moment - self._labtime.time()))
        else:
            self._device.update(moment)
            self._now = moment

    def _temperature(self) -> float:
        """Read thermistor 1. In simulation, the noise comes from the random generator of this lab."""
        others = random.getstate()
        random.setstate(self._random)
        try:
            return float(self._device.T1)
        finally:
            self._random = random.getstate()
            random.setstate(others)


def _power(name: str, power: float) -> float:
    return _check.real(name, power, at_least=0.0, at_most=100.0)


def _times(sample_time: float, duration: float) -> Array:
    h = _check.real("sample_time", sample_time, above=0.0)
    if duration < 2 * h:
        raise ValueError(f"duration must be at least two samples of {h:g} s, found {duration:g}")
    return np.asarray(h * np.arange(round(duration / h) + 1), dtype=float)


def _silent() -> contextlib.redirect_stdout[io.StringIO]:
    return contextlib.redirect_stdout(io.StringIO())
