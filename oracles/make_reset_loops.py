"""Make reset_loops.json: limited loops with automatic reset in continuous time, by the method of steps.

An integrator with dead time is controlled as in huba2024, Fig. 1: binomial filter, PDA terms of the filter's states,
saturation, and positive feedback of the saturated signal through a lag. An adaptive Runge-Kutta method of order 8
integrates from break to break. The breaks are the multiples of the dead time, the instants at which the saturation
begins or ends, and those instants one dead time later. The past comes from the dense output.

Nothing is shared with the program under test, which is sampled. Everything is computed twice, with different steps and
tolerances. The script fails if the results differ by more than 1e-8. Run: python oracles/make_reset_loops.py
"""

import json
from itertools import pairwise

import numpy as np
from problems import file_of, problems
from scipy.integrate import solve_ivp

END, EVERY, AGREEMENT = 30.0, 0.5, 1e-8


class Run:
    """An integration. The state consists of filter, reset, prefilter and output."""

    def __init__(self, case, largest_step, tolerance):
        self.case, self.own = case, case["controller"]
        self.options = {"method": "DOP853", "rtol": tolerance, "atol": tolerance, "dense_output": True}
        self.largest_step = largest_step
        self.order, self.q = self.own["filter_order"], len(case["prefilter"]) - 1
        self.pieces = []

    def wanted(self, x):
        """Return the control signal before the limits."""
        kp, kd, ka, time = (self.own[key] for key in ("kp", "kd", "ka", "filter_time"))
        error = self.reference(x) - x[-1]
        chain = [error, *x[: self.order]]  # each lag's input and output
        slopes = [(a - b) / time for a, b in pairwise(chain)]
        first = slopes[-1]
        second = (slopes[-2] - slopes[-1]) / time if ka else 0.0
        return kp * chain[-1] + kd * first + ka * second + x[self.order]

    def reference(self, x):
        return x[self.order + self.q] if self.q else self.case["setpoint"]

    def control(self, x):
        low, high = self.case["limits"]
        return min(max(self.wanted(x), low), high)

    def past(self, t):
        """Return the control signal at an earlier time. It is 0 before t = 0."""
        if t < 0:
            return 0.0
        piece = next(p for p in reversed(self.pieces) if p.t_min <= t)
        return self.control(piece(min(t, piece.t_max)))

    def slope(self, t, x, middle):
        case, own, n = self.case, self.own, self.order
        error = self.reference(x) - x[-1]
        out = np.empty_like(x)
        for i in range(n):
            out[i] = ((error if i == 0 else x[i - 1]) - x[i]) / own["filter_time"]
        out[n] = (self.control(x) - x[n]) / own["ti"]
        if (
            self.q
        ):  # The states begin at the highest derivative, and the last one is the output of the filter.
            den = case["prefilter"]
            f = x[n + 1 : n + 1 + self.q]
            out[n + 2 : n + 1 + self.q] = f[:-1]
            out[n + 1] = (case["setpoint"] - sum(den[i + 1] * f[i] for i in range(self.q))) / den[0]
        late = middle - case["delay"] >= 0  # the load comes through the dead time, too
        out[-1] = (self.past(t - case["delay"]) + case["load"]) if late else 0.0
        return out

    def go(self):
        """Integrate to the end, from break to break."""
        delay, (low, high) = self.case["delay"], self.case["limits"]
        breaks = sorted({k * delay for k in range(int(END / delay) + 1)} | {END})
        x = np.zeros(self.order + self.q + 2)
        while len(breaks) > 1:
            start, stop = breaks[0], breaks[1]
            middle = (start + stop) / 2
            events = [lambda t, x, middle, edge=edge: self.wanted(x) - edge for edge in (low, high)]
            arguments = {"args": (middle,), "max_step": self.largest_step, **self.options}
            run = solve_ivp(self.slope, (start, stop), x, events=events, **arguments)
            hits = [t for hit in run.t_events for t in hit if start + 1e-7 < t < stop - 1e-7]
            if hits:
                stop = min(hits)
                run = solve_ivp(self.slope, (start, stop), x, **arguments)
                breaks = sorted({*breaks, stop} | ({stop + delay} if stop + delay < END else set()))
            self.pieces.append(run.sol)
            x = run.y[:, -1]
            breaks = breaks[1:]
        return self

    def values(self, times):
        """Return y and u at the times."""
        states = [next(p for p in self.pieces if p.t_max >= t)(t) for t in times]
        return np.array([x[-1] for x in states]), np.array([self.control(x) for x in states])


def main():
    times = np.arange(0.0, END + EVERY / 2, EVERY)
    stored, worst = [], 0.0
    for case in problems(__file__):
        first, second = (Run(case, *setting).go().values(times) for setting in ((0.02, 1e-12), (0.01, 1e-11)))
        worst = max(worst, *(float(np.max(np.abs(a - b))) for a, b in zip(first, second, strict=True)))
        y, u = (np.round(x, 10).tolist() for x in second)
        stored.append(case | {"y": y, "u": u})
    assert worst < AGREEMENT, worst
    head = {"made_by": "oracles/make_reset_loops.py", "agreement": worst, "times": times.tolist()}
    file_of(__file__).write_text(json.dumps(head | {"cases": stored}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
