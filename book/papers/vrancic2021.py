"""vrancic2021: the processes, designs and rivals that its pages share."""

import control
import numpy as np

import pidalab
from pidalab import areas
from pidalab.rules import magnitude_optimum as mo

T_S = 0.002  # sample time of Sections 3 and 4, s

# %% The processes
P = {
    1: pidalab.lags(4),  # (18)
    2: pidalab.lags(2, delay=0.5),  # (18)
    3: pidalab.lags(3, delay=0.5),  # as used for Tables 3 to 5; (33) prints another
    4: pidalab.lags(3, delay=1.0),  # (38)
    5: pidalab.Process([6.0], np.poly([-1, -2, -3])),  # (39)
    6: pidalab.Process([1.0], np.poly([-1, -3, -6])),  # (42) with the gain 1/18
    7: pidalab.Process([64.0], np.poly([-1, -2, -4, -8])),  # (45)
}

# %% Tables 3 to 6: process, m, n and wanted noise gain of each row
CASES = {f"table3.khf{k}": (3, 3, 4, k) for k in (2, 5, 10, 20)}
CASES |= {f"table4.n{n}": (3, 3, n, 10) for n in (3, 4, 5, 6)}
CASES |= {f"table5.m{m}": (3, m, m + 1, 10) for m in (1, 2, 3, 4)}
CASES |= {f"table6.m{m}": (4, m, m + 1, 10) for m in (2, 3, 4)}
REPEATED = "table4.n4", "table5.m3"  # the row of Table 3 for a noise gain of 10


def designed(g: int, m: int, n: int, noise_gain: float) -> pidalab.Loop:
    """Loop of a design of Tables 3 to 6: T_F begins at 0.035 and is corrected four times."""
    design = mo.tune_for_noise(P[g], m, n, noise_gain, T_S, first=0.035, updates=4)
    return design.loop(P[g])


EXAMPLE_1 = tuple((g, m) for g in (1, 2) for m in (1, 2, 3))


def example(g: int, m: int) -> pidalab.Loop:
    """Loop of Table 2: n = m, T_F = 0.1."""
    return mo.tune(P[g], m, m, 0.1).loop(P[g])


# %% Section 5: controllers of the other methods, and magnitude optima with the same filters
FILTER_47 = control.tf([1.0], [5.26e-5, 0.0132, 1.0])
RIVAL = {5: "Lurang", 6: "Jung", 7: "Puangdownreong"}
RIVAL_GAINS = {
    5: (2.20, 3.60, 1.60, 0.06),  # (40)
    6: (529.8, 516.5, 179.2, 26.3),  # (43)
    7: (1.647, 2.684, 1.105, -2.65e-3),  # (46)
}
SHORT = {5: 0.01, 6: 0.005}  # T_F of cases 1 and 2


def with_filter_47(gains: tuple[float, ...]) -> control.TransferFunction:
    """Gains K_-1, K_0, ... with the filter of case 3."""
    return FILTER_47 * control.tf(gains[::-1], [1.0, 0.0])


def gains_48() -> tuple[float, ...]:
    """Gains of PID_2^2 for G_P7 with the filter of case 3."""
    known = areas.from_process(P[7], 8)
    return tuple(mo.gains(areas.with_filter(known, FILTER_47), m=2).tolist())


def contest(g: int) -> dict[str, pidalab.Loop]:
    """Loops that Section 5 compares on G_P5, G_P6 or G_P7, the rival last."""
    if g == 7:
        found = {
            "PID₂²": with_filter_47(gains_48()),
            RIVAL[7]: with_filter_47(RIVAL_GAINS[7]),
        }
        return {name: pidalab.Loop(P[7], C) for name, C in found.items()}
    found = {label(m, m): mo.tune(P[g], m, m, SHORT[g]).controller for m in (2, 3)}
    found[RIVAL[g]] = pidalab.HighOrderPID(RIVAL_GAINS[g], SHORT[g], filter_order=2)
    return {name: pidalab.Loop(P[g], C) for name, C in found.items()}


ENDS = {5: (4, 4), 6: (4, 4), 7: (20, 40)}  # of the integrals of Tables 7 to 9, s


def smooth(loop: pidalab.Loop, time: float, order: int = 2) -> pidalab.Loop:
    """Return the loop with the prefilter (9)."""
    return pidalab.Loop(
        loop.process, loop.controller, prefilter=pidalab.lags(order, lag=time)
    )


def ise(
    loop: pidalab.Loop, until: float, load_until: float, prefilter_time: float = 0.01
) -> dict[str, float]:
    """ISE of r_f - y after a set-point step, and of y after a load step."""
    t = np.linspace(0, until, 40001)
    run = pidalab.step_response(smooth(loop, prefilter_time), t)
    wanted = pidalab.open_loop_step(pidalab.lags(2, lag=prefilter_time), t)
    load = pidalab.load_response(loop, np.linspace(0, load_until, 40001))
    return {"tracking": run.against(wanted).ise(), "load": load.ise()}


# %% Names
def label(m: int, n: int) -> str:
    """PID with m derivatives and a filter of order n, as a table or a figure shows it."""
    return f"PID{'₀₁₂₃₄₅₆'[n]}{'⁰¹²³⁴'[m]}"


def title(key: str) -> str:
    """Row of Tables 3 to 6, as a table or a figure shows it."""
    _, m, n, noise_gain = CASES[key]
    return f"{label(m, n)}, noise gain {noise_gain}"


def plant(g: int) -> str:
    """Name of a process, as a table shows it."""
    return f"Gₚ{'₁₂₃₄₅₆₇'[g - 1]}"


# %% How the paper writes what the ledger calls so
WORDS = {f"{x}{k}": f"{x.upper()}{'₀₁₂₃₄₅₆₇₈₉'[k]}" for x in "ak" for k in range(10)}
WORDS |= {"km1": "K₋₁", "tf": "T_F", "sigma": "σ_rel", "ms": "M_S", "gp6": plant(6)}
WORDS |= {key: title(key) for key in CASES}
WORDS |= {f"{eq}.m{m}": label(m, m) for eq in ("eq41", "eq44", "eq48") for m in (2, 3)}
WORDS |= {"load": "disturbance"}
for g in (1, 2):
    WORDS[f"table1.gp{g}.plain"] = f"{plant(g)} alone"
    for m in (1, 2, 3):
        WORDS[f"table1.gp{g}.m{m}"] = f"{plant(g)}, filter of {label(m, m)}"
        WORDS[f"table2.gp{g}.m{m}"] = f"{plant(g)}, {label(m, m)}"
for n in (7, 8, 9):
    WORDS |= {f"table{n}.pid22": label(2, 2), f"table{n}.pid33": label(3, 3)}
WORDS |= {"table7.lurang": RIVAL[5], "table8.jung": RIVAL[6], "table9.puang": RIVAL[7]}
