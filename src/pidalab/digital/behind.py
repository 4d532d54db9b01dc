r"""Parts of a controller behind one more filter: in series with it, and still a sum of chains of equal lags.

A part with lags of its own time constant :math:`T` and the filter with :math:`T_F` are two chains in one. By partial
fractions they are a sum of one chain each,

.. math:: \frac{K_{-1} s^{-1} + K_0 + K_1 s + \dots}{(1 + T s)^n (1 + T_F s)^q}
          = \frac{K_{-1}}{s} + \frac{A(s)}{(1 + T s)^n} + \frac{B(s)}{(1 + T_F s)^q},

and every method of discretisation takes sums term by term, so nothing is approximated.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pidalab._check import Array
from pidalab.forms import FilteredGains
from pidalab.process import binomial, rational

SAME = 1e-9  # relative difference of time constants that are one
LARGEST = 1e3  # by how much the shares of two chains may exceed what they add up to


def behind(parts: tuple[FilteredGains, ...], output_filter: Any) -> tuple[FilteredGains, ...]:
    """Return parts whose sum is that of `parts` times a filter 1/(T s + 1)^n, or raise for another filter."""
    time, order = _binomial(output_filter)
    if not order:
        return parts
    return tuple(one for part in parts for one in _behind(part, time, order))


def _binomial(output_filter: Any) -> tuple[float, int]:
    """Return time constant and order of a filter, which has to be equal lags of gain 1."""
    num, den = rational("output_filter", output_filter)
    order = den.size - 1
    time = float(den[-2] / den[-1]) / order if order and den[-1] else 0.0
    lags = binomial(time, order) * den[-1]
    if num.size > 1 or not np.allclose(lags, den, rtol=1e-9, atol=0.0) or abs(num[0] / den[-1] - 1) > 1e-9:
        raise ValueError(
            "output_filter must be equal lags of gain 1, 1/(T s + 1)^n, to become a part of a digital controller, "
            f"found [{', '.join(f'{c:.6g}' for c in num)}] / [{', '.join(f'{c:.6g}' for c in den)}]"
        )
    return time, order


def _behind(part: FilteredGains, time: float, order: int) -> list[FilteredGains]:
    """Return one part behind the filter, as one chain or as two."""
    own, n = part.filter_time, part.filter_order
    if not n or abs(own - time) <= SAME * time:
        return [part._replace(filter_time=time, filter_order=n + order)]
    if abs(own - time) < max(own, time) * LARGEST ** (-1 / (n + order - 1)):
        raise ValueError(
            f"output_filter: its time constant {time:.6g} and that of the {part.name} part, {own:.6g}, are too near "
            "each other to be taken apart; make them equal, or more different"
        )
    ki, *rest = part.gains
    # in units of the filter's time; s^-1 apart, what is left is a proper fraction
    share = own / time
    first, second = binomial(share, n), binomial(1.0, order)
    top: Any = np.array([gain / time**k for k, gain in enumerate(rest)])[::-1]
    top = np.polysub(top, ki * time * np.convolve(first, second)[:-1])
    columns = [np.convolve(second, power) for power in _powers(n)]
    columns += [np.convolve(first, power) for power in _powers(order)]
    system = np.array([np.pad(column, (n + order - column.size, 0)) for column in columns]).T
    found = np.linalg.solve(system, np.pad(top, (n + order - top.size, 0)))
    back = time ** np.arange(max(n, order))  # from its units to those of s
    chains = ((found[:n] * back[:n], own, n, ""), (found[n:] * back[:order], time, order, "_behind"))
    whole = [FilteredGains(f"{part.name}_integral", (ki,))] if ki else []
    derivative = not any(part.gains[:2])
    return whole + [
        FilteredGains(part.name + suffix, (0.0, *gains.tolist()), lag, lags, derivative)
        for gains, lag, lags, suffix in chains
    ]


def _powers(count: int) -> list[Array]:
    """The powers s^0 to s^(count - 1) as polynomials."""
    return [np.eye(1, k + 1)[0] for k in range(count)]
