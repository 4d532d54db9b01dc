"""How far two formulas lie apart, and how a page shows it."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

EXACT = 1e-9  # what two formulas may differ by, relative


def relative(found: ArrayLike, wanted: ArrayLike) -> float:
    """Largest deviation, as a share of what is wanted."""
    return float(np.max(abs(np.asarray(found) / np.asarray(wanted) - 1)))


def decade(x: float) -> str:
    """A rounding error as a power of ten, which does not depend on the machine."""
    return "1e-9" if x <= EXACT else f"{x:.1e}"


def residuals(rows: dict[str, float]) -> pd.DataFrame:
    """Largest residuals by equation; those of rounding only as such."""
    shown = {name: "below 1e-9" if x <= EXACT else f"{x:.2g}" for name, x in rows.items()}
    return pd.DataFrame({"largest relative residual": shown})
