"""Section 4: times, gains, crossovers and filters of the eight controllers, and how the gains were searched."""

from __future__ import annotations

import math

import control
import numpy as np
import pandas as pd
import pidalab
from pidalab.ledger import Ledger, every
from pidalab.rules import haalman

from .work import CASES, ORDERS, Array, Case, gain_at_ms, gain_needed, ms_of, work

STEP = 0.01  # of the gain, to which the paper prints it
GRID = (-4.0, 2.5, 88)  # decades and points of a frequency grid with which all eight gains come out
DENSITIES = np.arange(10.0, 30.0, 0.02)  # points per decade of the grids tried
PHASES = np.arange(0.0, 1.0, 0.01)  # where their points fall, in steps of the grid
FINE = 1e-3  # decades between the frequencies to which their points are moved


def times(book: Ledger) -> pd.DataFrame:
    """Integral, derivative and acceleration times, eq. (8)."""
    shared, rows = work(book), {}
    for example in ORDERS:
        for kind in ("pida", "pid"):
            C = shared.designs[Case(example, kind, 1.4)]
            book.check({f"{example}.{kind}.ti": C.ti, f"{example}.{kind}.td": C.td})
            rows[f"{example}, {kind.upper()}"] = [C.ti, C.td, C.ta]
        a3, a1 = (book.printed(f"{example}.topdt.{key}") for key in ("a3", "a1"))
        book.check(
            f"{example}.pida.ta",
            shared.designs[Case(example, "pida", 1.4)].ta,
            note=f"The printed, already rounded coefficients give {a3}/{a1} = {a3 / a1:.4f}, and so the print.",
        )
    return pd.DataFrame(rows, index=["ti", "td", "ta"]).T.map("{:.4f}".format)


def stepped(kp: float) -> float:
    """Round a gain up to the next step: the first that reaches Ms when the gain is increased in steps."""
    return math.ceil(kp / STEP) * STEP


def gains(book: Ledger) -> pd.DataFrame:
    """The eight gains, raised in steps of 0.01 until the model loop without output filter has the Ms asked for."""
    shared, rows = work(book), {}
    found = {case: stepped(C.kp) for case, C in shared.designs.items()}
    printed = {case: shared.used[case].kp for case in CASES}
    agree = sum(math.isclose(found[case], printed[case]) for case in CASES)
    book.check({f"{case.row}.kp": found[case] for case in CASES})
    for case in CASES:
        exact, reached = shared.designs[case].kp, ms_of(shared.loop(case, on="model", filtered=False))
        rows[case.label] = [f"{printed[case]:.2f}", f"{exact:.4f}", f"{found[case]:.2f}", f"{reached:.3f}"]
        note = f"The exact gain is {exact:.6f}; the printed one gives Ms = {reached:.3f} on the model."
        if case == Case("ex1", "pida", 2.0):
            note += f" The printed gain was used: the printed ω_gc belongs to it. {_about_grids(book)}"
        if case == Case("ex1", "pid", 1.4):
            note += f" {_about_filter(book)}"
        book.note(f"{case.row}.kp", f"{note} Steps of {STEP:g} give {agree} of the 8 gains.")
    columns = ["printed", "exact", f"in steps of {STEP:g}", "Ms of the printed gain"]
    return pd.DataFrame(rows, index=columns).T


def _about_filter(book: Ledger) -> str:
    """Which gains the printed filter time of eq. (15) allows."""
    case, row = Case("ex1", "pid", 1.4), book.row("ex1.pid.ms14.filter")
    least, most = (
        _gain_with_crossover(book, case, haalman.SLOWDOWN / (float(row.printed) + row.half_unit * sign))
        for sign in (1, -1)
    )
    return (
        f"Eq. (15) needs a gain between {least:.5f} and {most:.5f}; the exact one is, the printed one is not: "
        "this filter came from a gain that was not rounded."
    )


def _gain_with_crossover(book: Ledger, case: Case, wgc: float) -> float:
    """Gain with which the model loop crosses 1 at wgc."""
    shared = work(book)
    L = pidalab.Loop(shared.model(case), shared.designs[case]).L(1j * wgc)
    return shared.designs[case].kp / float(abs(L))


def coarse_grids(book: Ledger) -> pd.DataFrame:
    """The gains that one coarse grid of frequencies gives, beside the exact ones and the print."""
    shared, grid = work(book), np.logspace(*GRID)
    rows = {
        case.label: [
            shared.used[case].kp,
            stepped(shared.designs[case].kp),
            stepped(_on_grid(book, case, grid)),
        ]
        for case in CASES
    }
    columns = ["printed", "exact maximum", f"grid of {GRID[2]} points"]
    return pd.DataFrame(rows, index=columns).T.map("{:.2f}".format)


def _on_grid(book: Ledger, case: Case, w: Array) -> float:
    """Gain at which the largest |S| on a grid reaches Ms."""
    unit = pidalab.Loop(work(book).model(case), _unit(book, case))
    return float(np.min(gain_needed(unit, case.ms, w)))


