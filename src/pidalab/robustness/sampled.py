r"""A plant between a hold and a sampler, exact with its dead time.

Across a sample interval h the input of the plant has one or two pieces in which it is constant (see `statespace`), so
that with :math:`x_{k+1} = \Phi x_k + \sum_j \Gamma_j v_{k-m_j}` the plant is, from sample to sample,

.. math:: G(z) = \sum_j c\,(z - \Phi)^{-1} \Gamma_j z^{-m_j} + d\,z^{-m_0},

and :math:`L(z) = G(z) K(z)` is all that stability and margins at the samples need. Nothing is approximated. What the
output does between two samples is not seen here.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import schur

from pidalab.process import Process
from pidalab.statespace import ALIGNED, held, pieces, realise

LONGEST = 1e6  # samples of a dead time; of half a sample more nothing can be seen


def require_later_answer(plant: Any, direct: float, h: float) -> None:
    """Raise for a plant whose output at a sample shows the input that is set there."""
    if direct and plant.delay < h * ALIGNED:
        raise ValueError(
            "the plant answers within the sample (direct feedthrough without dead time): the controller would read "
            f"what it has not set yet; found {plant!r}"
        )


class SampledPlant(NamedTuple):
    """A process between a hold and a sampler, in the coordinates in which its transition is triangular."""

    transition: Any  # (n, n), upper triangular
    inputs: list[tuple[Any, int]]  # influence of an input, and how many samples ago it was set
    output: Any  # (n,)
    direct: float

    def __call__(self, z: Any) -> Any:
        """Evaluate G at points z, of any shape."""
        rows: list[Any] = []  # of output (z - transition)^-1
        for j in range(self.output.size):
            before = sum(
                (row * t for row, t in zip(rows, self.transition[:j, j], strict=True)), self.output[j]
            )
            rows.append(before / (z - self.transition[j, j]))
        total = self.direct * z ** -self.inputs[0][1]
        for gamma, ago in self.inputs:
            total = total + sum(row * g for row, g in zip(rows, gamma, strict=True)) * z**-ago
        return total


def sampled_plant(process: Process, h: float) -> SampledPlant:
    """Discretise a process for an input that is held, dead time exact."""
    A, b, c, d = realise(process.num, process.den)
    if process.delay > LONGEST * h:
        raise ValueError(
            f"the dead time must be at most {LONGEST:g} samples for the margins of a sampled loop, found "
            f"{process.delay:.4g} with a sample time of {h:.4g}: so fast a sampling costs nothing, take the continuous "
            "controller"
        )
    own = pieces(process.delay, h)
    require_later_answer(process, d, h)
    phi, inputs = np.eye(c.size), []
    for piece in reversed(own):
        transition, gamma = held(A, b, piece.time)
        inputs.append((phi @ gamma, piece.ago))
        phi = phi @ transition
    triangular, basis = schur(phi, output="complex") if c.size else (phi, phi)
    return SampledPlant(
        triangular, [(basis.conj().T @ gamma, ago) for gamma, ago in reversed(inputs)], c @ basis, d
    )
