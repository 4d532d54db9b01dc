"""Controller parameters for vendor blocks (ideal, series, parallel form) and for two firmwares.

Klipper, the firmware of 3D printers, divides its three parameters by 255 (klippy/extras/heaters.py). Its u is a
fraction of full power, y is in °C, and the derivative has a filter of `smooth_time`. Betaflight, the firmware of
drones, has a factor for each parameter (src/main/flight/pid.h), another factor for the I of the yaw axis, and divides
the sum by 1000 (mixer.c). Its u is a fraction of full thrust, y is in degrees per second. Both measure time in
seconds.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from pidalab import _check
from pidalab.forms import FilteredGains, IdealGains

SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0}

Form = dict[str, float] | str


class Firmware(NamedTuple):
    """Parameters for gains of 1, with u from 0 to 1 and time in seconds, and the derivative filter time in seconds."""

    p: float
    i: float
    d: float
    lag: float
    names: tuple[str, str, str]


FLIGHT = 1000 / 0.032029, 1000 / 0.244381, 1000 / 0.000529  # PTERM_SCALE, ITERM_SCALE and DTERM_SCALE
FLIGHT_LAG = 1 / (2 * math.pi * 75)  # first derivative filter at its default of 75 Hz
FIRMWARE = {
    "klipper": Firmware(255.0, 255.0, 255.0, 1.0, ("pid_Kp", "pid_Ki", "pid_Kd")),
    "betaflight": Firmware(*FLIGHT, FLIGHT_LAG, ("P", "I", "D")),
    "betaflight-yaw": Firmware(FLIGHT[0], FLIGHT[1] / 2.5, FLIGHT[2], FLIGHT_LAG, ("P", "I", "D")),
}


class VendorForms(NamedTuple):
    """Parameters by name, or the reason why a form does not exist. ``print`` lists the forms that exist.

    Attributes
    ----------
    ideal : dict or str
        Kc (1 + 1/(Ti s) + Td s): ISA standard form, non-interacting.
    series : dict or str
        Kc' (1 + 1/(Ti' s)) (1 + Td' s): classical, interacting form.
    parallel : dict or str
        Kp + Ki/s + Kd s: independent gains.
    filters : str
        Filters of the controller, which the forms do not contain, with time constants in seconds.
    klipper, betaflight : dict or str
        The parameters of that firmware; empty if `full_output` was not given.
    """

    ideal: Form
    series: Form
    parallel: Form
    filters: str = "none"
    klipper: Form = ""
    betaflight: Form = ""

    def __str__(self) -> str:
        """List the forms that exist, and in one line those that do not."""
        lines, missing = [], {}
        for name, form in self._asdict().items():
            if isinstance(form, dict):
                lines.append(f"{name + ': ':10}{', '.join(f'{key} = {x:.5g}' for key, x in form.items())}")
            elif form and name != "filters":
                missing[name] = form
        lines.append(f"filters:  {self.filters}")
        if missing:
            lines.append(f"no vendor block for: {', '.join(missing)} ({next(iter(missing.values()))})")
        return "\n".join(lines)


def vendor_forms(
    gains: IdealGains, parts: tuple[FilteredGains, ...], time_unit: str, full_output: float | None
) -> VendorForms:
    """Return the gains as parameters of vendor blocks, with the filters; `time_unit` is that of the model."""
    _check.choice("time_unit", time_unit, SECONDS)
    unit = SECONDS[time_unit]
    filters = ", ".join(_filter(part, unit) for part in parts if part.filter_order) or "none"
    if gains.ka:
        lost = f"these blocks have no acceleration term, and ka = {gains.ka:.5g} would be lost"
        return VendorForms(lost, lost, lost, filters, *[lost] * (0 if full_output is None else 2))
    forms = VendorForms(*_forms(gains, unit), filters)
    if full_output is None:
        return forms
    flight = firmware_form(gains, "betaflight", full_output, time_unit)
    flight["I of yaw"] = firmware_form(gains, "betaflight-yaw", full_output, time_unit)["I"]
    return forms._replace(klipper=firmware_form(gains, "klipper", full_output, time_unit), betaflight=flight)


def firmware_form(
    gains: IdealGains, firmware: str, full_output: float = 1.0, time_unit: str = "s"
) -> dict[str, float]:
    """Return the three parameters of a firmware.

    Parameters
    ----------
    gains : IdealGains
        In units of u per unit of y (°C for Klipper, degrees per second for Betaflight), without acceleration.
    firmware : {"klipper", "betaflight", "betaflight-yaw"}
        The firmware.
    full_output : float, optional
        u at full power, not 0: 1, or 100 if u is in per cent.
    time_unit : {"s", "min", "h"}, optional
        Unit of the model's time.

    Returns
    -------
    dict
        The parameters by the names of the firmware.

    Raises
    ------
    ValueError
        For an unknown firmware or unit, and for gains with acceleration.

    Examples
    --------
    >>> import pidalab
    >>> from pidalab.plant.vendor import firmware_form
    >>> gains = pidalab.PIDA(kp=8.0, ti=20.0, td=5.0).gains()  # u in per cent
    >>> {name: round(number, 4) for name, number in firmware_form(gains, "klipper", 100.0).items()}
    {'pid_Kp': 20.4, 'pid_Ki': 1.02, 'pid_Kd': 102.0}
    """
    scale, unit, full = _firmware(firmware, full_output, time_unit)
    if gains.ka:
        raise ValueError(f"{firmware} has no acceleration term, and ka = {gains.ka:.5g} would be lost")
    numbers = scale.p * gains.kp / full, scale.i * gains.ki / unit / full, scale.d * gains.kd * unit / full
    return dict(zip(scale.names, numbers, strict=True))


def firmware_gains(
    firmware: str, p: float, i: float, d: float = 0.0, full_output: float = 1.0, time_unit: str = "s"
) -> tuple[IdealGains, float]:
    """Return the gains for three parameters of a firmware, and the default time constant of its derivative filter.

    Parameters
    ----------
    firmware, full_output, time_unit : str, float, str
        As for `firmware_form`.
    p, i, d : float
        The parameters.

    Returns
    -------
    gains : IdealGains
        In units of u per unit of y, and in the unit of time.
    lag : float
        In that unit of time.

    Raises
    ------
    ValueError
        For an unknown firmware or unit, and parameters of different signs.

    Examples
    --------
    >>> from pidalab.plant.vendor import firmware_gains
    >>> gains, lag = firmware_gains("klipper", 20.4, 1.02, 102.0, full_output=100.0)
    >>> round(gains.kp, 4), round(gains.ki, 4), round(gains.kd, 4), lag
    (8.0, 0.4, 40.0, 1.0)
    """
    scale, unit, full = _firmware(firmware, full_output, time_unit)
    p, i, d = (_check.real(name, number) for name, number in zip("pid", (p, i, d), strict=True))
    if min(i * p, d * p) < 0:
        raise ValueError(f"p, i and d must have one sign, found {p:g}, {i:g} and {d:g}")
    gains = IdealGains(i * full / scale.i * unit, p * full / scale.p, d * full / scale.d / unit, 0.0)
    return gains, scale.lag / unit


def _firmware(firmware: str, full_output: float, time_unit: str) -> tuple[Firmware, float, float]:
    """Return the firmware, the unit of time in seconds and the output at full power."""
    _check.choice("firmware", firmware, FIRMWARE)
    _check.choice("time_unit", time_unit, SECONDS)
    full = _check.real("full_output", full_output)
    if full == 0:
        raise ValueError("full_output must not be 0: it is u at full power")
    return FIRMWARE[firmware], SECONDS[time_unit], full


def _forms(gains: IdealGains, unit: float) -> tuple[Form, Form, Form]:
    """Return the ideal, the series and the parallel form of gains without acceleration."""
    ki, kp, kd, _ = gains
    parallel = {"Kp": kp, "Ki [1/s]": ki / unit, "Ki [1/min]": 60 * ki / unit}
    parallel |= {"Kd [s]": kd * unit, "Kd [min]": kd * unit / 60}
    if kp == 0:
        reason = "kp is 0, and the times of these blocks are ratios to kp"
        return reason, reason, parallel
    ti, td = kp / ki if ki else math.inf, kd / kp
    ideal = _with_units(kp, ti * unit, td * unit)
    if not ki:
        return ideal, ideal, parallel
    try:
        series = gains.series()
    except ValueError:
        return ideal, f"this block needs Ti >= 4 Td, found Ti = {ti:.5g} and Td = {td:.5g}", parallel
    return ideal, _with_units(series.kp, series.ti * unit, series.kd / series.kp * unit), parallel


def _with_units(gain: float, ti: float, td: float) -> dict[str, float]:
    """Return gain and times in seconds and minutes, and the reset rate."""
    times = {"Ti [s]": ti, "Ti [min]": ti / 60, "repeats/min": 60 / ti, "Td [s]": td, "Td [min]": td / 60}
    return {"Kc": gain, **times}


def _filter(part: FilteredGains, unit: float) -> str:
    """Describe the filter of a part of the controller."""
    name = "all parts" if part.name == "filtered" else part.name
    order = f" ({part.filter_order} equal lags)" if part.filter_order > 1 else ""
    return f"{name} {part.filter_time * unit:.5g} s{order}"
