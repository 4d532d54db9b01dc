"""What the three filters cost: the output filter F, and the filters N and M of derivative and acceleration."""

from __future__ import annotations

import math

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pidalab
from matplotlib.figure import Figure
from pidalab import plots
from pidalab.ledger import Ledger, every

from .work import CASES, KINDS, SIGNIFICANT, Case, gain_at_ms, ms_of, once, said, work


def output_filter(book: Ledger) -> pd.DataFrame:
    """Phase lag, rise of Ms and place of the corner of the output filter, eq. (9)."""
    shared, rows = work(book), {}
    lag, rise, corner = {}, {}, {}
    for case, F in shared.filters.items():
        bare, full = (shared.loop(case, on="model", filtered=filtered) for filtered in (False, True))
        lag[case] = F.order * math.degrees(math.atan(F.time * F.wgc)), pidalab.margins(bare).pm
        rise[case] = ms_of(bare), ms_of(full)
        corner[case] = 1 / (F.time * _bandwidth(shared.loops[case]))
        lost = math.sqrt(2 ** (1 / F.order) - 1)  # share of the corner at which the filter has lost 3 dB
        rows[case.label] = [*lag[case], *rise[case], corner[case], corner[case] * lost]
    of_kind = {kind: next(lag[case][0] for case in CASES if case.kind == kind) for kind in KINDS}
    book.statement(
        "st.filter.lag",
        *every({case.label: (x, SIGNIFICANT * pm) for case, (x, pm) in lag.items()}, "<"),
        left_name="lag of F at the crossover, degrees",
        right_name="a significant share of the phase margin",
        note="Significant is at least 20 %, the book's convention. The lag is "
        f"{of_kind['pida']:.1f} degrees for PIDA and {of_kind['pid']:.1f} for PID.",
    )
    first, second = rise[Case("ex1", "pida", 1.4)], rise[Case("ex1", "pida", 2.0)]
    book.statement(
        "st.filter.ms",
        *every({case.label: (full, bare / (1 - SIGNIFICANT)) for case, (bare, full) in rise.items()}, "<"),
        left_name="Ms with F",
        right_name="what is significantly more than without",
        note=f"{said(*second)} At the peak of S the lag counts for more than at the crossover: in Example 1 Ms of the "
        f"PIDA on the model rises from {first[0]:.2f} to {first[1]:.2f} and from {second[0]:.2f} to {second[1]:.2f}.",
    )
    furthest = max(corner, key=lambda case: corner[case])
    book.statement(
        "st.filter.cutoff",
        corner[furthest],
        "within",
        20,
        convention="similar",
        left_name=f"corner of F in bandwidths of the closed loop ({furthest.label}, the furthest)",
        right_name="20",
        note=f"The corner lies at {min(corner.values()):.1f} to {max(corner.values()):.1f} times the bandwidth, where "
        "|T| has fallen by 3 dB; it is at 20 times the gain crossover by eq. (9), which the paper calls the bandwidth.",
    )
    columns = ["lag, degrees", "phase margin", "Ms", "Ms with F", "corner/bandwidth", "3 dB point/bandwidth"]
    return pd.DataFrame(rows, index=columns).T.map("{:.3g}".format)


def _bandwidth(loop: pidalab.Loop) -> float:
    """Frequency at which |T| has first fallen by 3 dB."""
    w = np.logspace(-2, 2, 20001)
    size = np.abs(loop.T(1j * w))
    at = int(np.argmax(size < math.sqrt(0.5)))
    share = (size[at - 1] - math.sqrt(0.5)) / (size[at - 1] - size[at])
    return float(w[at - 1] * (w[at] / w[at - 1]) ** share)


