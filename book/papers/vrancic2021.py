"""Processes, designs, rivals and figures for the pages on vrancic2021."""

import control
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

import pidalab
from pidalab import areas, plots
from pidalab.rules import magnitude_optimum as mo

T_S = 0.002  # sample time of Sections 3 and 4, s

# %% The processes
P = {
    1: pidalab.lags(4),  # (18)
    2: pidalab.lags(2, delay=0.5),  # (18)
    # the process of Tables 3 to 5; (33) prints another process
    3: pidalab.lags(3, delay=0.5),
    4: pidalab.lags(3, delay=1.0),  # (38)
    5: pidalab.Process([6.0], np.poly([-1, -2, -3])),  # (39)
    6: pidalab.Process([1.0], np.poly([-1, -3, -6])),  # (42); 0.0556 read as 1/18
    7: pidalab.Process([64.0], np.poly([-1, -2, -4, -8])),  # (45)
}

# %% Process, m, n and wanted noise gain of each row of Tables 3 to 6
CASES = {f"table3.khf{k}": (3, 3, 4, k) for k in (2, 5, 10, 20)}
CASES |= {f"table4.n{n}": (3, 3, n, 10) for n in (3, 4, 5, 6)}
CASES |= {f"table5.m{m}": (3, m, m + 1, 10) for m in (1, 2, 3, 4)}
CASES |= {f"table6.m{m}": (4, m, m + 1, 10) for m in (2, 3, 4)}
REPEATED = "table4.n4", "table5.m3"  # Both repeat table3.khf10.


def designed(g: int, m: int, n: int, noise_gain: float) -> pidalab.Loop:
    """Return a loop of Tables 3 to 6. T_F starts at 0.1 and is corrected four times."""
    design = mo.tune_for_noise(P[g], m, n, noise_gain, T_S, first=0.1, updates=4)
    return design.loop(P[g])


EXAMPLE_1 = tuple((g, m) for g in (1, 2) for m in (1, 2, 3))


def example(g: int, m: int) -> pidalab.Loop:
    """Return a loop of Table 2, with n = m and T_F = 0.1."""
    return mo.tune(P[g], m, m, 0.1).loop(P[g])


# %% Section 5: rivals, and magnitude optima with the same filters
FILTER_47 = control.tf([1.0], [5.26e-5, 0.0132, 1.0])
RIVAL = {5: "Lurang", 6: "Jung", 7: "Puangdownreong"}
RIVAL_GAINS = {
    5: (2.20, 3.60, 1.60, 0.06),  # (40)
    6: (529.8, 516.5, 179.2, 26.3),  # (43)
    7: (1.647, 2.684, 1.105, -2.65e-3),  # (46)
}
SHORT = {5: 0.01, 6: 0.005}  # T_F of cases 1 and 2


def with_filter_47(gains: tuple[float, ...]) -> control.TransferFunction:
    """Return a controller with the gains K_-1, K_0, ... and the filter (47)."""
    return FILTER_47 * control.tf(gains[::-1], [1.0, 0.0])


def gains_48() -> tuple[float, ...]:
    """Return the gains of PID_2^2 for G_P7 with the filter (47)."""
    known = areas.from_process(P[7], 8)
    return tuple(mo.gains(areas.with_filter(known, FILTER_47), m=2).tolist())


def contest(g: int) -> dict[str, pidalab.Loop]:
    """Return the loops that Section 5 compares on G_P5, G_P6 or G_P7, the rival last."""
    if g == 7:
        found = {
            "PID₂²": with_filter_47(gains_48()),
            RIVAL[7]: with_filter_47(RIVAL_GAINS[7]),
        }
        return {name: pidalab.Loop(P[7], C) for name, C in found.items()}
    found = {label(m, m): mo.tune(P[g], m, m, SHORT[g]).controller for m in (2, 3)}
    found[RIVAL[g]] = pidalab.HighOrderPID(RIVAL_GAINS[g], SHORT[g], filter_order=2)
    return {name: pidalab.Loop(P[g], C) for name, C in found.items()}


# Ends of the integrals of Tables 7 to 9 for tracking and load, in s.
ENDS = {5: (4, 4), 6: (4, 4), 7: (20, 40)}


def smooth(loop: pidalab.Loop, time: float, order: int = 2) -> pidalab.Loop:
    """Return the loop with the prefilter (9)."""
    return pidalab.Loop(
        loop.process, loop.controller, prefilter=pidalab.lags(order, lag=time)
    )


def ise(
    loop: pidalab.Loop, until: float, load_until: float, prefilter_time: float = 0.01
) -> dict[str, float]:
    """Return the ISE of r_f - y after a set-point step, and of y after a load step."""
    t = np.linspace(0, until, 40001)
    run = pidalab.step_response(smooth(loop, prefilter_time), t)
    wanted = pidalab.open_loop_step(pidalab.lags(2, lag=prefilter_time), t)
    load = pidalab.load_response(loop, np.linspace(0, load_until, 40001))
    return {"tracking": run.against(wanted).ise(), "load": load.ise()}


# %% Figures
def both_steps(loop: pidalab.Loop, prefilter_time: float) -> pidalab.Response:
    """Simulate a set-point step at 0 with the prefilter (9), and a load step at 15 s."""
    t = T_S * np.arange(12501)
    load = np.where(t < 15.0, 0.0, 1.0)
    return pidalab.simulate(smooth(loop, prefilter_time), t, setpoint=1.0, load=load)


