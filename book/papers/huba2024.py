"""The loop of Fig. 3 of huba2024, its measures and portraits, and a simulated dryer."""

from dataclasses import dataclass
from itertools import product

import matplotlib.pyplot as plt
import numpy as np

import pidalab
from pidalab import identification, plots
from pidalab.controllers import AutomaticReset, Controller
from pidalab.forms import FilteredGains
from pidalab.process import binomial
from pidalab.rules import automatic_reset as ar, mrdp

T_S, SPARE = 0.001, 0.1  # sample time; distance of the limits from u at rest
STEPS = ("setpoint", "load")
FREE = (-np.inf, np.inf)


def plant(delay=1.0):
    """Return the integrator with dead time, K_s = 1."""
    return pidalab.ipdt(1.0, delay=delay)


def design(setting, n=4, filter_time=0.2, **options):
    """Return a design for T_dp = 1 with the filter Q_n. By default n T_f = 0.8, so T_d = 1.8."""
    return ar.tune(plant(), setting, n=n, filter_time=filter_time, **options)


# The six controllers of the paper.
DESIGNS = {name: design(setting) for name, setting in ar.SETTINGS.items()}


def label(name):
    """Return the name of a controller for a figure."""
    return name.replace("_1", "$_1$").replace("_2", "$_2$")


def limits(step, spare=SPARE):
    """Return limits of u at the distance `spare` from its values at rest."""
    return (-spare, spare) if step == "setpoint" else (-1.0 - spare, spare)


def sampled(loop, step, bounds=None, end=60.0, h=T_S, **options):
    """Return the response to a unit step, by default with the limits of Fig. 3."""
    given = {"setpoint": 0.0, "load": 0.0, "limits": bounds or limits(step)} | options
    t = h * np.arange(round(end / h) + 1)
    return pidalab.simulate_sampled(loop, t, **given | {step: 1.0})


def runs(names=DESIGNS, bounds=None):
    """Return the responses by name and step. The run of PI lasts 300 time units, the others last 60."""
    ends = {"PI": 300.0}
    return {
        (name, step): sampled(DESIGNS[name].loop(), step, bounds, ends.get(name, 60.0))
        for name, step in product(names, STEPS)
    }


def excess(response, step):
    """Return the movement of y and u beyond a monotonic step or one pulse, as in (24)."""
    if step == "setpoint":
        found = response.tv("y", final=1.0) - 1.0, response.tv1("u", final=0.0)
    else:
        found = response.tv1("y", final=0.0), response.tv1("u", final=-1.0)
    return max(found[0], 0.0), max(found[1], 0.0)


def shapes(runs, *names):
    """Return the excess and the change of y and u, for both steps."""
    found = {}
    for name, step in product(names, STEPS):
        r = runs[name, step]
        of_y = 1.0 if step == "setpoint" else np.max(np.abs(r.y))
        changes = of_y, np.ptp(np.append(r.u, 0.0))
        for signal, e, size in zip("yu", excess(r, step), changes, strict=True):
            # An excess below a billionth of the change is a rounding error.
            e = e if e > 1e-9 * size else 0.0
            found[f"{name}, {signal} after the {step} step"] = e, size
    return found


def beyond(response, step):
    """Return the overshoot after a set-point step, or the undershoot after a load step."""
    return max(0.0, response.y.max() - 1.0 if step == "setpoint" else -response.y.min())


def point(setting):
    """Return a setting as a point (kappa, tau_D, tau_A, tau_i) of the portrait."""
    return np.array([setting.kp, *setting.times, setting.ti])


def setting_at(spot):
    """Return a point of the portrait as a setting."""
    kappa, td, ta, ti = map(float, spot)
    return ar.Setting("portrait", "portrait", 0.5, kappa, kappa * td, kappa * ta, ti)


