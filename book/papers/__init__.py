"""Computations of the chapters and their audits, a module for each paper."""

from collections.abc import Mapping

from paperledger import Ledger


def ends(book: Ledger, id: str) -> tuple[float, float]:
    """Return the smallest and the largest number that round to the printed one."""
    printed, half = book.printed(id), book.row(id).half_unit * (1 + 1e-9)
    return printed - half, printed + half


def agreeing(book: Ledger, values: Mapping[str, float]) -> int:
    """Count the values, by id, that round to the printed ones."""
    bounds = {id: ends(book, id) for id in values}
    return sum(low <= values[id] <= high for id, (low, high) in bounds.items())


def distance(book: Ledger, id: str, value: float) -> tuple[float, float]:
    """Return the distance of a value from the printed one, and half a unit of the last printed digit."""
    return abs(value - book.printed(id)), book.row(id).half_unit
