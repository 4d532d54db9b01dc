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


class Candidate(NamedTuple):
    """A pair of orders, its design, and the IAE of a unit step of the load."""

    m: int
    n: int
    design: Design
    iae: float


def rank_orders(
    process: Process, noise_gain: float, sample_time: float, largest_m: int = 4, largest_n: int = 6
) -> list[Candidate]:
    """Designs of all orders with the same noise gain, the best first: the question that the paper leaves open.

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
    largest_m, largest_n : int, optional
        Orders up to these are compared, with n at least 1 and at least m.

    Returns
    -------
    list of Candidate
        Sorted by IAE. Orders are missing for which there is no such design, or none with a stable loop.

    Raises
    ------
    TypeError, ValueError
        For something else than a Process, bounds below 0 and 1, and if no orders are left.

    Examples
    --------
    >>> import pidalab
    >>> process = pidalab.lags(3, delay=0.5)
    >>> best = pidalab.rules.magnitude_optimum.rank_orders(process, 10.0, sample_time=0.002, largest_m=2, largest_n=3)
    >>> [(c.m, c.n) for c in best[:2]], best[0].iae
    ([(2, 3), (2, 2)], 1.31)
    """
    require_process("process", process)
    largest_m = _check.order("largest_m", largest_m, at_least=0)
    largest_n = _check.order("largest_n", largest_n, at_least=1)
    _check.real("noise_gain", noise_gain, above=0.0)
    _check.real("sample_time", sample_time, above=0.0)
    exact(process, 1)  # complains of a process without areas
    found, refused = [], []
    for m in range(largest_m + 1):
        for n in range(max(m, 1), largest_n + 1):
            try:
                design = tune_for_exact_noise(process, m, n, noise_gain, sample_time)
            except ValueError as reason:
                refused.append(f"m = {m}, n = {n}: {reason}")
                continue
            found.append(Candidate(m, n, design, load_iae(Loop(process, design.controller))))
    if not found:
        raise ValueError("no orders up to largest_m and largest_n have such a design; " + "; ".join(refused))
    return sorted(found, key=lambda candidate: candidate.iae)
