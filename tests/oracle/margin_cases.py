"""The loops of margins.json: those of every kind that have margins, and some that have none."""

from delay_loop_cases import ideal_pida, lag_filter, pida, poly, rational


def loop(name, note, process, controller, delay, output_filter=None):
    return {
        "name": name,
        "note": note,
        "process": process,
        "controller": controller,
        "output_filter": output_filter,
        "delay": delay,
    }


def gain(k):
    return rational([k], [1.0])


def cases():
    integrator, lag = rational([1.0], [1.0, 0.0]), rational([1.0], [1.0, 1.0])
    third = rational([1.0], [0.905, 3.159, 3.37, 1.0])
    light = rational([1.0], poly([1.0, 0.02, 1.0], [0.3, 1.0]))
    unstable = rational([1.0], [1.0, -1.0])
    lags8 = rational([1.0], poly(*[[1.0, 1.0]] * 8))
    spread = rational([1.0], poly([1.0, 1.0], [0.2, 1.0], [0.04, 1.0], [0.008, 1.0]))
    twice = rational([1.0], [1.0, 0.0, 0.0])
    slow = rational([3.0], poly([20.0, 1.0], [2.0, 1.0]))
    return [
        loop("integrator_gain", "1/s e^{-s}, gain 0.5: closed forms", integrator, gain(0.5), 1.0),
        loop("integrator_pi", "1/s e^{-s}, PI", integrator, pida(0.4, 8.0), 1.0),
        loop(
            "integrator_pida",
            "1/s e^{-s}, ideal PIDA over (0.05s+1)^3",
            integrator,
            ideal_pida(0.6, 6.0, 0.4, 0.06, *[[0.05, 1.0]] * 3),
            1.0,
        ),
        loop(
            "double_integrator",
            "1/s^2 e^{-0.1s}, PID: conditionally stable",
            twice,
            pida(0.3, 20.0, 3.0),
            0.1,
            lag_filter(0.02, 1),
        ),
        loop("lag_dominated", "1/(100s+1) e^{-s}, PI", rational([1.0], [100.0, 1.0]), pida(50.0, 8.0), 1.0),
        loop("balanced_pid", "1/(s+1) e^{-0.3s}, PID, N = 10", lag, pida(1.8, 1.1, 0.12), 0.3),
        loop("delay_dominated", "1/(s+1) e^{-30s}, PI", lag, pida(0.2, 8.0), 30.0),
        loop(
            "delay_and_integrator",
            "e^{-2s}, integral action: closed forms",
            gain(1.0),
            {"num": [0.15], "den": [1.0, 0.0]},
            2.0,
        ),
        loop(
            "third_order_pida",
            "third-order plant, dead time 0.826, PIDA, filter 1/(0.13s+1)^2",
            third,
            pida(1.31, 3.37, 0.938, 0.269),
            0.826,
            lag_filter(0.13),
        ),
        loop(
            "four_lags",
            "1/(s+1)^4 without dead time, PIDA",
            rational([1.0], poly(*[[1.0, 1.0]] * 4)),
            pida(2.0, 3.0, 1.0, 0.3),
            0.0,
        ),
        loop("eight_lags", "1/(s+1)^8, PI", lags8, pida(0.6, 4.5), 0.0),
        loop(
            "lags_apart",
            "lags 1, 0.2, 0.04, 0.008, PID",
            spread,
            pida(8.0, 0.8, 0.08, n=20.0),
            0.01,
            lag_filter(0.002),
        ),
        loop(
            "resonance_gain",
            "resonance 50 times the static gain, dead time 0.4, gain",
            light,
            gain(0.015),
            0.4,
        ),
        loop(
            "resonance_integral",
            "the same with integral action",
            light,
            {"num": [0.02], "den": [1.0, 0.0]},
            0.4,
        ),
        loop(
            "three_crossovers",
            "lag 32 and a resonance: the smallest phase margin is not the smallest delay margin",
            rational([1.0], poly([1 / 2.15**2, 2 * 0.0134 / 2.15, 1.0], [32.0, 1.0])),
            pida(1.866, 17.9, 0.065),
            0.18,
        ),
        loop(
            "inverse_response",
            "(1-0.7s)/(s+1)^2 e^{-0.3s}, PID",
            rational([-0.7, 1.0], [1.0, 2.0, 1.0]),
            pida(0.4, 1.5, 0.2),
            0.3,
        ),
        loop(
            "two_wrong_zeros",
            "(1-0.3s)(1-0.5s)/(s+1)^3, PI",
            rational(poly([-0.3, 1.0], [-0.5, 1.0]), poly(*[[1.0, 1.0]] * 3)),
            pida(0.5, 2.0),
            0.2,
        ),
        loop("unstable_gain", "1/(s-1) e^{-0.2s}, gain 2.5", unstable, gain(2.5), 0.2),
        loop("unstable_pi", "1/(s-1) e^{-0.2s}, PI", unstable, pida(2.6, 4.0), 0.2),
        loop(
            "unstable_pd",
            "1/(s-1) e^{-0.2s}, PD with N = 10 and a filter",
            unstable,
            pida(3.0, None, 0.08),
            0.2,
            lag_filter(0.01),
        ),
        loop(
            "neutral_gain",
            "(0.4s+1)/(s+1) e^{-0.7s}, gain 0.6",
            rational([0.4, 1.0], [1.0, 1.0]),
            gain(0.6),
            0.7,
        ),
        loop(
            "neutral_pi", "(0.5s+1)/(s+1) e^{-s}, PI", rational([0.5, 1.0], [1.0, 1.0]), pida(0.5, 1.2), 1.0
        ),
        loop(
            "neutral_rising",
            "(2s+1)/(s+1) e^{-0.5s}, gain 0.4: all peaks are higher than the one before",
            rational([2.0, 1.0], [1.0, 1.0]),
            gain(0.4),
            0.5,
        ),
        loop(
            "stiff_filter",
            "1/(s+1) e^{-0.5s}, PID, N = 10, filter 1/(1e-5s+1)^2",
            lag,
            pida(1.2, 1.1, 0.15),
            0.5,
            lag_filter(1e-5),
        ),
        loop(
            "stiff_pida",
            "third-order plant, dead time 0.5, PIDA with N = M = 1e5, filter 1/(1e-5s+1)^2",
            third,
            pida(1.31, 3.37, 0.938, 0.269, n=1e5),
            0.5,
            lag_filter(1e-5),
        ),
        loop("negative_gain", "-2/(3s+1) e^{-s}, PI", rational([-2.0], [3.0, 1.0]), pida(-0.4, 3.0), 1.0),
        loop("slow_plant", "3/((20s+1)(2s+1)) e^{-1.7s}, PID, N = 10", slow, pida(1.4, 18.0, 1.6), 1.7),
        loop("nearly_unstable", "1/s e^{-s}, gain 1.57", integrator, gain(1.57), 1.0),
        loop("integrator_too_much", "1/s e^{-s}, gain 9: unstable", integrator, gain(9.0), 1.0),
        loop(
            "resonance_too_much",
            "the plant with the resonance under gain 0.3: unstable",
            light,
            gain(0.3),
            0.4,
        ),
        loop("unstable_too_little", "1/(s-1) e^{-0.2s}, gain 0.9: unstable", unstable, gain(0.9), 0.2),
    ]
