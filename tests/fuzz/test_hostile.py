"""Replace one argument of a public call by a hostile value: an answer, or an error that explains why.

Allowed errors are TypeError, ValueError, and the ArithmeticError of a method that does not apply, with messages of this
library. A test fails with any other exception, NaN, or any warning except that of a doubtful record.
"""

import re
from functools import partial

import drawn
import numpy as np
import pytest
from hypothesis import given, strategies as st

import pidalab
from pidalab import (
    PIDA,
    HighOrderPID,
    Loop,
    NonInteractivePIDA,
    SeriesPIDA,
    areas,
    digital,
    identification,
    reduction,
    robustness,
)
from pidalab.rules import automatic_reset, classical, haalman, itae, magnitude_optimum, mrdp

PLANT = pidalab.lags(3, delay=1.0)
MODEL = pidalab.sopdt(1.0, 1.0, 1.0, 0.5)
LINEAR = Loop(PLANT, PIDA(1.0, 3.0, 1.0, 0.3, n=5, m=5))
TIMES = np.linspace(0, 40, 401)
FILTER = pidalab.lags(1, 0.4).rational_part()
RISE = np.interp(TIMES, [0, 5, 20, 40], [0, 0, 2, 2])
RAMP = np.maximum(TIMES - 2, 0)

CALLS = {
    "Process": partial(pidalab.Process, num=[1.0], den=[1.0, 1.0], delay=1.0),
    "fopdt": partial(pidalab.fopdt, gain=1.0, lag=1.0, delay=1.0),
    "lags": partial(pidalab.lags, order=3, lag=1.0, gain=1.0, delay=1.0),
    "PIDA": partial(PIDA, kp=1.0, ti=3.0, td=1.0, ta=0.3, n=10, m=10),
    "HighOrderPID": partial(HighOrderPID, gains=[0.3, 1.0, 1.0], filter_time=0.1, filter_order=2),
    "NonInteractivePIDA": partial(
        NonInteractivePIDA, kc=1.0, tau_i=3.0, tau_d=1.0, tau_a=0.5, alpha_d=0.05, alpha_a=0.025
    ),
    "SeriesPIDA": partial(SeriesPIDA, kp=1.0, kd=0.5, ka=0.1, ti=3.0, filter_time=0.1, filter_order=2),
    "Loop": partial(Loop, process=PLANT, controller=PIDA(1.0, 3.0)),
    "margins": partial(pidalab.margins, loop=LINEAR),
    "rightmost_poles": partial(pidalab.rightmost_poles, loop=LINEAR, count=2),
    "load_response": partial(pidalab.load_response, loop=LINEAR, t=TIMES),
    "simulate": partial(pidalab.simulate, loop=LINEAR, t=TIMES, setpoint=1.0, load=0.0, noise=0.0),
    "simulate_sampled": partial(
        pidalab.simulate_sampled, loop=LINEAR, t=0.01 * np.arange(401), setpoint=1.0, load=0.0, noise=0.0
    ),
    "open_loop_step": partial(pidalab.open_loop_step, process=PLANT, t=TIMES),
    "noise_gain": partial(pidalab.noise_gain, loop=LINEAR, sample_time=0.01),
    "uniform_noise": partial(pidalab.uniform_noise, t=TIMES, amplitude=0.1, seed=1),
    "Record": partial(pidalab.Record, t=TIMES, u=(TIMES >= 3) * 1.0, y=RISE),
    "Response": partial(pidalab.Response, t=TIMES, r=1.0, d=0.0, n=0.0, y=RISE, u=RISE),
    "areas.from_process": partial(areas.from_process, process=PLANT, count=4),
    "areas.from_record": partial(areas.from_record, t=TIMES, u=(TIMES >= 3) * 1.0, y=RISE, count=2),
    "three_point": partial(identification.three_point, t=TIMES, y=RISE, step=1.0),
    "ipdt_tangent": partial(identification.ipdt_tangent, t=TIMES, y=RAMP, step=1.0),
    "to_fopdt": partial(reduction.to_fopdt, process=PLANT),
    "ultimate_frequency": partial(reduction.ultimate_frequency, process=PLANT),
    "circle": partial(robustness.circle, loop=LINEAR),
    "haalman": partial(haalman.tune, model=PLANT, ms=1.4, kind="PIDA", n=10, m=10),
    "simc": partial(classical.simc, model=MODEL, kind="PID", closed_loop_time=1.0, n=10),
    "itae": partial(itae.tune, model=MODEL, test="load", kind="PIDA", alpha_d=0.05, alpha_a=0.025),
    "magnitude_optimum": partial(magnitude_optimum.tune, model=PLANT, m=1, n=2, filter_time=0.1),
    "mrdp": partial(mrdp.tune, model=pidalab.ipdt(1.0, 1.0), m=2, n=3, te=0.3),
    "automatic_reset": partial(
        automatic_reset.tune,
        model=pidalab.ipdt(1.0, 1.0),
        setting=automatic_reset.multiple_pole(2),
        n=3,
        filter_time=0.3,
    ),
    "discretise": partial(
        digital.discretise,
        parts=PIDA(1.0, 3.0, 1.0, 0.3).parts(),
        sample_time=0.1,
        method="backward",
        **{"b": 0.5, "c": 0.0, "limits": (-9.0, 9.0), "rate_limit": 9.0, "deadband": 0.1, "bias": 1.0},
        **{"y_offset": 2.0},
        **{
            "anti_windup": "back-calculation",
            "tracking_time": 2.0,
            "prefilter": FILTER,
            "output_filter": FILTER,
        },
    ),
    "DigitalController.step": partial(
        PIDA(1.0, 3.0, 1.0, 0.3).discretise(0.1).step, r=1.0, y=0.0, manual=1.0, track=2.0
    ),
    "from_json": partial(digital.from_json, text=PIDA(1.0, 3.0).discretise(0.1).json()),
    "tune": partial(
        pidalab.tune,
        model=PLANT,
        kind="PI",
        ms=1.6,
        noise_gain=4.0,
        sample_time=0.1,
        rule="simc",
        spread=0.1,
        output_filter=FILTER,
    ),
    "report": partial(pidalab.report, model=PLANT, ms=1.6, sample_time=0.1, rule="simc", kinds=("PI",)),
    "portrait": partial(
        pidalab.portrait,
        loop=Loop(pidalab.ipdt(1.0, 1.0), SeriesPIDA(0.5, 0.2, 0.02, 9.0, 0.2, 3)),
        parameters={"kp": [0.4, 0.5]},
        t=0.1 * np.arange(401),
        setpoint=1.0,
        load=0.0,
        noise=0.0,
        limits=(-9.0, 9.0),
        prefilter=([1.0], [1.0, 1.0]),
    ),
    "vendor_forms": partial(PIDA(1.0, 3.0, 1.0).vendor_forms, time_unit="s"),
}
FROM_BELOW = re.compile(
    "^$|truth value|unhashable|too large to convert|out of range|not supported between|unsupported"
)
HOSTILE = (
    *(np.nan, np.inf, -np.inf, 0, -1.0, -3, 2.5, 40, 1e-9, 1e9),
    *(1 + 2j, True, None, "text", "", b"x", {}, object()),
    *([], [np.nan], [0.0, 0.0], [1.0, -1.0], [[1.0, 2.0]], np.zeros(401), np.arange(401)[::-1]),
    *(PLANT, LINEAR, PIDA(1.0, 3.0)),
)


