"""How a computed number misses a printed one, in words."""

from __future__ import annotations

from pidalab.ledger import Ledger

PLACES = 4  # decimals that the authors' program seems to have shown before the print rounded once more


def entry(book: Ledger, id: str, value: float) -> None:
    """Hand over a number; where it misses the print, say by how much and whether it is a tie of two roundings."""
    half = book.row(id).half_unit
    beyond = abs(value - book.printed(id)) / (2 * half) - 0.5
    if beyond <= 0:
        book.check(id, value)
        return
    note = f"{value:.7g}: beyond the limit of rounding by {beyond:.1g} units."
    if twice(value, book.printed(id), half):
        note += f" Rounded to {PLACES} places first, it is a tie, {round(value, PLACES):g}."
    book.check(id, value, note=note)


def twice(value: float, printed: float, half_unit: float) -> bool:
    """Whether a number rounds to the print if it was rounded to four places before, ties either way."""
    return abs(round(value, PLACES) - printed) <= half_unit * (1 + 2e-6)


def decimals(half_unit: float) -> int:
    """Places of a print, from half a unit of its last."""
    return max(0, len(f"{2 * half_unit:.10f}".rstrip("0").partition(".")[2]))
