"""Style of figures: a colour and a dash for each kind of controller, and sizes that are legible on a phone."""

from __future__ import annotations

import re
from typing import Any

from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

GREY = "#808080"  # for limits, set points and records
LOOKS: dict[str, dict[str, Any]] = {  # as in the lab, book/_static/lab/lab.css
    "PIDA": {"color": "#1f5fa8", "linestyle": "-"},
    "m = 3": {"color": "#2a8f5b", "linestyle": (0, (6, 1.5))},
    "m = 4": {"color": "#8a4fa3", "linestyle": (0, (1, 1.5))},
    "PID": {"color": "#c8591a", "linestyle": (0, (3.5, 1.5))},
    "PI": {"color": "#7a6a1c", "linestyle": (0, (4, 1.5, 1, 1.5))},
    "other": {"color": "#404040", "linestyle": (0, (8, 1.5, 1, 1.5))},
}
# A further design of the same kind gets the first unused look in this order.
OTHERS = ("m = 3", "m = 4", "other", "PID", "PI", "PIDA")
SETTLED = {  # fixed looks of controllers and anti-windup methods that appear on several pages
    "PPM-PIDA": "m = 3",
    "PIDA$_1$": "m = 4",
    "PIDA$_2$": "other",
    "integrates on": "PIDA",
    "no protection": "PIDA",
    "back-calculation": "PID",
    "conditioning": "PID",
    "clamping": "m = 3",
    "automatic reset": "m = 4",
}
STYLE: dict[str, Any] = {
    "figure.dpi": 100,
    "figure.figsize": (6.4, 4.0),
    "figure.facecolor": "none",
    "savefig.facecolor": "none",
    "axes.facecolor": "none",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.formatter.min_exponent": 3,  # write 0.1 and 20 instead of powers of ten
    "axes.titlesize": "medium",
    "axes.titlelocation": "left",
    "axes.prop_cycle": cycler(
        **{key: [look[key] for look in LOOKS.values()] for key in ("color", "linestyle")}
    ),
    "grid.color": GREY,
    "grid.alpha": 0.25,
    "font.size": 12,  # points, as in the text of a page; 9 px on a phone
    "figure.titlesize": "medium",
    "figure.labelsize": "medium",
    "legend.frameon": False,
    "legend.handlelength": 2.4,
    "lines.linewidth": 1.8,
    "figure.constrained_layout.use": True,
    "svg.fonttype": "none",  # writes words instead of outlines, so that the page determines their font
    "svg.hashsalt": "pidalab",
}


def kind_of(label: str) -> str | None:
    """Return the kind of controller that a label names. For example, "m = 2" and "PID₄²" name a PIDA."""
    if derivative_label := re.match(r"m = ([0-4])|PID[₀-₉]([⁰¹²³⁴])", label):
        derivatives = int(derivative_label[1] or "⁰¹²³⁴".index(derivative_label[2]))
        return ("PI", "PID", "PIDA", "m = 3", "m = 4")[derivatives]
    named = re.search(r"\b(PIDA|PID|PI)(?![A-Za-z])", label)
    return named[1] if named else None


class BookAxes(Axes):
    """Axes in which the label of a line determines the colour and dash. A label has the same look in the whole figure.

    Some labels neither name a kind of controller nor have a fixed look. Such a line gets an unused look if the figure
    already has a line whose label determined its look. Otherwise matplotlib chooses the look.
    """

    name = "rectilinear"

    def plot(self, *args: Any, **kwargs: Any) -> list[Line2D]:
        label, formats = kwargs.get("label"), [each for each in args if isinstance(each, str)]
        given = vars(self.figure).setdefault("_pidalab_looks", {})
        coloured = {"color", "c"} & set(kwargs) or re.search("[rgbcmykw]", "".join(formats))
        if isinstance(label, str) and (label in SETTLED or kind_of(label) or given) and not coloured:
            look = dict(self._look(label, given))
            if {"linestyle", "ls"} & set(kwargs) or formats:
                del look["linestyle"]
            kwargs |= look
        return super().plot(*args, **kwargs)

    def _look(self, label: str, given: dict[str, str]) -> dict[str, Any]:
        if label not in given:
            order = [kind for kind in (kind_of(label), *OTHERS) if kind]
            here = [line.get_color() for line in self.lines]
            free = [kind for kind in order if kind not in given.values()]
            # If all looks are used in the figure, use a look that these axes do not have yet.
            free += [kind for kind in order if LOOKS[kind]["color"] not in here]
            given[label] = SETTLED.get(label) or [*free, *order][0]
        return LOOKS[given[label]]
