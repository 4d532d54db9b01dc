"""The engineer's wing: from a record of a plant to a model, a controller that is safe on it, and its code.

One door, and behind it one road::

    Record -> fit -> tune -> discretise -> code; report and check beside it

It stands on the library, and nothing of the library stands on it: a chapter that simulates loops loads none of it.
Names are imported when they are first used.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
