"""Every file of others that the site carries has its project, its version and its licence."""

import json
import re

import pytest
import vendored


def test_the_bill_of_the_site_is_that_of_its_files(site):
    found = vendored.components(vendored.table(), site)
    written = json.loads((site / vendored.BILL).read_text(encoding="utf-8"))
    assert written == json.loads(vendored.bill(found, site))
    assert (site / vendored.NOTICE).read_text(encoding="utf-8") == vendored.notice(found)
    listed = {file["name"] for one in written["components"] for file in one["components"]}
    assert listed == set(vendored.carried(site))
    assert all(re.fullmatch(r"[\d.]+", one["version"]) for one in written["components"])


@pytest.fixture
def small(tmp_path):
    """A site with one file of others, and the row for it."""
    (tmp_path / "_static").mkdir()
    (tmp_path / "_static" / "other.js").write_text("// other 1.2\n", encoding="utf-8")
    (tmp_path / "index.html").write_text("", encoding="utf-8")
    names = {"name": "other", "url": "https://example.org", "purl": "pkg:npm/other", "licence": "MIT"}
    where = {"file": "_static/other.js", "pattern": r"other ([\d.]+)"}
    return tmp_path, names | {"copyright": "2026 A", "files": ["_static/other*"], "version": where}


def test_a_file_that_nobody_claims(small):
    site, row = small
    assert [one.version for one in vendored.components([row], site)] == ["1.2"]
    (site / "_static" / "stray.js").write_text("", encoding="utf-8")
    with pytest.raises(ValueError, match=r"_static/stray\.js belongs to nobody"):
        vendored.components([row], site)


def test_a_project_that_is_gone_and_a_version_that_is_not_found(small):
    site, row = small
    with pytest.raises(ValueError, match="gone has no files"):
        vendored.components([row, row | {"name": "gone", "files": ["_static/gone.js"]}], site)
    with pytest.raises(ValueError, match="finds no version"):
        vendored.components([row | {"version": row["version"] | {"pattern": "v([0-9])"}}], site)
    with pytest.raises(ValueError, match="belongs to other and twin"):
        vendored.components([row, row | {"name": "twin"}], site)