def portrait(
    points, step="load", h=T_S, delay=1.0, end=60.0, spare=SPARE, n=4, filter_time=0.2
):
    """Return the portrait of settings as in `point`, each with its prefilter (20)."""
    kappa, td, ta, ti = np.moveaxis(np.asarray(points, float), -1, 0)
    held = pidalab.SeriesPIDA(1.0, 1.0, 1.0, 1.0, filter_time, n)
    T = 1.0 + n * filter_time
    gains = {"kp": kappa / T, "kd": kappa * td, "ka": kappa * ta * T, "ti": ti * T}
    den = [ta * ti * T**3, (ta + td * ti) * T**2, (td + ti) * T, np.ones_like(ti)]
    t, loop = h * np.arange(round(end / h) + 1), pidalab.Loop(plant(delay), held)
    given = {step: 1.0, "limits": limits(step, spare), "prefilter": ([1.0], den)}
    return pidalab.portrait(loop, gains, t, **given)


def worst(p, step="load"):
    """Return the larger excess of y and u in a portrait."""
    of_y = p.tv1_y if step == "load" else p.tv_y + np.abs(1.0 - p.y_end) - 1.0
    return np.maximum(of_y, p.tv1_u)


@dataclass(frozen=True)
class Series(Controller):
    """Stabilising controller of any degree with automatic reset. `stabiliser` has gains in ascending powers of s."""

    stabiliser: tuple[float, ...]
    ti: float
    filter_time: float
    filter_order: int

    def automatic_reset(self):
        stabiliser = np.array(self.stabiliser[::-1])
        return AutomaticReset(self.ti, stabiliser, self.filter_time, self.filter_order)

    def fraction(self):
        den = np.convolve(binomial(self.filter_time, self.filter_order), [self.ti, 0.0])
        return np.convolve(self.stabiliser[::-1], [self.ti, 1.0]), den

    def parts(self):
        gains = tuple((self.fraction()[0][::-1] / self.ti).tolist())
        return (FilteredGains("filtered", gains, self.filter_time, self.filter_order),)


def higher(m, n, te=0.8, delay=1.0, real=False):
    """Return the loop of the multiple-pole PID^m with Q_n and T_f = te/n. The fastest zero gives T_i.

    If this zero is complex, its pair becomes real first, as in (26) to (29). With `real` the fastest real zero is
    taken instead.
    """
    numerator, T = mrdp.constants(m).numerator, 1.0 + te
    zeros = np.roots(numerator).astype(complex)
    zeros = zeros[np.argsort(zeros.real)]
    if real:
        k = np.flatnonzero(np.abs(zeros.imag) < 1e-9)[0]
        zeros = np.r_[zeros[k], np.delete(zeros, k)]
    elif abs(zeros[0].imag) > 1e-9:
        zeros[:2] = zeros[0].real
    ti, rest = -1 / zeros[0].real, np.atleast_1d(np.poly(zeros[1:])).real
    gains = (numerator[-1] * ti / rest[-1] * rest)[::-1] * T ** np.arange(-1.0, m)
    controller = Series(tuple(gains.tolist()), ti * T, te / n, n)
    den = np.convolve(gains[::-1] / gains[0], [ti * T, 1.0])
    prefilter = pidalab.Process([1.0], den)
    return pidalab.Loop(plant(delay), controller, prefilter=prefilter)


def behind(lag, filter_time):
    """Return one lag in series with the filter Q_4."""
    return pidalab.Process(
        [1.0], np.convolve(pidalab.lags(4, filter_time).den, [lag, 1.0])
    )


def dryer(gain, delay, rise=4.0, sensor=10.0, transport=5.0):
    """Return a simulated dryer from V to K, and the T_f with which the tangent of the filtered step response is (32).

    The final rise in K/V, the lag of the sensor and the transport delay are assumed.
    """
    slow, filter_time, t = 5000.0, 15.0, np.linspace(0, 1500, 15001)
    for _ in range(8):
        den = np.convolve([slow, 1.0], [sensor, 1.0])
        late = np.convolve(den, pidalab.lags(4, filter_time).den)
        step = pidalab.open_loop_step(pidalab.Process([rise], late, delay=transport), t)
        found = identification.ipdt_tangent(t, step.y)
        slow *= found.num[0] / gain
        filter_time += (delay - found.delay) / 4
    return pidalab.Process([rise], den, delay=transport), filter_time


