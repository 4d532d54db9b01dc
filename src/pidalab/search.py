"""Searches: whether one of SciPy's succeeded, and the border of a property."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def succeeded(result: Any, what: str) -> Any:
    """Return the result of an optimiser or a root finder of SciPy, once it says that it succeeded.

    Parameters
    ----------
    result : scipy.optimize.OptimizeResult or scipy.optimize.RootResults
        What the search returned.
    what : str
        What was searched, for the message.

    Returns
    -------
    object
        The same result.

    Raises
    ------
    ArithmeticError
        If the search failed: with its own reason, where it ended and how many values it took.

    Examples
    --------
    >>> from scipy.optimize import minimize
    >>> from pidalab.search import succeeded
    >>> found = succeeded(minimize(lambda x: (x[0] - 2) ** 2, [0.0]), "the least square")
    >>> print(f"{found.x[0]:.4f}")
    2.0000
    """
    if getattr(result, "success", getattr(result, "converged", False)):
        return result
    reason = getattr(result, "message", getattr(result, "flag", "it does not say why"))
    end = getattr(result, "x", getattr(result, "root", None))
    asked = getattr(result, "nfev", getattr(result, "function_calls", "an unknown number of"))
    raise ArithmeticError(f"{what} was not found: {reason} (at {end}, after {asked} values)")


def border(holds: Callable[[float], bool], inside: float, outside: float, share: float = 1e-7) -> float:
    """Bisect between a value where a property holds and one where it does not.

    Parameters
    ----------
    holds : callable
        The property.
    inside, outside : float
        Where it holds, and where it does not, in any order.
    share : float, optional
        How near the two must come, as a share of the larger one.

    Returns
    -------
    float
        The border, on the side where the property holds.

    Examples
    --------
    >>> from pidalab.search import border
    >>> border(lambda x: x * x > 2, inside=2.0, outside=1.0)
    1.414214
    """
    while abs(inside - outside) > share * max(abs(inside), abs(outside)):
        middle = 0.5 * (inside + outside)
        if holds(middle):
            inside = middle
        else:
            outside = middle
    return inside
