"""Convert controllers to forms of vendors: the controller is the same, or an error says why there is none."""

import math

import pytest

from pidalab import PIDA, HighOrderPID, SeriesPIDA


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
    lines = str(PIDA(1.0, 3.0, 0.5, 0.1).vendor_forms("s")).splitlines()
    assert [line.split(":")[0] for line in lines] == ["filters", "no vendor block for"]
    with pytest.raises(ValueError, match=r"time_unit must be 's', 'min' or 'h', found 'ms'"):
        PIDA(1.0, 2.0).vendor_forms("ms")