CLOCK = 0.5 * np.arange(20001)  # s, sample time of the dryer
LID = np.where(CLOCK < 6000, 0.0, -6.0)  # V, a load as if a lid were opened


def dryer_record(process, seed):
    """Return times and the rise in K after a step to 12 V, with noise and resolution."""
    t = CLOCK[:6001]
    noise = pidalab.uniform_noise(t, 0.3, seed=seed)
    noise[0] = 0.0
    y = 12.0 * pidalab.open_loop_step(process, t).y
    return t, 0.1 * np.rint((y + noise) / 0.1)


def dryer_runs(process, filter_time, gain, delay):
    """Run PI, PID and PIDA_1 on the dryer from 25 to 80 °C, without and with noise."""
    real = {"noise": pidalab.uniform_noise(CLOCK, 0.3, seed=6)}
    real |= {"quanta": (0.1, 0.0), "pulse_widths": 255}
    model, clean, noisy = pidalab.ipdt(gain, delay=delay), {}, {}
    for name in ("PI", "PID", "PIDA_1"):
        own = ar.tune(
            model, ar.SETTINGS[name], n=4, filter_time=filter_time, weight=0.0
        )
        given = own.loop(process), CLOCK, 55.0
        limited = {"load": LID, "limits": (0.0, 24.0)}
        clean[name] = pidalab.simulate_sampled(*given, **limited)
        noisy[name] = pidalab.simulate_sampled(*given, **limited, **real)
    return clean, noisy


def draw_dryer(process, filter_time, gain, delay):
    """Draw Figs 5 and 6: a step to 12 V with its model, heating and a load."""
    figure, axes = plt.subplots(2, 2, figsize=(6.4, 4.8))
    (first, *views), spans = axes.flat, ((0, 10000), (3400, 5000), (5900, 7400))
    t, y = dryer_record(process, seed=2024)
    smooth = identification.binomial_filtered(t, y, filter_time, 4)
    model = identification.ipdt_least_squares(t, smooth, 12.0)
    ramp = 12.0 * model.num[0] * np.maximum(t - model.delay, 0.0)
    lines = {"record": (y, 400), "filtered": (smooth, 100), "model": (ramp, 100)}
    for name, (line, points) in lines.items():
        first.plot(*plots.thin(t[t <= 600], line[t <= 600], points), label=name)
    first.set(title="Fig. 5: step to 12 V", ylabel="rise, K", xlim=(0, 600))
    first.legend(loc="upper left")
    for name, r in dryer_runs(process, filter_time, gain, delay)[1].items():
        for ax, (low, high) in zip(views, spans, strict=True):
            part = (r.t >= low) & (r.t <= high)
            line = plots.thin(r.t[part], 25 + r.y[part], 200)
            ax.plot(*line, label=label(name), linewidth=1.2)
            ax.set(xlim=(low, high), xlabel="time, s")
    views[0].set(title="Fig. 6: temperature, °C", xlabel="")
    views[1].set(title="end of heating", ylim=(75, 82), ylabel="temperature, °C")
    views[2].set(title="after the load", ylim=(78.8, 80.8))
    views[0].legend(loc="lower right")
    return figure


# The paper's notation for the parts of names in the ledger.
WORDS = {"tau0": "τ_0", "kappa": "κ", "tau_i": "τ_i", "tau_d": "τ_D", "tau_a": "τ_A"}
WORDS |= {"s0": "s_0 T_d", "kp": "K_p K_s T_d", "ti": "T_i/T_d", "td": "T_D/T_d"}
WORDS |= {"kd": "K_d K_s", "ka": "K_a K_s/T_d", "ta2": "T_A²/T_d²", "re": "real part"}
WORDS |= {"im": "imaginary part", "pole": "double zero", "denominator": "T_d/T_2"}
WORDS |= {"t2": "T_2/T_d", "te": "T_e", "tf": "T_f", "fig3": "Fig. 3"}
WORDS |= {f"eq{n}": f"({n})" for n in (11, *range(15, 32))}
WORDS |= {f"table1.m{m}": f"m = {m}" for m in range(3)}
