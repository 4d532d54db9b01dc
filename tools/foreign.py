"""Tune controllers for public plant records in a folder, and write the results as a table.

foreign.toml lists the records with their sources and columns.
"""

from __future__ import annotations

import argparse
import csv
import math
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import pidalab

LIST = Path(__file__).with_suffix(".toml")
ABOUT = ("repository", "commit", "path", "plant", "sign", "remark")
FOUND = ("samples", "experiment", "model", "gain", "nrmse", "holdout", "ms", "ms_worst", "price", "result")


def listed() -> Iterator[tuple[str, dict[str, str], dict[str, Any]]]:
    """Yield the path in the folder, the source and the options of each record."""
    for source in tomllib.loads(LIST.read_text(encoding="utf-8"))["source"]:
        for name, known in source["records"].items():
            about = {key: str(known.get(key, source.get(key, ""))) for key in ABOUT}
            yield f"{source['folder']}/{name}", about, {k: v for k, v in known.items() if k not in ABOUT}


def read(path: Path, options: dict[str, Any]) -> pidalab.Record:
    """Read a record from a text file, or from a Matlab file whose arrays are the columns in order."""
    if path.suffix != ".mat":
        return pidalab.Record.read_csv(path, **options)
    from scipy.io import loadmat

    arrays = [value for name, value in loadmat(path).items() if not name.startswith("__")]
    columns = np.column_stack(arrays).astype(float)
    return pidalab.Record(
        options["period"] * np.arange(len(columns)), columns[:, options["u"]], columns[:, options["y"]]
    )


def tried(path: Path, options: dict[str, Any], kind: str) -> dict[str, object]:
    """Read a record, fit a model and tune. Return the results, or the reason of a refusal."""
    row: dict[str, object] = {}
    try:
        record = read(path, options)
        row |= {"samples": record.t.size, "experiment": record.experiment}
        fit = pidalab.identification.fit(record)
        row |= {"model": fit.model, "gain": f"{fit.parameters['gain']:.3g}", "nrmse": f"{fit.nrmse:.2f}"}
        row["holdout"] = "" if math.isnan(fit.holdout) else f"{fit.holdout:.2f}"
        design = pidalab.tune(fit, kind, sample_time=record.sampling)
        row |= {"ms": f"{design.ms_sampled:.2f}", "ms_worst": f"{design.ms_worst:.2f}"}
        row |= {"price": f"{design.price:.2f}", "result": f"a {kind}"}
    except ValueError as refusal:
        row["result"] = f"refused: {' '.join(str(refusal).split()).removeprefix(f'{path.name} ')}"
    return row


def main() -> None:
    """Write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, required=True, help="CSV file")
    parser.add_argument("--kind", default="PID")
    given = parser.parse_args()
    with given.out.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, ABOUT + FOUND, lineterminator="\n")
        table.writeheader()
        for where, about, options in listed():
            row = about | tried(given.folder / where, options, given.kind)
            table.writerow(row)
            file.flush()
            print(f"{where}: {row['result']}", flush=True)


if __name__ == "__main__":
    main()
