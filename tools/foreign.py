"""Tune on plant records of others, which lie in a folder, and write what came of each as a table.

The records are listed with their sources and columns in foreign.toml. They are not part of this repository.
"""

from __future__ import annotations

import argparse
import csv
import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

import pidalab

LIST = Path(__file__).with_suffix(".toml")
HEAD = [
    "repository", "commit", "path", "samples", "experiment", "model", "nrmse", "holdout", "ms", "ms_worst", "price",
    "result",
]  # fmt: skip


def read(path: Path, options: dict[str, Any]) -> pidalab.Record:
    """Read a record from a text file, or from a Matlab file whose columns are those of its arrays, in order."""
    if path.suffix != ".mat":
        return pidalab.Record.read_csv(path, **options)
    from scipy.io import loadmat

    arrays = [value for name, value in loadmat(path).items() if not name.startswith("__")]
    columns = np.column_stack(arrays).astype(float)
    return pidalab.Record(
        options["period"] * np.arange(len(columns)), columns[:, options["u"]], columns[:, options["y"]]
    )


def tried(path: Path, options: dict[str, Any], kind: str) -> dict[str, object]:
    """Go from a file to a design as far as it goes."""
    row: dict[str, object] = {}
    try:
        record = read(path, options)
        row |= {"samples": record.t.size, "experiment": record.experiment}
        fit = pidalab.identification.fit(record)
        row |= {"model": fit.model, "nrmse": f"{fit.nrmse:.2f}"}
        row["holdout"] = "" if math.isnan(fit.holdout) else f"{fit.holdout:.2f}"
        design = pidalab.tune(fit, kind, sample_time=record.sampling)
        info = design.info
        row |= {name: f"{info[name]:.2f}" for name in ("ms", "ms_worst", "price") if name in info}
        row["result"] = f"a {kind}"
    except ValueError as refusal:
        row["result"] = f"refused: {' '.join(str(refusal).split())}"
    return row


def main() -> None:
    """Write the table row by row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, required=True, help="CSV file")
    parser.add_argument("--kind", default="PID")
    given = parser.parse_args()
    with given.out.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, HEAD, lineterminator="\n")
        table.writeheader()
        for source in tomllib.loads(LIST.read_text(encoding="utf-8"))["source"]:
            for name, options in source["records"].items():
                row = tried(given.folder / source["folder"] / name, options, given.kind)
                row |= {"repository": source["repository"], "commit": source["commit"], "path": name}
                table.writerow(row)
                file.flush()
                print(f"{name}: {row['result']}", flush=True)


if __name__ == "__main__":
    main()
