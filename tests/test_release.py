"""Check that published metadata agree. `make release` also installs and uses the wheel."""

import importlib.util
import json
import re
import tomllib
from pathlib import Path

import pytest
import vendored
import yaml

from paperledger import papers
from paperledger.running import missing

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


SPEC = importlib.util.spec_from_file_location("setup", ROOT / "setup.py")
setup = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(setup)


def test_the_readme_is_valid_on_a_package_index():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert setup.TARGET.search(readme)
    standing = setup.standing(readme, PROJECT["urls"]["Repository"])
    assert not setup.TARGET.search(standing)
    files = re.findall(rf"{PROJECT['urls']['Repository']}/(?:raw|blob)/main/([^)\"#]+)", standing)
    assert len(files) > 4
    assert [name for name in files if not (ROOT / name).is_file()] == []
    # PyPI does not typeset formulas.
    assert "$$" not in readme


def test_repository_addresses_agree():
    repository = yaml.safe_load((ROOT / "_config.yml").read_text(encoding="utf-8"))["sphinx"]["config"][
        "html_theme_options"
    ]["repository_url"]
    urls = PROJECT["urls"]
    assert urls["Repository"] == repository
    assert urls["Issues"] == f"{repository}/issues"
    assert urls["Changelog"] == f"{repository}/blob/main/CHANGELOG.md"


def test_one_version():
    """The version is semantic, cited, and the newest of the changelog."""
    version = PROJECT["version"]
    assert re.fullmatch(r"\d+\.\d+\.\d+", version)
    assert yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))["version"] == version
    releases = re.findall(
        r"^## \[(.+?)\]", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), flags=re.MULTILINE
    )
    released = [name for name in releases if name != "Unreleased"]
    assert released[0] == version
    numbers = [tuple(map(int, name.split("."))) for name in released]
    assert numbers == sorted(set(numbers), reverse=True)
    assert "Unreleased" not in releases[1:]


def test_actions_are_named_by_their_commit():
    """A tag could be moved to other code."""
    for path in (ROOT / ".github" / "workflows").glob("*.yml"):
        used = re.findall(r"uses: (\S+)", path.read_text(encoding="utf-8"))
        assert used
        assert [action for action in used if not re.fullmatch(r"[\w-]+/[\w-]+@[0-9a-f]{40}", action)] == []


def test_the_lock_for_readers_is_a_part_of_the_other():
    """Both locks have hashes and the same versions. Only one has packages for tests and tools."""
    locks = [
        (ROOT / name).read_text(encoding="utf-8") for name in ("requirements.txt", "requirements-dev.txt")
    ]
    reader, developer = (set(re.findall(r"^[\w.-]+==[^ ]+", text, flags=re.MULTILINE)) for text in locks)
    assert reader < developer
    assert not {requirement.split("==")[0] for requirement in reader} & {
        "pytest",
        "playwright",
        "mini-racer",
        "mypy",
        "symengine",
    }
    for text in locks:
        assert text.count("==") <= text.count("--hash=sha256:")
        assert "://" not in text


def test_every_licence_of_the_site_has_its_text():
    asked = {name for row in vendored.table() for name in row["licence"].split(" AND ")}
    assert {*vendored.texts(), *vendored.LINKED} == asked


@pytest.mark.parametrize("paper", papers(ROOT / "book" / "ledger"))
def test_a_paper_is_named_wherever_a_book_needs_it(paper):
    assert missing(paper, ROOT / "book" / "ledger") == []


def test_the_colab_notebook_runs(capsys, monkeypatch):
    """The first cell clones the repository in pyproject.toml. The others run in a clone."""
    cells = json.loads((ROOT / "colab.ipynb").read_text(encoding="utf-8"))["cells"]
    first, *others = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    assert f"clone --quiet --depth 1 {PROJECT['urls']['Repository']}\n" in first
    monkeypatch.chdir(ROOT / "book")
    for source in others:
        exec(compile(source, "colab.ipynb", "exec"), {})
    assert "gain margin" in capsys.readouterr().out
