"""Plants that are not linear: one that is faster upwards than downwards."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pidalab import _check
from pidalab.process import Process, rational


@dataclass(frozen=True)
class AsymmetricPlant:
    r"""A plant whose store fills at another speed than it empties.

    .. math:: T(w, x)\,\dot x = w - x, \quad T = T_{rise} \text{ where } w > x, \text{ otherwise } T_{fall};
              \qquad y = G(s)\,x + D(s)\,w; \qquad w(t) = v(t - L)

    with v the input of the process. At rest x = w, so that the static gain is one and the same; and a shift of all
    signals to another state of rest changes nothing.

    Parameters
    ----------
    main : control.TransferFunction
        G, from the store to the output; proper.
    rise, fall : float
        Time constants of the store, above 0.
    direct : control.TransferFunction or float, optional
        D, the path past the store; proper.
    delay : float, optional
        Dead time L, not negative.

    Raises
    ------
    TypeError, ValueError
        For paths that are not proper, time constants that are not positive, a negative dead time.

    Examples
    --------
    >>> import control, pidalab
    >>> plant = pidalab.AsymmetricPlant(control.tf([2.0], [5.0, 1.0]), rise=1.0, fall=3.0)
    >>> plant.rising, plant.falling
    (Process(num=[2], den=[5, 6, 1], delay=0), Process(num=[2], den=[15, 8, 1], delay=0))
    """

    main: Any
    rise: float
    fall: float
    direct: Any = 0.0
    delay: float = 0.0

    def __post_init__(self) -> None:
        for name in ("main", "direct"):
            rational(name, getattr(self, name))
        for name in ("rise", "fall"):
            object.__setattr__(self, name, _check.real(name, getattr(self, name), above=0.0))
        object.__setattr__(self, "delay", _check.real("delay", self.delay, at_least=0.0))

    @property
    def rising(self) -> Process:
        """The linear process that the plant is while its store fills."""
        return self._linear(self.rise)

    @property
    def falling(self) -> Process:
        """The linear process that the plant is while its store empties."""
        return self._linear(self.fall)

    def _linear(self, time: float) -> Process:
        (main, under), (past, below) = rational("main", self.main), rational("direct", self.direct)
        under = np.convolve(under, [time, 1.0])
        extra, rest = np.polydiv(under, below) if under.size >= below.size else (np.ones(1), under)
        # one denominator divides the other: no need for both
        if np.max(np.abs(rest)) < 1e-12 * np.max(np.abs(under)):
            return Process(np.polyadd(main, np.convolve(past, extra)), under, self.delay)
        num = np.polyadd(np.convolve(main, below), np.convolve(past, under))
        return Process(num, np.convolve(under, below), self.delay)
