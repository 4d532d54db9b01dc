"""What a descent sees: unknowns in units of its start, and functions that give a value, and its slope when asked."""

from __future__ import annotations

from typing import Any

import numpy as np

from pidalab._check import Array

UNITS = (0.1, 1.0)  # least and largest unit of a gain in a descent


class Scaled:
    """Unknowns as a descent sees them: the integral gain by its logarithm, the others in units of where it starts."""

    def __init__(self, start: Array, gains: int) -> None:
        self.unit = np.ones(start.size)
        self.unit[1:gains] = np.clip(start[1:gains], *UNITS)

    def __call__(self, x: Array) -> Array:
        """From unknowns to what the descent sees."""
        z = x / self.unit
        z[0] = np.log(x[0])
        return z

    def back(self, z: Array) -> Array:
        """From what the descent sees to unknowns."""
        x = z * self.unit
        x[0] = np.exp(z[0])
        return x

    def slopes(self, x: Array, by_x: Array) -> Array:
        """From slopes by the unknowns to those by what the descent sees."""
        by_z = by_x * self.unit
        by_z[..., 0] = by_x[..., 0] * x[0]
        return by_z

    def objective(self, function: Any) -> tuple[Any, Any]:
        """Value and slope of a function, as functions of what the descent sees."""
        last = Last(function)

        def slope(z: Array) -> Array:
            x = self.back(z)
            return self.slopes(x, last.slope(x))

        return lambda z: last.value(self.back(z)), slope

    def constraint(self, one: dict[str, Any]) -> dict[str, Any]:
        """What is left to a limit."""

        def slope(z: Array) -> Array:
            x = self.back(z)
            return self.slopes(x, one["jac"](x))

        return {"type": "ineq", "fun": lambda z: one["fun"](self.back(z)), "jac": slope}


class Last:
    """A function that gives a value and a function of its slope, for those who ask for one after the other."""

    def __init__(self, both: Any) -> None:
        self.both, self.place = both, b""

    def _at(self, x: Array) -> tuple[Any, Any]:
        if x.tobytes() != self.place:  # a tenth of the time that arrays take to be compared
            self.place, self.last = x.tobytes(), self.both(x.copy())
        return self.last

    def value(self, x: Array) -> Any:
        """Value at x."""
        return self._at(x)[0]

    def slope(self, x: Array) -> Any:
        """Slope at x."""
        return self._at(x)[1]()
