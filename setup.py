"""Complete the links of the README for a package index, which pyproject.toml cannot do."""

import re
import tomllib
from pathlib import Path

from setuptools import setup

ROOT = Path(__file__).parent
TARGET = re.compile(r'(\]\(|(?:src|srcset)=")(?!https?://|#|mailto:)([^)"]+)')
PICTURES = (".svg", ".png")


def standing(readme: str, repository: str) -> str:
    """Return the README with a full address for every link into the repository."""

    def full(found: re.Match[str]) -> str:
        kind = "raw" if found[2].endswith(PICTURES) else "blob"
        return f"{found[1]}{repository}/{kind}/main/{found[2]}"

    return TARGET.sub(full, readme)


if __name__ == "__main__":
    urls = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["urls"]
    setup(
        long_description=standing((ROOT / "README.md").read_text(encoding="utf-8"), urls["Repository"]),
        long_description_content_type="text/markdown",
    )
