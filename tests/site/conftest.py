"""What the tests of the book share: where the built site is, and which pages the table of contents names."""

from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]


def toc_pages(toc: Path) -> list[str]:
    """Every page that a table of contents names, in its order."""

    def walk(node):
        if isinstance(node, list):
            for item in node:
                yield from walk(item)
        elif isinstance(node, dict):
            yield from (node[key] for key in ("root", "file") if key in node)
            for value in node.values():
                yield from walk(value)

    return list(walk(yaml.safe_load(toc.read_text())))


def pytest_generate_tests(metafunc):
    if "page_name" in metafunc.fixturenames:
        metafunc.parametrize("page_name", toc_pages(ROOT / "_toc.yml"))


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT


@pytest.fixture(scope="session")
def toc() -> list[str]:
    return toc_pages(ROOT / "_toc.yml")


@pytest.fixture(scope="session")
def site() -> Path:
    built = ROOT / "_build" / "html"
    if not (built / "index.html").exists():
        pytest.fail("there is no built site in _build/html: run `make book` first")
    return built
