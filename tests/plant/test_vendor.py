"""Forms of vendors: each is the same controller, in seconds, or says why it does not exist."""

import math

import numpy as np
import pytest

from pidalab import PIDA, HighOrderPID, SeriesPIDA
from pidalab.plant.vendor import firmware_form, firmware_gains


@pytest.mark.parametrize(("unit", "seconds"), [("s", 1.0), ("min", 60.0), ("h", 3600.0)])
def test_forms_are_the_same_controller(unit, seconds):
    own = PIDA(2.0, 8.0, 1.5)
    forms = own.vendor_forms(unit)
    s = 0.3 + 0.2j  # in 1/s; times are in seconds there
    gains = own.gains()
    true = gains.ki / (s * seconds) + gains.kp + gains.kd * s * seconds
    i, x, p = forms.ideal, forms.series, forms.parallel
    assert i["Kc"] * (1 + 1 / (i["Ti [s]"] * s) + i["Td [s]"] * s) == pytest.approx(true)
    assert x["Kc"] * (1 + 1 / (x["Ti [s]"] * s)) * (1 + x["Td [s]"] * s) == pytest.approx(true)
    assert p["Kp"] + p["Ki [1/s]"] / s + p["Kd [s]"] * s == pytest.approx(true)
    assert p["Ki [1/min]"] == pytest.approx(60 * p["Ki [1/s]"])
    assert p["Kd [min]"] == pytest.approx(p["Kd [s]"] / 60)
    for form in (i, x):
        assert form["Ti [min]"] == pytest.approx(form["Ti [s]"] / 60)
        assert form["repeats/min"] == pytest.approx(1 / form["Ti [min]"])


def test_missing_forms():
    assert "needs Ti >= 4 Td, found Ti = 3 and Td = 1" in PIDA(1.0, 3.0, 1.0).vendor_forms().series
    for form in SeriesPIDA(1.0, 0.5, 0.2, 2.0, 0.1, 2).vendor_forms()[:3]:
        assert "no acceleration term, and ka = 0.2" in form
    pure = HighOrderPID([1.0, 0.0], 0.0, 0).vendor_forms()
    assert "kp is 0" in pure.ideal
    assert pure.parallel["Ki [1/s]"] == 1.0
    pd = PIDA(1.0, math.inf, 2.0).vendor_forms()
    assert pd.ideal == pd.series
    assert pd.ideal["repeats/min"] == 0.0
    said = str(PIDA(1.0, 3.0, 1.0).vendor_forms())
    assert "series:" not in said
    assert said.endswith("no vendor block for: series (this block needs Ti >= 4 Td, found Ti = 3 and Td = 1)")
    lines = str(PIDA(1.0, 3.0, 0.5, 0.1).vendor_forms("s", full_output=1.0)).splitlines()
    assert [line.split(":")[0] for line in lines] == ["filters", "no vendor block for"]
    with pytest.raises(ValueError, match=r"time_unit must be 's', 'min' or 'h', found 'ms'"):
        PIDA(1.0, 2.0).vendor_forms("ms")


def klipper(t, y, target, p, i, d, smooth_time=1.0):
    """u of the loop of klippy/extras/heaters.py, written anew: integral and derivative by differences."""
    kp, ki, kd = p / 255, i / 255, d / 255
    step, integral, slope, u = t[1] - t[0], 0.0, 0.0, []
    for k, now in enumerate(y):
        before = y[k - 1] if k else now
        integral += step * (target - now)
        slope += (-(now - before) / step - slope) * step / (smooth_time + step)
        u.append(kp * (target - now) + ki * integral + kd * slope)
    return np.array(u)


def test_klipper_runs_the_controller_that_is_read_from_its_numbers():
    """Temperatures that rise as 20 (1 - exp(-t/30)), by the firmware's differences and in closed form."""
    t = np.arange(0.0, 60.0, 0.01)
    y = 20 * (1 - np.exp(-t / 30))
    running = PIDA.from_firmware("klipper", 22.2, 1.08, 114.0)
    lag, slope = running.td / running.n, 20 / 30 * np.exp(-t / 30)
    behind = 20 / 30 * (np.exp(-t / 30) - np.exp(-t / lag)) / (1 - lag / 30)
    integral = 5 * t + 20 * 30 * (1 - np.exp(-t / 30))  # of 25 - y
    error = 25 - y
    expected = running.kp * (error + integral / running.ti - running.td * behind)
    assert lag == 1.0
    assert slope[0] > behind[0] == 0.0
    assert klipper(t, y, 25.0, 22.2, 1.08, 114.0) == pytest.approx(expected, abs=2e-3)


def test_betaflight_has_a_factor_for_each_number():
    """As they come, roll has 45, 80 and 40; the sum over 1000 is the share of full thrust."""
    gains, lag = firmware_gains("betaflight", 45, 80, 40)
    assert gains == pytest.approx((80 * 0.244381e-3, 45 * 0.032029e-3, 40 * 0.000529e-3, 0))
    assert lag == pytest.approx(1 / (2 * math.pi * 75))
    assert firmware_gains("betaflight-yaw", 45, 80, 40)[0].ki == pytest.approx(2.5 * gains.ki)


@pytest.mark.parametrize("firmware", ["klipper", "betaflight", "betaflight-yaw"])
@pytest.mark.parametrize(("unit", "full"), [("s", 1.0), ("min", 100.0), ("h", -2.0)])
def test_firmware_round_trip(firmware, unit, full):
    own = PIDA(0.08, 20.0, 5.0)
    numbers = firmware_form(own.gains(), firmware, full, unit)
    gains, _ = firmware_gains(firmware, *numbers.values(), full, unit)
    assert gains == pytest.approx(own.gains())
    # a share of full power and seconds: the same numbers whatever the units
    seconds = {"s": 1.0, "min": 60.0, "h": 3600.0}[unit]
    same = PIDA(0.08 / full, 20.0 * seconds, 5.0 * seconds)
    assert firmware_form(same.gains(), firmware) == pytest.approx(numbers)


def test_firmware_in_vendor_forms():
    forms = PIDA(8.0, 20.0, 5.0).vendor_forms("s", full_output=100.0)
    assert forms.klipper == pytest.approx({"pid_Kp": 20.4, "pid_Ki": 1.02, "pid_Kd": 102.0})
    assert forms.betaflight["I"] == pytest.approx(2.5 * forms.betaflight["I of yaw"])
    assert "betaflight: P = " in str(forms)
    assert "klipper" not in str(PIDA(8.0, 20.0, 5.0).vendor_forms("s"))
    assert "would be lost" in PIDA(1.0, 2.0, 0.5, 0.1).vendor_forms("s", 1.0).klipper
    assert PIDA.from_firmware("klipper", 10, 1) == PIDA(10 / 255, 10.0)
    assert PIDA.from_firmware("klipper", 10, 1, 20, lag=0.5).n == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: PIDA.from_firmware("marlin", 1, 1),
            "firmware must be 'klipper', 'betaflight' or 'betaflight-yaw'",
        ),
        (lambda: PIDA.from_firmware("klipper", 1, 1, full_output=0), "full_output must not be 0"),
        (lambda: PIDA.from_firmware("klipper", 1, 1, time_unit="ms"), "time_unit must be"),
        (lambda: PIDA.from_firmware("klipper", 0, 1), "kp is 0"),
        (lambda: firmware_form(PIDA(1.0, 2.0, 0.5, 0.1).gains(), "klipper"), "ka = 0.1 would be lost"),
    ],
)
def test_firmware_refuses(call, message):
    with pytest.raises(ValueError, match=message):
        call()