@pytest.mark.filterwarnings("ignore::pidalab.areas.RecordWarning")
@drawn.cases(100)
@given(st.sampled_from(sorted(CALLS)), st.data())
def test_hostile_arguments_are_answered_or_explained(name, data):
    call = CALLS[name]
    argument = data.draw(st.sampled_from(sorted(call.keywords)), label="argument")
    value = HOSTILE[data.draw(st.integers(0, len(HOSTILE) - 1), label="value")]
    try:
        answer = call(**{argument: value})
    except (TypeError, ValueError, ArithmeticError) as error:
        said, kind = str(error), type(error)
    else:
        said, kind = "", None
    if kind is not None:
        assert kind in (TypeError, ValueError, ArithmeticError), (
            f"{argument} = {value!r}: {kind.__name__}: {said}"
        )
        assert not FROM_BELOW.search(said), f"{argument} = {value!r}: {said}"
        return
    for number in numbers(answer):
        assert not np.isnan(number).any(), f"{argument} = {value!r} gives {answer!r}"


def numbers(answer):
    """Yield the numbers of an answer, one level deep, without margins (which are NaN for an unstable loop)."""
    if isinstance(answer, pidalab.Margins):
        return
    inside = vars(answer).values() if hasattr(answer, "__dict__") else [answer]
    for value in inside:
        if isinstance(value, (float, np.ndarray)):
            yield np.asarray(value)
