"""The loops of sampled_loops.json: controllers by class and arguments, since what is discretised is a sum of parts."""

from delay_loop_cases import poly, rational


def loop(name, process, delay, controller, arguments, method, sample_time, samples=61):
    return {
        "name": name,
        "process": process,
        "delay": delay,
        "controller": controller,
        "arguments": arguments,
        "method": method,
        "sample_time": sample_time,
        "samples": samples,
        "every": 4,
    }


def cases():
    integrator, lag = rational([1.0], [1.0, 0.0]), rational([1.0], [1.0, 1.0])
    third = rational([1.0], [0.905, 3.159, 3.37, 1.0])
    resonance = rational([1.0], poly([1.0, 0.02, 1.0], [0.3, 1.0]))
    inverse, unstable = rational([-0.7, 1.0], [1.0, 2.0, 1.0]), rational([1.0], [1.0, -1.0])
    pida = {"kp": 1.31, "ti": 3.37, "td": 0.938, "ta": 0.269}
    fast = {"gains": [0.9, 1.2, 0.18], "filter_time": 1e-5, "filter_order": 2}
    series = {"kp": 0.8, "kd": 0.5, "ka": 0.1, "ti": 1.5, "filter_time": 0.2, "filter_order": 2}
    steady = {"gains": [0.02, 0.0], "filter_time": 0.1, "filter_order": 1}
    held_up = {"gains": [0.0, 3.0, 0.24], "filter_time": 0.05, "filter_order": 2}
    return [
        loop("integrator_pi_odd", integrator, 1.0, "PIDA", {"kp": 0.4, "ti": 8.0}, "backward", 0.3),
        loop("integrator_pi_even", integrator, 1.0, "PIDA", {"kp": 0.4, "ti": 8.0}, "tustin", 0.25),
        loop("integrator_no_delay", integrator, 0.0, "PIDA", {"kp": 0.4, "ti": 8.0}, "zoh", 0.5),
        loop(
            "lag_dominated", rational([1.0], [100.0, 1.0]), 1.0, "PIDA", {"kp": 50.0, "ti": 8.0}, "zoh", 0.4
        ),
        loop("balanced_pid", lag, 0.3, "PIDA", {"kp": 1.5, "ti": 1.1, "td": 0.12}, "backward", 0.05),
        loop("delay_dominated", lag, 5.03, "PIDA", {"kp": 0.2, "ti": 1.9}, "backward", 0.5),
        loop("third_order_pida", third, 0.826, "PIDA", pida, "tustin", 0.05, 121),
        loop("third_order_held", third, 0.1, "PIDA", pida, "zoh", 0.02, 241),
        loop("resonance", resonance, 0.4, "HighOrderPID", steady, "backward", 0.15),
        loop("resonance_held", resonance, 0.4, "HighOrderPID", steady, "zoh", 0.1),
        loop("inverse_response", inverse, 0.3, "PIDA", {"kp": 0.4, "ti": 1.5, "td": 0.2}, "backward", 0.1),
        loop("unstable_pi", unstable, 0.2, "PIDA", {"kp": 2.6, "ti": 4.0}, "tustin", 0.07),
        loop("unstable_pd", unstable, 0.2, "HighOrderPID", held_up, "zoh", 0.03),
        loop(
            "feedthrough",
            rational([0.5, 1.0], [1.0, 1.0]),
            1.0,
            "PIDA",
            {"kp": 0.5, "ti": 1.2},
            "backward",
            0.3,
        ),
        loop("stiff_filter", lag, 0.5, "HighOrderPID", fast, "backward", 0.1),
        loop("reset", rational([1.0], [1.0, 2.0, 1.0]), 0.25, "SeriesPIDA", series, "tustin", 0.25),
        loop("reset_odd", rational([1.0], [1.0, 2.0, 1.0]), 0.61, "SeriesPIDA", series, "backward", 0.17),
        loop(
            "slow_plant",
            rational([3.0], poly([20.0, 1.0], [2.0, 1.0])),
            1.73,
            "PIDA",
            {"kp": 1.4, "ti": 18.0, "td": 1.6},
            "zoh",
            0.15,
        ),
        loop(
            "negative_gain",
            rational([-2.0], [3.0, 1.0]),
            1.0,
            "PIDA",
            {"kp": -0.4, "ti": 3.0},
            "tustin",
            0.35,
        ),
        loop("integrator_too_much", integrator, 1.0, "PIDA", {"kp": 3.0, "ti": 8.0}, "backward", 0.3, 31),
        loop("unstable_too_little", unstable, 0.2, "PIDA", {"kp": 0.9, "ti": 4.0}, "backward", 0.07, 31),
    ]
