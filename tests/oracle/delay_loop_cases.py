"""The loops of delay_loops.json: coefficients in descending powers, dead time and times.

The stored doubles *are* the problem: products are multiplied out in double precision here,
and the reference values belong to the resulting coefficients exactly.
"""

import numpy as np


def poly(*factors):
    """Product of polynomials in descending powers."""
    out = np.ones(1)
    for f in factors:
        out = np.polymul(out, f)
    return out


def rational(num, den):
    return {"num": [float(x) for x in num], "den": [float(x) for x in den]}


def pida(kp, ti=None, td=0.0, ta=0.0, n=10.0):
    """kp (1 + 1/(ti s) + td s/(td/n s + 1) + ta s^2/(ta/n s + 1)^2)."""
    d1 = [td / n, 1.0] if td else [1.0]
    d2 = poly([ta / n, 1.0], [ta / n, 1.0]) if ta else np.ones(1)
    num = poly(d1, d2)
    num = np.polyadd(num, poly([td, 0.0], d2))
    num = np.polyadd(num, poly([ta, 0.0, 0.0], d1))
    den = poly(d1, d2)
    if ti:
        num, den = np.polyadd(poly(num, [ti, 0.0]), den), poly(den, [ti, 0.0])
    return rational(kp * num, den)


def ideal_pida(kp, ti, td, ta, *filters):
    """kp (1 + 1/(ti s) + td s + ta s^2) with filters in the denominator."""
    num = [kp * ti * ta, kp * ti * td, kp * ti, kp] if ta else [kp * ti * td, kp * ti, kp]
    return rational(num, poly([ti, 0.0], *filters))


def lag_filter(tf, order=2):
    return rational([1.0], poly(*[[tf, 1.0]] * order))


def multiples(delay, *k):
    """Times k * delay as a float program computes them."""
    return [float(x * delay) for x in k]


def loop(name, note, process, controller, delay, times, output_filter=None, prefilter=None, **kw):
    return {
        "name": name,
        "note": note,
        "process": process,
        "controller": controller,
        "output_filter": output_filter,
        "prefilter": prefilter,
        "delay": delay,
        "times": sorted({float(t) for t in times}),
        **kw,
    }


