"""Figures of the book: a kind of controller looks the same in all of them."""

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


def test_a_kind_has_its_look_in_any_order(axes):
    assert drawn(axes[0], "PI", "PID", "PIDA") == ["PI", "PID", "PIDA"]
    assert drawn(axes[1], "PIDA, Ms 1.4", "m = 0", "PID₃²") == ["m = 3", "m = 4", "other"]


def test_a_second_design_of_a_kind_keeps_its_look_in_every_panel(axes):
    assert drawn(axes[0], "PIDA, fast", "PIDA, slow") == ["PIDA", "m = 3"]
    assert drawn(axes[1], "PIDA, slow", "PIDA, fast") == ["m = 3", "PIDA"]


def test_a_label_without_a_kind_takes_no_look_that_is_taken(axes):
    assert drawn(axes[0], "PID₂²", "Lurang") == ["PIDA", "m = 3"]
    assert drawn(axes[1], "Lurang") == ["m = 3"]


def test_what_appears_on_several_pages_has_its_look_in_any_company(axes):
    assert drawn(axes[0], "MRDP-PIDA", "PIDA$_1$") == ["PIDA", "m = 4"]
    assert drawn(axes[1], "automatic reset", "clamping") == ["m = 4", "m = 3"]


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


def test_marks_and_given_dashes_keep_their_own(axes):
    (line,) = axes[0].plot([0, 1], [0, 1], "o", label="PID")
    assert (look(line), line.get_linestyle()) == ("PID", "None")
    (line,) = axes[0].loglog([1, 2], [1, 2], linestyle=":", label="PI")
    assert (look(line), line.get_linestyle()) == ("PI", ":")
    assert axes[0].plot([0, 1], [0, 1], color="red", label="PIDA")[0].get_color() == "red"


def test_a_label_of_several_axes_stands_once_in_the_legend(axes):
    for ax, labels in zip(axes, (("PI", "PID"), ("PID", "PIDA")), strict=True):
        drawn(ax, *labels)
    plots.legend(axes[0].figure, ncols=2)
    assert [text.get_text() for text in axes[0].figure.legends[0].get_texts()] == ["PI", "PID", "PIDA"]