def _unit(book: Ledger, case: Case, ratio: float = 10.0) -> pidalab.PIDA:
    """Controller of a case with gain 1."""
    C = work(book).designs[case]
    return pidalab.PIDA(1.0, C.ti, C.td, C.ta, ratio, ratio)


def _about_grids(book: Ledger) -> str:
    """How many coarse grids give all eight gains: density and phase of logarithmic grids, searched on a fine one."""
    x = np.arange(-2.0, 1.5, FINE)  # logarithm of the frequency, fine
    need = np.array(
        [
            gain_needed(pidalab.Loop(work(book).model(case), _unit(book, case)), case.ms, 10**x)
            for case in CASES
        ]
    )
    printed = np.array([work(book).used[case].kp for case in CASES])
    hits = []
    for density in DENSITIES:
        # One row of grid points for each phase; the gain of a grid is the smallest that any of its points needs.
        lattice = np.arange(math.ceil(-1.9 * density), math.floor(1.4 * density)) + PHASES[:, None]
        nearest = np.round((lattice / density - x[0]) / FINE).astype(int)
        found = np.ceil(need[:, nearest].min(axis=2) / STEP) * STEP
        hits += [float(density)] * int(np.sum(np.all(np.isclose(found, printed[:, None]), axis=0)))
    lowest, highest, points = GRID
    mine = [stepped(_on_grid(book, case, np.logspace(*GRID))) for case in CASES]
    agree = int(np.sum(np.isclose(mine, printed)))
    range_of_hits = f", all between {min(hits):.1f} and {max(hits):.1f}" if hits else ""
    return (
        f"It is not the exact peak of S, but a coarse grid that misses the peak can give it: {points} points over "
        f"{highest - lowest:g} decades from 1e{lowest:g} give {agree} of the 8 gains, and so do {len(hits)} of "
        f"{DENSITIES.size * PHASES.size} logarithmic grids of {DENSITIES[0]:.0f} to {DENSITIES[-1]:.0f} points per "
        f"decade{range_of_hits}. That it can be so is no proof that it was."
    )


def which_loop(book: Ledger) -> pd.DataFrame:
    """Ms of the printed gains: on model or process, without and with the output filter."""
    shared = work(book)
    kinds = {"model": ("model", False), "process": ("process", False), "model, with F": ("model", True)}
    kinds["process, with F"] = ("process", True)
    ms = {
        name: {case: ms_of(shared.loop(case, on=on, filtered=filtered)) for case in CASES}
        for name, (on, filtered) in kinds.items()
    }
    half = 0.05  # half a unit of the last printed place of 1.4 and 2.0
    for row, name in {
        "sec3.ms.model": "model",
        "sec2.ms.process": "process",
        "st.filter.ms.printed": "model, with F",
        "sec2.ms.simulated": "process, with F",
    }.items():
        off = {case.label: (abs(value - case.ms), half) for case, value in ms[name].items()}
        low, high = (pick(value - case.ms for case, value in ms[name].items()) for pick in (min, max))
        book.statement(
            row,
            *every(off, "<="),
            left_name="distance of Ms from the value asked for",
            right_name="half a unit of its last printed digit",
            note=f"Ms of the printed gains is off by {low:+.3f} to {high:+.3f} over the eight loops.",
        )
    return pd.DataFrame(
        {name: {case.label: f"{x:.3f}" for case, x in column.items()} for name, column in ms.items()}
    )


def crossovers(book: Ledger) -> pd.DataFrame:
    """Gain crossovers and filter times, eqs. (9), (13), (15), (19) and (21)."""
    shared, rows = work(book), {}
    for case, F in shared.filters.items():
        if case not in (Case("ex1", "pid", 1.4), Case("ex2", "pid", 1.4)):
            book.check(f"{case.row}.wgc", F.wgc)
        if case.ms == 1.4:  # the paper prints the filter for this Ms only
            book.check(f"{case.row}.filter", F.time)
        bounds = [
            _gain_with_crossover(
                book, case, book.printed(f"{case.row}.wgc") + sign * book.row(f"{case.row}.wgc").half_unit
            )
            for sign in (-1, 1)
        ]
        rows[case.label] = [
            f"{shared.used[case].kp:.2f}",
            f"{F.wgc:.4f}",
            f"{bounds[0]:.4f} to {bounds[1]:.4f}",
        ]
    _disagreeing(book)
    _model_or_process(book)
    _inputs(book)
    return pd.DataFrame(rows, index=["printed kp", "ω_gc", "kp that prints the paper's ω_gc"]).T


