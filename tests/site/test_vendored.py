"""Every third-party file that the site carries has its project, its version and its licence."""

import re

import pytest
import vendored


def test_the_notice_covers_every_file_of_the_site(site):
    found = vendored.components(vendored.table(), site)
    assert (site / vendored.NOTICE).read_text(encoding="utf-8") == vendored.notice(found)
    assert {name for one in found for name in one["files"]} == set(vendored.carried(site))
    assert all(re.fullmatch(r"[\d.]+", one["version"]) for one in found)


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
    assert [one["version"] for one in vendored.components([row], site)] == ["1.2"]
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
