"""Products of blocks, written as with python-control: by a number, by each other, by one of its systems."""

from __future__ import annotations

from typing import Any

import numpy as np

from pidalab import _check


def of_control(system: Any) -> bool:
    """Whether something is a system of python-control, which need not be imported to tell."""
    return type(system).__name__ in ("TransferFunction", "StateSpace") and type(system).__module__.startswith(
        "control"
    )


class Block:
    """What plants and controllers share: ``2 * block``, ``block / 2``, ``-block`` and products with python-control."""

    __array_ufunc__ = None  # numbers of numpy hand the product over

    def _scaled(self, factor: float) -> Any:
        """Return the block with its gain multiplied."""
        raise TypeError(f"{type(self).__name__} must define _scaled to be multiplied by a number")

    def _in_series(self, system: Any) -> Any:
        """Return the product with a system of python-control."""
        raise TypeError(f"{type(self).__name__} must define _in_series to be multiplied by {system!r}")

    def __mul__(self, other: Any) -> Any:
        if of_control(other):
            return self._in_series(other)
        if isinstance(other, (int, float, np.integer, np.floating)):
            return self._scaled(_check.real("the factor", other))
        hint = "; blocks meet in a loop, pidalab.Loop(process, controller), whose L is their product"
        raise TypeError(
            f"a {type(self).__name__} can be multiplied by a number or a system of python-control, found "
            f"{type(other).__name__}{hint if isinstance(other, Block) else ''}"
        )

    __rmul__ = __mul__  # one input, one output: the order does not matter

    def __truediv__(self, divisor: float) -> Any:
        divisor = _check.real("the divisor", divisor)
        if divisor == 0:
            raise ValueError("the divisor must not be 0, found 0")
        return self._scaled(1 / divisor)

    def __neg__(self) -> Any:
        return self._scaled(-1.0)
