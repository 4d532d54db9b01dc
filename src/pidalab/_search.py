"""Search for the border of a property that holds on one side of a value and not on the other."""

from __future__ import annotations

from collections.abc import Callable


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
    >>> from pidalab._search import border
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
