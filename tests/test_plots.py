"""Check the style of figures: a kind of controller looks the same in all of them."""

import matplotlib.pyplot as plt
import pytest

from pidalab import plots
from pidalab.style import LOOKS


@pytest.fixture
def axes():
    with plt.rc_context():
        plots.use_book_style()
        figure, axes = plt.subplots(1, 2)
        yield axes
        plt.close(figure)


def look(line):
    return next(kind for kind, look in LOOKS.items() if look["color"] == line.get_color())


def drawn(ax, *labels, **style):
    return [look(ax.plot([0, 1], [0, 1], label=label, **style)[0]) for label in labels]


@pytest.mark.parametrize(
    "panels",
    [
        # In any order.
        ({"PI": "PI", "PID": "PID", "PIDA": "PIDA"}, {"PIDA, Ms 1.4": "m = 3", "m = 0": "m = 4", "PID₃²": "other"}),
        # A second design of a kind, in every panel.
        ({"PIDA, fast": "PIDA", "PIDA, slow": "m = 3"}, {"PIDA, slow": "m = 3", "PIDA, fast": "PIDA"}),
        # A label without a kind does not take the style of another line.
        ({"PID₂²": "PIDA", "Lurang": "m = 3"}, {"Lurang": "m = 3"}),
        # Labels of several pages.
        ({"MRDP-PIDA": "PIDA", "PIDA$_1$": "m = 4"}, {"automatic reset": "m = 4", "clamping": "m = 3"}),
    ],
)  # fmt: skip
def test_a_label_has_one_look_in_all_panels(axes, panels):
    for ax, looks in zip(axes, panels, strict=True):
        assert drawn(ax, *looks) == [*looks.values()]


def test_labels_stand_beside_their_lines(axes):
    ax = axes[0]
    ax.plot([0, 10], [0, 10], label="up")
    ax.plot([0, 10], [10, 0], label="down")
    ax.plot([0, 10], [5, 5], label="level")
    plots.label_lines(ax, {"up": 2.0, "down": 8.0, "level": 5.0}, below={"down"})
    places = {text.get_text(): (text.xy, text.get_ha(), text.get_va()) for text in ax.texts}
    assert places == {
        "up": (pytest.approx((2, 2)), "right", "bottom"),
        "down": (pytest.approx((8, 2)), "right", "top"),
        "level": (pytest.approx((5, 5)), "center", "bottom"),
    }
    assert [text.get_color() for text in ax.texts] == [line.get_color() for line in ax.lines]


def test_markers_dashes_and_colours_can_be_given(axes):
    (line,) = axes[0].plot([0, 1], [0, 1], "o", label="PID")
    assert (look(line), line.get_linestyle()) == ("PID", "None")
    (line,) = axes[0].loglog([1, 2], [1, 2], linestyle=":", label="PI")
    assert (look(line), line.get_linestyle()) == ("PI", ":")
    assert axes[0].plot([0, 1], [0, 1], color="red", label="PIDA")[0].get_color() == "red"


def test_the_legend_has_each_label_once(axes):
    for ax, labels in zip(axes, (("PI", "PID"), ("PID", "PIDA")), strict=True):
        drawn(ax, *labels)
    plots.legend(axes[0].figure, ncols=2)
    assert [text.get_text() for text in axes[0].figure.legends[0].get_texts()] == ["PI", "PID", "PIDA"]
