"""The document that is printed: its links lead to places in it, its pictures are there, answers stand at the end."""

import pdf
import pytest
from bs4 import BeautifulSoup

PAGES = {"book/a", "book/audit/b"}


@pytest.mark.parametrize(
    ("address", "target"),
    [
        ("#x", "#book/a--x"),
        ("audit/b.html", "#book/audit/b"),
        ("audit/b.html#x%20y", "#book/audit/b--x y"),
        ("audit/b.html#lab-eyJ9", "#book/audit/b"),  # a design in the lab
        ("../genindex.html", None),
        ("https://example.org/a.html", "https://example.org/a.html"),
    ],
)
def test_links_stay_in_the_document_or_go(address, target):
    assert pdf.inside("book/a", address, PAGES) == target


def test_a_fold_is_open_on_paper():
    fold = "<details><summary>a</summary><p>why</p></details>"
    row = f"<table><tr><td class='verdict'>holds</td><th>{fold}</th></tr></table>"
    claim = BeautifulSoup(row, "html.parser")
    pdf.unfold(claim.details)
    assert claim.th.get_text(" ") == "a why"
    whole = BeautifulSoup(f"<details><summary>All rows</summary>{row}</details>", "html.parser")
    pdf.unfold(whole.details)
    assert whole.get_text() == "All rows are in the audit."


@pytest.mark.parametrize(
    ("inside", "left"),
    [
        ("<div class='pidalab-live' data-live='{\"caption\": \"Two.\"}'><p>x</p></div>", " Two."),
        ("<div class='pidalab-live'><script type='application/json'>{\"a\": 1}</script></div>", ""),
    ],
)
def test_a_live_figure_without_a_picture_leaves_its_caption(inside, left):
    live = BeautifulSoup(inside, "html.parser").div
    pdf.still(live)
    assert live.get_text() == "In the online book a live figure appears here." + left


def test_a_live_figure_with_a_picture_leaves_it():
    live = BeautifulSoup("<div class='pidalab-live'><img src='a.svg'></div>", "html.parser").div
    pdf.still(live)
    assert live.img is not None


def test_the_joined_document(site, monkeypatch):
    some = ["book/learn/what-acceleration-does", "book/lab"]
    monkeypatch.setattr(pdf, "parts", lambda: [("", ["book/intro"]), ("Learn", some)])
    soup = pdf.joined("1.2.3")
    assert pdf.faults(soup) == []
    anchors = {place["id"] for place in soup.select("[id]")}
    assert {"book/intro", *some, "answers"} <= anchors
    assert soup.select("details, .only-dark, button, article script") == []
    answers = soup.select("div.solution")
    assert answers
    assert all(answer.find_parent(id="answers") for answer in answers)


def test_a_link_without_a_place_and_a_picture_without_a_file(site):
    bad = BeautifulSoup(
        "<a href='#gone'>x</a><img src='gone.svg'><p id='here'><a href='#here'>y</a></p>", "html.parser"
    )
    assert pdf.faults(bad) == ["#gone leads nowhere", "gone.svg is not there"]
