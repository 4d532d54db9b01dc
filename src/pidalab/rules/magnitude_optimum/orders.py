"""Which orders of controller and filter are best for a given noise gain."""

from __future__ import annotations

from typing import NamedTuple

from pidalab import _check
from pidalab.areas import exact
from pidalab.loop import Loop
from pidalab.process import Process, require_process
from pidalab.rules._design import Design
from pidalab.rules.magnitude_optimum.noise import tune_for_exact_noise
from pidalab.simulation.settling import load_iae

LARGEST_M, LARGEST_N = 4, 6  # orders that are compared


class Candidate(NamedTuple):
    """A pair of orders, its design, and the IAE of a unit step of the load."""

    m: int
    n: int
    design: Design
    iae: float


def rank_orders(process: Process, noise_gain: float, sample_time: float) -> list[Candidate]:
    """Designs of the orders m up to 4, n up to 6 with one noise gain, the best first: what the paper leaves open.

    The paper answers it by the largest integral gain, for a step of the set point, and with noise gains that differ by
    a factor of three. Here every design has the noise gain asked for (`tune_for_exact_noise`), and the criterion is the
    integral of the absolute error after a unit step of the load, in the continuous loop with exact dead time.

    Parameters
    ----------
    process : Process
        Stable.
    noise_gain : float
        Ratio of the standard deviations of control signal and noise, above 0.
    sample_time : float
        Sample time of the controller, above 0.

    Returns
    -------
    list of Candidate
        Sorted by IAE. Orders are missing for which there is no such design, or none with a stable loop.

    Raises
    ------
    TypeError, ValueError
        For something else than a Process, and if no orders are left.

    Examples
    --------
    >>> import pidalab
    >>> process = pidalab.lags(3, delay=0.5)
    >>> best = pidalab.rules.magnitude_optimum.rank_orders(process, 10.0, sample_time=0.002)
    >>> [(c.m, c.n) for c in best[:2]], best[0].iae
    ([(4, 6), (4, 5)], 1.106)
    """
    require_process("process", process)
    _check.real("noise_gain", noise_gain, above=0.0)
    _check.real("sample_time", sample_time, above=0.0)
    exact(process, 1)  # complains of a process without areas
    found, refused = [], []
    for m in range(LARGEST_M + 1):
        for n in range(max(m, 1), LARGEST_N + 1):
            try:
                design = tune_for_exact_noise(process, m, n, noise_gain, sample_time)
            except ValueError as reason:
                refused.append(f"m = {m}, n = {n}: {reason}")
                continue
            found.append(Candidate(m, n, design, load_iae(Loop(process, design.controller))))
    if not found:
        raise ValueError("no orders have such a design: " + "; ".join(refused))
    return sorted(found, key=lambda candidate: candidate.iae)
