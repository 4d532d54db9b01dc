"""Check the pages across the papers: tables match the library, and sentences match the tables."""

import importlib
import re

import pytest


@pytest.fixture(scope="module")
def pages():
    """Return the modules of the pages."""
    return {
        name: importlib.import_module(name)
        for name in ("tables", "words", "recompute", "frontier_words", "plant_map")
    }


def test_tables_are_what_the_library_computes(pages):
    """Recompute a random hundredth of the rows. A failure names its seed."""
    assert "agree" in pages["recompute"].drift(share=1e-2, searched=1)


def test_every_plant_of_the_batch_has_a_class(pages):
    table = pages["tables"].plants()
    assert len(table) == 134
    assert table["class"].notna().all()
    assert (table[table["family"] == "P6"]["class"] == "integrating").all()


def test_every_rule_has_a_row_for_every_plant(pages):
    """A row has measures, an unstable loop, or a reason."""
    tables = pages["tables"]
    counts = tables.served()[["refused", "stable", "unstable loop"]].sum(axis=1)
    assert set(counts) == {tables.read("comparison")["plant"].nunique()}
    rows = tables.read("comparison")
    assert rows[rows["iae_load"].isna()]["reason"].notna().all()


def test_no_rule_beats_the_optimum_at_equal_terms(pages):
    for terms in ("quiet", "loud"):
        assert pages["tables"].compared(terms)["of_kind"].min() > 0.995


def test_conclusions_follow_from_the_numbers(pages, monkeypatch):
    """If acceleration saved nothing, the page would say so."""
    tables, words = pages["tables"], pages["words"]
    assert list(words.acceleration()["acceleration"]) == ["pays on some", "pays", "pays"]
    honest = tables.frontier()
    monkeypatch.setattr(tables, "frontier", lambda: honest.assign(PIDA=honest["PID"]))
    table = words.acceleration()
    assert set(table["acceleration"]) == {"does not pay"}
    assert set(table["saves, noise loud"]) == {"0%"}


def test_map_and_table_agree(pages):
    """A cell of the map recommends PIDA if PIDA saves at least a tenth, and if acceleration pays by the table."""
    tables, words, plant_map = pages["tables"], pages["words"], pages["plant_map"]
    table, study = plant_map.fields(), (tables.pays(), tables.compared("loud").dropna(subset=["of_best"]))
    verdicts = words.acceleration()["acceleration"]
    for (row, _), some in table.groupby(["row", "column"]):
        facts = plant_map.facts(some, study)
        kind, median = facts["kinds"]["loud"], facts["saves"]["loud"][0]
        assert (kind == "PIDA") == (median >= tables.WORTH)
        if verdicts.iloc[row // 2] == "pays":
            assert kind == "PIDA"
        advice = plant_map.advice(facts["rule"], facts["distance"])
        assert ("use the optimum" in advice) == (1 - 1 / facts["distance"] >= tables.WORTH)


@pytest.mark.parametrize("ms", [1.4, 2.0])
def test_the_frontier_is_monotonic(pages, ms):
    """Within 1 %, higher orders and more noise never raise the IAE."""
    table = pages["frontier_words"].curves(ms)
    assert len(table) == 13 * 4 * 7
    wide = table.pivot_table(index=["plant", "noise_limit"], columns="order", values="iae").dropna()
    assert (wide[[1, 2, 3]].to_numpy() <= 1.01 * wide[[0, 1, 2]].to_numpy()).all()
    for _, curve in table.dropna(subset=["iae"]).sort_values("noise_limit").groupby(["plant", "order"]):
        assert (curve["iae"].to_numpy()[1:] <= 1.01 * curve["iae"].to_numpy()[:-1]).all()


def test_a_field_of_the_map_opens_the_lab_with_its_plant(site, lab):
    page = lab()
    html = (site / "book" / "across" / "which-controller.html").read_text(encoding="utf-8")
    links = re.findall(r'href="\.\./lab\.html(#lab-[\w-]+)"', html)
    assert len(links) == html.count('class="map-panel"') > 10
    states = [page.evaluate("(hash) => pidalabModel.read(hash)", link) for link in links]
    assert all(state["designs"][0]["kind"] in ("PI", "PID", "PIDA") for state in states)
    page.evaluate("(hash) => { location.hash = hash }", links[0])
    page.wait_for_function("() => document.querySelectorAll('.lab-numbers').length === 2")
    assert page.get_by_label("plant", exact=True).input_value() == "given"


def test_the_answer_table_fits_a_phone(site, visit):
    """The answer table is the first table of the page on all plants."""
    page, _ = visit(
        (site / "book" / "across" / "which-controller.html").as_uri(), viewport={"width": 390, "height": 844}
    )
    cells = page.locator(".answer-table td").all()
    assert len(cells) == 3 * 4
    assert max(box["x"] + box["width"] for box in (cell.bounding_box() for cell in cells)) <= 390


def test_the_landing_page_follows_the_noise_slider(site, visit):
    page, wrong = visit((site / "book" / "intro.html").as_uri())
    bar, words = page.get_by_label("Noise allowed"), page.locator(".landing-side .lab-live")
    saved = []
    for k in (0, 5, 11):
        bar.fill(str(k))
        saved.append(int(re.search(r"saves (\d+) %", words.inner_text())[1]))
    assert 0 < saved[0] < saved[1] < saved[2] < 50
    assert "PI and PID cannot use this much noise." in words.inner_text()
    bar.fill("1")
    assert "IAE" in words.inner_text()
    assert words.inner_text().endswith("PI cannot use this much noise.")
    dot = page.locator(".pidalab-landing .lab-handle")
    dot.hover()
    page.mouse.down()
    page.mouse.move(0, dot.bounding_box()["y"])
    page.mouse.up()
    assert f"saves {saved[0]} %" in words.inner_text()
    assert wrong == []


def test_numbers_in_coloured_cells_are_legible_in_dark_mode(site, visit):
    drawn = [p for p in (site / "_images").glob("*-dark.svg") if 'id="as-drawn"' in p.read_text("utf-8")]
    assert drawn
    for path in drawn:
        page, _ = visit(path.as_uri())
        fills = (
            "() => [...document.querySelectorAll('#as-drawn text')].map(text => getComputedStyle(text).fill)"
        )
        assert set(page.evaluate(fills)) == {"rgb(17, 17, 17)", "rgb(255, 255, 255)"}
