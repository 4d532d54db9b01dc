"""The `Design`, which every rule returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from pidalab.controllers import Controller
from pidalab.controllers.base import six_digits
from pidalab.loop import Loop
from pidalab.process import Process, rational
from pidalab.robustness.margins import ms_or_infinite

if TYPE_CHECKING:
    from pidalab.digital import DigitalController
    from pidalab.plant.vendor import VendorForms


@dataclass(frozen=True, eq=False)
class Design:
    """A controller with its filters, its model and its source.

    Each entry of `info` is also an attribute, such as ``design.iae``. ``design.ms`` is the maximum sensitivity of the
    loop with the model, infinite if the loop is unstable. ``design.ms_asked`` is the Ms that was given to the rule, if
    any.

    Parameters
    ----------
    model : Process, MeasuredAreas or ndarray
        Model that was given to the rule. Only the magnitude optimum accepts areas.
    controller : controller
        Controller from the control error to the control signal, with its own filters.
    prefilter : control.TransferFunction, optional
        Filter of the set point, or None.
    output_filter : OutputFilter or control.TransferFunction, optional
        Filter of the control signal inside the loop, or None.
    source : str
        Paper and equations of the rule.
    info : mapping, optional
        Further results of the rule, such as a predicted IAE, by name.
    sources : mapping, optional
        Source of each entry of `info`, by the same name.

    Examples
    --------
    >>> import pidalab
    >>> design = pidalab.rules.haalman.tune(pidalab.lags(3, delay=1.0), ms=1.6)
    >>> print(f"{design.controller.kp:.3f} {design.ms_asked} {design.ms:.2f} {pidalab.is_stable(design.loop())}")
    1.299 1.6 1.76 True
    """

    model: Any
    controller: Controller
    prefilter: Any = None
    output_filter: Any = None
    source: str = ""
    info: Mapping[str, Any] = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("info", "sources"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    def __getattr__(self, name: str) -> Any:
        """Read an entry of `info`."""
        if name.startswith("_") or name == "info":
            raise AttributeError(f"this design has no {name!r}")
        if name in self.info:
            return self.info[name]
        if name == "ms" and isinstance(self.model, Process):
            return self._ms
        known = ", ".join(self.info) or "nothing"
        raise AttributeError(f"this design has no {name!r}; its info has {known}")

    @cached_property
    def _ms(self) -> float:
        """Maximum sensitivity of the loop with the model, computed on first use."""
        return ms_or_infinite(self.loop())

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.info]

    def __reduce__(self) -> tuple[Any, ...]:
        blocks = (self.model, self.controller, self.prefilter, self.output_filter)
        return Design, (*blocks, self.source, dict(self.info), dict(self.sources))

    def loop(self, process: Process | None = None) -> Loop:
        """Close the loop around a process, with all filters of the design.

        Parameters
        ----------
        process : Process, optional
            The process to control. By default the model.

        Returns
        -------
        Loop

        Raises
        ------
        TypeError
            If no process is given and the design was made from areas.

        Examples
        --------
        >>> import pidalab
        >>> design = pidalab.rules.mrdp.tune(pidalab.ipdt(1.0, delay=1.0), m=1, n=2, te=0.2)
        >>> pidalab.is_stable(design.loop())
        True
        """
        if process is None and not isinstance(self.model, Process):
            raise TypeError("process must be given: this design was made from areas")
        plant = self.model if process is None else process
        return Loop(plant, self.controller, self.output_filter, self.prefilter)

    def discretise(self, sample_time: float, method: str = "backward", **options: Any) -> DigitalController:
        """Return the digital controller for a sample time, including output filter and prefilter.

        If the output filter is a model of the sensor (as in `pidalab.tune`), the digital controller must not contain
        this filter. In this case use ``design.controller.discretise``.

        Parameters
        ----------
        sample_time : float
            Time between samples, above 0.
        method : {"backward", "tustin", "zoh"}, optional
            As in `pidalab.digital.discretise`.
        **options : optional
            As in `pidalab.digital.discretise`.

        Returns
        -------
        DigitalController

        Raises
        ------
        TypeError, ValueError
            As for ``controller.discretise``.

        Examples
        --------
        >>> import numpy as np, pidalab
        >>> design = pidalab.rules.haalman.tune(pidalab.lags(3, lag=20.0, delay=10.0), ms=1.6)
        >>> digital = design.discretise(0.5)
        >>> z = np.exp(0.5j * 0.1)  # ω = 0.1
        >>> smooth = design.loop().block("output_filter", (1 - 1 / z) / 0.5)
        >>> bool(np.isclose(digital(z), design.controller((1 - 1 / z) / 0.5) * smooth))
        True
        """
        options = {"prefilter": self.prefilter} | options
        return self.controller.discretise(sample_time, method, self.output_filter, **options)

    def vendor_forms(self, time_unit: str = "s") -> VendorForms:
        """Convert the controller to parameters of vendor blocks, and list all filters of the design.

        Parameters
        ----------
        time_unit : {"s", "min", "h"}, optional
            Unit of the model's time.

        Returns
        -------
        VendorForms
            As for ``controller.vendor_forms``.

        Raises
        ------
        ValueError
            If the unit is unknown.

        Examples
        --------
        >>> import pidalab
        >>> design = pidalab.rules.haalman.tune(pidalab.fopdt(1.0, lag=60.0, delay=20.0), ms=1.6, kind="PI")
        >>> print(design.vendor_forms("s"))
        ideal:    Kc = 1.5171, Ti [s] = 60, Ti [min] = 1, repeats/min = 1, Td [s] = 0, Td [min] = 0
        series:   Kc = 1.5171, Ti [s] = 60, Ti [min] = 1, repeats/min = 1, Td [s] = 0, Td [min] = 0
        parallel: Kp = 1.5171, Ki [1/s] = 0.025284, Ki [1/min] = 1.5171, Kd [s] = 0, Kd [min] = 0
        filters:  none; output filter OutputFilter(time=1.97752, order=1, wgc=0.0252842) in units of the model
        """
        forms = self.controller.vendor_forms(time_unit)
        filters = {"output filter": self.output_filter, "prefilter": self.prefilter}
        beside = [
            f"; {name} {_block(x)} in units of the model" for name, x in filters.items() if x is not None
        ]
        return forms._replace(filters=forms.filters + "".join(beside))

    def __repr__(self) -> str:
        return f"Design({self.model!r}, {self.controller!r}, source={self.source!r})"

    def __str__(self) -> str:
        blocks = {name: getattr(self, name) for name in ("model", "controller", "prefilter", "output_filter")}
        lines = [f"Design by {self.source}"]
        lines += [f"  {name:14} {_block(value)}" for name, value in blocks.items() if value is not None]
        for name, value in self.info.items():
            lines.append(f"  {name:14} {_value(value):24} {self.sources.get(name, '')}".rstrip())
        return "\n".join(lines)


def _block(block: Any) -> str:
    """Write a block on one line, with numbers of six digits. Transfer functions become lists of coefficients."""
    if isinstance(block, Process) or hasattr(block, "fraction") or not hasattr(block, "num"):
        return six_digits(repr(block))
    num, den = (", ".join(f"{c:.6g}" for c in part) for part in rational("block", block))
    return f"[{num}] / [{den}]"


def _value(value: Any) -> str:
    """Write a value of `info`, with numbers of six digits."""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, tuple) and all(isinstance(x, float) for x in value):
        return ", ".join(f"{x:.6g}" for x in value) or "none"
    return str(value)
