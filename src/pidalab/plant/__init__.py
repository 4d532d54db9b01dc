"""From a record of a plant to a model, a safe controller and its code.

The steps are::

    Record -> fit -> tune -> discretise -> code

`report` compares candidates, and `check` judges gains that run. The library does not import this package, but for names
that it imports on first use.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