def cancellation(book: Ledger) -> pd.DataFrame:
    """Remark 1: what N and M do to the cancelled poles, to the loop at the peak of S, and to the gain."""
    shared, rows = work(book), {}
    high, loss, at_peak = {}, {}, {}
    for case, C in shared.designs.items():
        model = shared.model(case)
        _, w = pidalab.max_sensitivity(pidalab.Loop(model, C))
        ideal = pidalab.PIDA(C.kp, C.ti, C.td, C.ta, 1e9, 1e9)
        ratio = complex(C(1j * w) / ideal(1j * w))
        slowest = min(C.n / C.td, C.m / C.ta) if C.ta else C.n / C.td
        # Without its filters the controller leaves an integrator and the dead time.
        without = C.ti * gain_at_ms(pidalab.Loop(pidalab.ipdt(model.gain(), model.delay), 1.0), case.ms)
        high[case], loss[case] = (slowest, w), (C.kp, (1 - SIGNIFICANT) * without)
        at_peak[case] = abs(ratio) - 1, math.degrees(math.atan2(ratio.imag, ratio.real))
        rows[case.label] = [slowest / w, 100 * at_peak[case][0], at_peak[case][1], without, C.kp]
    book.statement(
        "sec3.remark1.frequency",
        *every({case.label: pair for case, pair in high.items()}, ">", "much"),
        left_name="lowest corner of the filters",
        right_name="frequency of the peak of S",
        digits=6,
        note="Read as: much higher. Six digits, since a flat peak leaves its frequency no sharper. The factor is "
        f"{min(a / b for a, b in high.values()):.1f} to {max(a / b for a, b in high.values()):.0f}. {_zeros(book)}",
    )
    worst = [case for case in CASES if case.kind == "pida" and case.example == "ex1"]
    book.statement(
        "sec3.remark1.gain",
        *every({case.label: pair for case, pair in loss.items()}, ">"),
        left_name="Kp with N = M = 10",
        right_name="four fifths of Kp of the ideal cancellation",
        note="Significant is at least 20 %, the book's convention. In Example 1 the PIDA loses "
        + " and ".join(
            f"{100 * (1 - (1 - SIGNIFICANT) * loss[case][0] / loss[case][1]):.0f} %" for case in worst
        )
        + " of its gain; at the peak of S the filters turn the loop by "
        + " and ".join(f"{at_peak[case][1]:.1f}" for case in worst)
        + " degrees and raise it by "
        + " and ".join(f"{100 * at_peak[case][0]:.0f} %" for case in worst)
        + ".",
    )
    columns = ["corner/peak of S", "gain at the peak, %", "phase there, degrees", "kp without filters", "kp"]
    return pd.DataFrame(rows, index=columns).T.map("{:.3g}".format)


def _zeros(book: Ledger) -> str:
    """Zeros of the filtered PIDA of Example 1 beside the poles that they are to cancel."""
    shared, case = work(book), Case("ex1", "pida", 1.4)
    zeros = np.sort(np.roots(shared.designs[case].transfer_function().num[0][0]).real)[::-1]
    poles = np.sort(np.roots(shared.model(case).den).real)[::-1]
    shown = [", ".join(f"{x:.2f}" for x in values) for values in (zeros, poles)]
    return f"In Example 1 the zeros of the filtered PIDA are {shown[0]}, the poles of the model {shown[1]}."


def sensitivity(book: Ledger) -> Figure:
    """Sensitivity of one loop without and with the output filter."""
    shared, case = work(book), Case("ex1", "pida", 2.0)
    w = np.logspace(-2, 2, 1200)
    bare, full = (shared.loop(case, on="model", filtered=filtered) for filtered in (False, True))
    figure, ax = plt.subplots(figsize=(6.4, 2.8))
    plots.magnitude(ax, {"without F": bare.S(1j * w), "with F": full.S(1j * w)}, w)
    ax.axhline(case.ms, color="#808080", linestyle=":", linewidth=1.2)
    ax.set(ylabel="sensitivity |S|", xlim=(0.2, 10), yscale="linear", ylim=(0, 2.6))
    ax.legend(loc="upper left")
    return once(figure)