def draw(
    columns: dict[str, dict[str, pidalab.Loop]],
    prefilter_time: float = 0.2,
    u_range: tuple[float, float] = (-1, 4),
    noise: float = 0.0,
    spans: tuple[tuple[float, float], ...] | None = None,
) -> Figure:
    """Draw y above u of `both_steps`, a column for each title and time span.

    Bands show two standard deviations of u if the measurement noise has the standard deviation `noise`.
    """
    shape = {"sharex": "col", "sharey": "row", "squeeze": False, "figsize": (6.4, 3.6)}
    figure, axes = plt.subplots(2, len(columns), **shape)
    for k, (title, loops) in enumerate(columns.items()):
        (top, bottom), (start, end) = axes[:, k], spans[k] if spans else (0, 25)
        for name, loop in loops.items():
            run = both_steps(loop, prefilter_time)
            part = (run.t >= start) & (run.t <= end)
            t, y, u = (x[part] for x in (run.t, run.y, run.u))
            (line,) = top.plot(*plots.thin(t, y, 400), label=name)
            bottom.plot(*plots.thin(t, u, 400), label=name)
            if noise:
                wide = 2 * noise * pidalab.noise_gain(loop, T_S)
                few = slice(None, None, max(1, t.size // 50))
                band = t[few], u[few] - wide, u[few] + wide
                bottom.fill_between(*band, color=line.get_color(), alpha=0.2, lw=0)
        top.set(title=title, xlim=(start, end))
        bottom.set(xlabel="time, s", ylim=u_range)
    axes[0, 0].set_ylabel("output y")
    axes[1, 0].set_ylabel("control u")
    plots.legend(figure, ncols=4 if max(map(len, loops)) < 8 else 2)
    return figure


def enlarged(number: str, rows: dict[str, pidalab.Loop]) -> Figure:
    """Draw both steps of the rows of a table, enlarged, with bands for a noise of 0.01."""
    words = {row: WORDS[f"{number}.{row}"].replace("K_HF", "$K_{HF}$") for row in rows}
    loops = {words[row]: loop for row, loop in rows.items()}
    columns, spans = {"set-point step": loops, "load step": loops}, ((0, 5), (15, 20))
    return draw(columns, noise=0.01, spans=spans)


def draw_contest(g: int, u_until: float) -> Figure:
    """Draw y left and u right, the set-point step above the load step."""
    t, loops = np.linspace(0, 4, 8001), contest(g)
    figure, axes = plt.subplots(2, 2, figsize=(6.4, 3.9))
    step = {x: pidalab.step_response(smooth(C, 0.01), t) for x, C in loops.items()}
    load = {x: pidalab.load_response(C, t) for x, C in loops.items()}
    for row, runs, u_end in zip(axes, (step, load), (u_until, 4), strict=True):
        for ax, name, end in zip(row, "yu", (4, u_end), strict=True):
            plots.signal(ax, runs, name, until=end)
            ax.set(ylabel={"y": "output y", "u": "control u"}[name], xlabel="time, s")
    axes[0, 0].set_title("set-point step")
    axes[1, 0].set_title("load step")
    axes[0, 1].set_yscale("symlog", linthresh=10, linscale=2)
    axes[0, 1].set_yticks([-10_000, -100, 0, 100, 10_000])
    plots.legend(figure)
    return figure


# %% Names
def label(m: int, n: int) -> str:
    """Return the name of a PID with m derivatives and a filter of order n."""
    return f"PID{'₀₁₂₃₄₅₆'[n]}{'⁰¹²³⁴'[m]}"


def title(key: str) -> str:
    """Return the name of a row of Tables 3 to 6."""
    _, m, n, noise_gain = CASES[key]
    return f"{label(m, n)}, noise gain {noise_gain}"


def plant(g: int) -> str:
    """Return the name of a process, for tables."""
    return f"Gₚ{'₁₂₃₄₅₆₇'[g - 1]}"


# %% The paper's notation for names in the ledger
WORDS = {f"{x}{k}": f"{x.upper()}{'₀₁₂₃₄₅₆₇₈₉'[k]}" for x in "ak" for k in range(10)}
WORDS |= {"km1": "K₋₁", "tf": "T_F", "sigma": "σ_rel", "ms": "M_S", "gp6": plant(6)}
WORDS |= {key: label(m, n) for key, (_, m, n, _) in CASES.items()}
WORDS |= {f"table3.khf{k}": f"K_HF = {k}" for k in (2, 5, 10, 20)}
WORDS |= {f"{eq}.m{m}": label(m, m) for eq in ("eq41", "eq44", "eq48") for m in (2, 3)}
WORDS |= {"load": "disturbance"}
for g in (1, 2):
    WORDS[f"table1.gp{g}.plain"] = f"{plant(g)} alone"
    for m in (1, 2, 3):
        WORDS[f"table1.gp{g}.m{m}"] = f"filter of {label(m, m)}"
        WORDS[f"table2.gp{g}.m{m}"] = f"{plant(g)}, {label(m, m)}"
for n in (7, 8, 9):
    WORDS |= {f"table{n}.pid22": label(2, 2), f"table{n}.pid33": label(3, 3)}
WORDS |= {"table7.lurang": RIVAL[5], "table8.jung": RIVAL[6], "table9.puang": RIVAL[7]}