def _disagreeing(book: Ledger) -> None:
    """The two crossovers that contradict another number of the print."""
    shared = work(book)
    case = Case("ex1", "pid", 1.4)
    row = book.row(f"{case.row}.filter")
    low, high = (haalman.SLOWDOWN / (float(row.printed) + sign * row.half_unit) for sign in (1, -1))
    twin = shared.filters[Case("ex1", "pida", 1.4)].wgc
    book.check(
        f"{case.row}.wgc",
        shared.filters[case].wgc,
        note=f"As read. Eq. (15) prints the filter of the same loop, which allows ω_gc from {low:.4f} to {high:.4f}. "
        f"The PIDA loop a few lines earlier has {twin:.2f}.",
    )
    case = Case("ex2", "pid", 1.4)
    kp, wgc = book.row(f"{case.row}.kp"), book.row(f"{case.row}.wgc")
    most = float(kp.printed) + kp.half_unit
    least = _gain_with_crossover(book, case, float(wgc.printed) - wgc.half_unit)
    book.check(
        f"{case.row}.wgc",
        shared.filters[case].wgc,
        note=f"As read. With the printed model a crossover that prints as {wgc.printed} needs kp ≥ {least:.4f}, while "
        f"the printed gain is {most:.3f} at most. On the true process it needs "
        f"{shared.used[case].kp * least_on_process(book, case):.4f}. The printed filter time fits both.",
    )


def least_on_process(book: Ledger, case: Case) -> float:
    """Factor on the printed gain with which the loop on the process has the smallest crossover that prints as given."""
    row = book.row(f"{case.row}.wgc")
    wgc = float(row.printed) - row.half_unit
    return 1 / float(abs(work(book).loop(case, on="process", filtered=False).L(1j * wgc)))


def _model_or_process(book: Ledger) -> None:
    """The loop whose crossover is printed: with the model, where the two differ most."""
    shared, case = work(book), Case("ex1", "pida", 2.0)
    row = book.row(f"{case.row}.wgc")
    model, process = (
        float(pidalab.gain_crossovers(shared.loop(case, on=on, filtered=False))[0])
        for on in ("model", "process")
    )
    book.statement(
        "eq9.wgc",
        abs(model - float(row.printed)),
        "<=",
        row.half_unit,
        left_name="distance from the printed crossover",
        right_name="half a unit of its last digit",
        note=f"Example 1, PIDA, Ms = 2: ω_gc is {model:.3f} with the model, {process:.3f} with the process. As read, "
        "the condition after eq. (9) is written with P; the text was read by machine, which may have lost the hat.",
    )


def _inputs(book: Ledger) -> None:
    """Factors that the paper gives as inputs, found again in its printed results."""
    products = [
        book.printed(f"{row}.filter") * book.printed(f"{row}.wgc")
        for row in ("ex1.pida.ms14", "ex2.pida.ms14", "ex2.pid.ms14")
    ]
    mean = float(np.mean(products))
    note = (
        "Mean of the printed filter times of eqs. (13), (19) and (21) times the printed ω_gc: "
        f"{min(products):.4f} to {max(products):.4f}. Eq. (15) is left out, since its ω_gc does not fit."
    )
    book.check("sec3.eq9.slowdown", mean, note=note)
    book.check("sec3.eq9.factor", 1 / mean, note=note)


def other_ways(book: Ledger) -> pd.DataFrame:
    """How many of the eight gains other ways of raising them give, always in steps of 0.01."""
    shared = work(book)
    units = {case: (shared.model(case), _unit(book, case)) for case in CASES}
    ways = {
        "as described": {case: pidalab.Loop(*unit) for case, unit in units.items()},
        "on the true process": {
            case: pidalab.Loop(shared.processes[case.example], C) for case, (_, C) in units.items()
        },
        "with the output filter": {
            case: pidalab.Loop(*unit, shared.filters[case].transfer_function())
            for case, unit in units.items()
        },
        "printed coefficients": {
            case: pidalab.Loop(_printed_model(book, case), C) for case, (_, C) in units.items()
        },
    }
    for ratio in (5.0, 8.0, 12.0, 20.0):
        ways[f"N = M = {ratio:g}"] = {
            case: pidalab.Loop(model, _unit(book, case, ratio)) for case, (model, _) in units.items()
        }
    ways["no filters in C"] = {
        case: pidalab.Loop(model, _unit(book, case, 1e6)) for case, (model, _) in units.items()
    }
    for order in range(1, 6):
        ways[f"Padé, order {order}"] = {
            case: pidalab.Loop(_pade(model, order), C) for case, (model, C) in units.items()
        }
    rows = {}
    for name, loops in ways.items():
        found = {case: stepped(gain_at_ms(loop, case.ms)) for case, loop in loops.items()}
        hits = sum(math.isclose(kp, shared.used[case].kp) for case, kp in found.items())
        rows[name] = [f"{hits} of {len(CASES)}", f"{found[Case('ex1', 'pida', 2.0)]:.2f}"]
    return pd.DataFrame(rows, index=["printed gains that come out", "in place of 2.48"]).T


def _printed_model(book: Ledger, case: Case) -> pidalab.Process:
    """Model of the printed, rounded coefficients."""
    keys = ("a3", "a2", "a1") if case.kind == "pida" else ("a2", "a1")
    group = f"{case.example}.{'topdt' if case.kind == 'pida' else 'sopdt'}"
    den = [book.printed(f"{group}.{key}") for key in keys]
    return pidalab.Process([1.0], [*den, 1.0], book.printed(f"{group}.delay"))


def _pade(model: pidalab.Process, order: int) -> pidalab.Process:
    """Model whose dead time is a Padé approximation."""
    num, den = control.pade(model.delay, order)
    return pidalab.Process(np.convolve(model.num, num), np.convolve(model.den, den))
