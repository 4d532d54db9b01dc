"""Sets of a portrait that are digital controllers: each runs as it is, one after the other, in compiled code."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from pidalab._check import Array
from pidalab.digital import DigitalController
from pidalab.loop import Loop
from pidalab.response import Response
from pidalab.simulation.kernels import filtered, run_digital
from pidalab.simulation.lanes import MEASURES
from pidalab.simulation.steps import Actuator, Steps
from pidalab.statespace import discretise


class DigitalBank(NamedTuple):
    """Digital controllers, an array of objects of the shape of the grid, and the prefilter that all share."""

    shape: tuple[int, ...]
    controllers: Any
    num: Array  # of the prefilter
    den: Array

    @staticmethod
    def of(loop: Loop, parameters: Mapping[str, Any], prefilter: Any) -> DigitalBank:
        """Collect the controllers; complain about what else differs."""
        if prefilter is not None:
            raise ValueError(
                "prefilter must be that of the loop with digital controllers, found one beside it"
            )
        if loop.output_filter is not None:
            raise TypeError(f"loop must have no output filter, found {loop!r}")
        if not hasattr(parameters, "keys") or not hasattr(parameters, "__getitem__"):
            raise TypeError(f"parameters must be a mapping, found {type(parameters).__name__}")
        given = dict(parameters)
        controllers = np.empty((), dtype=object)
        controllers[()] = loop.controller
        for name, value in given.items():
            if name != "controller":
                raise ValueError(
                    "parameters must be 'controller', an array of digital ones, for a loop with a digital controller, "
                    f"found {name!r}"
                )
            controllers = np.array(value, dtype=object)
        if not controllers.size:
            raise ValueError(
                f"parameters must hold at least one set, found a grid of shape {controllers.shape}"
            )
        for i, k in enumerate(controllers.flat):
            if not isinstance(k, DigitalController):
                raise TypeError(
                    f"parameters['controller'] must be digital controllers, found {type(k).__name__} at index {i} in "
                    "flat order; discretise them, as in controller.discretise(sample_time)"
                )
        return DigitalBank(controllers.shape, controllers, *loop.blocks["prefilter"])

    def require_valid(self, h: float) -> None:
        """Raise for a controller that has another sample time than the step of t."""
        for i, k in enumerate(self.controllers.flat):
            if abs(h - k.sample_time) > 1e-6 * k.sample_time:
                raise ValueError(
                    f"t must have the sample time of the digital controllers, {k.sample_time:.6g} at index {i} in flat "
                    f"order, as its step, found {h:.6g}"
                )

    def static_gain(self) -> Array:
        """Return the static gain of the prefilter."""
        return np.asarray(self.num[-1] / self.den[-1])

    def limits(self, low: float, high: float) -> tuple[Array, Array]:
        """Return the limits of each set, from rest and in units of the model: those given, and its own."""
        bounds = [[(limit - k.bias) / k.u_span for limit in k.limits] for k in self.controllers.flat]
        own = np.array(bounds).reshape(*self.shape, 2)
        return np.maximum(own[..., 0], low), np.minimum(own[..., 1], high)

    def part(self, part: slice) -> DigitalBank:
        """Return some of the sets, in flat order."""
        return self._replace(shape=(part.stop - part.start,), controllers=self.controllers.flat[part])

    def measures(
        self, plant: Steps, limits: tuple[float, float], h: float, r: Array, d: Array, n: Array
    ) -> Array:
        """Run the sets, one-dimensional here, and measure them: shape (measures, sets)."""
        reference = filtered(discretise(self.num, self.den, h), r)
        actuator, t = Actuator(*limits, 0.0, 0), h * np.arange(r.size, dtype=float)
        raw = np.full((len(MEASURES), self.shape[0]), np.inf)
        for i, k in enumerate(self.controllers):
            low, high = (k.bias + k.u_span * limit for limit in limits)
            k = replace(k, limits=(max(low, k.limits[0]), min(high, k.limits[1])))
            units = (k.y_span, k.u_span)
            y, u, area = run_digital(k.numbers, k.at_rest(), units, plant, actuator, 0.0, reference, d, n)
            if np.isfinite([y, u, area]).all():
                with np.errstate(over="ignore"):  # the square of what is beyond 1e154 is infinite
                    raw[:, i] = _measured(Response._of_checked(t=t, r=r, d=d, n=n, y=y, u=u, area=area))
        return raw


def _measured(x: Response) -> list[float]:
    """Return the measures of a record, in the order of `MEASURES`."""
    extremes = [float(f(signal, initial=0.0)) for signal in (x.y, x.u) for f in (np.min, np.max)]
    return [x.ie(), x.iae(), x.ise(), x.itae(), x.tv("y"), x.tv("u"), *extremes, x.y[-1], x.u[-1]]
