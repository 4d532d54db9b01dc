"""Convert gains to the parameters of vendors' controller blocks in ideal, series and parallel form."""

from __future__ import annotations

from typing import NamedTuple

from pidalab import _check
from pidalab.forms import FilteredGains, IdealGains

SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0}
Form = dict[str, float] | str


class VendorForms(NamedTuple):
    """Parameters by name for each form, or the reason why a form does not exist. ``print`` shows them.

    Attributes
    ----------
    ideal : dict or str
        Kc (1 + 1/(Ti s) + Td s), the ISA standard form, also called non-interacting.
    series : dict or str
        Kc' (1 + 1/(Ti' s)) (1 + Td' s), the classical form, also called interacting.
    parallel : dict or str
        Kp + Ki/s + Kd s, with independent gains.
    filters : str
        Filters of the controller with time constants in seconds. The forms do not contain filters.
    """

    ideal: Form
    series: Form
    parallel: Form
    filters: str = "none"

    def __str__(self) -> str:
        forms = self._asdict()
        del forms["filters"]
        missing = {name: form for name, form in forms.items() if isinstance(form, str)}
        lines = [
            f"{name + ': ':10}{', '.join(f'{key} = {x:.5g}' for key, x in form.items())}"
            for name, form in forms.items()
            if name not in missing
        ]
        lines.append(f"filters:  {self.filters}")
        if missing:
            lines.append(f"no vendor block for: {', '.join(missing)} ({next(iter(missing.values()))})")
        return "\n".join(lines)


def vendor_forms(gains: IdealGains, parts: tuple[FilteredGains, ...], time_unit: str) -> VendorForms:
    """Return gains as parameters of vendor blocks, with their filters. All given times are in units of `time_unit`."""
    _check.choice("time_unit", time_unit, SECONDS)
    unit = SECONDS[time_unit]
    filters = ", ".join(_filter(part, unit) for part in parts if part.filter_order) or "none"
    ki, kp, kd, ka = gains
    if ka:
        lost = f"these blocks have no acceleration term, and ka = {ka:.5g} would be lost"
        return VendorForms(lost, lost, lost, filters)
    ki, kd = ki / unit, kd * unit
    parallel = {"Kp": kp, "Ki [1/s]": ki, "Ki [1/min]": 60 * ki, "Kd [s]": kd, "Kd [min]": kd / 60}
    if kp == 0:
        reason = "kp is 0, so these blocks cannot have the times Ti = kp/ki and Td = kd/kp"
        return VendorForms(reason, reason, parallel, filters)
    ti, td = gains.standard()[1:3]
    ideal = series = _with_units(kp, ti * unit, td * unit)
    if ki:
        try:
            factors = gains.series()
        except ValueError:
            reason = f"this block needs Ti >= 4 Td, found Ti = {ti:.5g} and Td = {td:.5g}"
            return VendorForms(ideal, reason, parallel, filters)
        series = _with_units(factors.kp, factors.ti * unit, factors.kd / factors.kp * unit)
    return VendorForms(ideal, series, parallel, filters)


def _with_units(gain: float, ti: float, td: float) -> dict[str, float]:
    times = {"Ti [s]": ti, "Ti [min]": ti / 60, "repeats/min": 60 / ti, "Td [s]": td, "Td [min]": td / 60}
    return {"Kc": gain, **times}


def _filter(part: FilteredGains, unit: float) -> str:
    name = "all parts" if part.name == "filtered" else part.name
    order = f" ({part.filter_order} equal lags)" if part.filter_order > 1 else ""
    return f"{name} {part.filter_time * unit:.5g} s{order}"
