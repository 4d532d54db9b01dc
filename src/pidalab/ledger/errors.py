"""The one error of the ledger."""

from collections.abc import Iterator
from contextlib import contextmanager


class LedgerError(ValueError):
    """What the ledger says and what was computed do not fit; the message has one line for each finding.

    Examples
    --------
    >>> issubclass(LedgerError, ValueError)
    True
    """


@contextmanager
def naming(id: str) -> Iterator[None]:
    """Say in which row an error happened.

    Parameters
    ----------
    id : str
        Id of the row, put before the message.

    Examples
    --------
    >>> with naming("demo.kp"):
    ...     raise LedgerError("'about 3' is not a number")
    Traceback (most recent call last):
    pidalab.ledger.errors.LedgerError: demo.kp: 'about 3' is not a number
    """
    try:
        yield
    except LedgerError as error:
        raise LedgerError(f"{id}: {error}") from None
