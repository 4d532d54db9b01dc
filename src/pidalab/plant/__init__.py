"""Turn a record of a plant into a model, a safe controller and its code.

The steps are::

    Record -> fit -> tune -> discretise -> code

`report` compares PI, PID and PIDA, and `check` judges the gains of a running controller. The library imports this
package only when a program uses one of its names.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