def cases():
    out = []

    def add(*args, **kw):
        out.append(loop(*args, **kw))

    add(
        "integrator_gain",
        "1/s e^{-s}, gain 0.5: piecewise polynomial",
        rational([1.0], [1.0, 0.0]),
        rational([0.5], [1.0]),
        1.0,
        [0, 0.5, 1, 1.25, 2, 2.5, 3, 3.75, 4, 5, 6.125, 7, 8.5, 10, 12.3, 15, 17.7, 20],
    )

    times = [0.1, 0.25, 0.45, 0.7, 1, 1.6, 2.25, 3.3, 4.1, 5.55, 7, 8.5, 10]
    add(
        "fopdt_pid",
        "1/(s+1) e^{-0.3s}, PID with derivative filter, N = 10",
        rational([1.0], [1.0, 1.0]),
        pida(1.8, 1.1, 0.12),
        0.3,
        [0, *times, *multiples(0.3, 1, 2, 3, 4, 7, 10, 20, 33)],
    )

    third = rational([1.0], [0.905, 3.159, 3.37, 1.0])
    controller = pida(1.31, 3.37, 0.938, 0.269)
    add(
        "third_order_pida",
        "third-order plant, dead time 0.826, PIDA, filter 1/(0.13s+1)^2",
        third,
        controller,
        0.826,
        [0, 0.05, 0.4, 1.3, 2, 3, 4.7, 6, 8.1, 11, 14.3, *multiples(0.826, 1, 2, 3, 4, 5, 7, 10, 15, 20)],
        output_filter=lag_filter(0.13),
    )
    add(
        "zero_delay_pida",
        "1/(s+1)^4 without dead time, same PIDA and filter",
        rational([1.0], [1.0, 4.0, 6.0, 4.0, 1.0]),
        controller,
        0.0,
        [0, 0.01, 0.05, 0.1, 0.3, 0.6, 1, 1.5, 2, 3, 4, 5, 6.5, 8, 10, 13, 16, 20, 25, 30],
        output_filter=lag_filter(0.13),
    )

    fopdt = rational([1.0], [1.0, 1.0])
    times = [0, 1e-6, 1e-5, 3e-5, 1e-4, 1e-3, 0.01, 0.1, 0.25, 0.5, 0.5 + 2e-5, 0.5 + 1e-3, 0.75]
    times += [1, 1 + 1e-5, 1.2, 1.5, 2, 2.5 + 1e-4, 3.3, 4, 5, 6.4, 8, 10]
    add(
        "stiff_pid_filter",
        "1/(s+1) e^{-0.5s}, PID with N = 10, output filter 1/(1e-5s+1)^2",
        fopdt,
        pida(1.2, 1.1, 0.15),
        0.5,
        times,
        output_filter=lag_filter(1e-5),
    )
    add(
        "stiff_ideal_pid",
        "same plant, ideal PID over (1e-5s+1)^2 in one block: u spikes",
        fopdt,
        ideal_pida(1.2, 1.1, 0.15, 0.0, [1e-5, 1.0], [1e-5, 1.0]),
        0.5,
        times,
    )
    add(
        "stiff_pida",
        "third-order plant, dead time 0.5, PIDA with N = M = 1e5, filter 1/(1e-5s+1)^2: five fast poles",
        third,
        pida(1.31, 3.37, 0.938, 0.269, n=1e5),
        0.5,
        times,
        output_filter=lag_filter(1e-5),
    )

    unstable = rational([1.0], [1.0, -1.0])
    times = [
        0,
        0.05,
        0.1,
        0.3,
        0.5,
        0.77,
        1.1,
        1.5,
        1.9,
        2.5,
        3.1,
        3.7,
        *multiples(0.2, 1, 2, 3, 4, 6, 10, 15, 20),
    ]
    add(
        "unstable_plant_pi",
        "1/(s-1) e^{-0.2s}, stabilised by PI",
        unstable,
        pida(2.6, 4.0),
        0.2,
        times,
    )
    add(
        "unstable_plant_pi_prefilter",
        "the same with prefilter 1/(s+1)",
        unstable,
        pida(2.6, 4.0),
        0.2,
        times,
        prefilter=rational([1.0], [1.0, 1.0]),
    )
    add(
        "unstable_plant_pd",
        "1/(s-1) e^{-0.2s}, stabilised by PD with N = 10 and a filter",
        unstable,
        pida(3.0, None, 0.08),
        0.2,
        times,
        output_filter=lag_filter(0.01),
        prefilter=rational([1.0], [1.0, 1.0]),
    )

    neutral = [0, 0.25, 0.5, 0.999, 1, 1.25, 1.75, 2, 2.5, 3, 3.5, 4, 4.75, 6, 7.2, 9, 10.1, 13, 16.6, 20]
    add(
        "square_wave",
        "pure dead time, C = 1: y = 0, 1, 0, 1, ...; jumps at t = k",
        rational([1.0], [1.0]),
        rational([1.0], [1.0]),
        1.0,
        neutral,
    )
    add(
        "neutral_pi",
        "(0.5s+1)/(s+1) e^{-s}, C = 0.8 (1 + 1/s): jumps at t = k",
        rational([0.5, 1.0], [1.0, 1.0]),
        rational([0.8, 0.8], [1.0, 0.0]),
        1.0,
        neutral,
    )
    half = [t / 2 for t in neutral]
    add(
        "feedthrough_lead_lag",
        "(s+2)/(2s+1) e^{-0.5s}, C = 0.9 (1.5s+1)/(2s+1): jumps at t = k/2",
        rational([1.0, 2.0], [2.0, 1.0]),
        rational([1.35, 0.9], [2.0, 1.0]),
        0.5,
        half,
    )
    add(
        "feedthrough_lag",
        "(s+2)/(2s+1) e^{-0.5s}, C = 0.9/(0.7s+1), strictly proper",
        rational([1.0, 2.0], [2.0, 1.0]),
        rational([0.9], [0.7, 1.0]),
        0.5,
        half,
    )

    times = [0, 0.01, 0.05, 0.1, 0.2, 0.4, 0.7, 1, 1.4, 2, 2.7, 3.5, 5, 7, 10, 15]
    add(
        "biproper_pi_zero_delay",
        "(0.5s+1)/(s+1), PI, no dead time (algebraic loop)",
        rational([0.5, 1.0], [1.0, 1.0]),
        pida(2.0, 0.8),
        0.0,
        times,
    )
    add(
        "biproper_pid_zero_delay",
        "(s^2+0.4s+2)/(s^2+s+1), PID N = 10, no dead time",
        rational([1.0, 0.4, 2.0], [1.0, 1.0, 1.0]),
        pida(0.7, 0.9, 0.3),
        0.0,
        times,
        prefilter=rational([0.3, 1.0], [1.0, 1.0]),
    )

    ipdt = rational([1.0], [1.0, 0.0])
    lags = [[0.05, 1.0]] * 3
    times = [0, 0.02, 0.1, 0.3, 0.6, 1, 1.05, 1.2, 1.7, 2, 2.6, 3, 3.3, 4.5, 5, 6.2, 8, 10, 13.3, 16.5, 20]
    dense = [k / 8 for k in range(161)]
    add(
        "ipdt_pida_stable",
        "1/s e^{-s}, ideal PIDA over (0.05s+1)^3, kp = 0.6, stable",
        ipdt,
        ideal_pida(0.6, 6.0, 0.4, 0.06, *lags),
        1.0,
        times,
        envelope_times=dense,
    )
    add(
        "ipdt_pida_unstable",
        "the same with kp = 2.2: unstable loop",
        ipdt,
        ideal_pida(2.2, 6.0, 0.4, 0.06, *lags),
        1.0,
        times,
        envelope_times=dense,
    )

    add(
        "underdamped_pi",
        "1/(s^2+0.4s+1) e^{-1.7s}, PI",
        rational([1.0], [1.0, 0.4, 1.0]),
        pida(0.15, 0.7),
        1.7,
        [0, 0.8, 2.2, 3, 5, 7.7, 10, 12.4, 15, 19, 23, 27.5, 31, *multiples(1.7, 1, 2, 3, 5, 8, 12, 16, 20)],
    )
    add(
        "many_delays",
        "1/(s+1) e^{-0.01s}, PI, 300 dead times",
        fopdt,
        pida(20.0, 0.2),
        0.01,
        [
            0,
            0.004,
            0.015,
            0.033,
            0.0625,
            0.111,
            0.23,
            0.5,
            0.755,
            1.234,
            1.5,
            2.125,
            2.5,
            *multiples(0.01, 1, 2, 5, 10, 300),
        ],
    )

    sixth = rational([1.0], poly(*[[tau, 1.0] for tau in (1.0, 0.8, 0.6, 0.4, 0.2, 0.1)]))
    times = [0, 0.1, 0.5, 1, 1.5, 2, 2.75, 3, 4, 5, 6.3, 7, 8.5, 10, 12.2, 14, 16, 18.1, 20]
    add(
        "ten_states",
        "sixth-order plant, PIDA over (0.15s+1)^2, output filter 1/(0.05s+1)",
        sixth,
        ideal_pida(0.8, 3.0, 0.7, 0.3, [0.15, 1.0], [0.15, 1.0]),
        1.0,
        times,
        output_filter=lag_filter(0.05, 1),
    )
    add(
        "twelve_states",
        "sixth-order plant, PIDA with N = 10, output filter 1/(0.1s+1)^2",
        sixth,
        pida(0.8, 3.0, 0.7, 0.3),
        1.0,
        times,
        output_filter=lag_filter(0.1),
    )
    return out
