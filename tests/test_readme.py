"""Check that the code of the front pages runs, and that their score is that of the ledgers."""

import re
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest

import pidalab
from paperledger import score_markdown

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "book" / "intro.md"]


def blocks(page):
    return re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_code_runs(page, capsys):
    assert blocks(page)
    for block in blocks(page):
        exec(compile(block, page.name, "exec"), {})
    assert "series:" in capsys.readouterr().out


def test_short_answers_run(capsys):
    """Run the answers in order, as a reader would."""
    space = {}
    with plt.rc_context():
        plt.rcdefaults()  # another test may have set the style of the book
        for block in blocks(ROOT / "book" / "how-do-i.md"):
            exec(compile(block, "how-do-i.md", "exec"), space)
    # The text states these numbers.
    assert space["overshoot"](space["ms"]) == pytest.approx(5.0, abs=0.2)
    assert space["quiet"].deadband == 0.02
    assert space["low"] < pidalab.margins(space["heater"]).ms < space["high"]
    assert space["after"] == space["before"][1]
    plt.close("all")


def test_score_is_that_of_the_ledgers():
    """`python -m paperledger readme README.md` writes it."""
    assert score_markdown(ROOT / "book" / "ledger") in (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_landing_figure_matches_its_designs():
    """`python tools/landing_figure.py` draws the figure and writes its caption, with `--search` also its designs."""
    import landing_figure as landing

    state, (gain, sample) = landing.stored(), landing.units()
    many = landing.medians()
    assert state.pop("median") == list(many.values())
    assert landing.markdown(state, many) in (ROOT / "book" / "intro.md").read_text(encoding="utf-8")
    t = np.linspace(0, 80, 8001)
    for k, limit in enumerate(landing.LIMITS):
        for kind, loop in landing.loops(state, k).items():
            assert pidalab.max_sensitivity(loop)[0] <= landing.MS + 1e-4
            assert pidalab.noise_gain(loop, sample) <= limit * gain * (1 + 1e-4)
            assert pidalab.load_response(loop, t).iae() == pytest.approx(state[kind][k][0], rel=1e-3)
