"""Write `.zenodo.json` and `codemeta.json`, what archives read about the project, from pyproject.toml and CITATION.cff.

``python tools/metadata.py`` after a change of either; a test holds the files against them.
"""

import json
import tomllib
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[1]


def described() -> dict[str, dict]:
    """Content of both files."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    authors = [one["name"] for one in project["authors"]]
    papers = [f"https://doi.org/{one['doi']}" for one in citation["references"] if "doi" in one]
    urls = project["urls"]
    zenodo = {
        "title": f"{project['name']}: {project['description']}",
        "upload_type": "software",
        "version": project["version"],
        "license": project["license"],
        "creators": [{"name": name} for name in authors],
        "keywords": project["keywords"],
        "description": citation["abstract"],
        "related_identifiers": [
            {"identifier": urls["Repository"], "relation": "isSupplementTo"},
            *({"identifier": paper, "relation": "references"} for paper in papers),
        ],
    }
    codemeta = {
        "@context": "https://w3id.org/codemeta/3.0",
        "@type": "SoftwareSourceCode",
        "name": project["name"],
        "description": project["description"],
        "version": project["version"],
        "license": f"https://spdx.org/licenses/{project['license']}",
        "author": [{"@type": "Organization", "name": name} for name in authors],
        "keywords": project["keywords"],
        "codeRepository": urls["Repository"],
        "url": urls["Documentation"],
        "issueTracker": urls["Issues"],
        "programmingLanguage": "Python",
        "runtimePlatform": f"Python {project['requires-python']}",
        "softwareRequirements": [one.split(";")[0] for one in project["dependencies"]],
        "referencePublication": papers,
    }
    return {".zenodo.json": zenodo, "codemeta.json": codemeta}


def text(content: dict) -> str:
    """Write one of them out."""
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    for name, content in described().items():
        (ROOT / name).write_text(text(content), encoding="utf-8")
