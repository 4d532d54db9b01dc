"""PIDA control: processes with dead time, exactly simulated loops, and tuning rules.

Data flow in one direction, in the library as in every chapter of the book::

    step data -> identify -> Process -> rule -> controller -> Loop -> Response -> measures -> figure, ledger

Names are imported when they are first used, so that ``import pidalab`` is fast.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
