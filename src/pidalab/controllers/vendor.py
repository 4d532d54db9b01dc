"""Parameters in the forms of makers of controllers: ideal, series and parallel, in seconds, minutes and repeats."""

from __future__ import annotations

import math
from typing import NamedTuple

from pidalab import _check
from pidalab.forms import FilteredGains, IdealGains

SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0}

Form = dict[str, float] | str


class VendorForms(NamedTuple):
    """Parameters by name, or the reason why a form does not exist; ``print`` shows them.

    Attributes
    ----------
    ideal : dict or str
        Kc (1 + 1/(Ti s) + Td s): ISA standard form, non-interacting.
    series : dict or str
        Kc' (1 + 1/(Ti' s)) (1 + Td' s): classical, interacting form.
    parallel : dict or str
        Kp + Ki/s + Kd s: independent gains.
    filters : str
        What the forms leave out: which part is behind which lags, with their time constants in seconds.
    """

    ideal: dict[str, float] | str
    series: dict[str, float] | str
    parallel: dict[str, float] | str
    filters: str = "none"

    def __str__(self) -> str:
        lines = []
        for name, form in self._asdict().items():
            text = (
                form
                if isinstance(form, str)
                else ", ".join(f"{key} = {value:.5g}" for key, value in form.items())
            )
            lines.append(f"{name + ':':10}{text}")
        return "\n".join(lines)


def vendor_forms(gains: IdealGains, parts: tuple[FilteredGains, ...], time_unit: str) -> VendorForms:
    """Return the gains in the forms of vendors, and the filters beside them; `time_unit` is that of the model."""
    _check.choice("time_unit", time_unit, SECONDS)
    unit = SECONDS[time_unit]
    ideal, series, parallel = _forms(gains, unit)
    return VendorForms(ideal, series, parallel, _filters(parts, unit))


def _forms(gains: IdealGains, unit: float) -> tuple[Form, Form, Form]:
    """Return the ideal, the series and the parallel form."""
    ki, kp, kd, ka = gains
    if ka:
        reason = f"no such form: these blocks have no acceleration term, and ka = {ka:.5g} would be lost"
        return reason, reason, reason
    parallel = {"Kp": kp, "Ki [1/s]": ki / unit, "Ki [1/min]": 60 * ki / unit, "Kd [s]": kd * unit}
    parallel["Kd [min]"] = kd * unit / 60
    if kp == 0:
        reason = "no such form: kp is 0, and its times are ratios to kp"
        return reason, reason, parallel
    ti, td = kp / ki if ki else math.inf, kd / kp
    ideal = _with_units(kp, ti * unit, td * unit)
    if not ki:
        return ideal, ideal, parallel
    try:
        series = gains.series()
    except ValueError:
        reason = f"no such form: it needs Ti >= 4 Td, found Ti = {ti:.5g} and Td = {td:.5g}"
        return ideal, reason, parallel
    return ideal, _with_units(series.kp, series.ti * unit, series.kd / series.kp * unit), parallel


def _with_units(gain: float, ti: float, td: float) -> dict[str, float]:
    """Return gain and times in seconds and minutes, and the reset rate."""
    times = {"Ti [s]": ti, "Ti [min]": ti / 60, "repeats/min": 60 / ti, "Td [s]": td, "Td [min]": td / 60}
    return {"Kc": gain, **times}


def _filters(parts: tuple[FilteredGains, ...], unit: float) -> str:
    """Say which part is behind how many lags, and of what time constant."""
    said = []
    for part in parts:
        if part.filter_order:
            name = "all parts" if part.name == "filtered" else part.name
            times = f" ({part.filter_order} equal lags)" if part.filter_order > 1 else ""
            said.append(f"{name} {part.filter_time * unit:.5g} s{times}")
    return ", ".join(said) or "none"
