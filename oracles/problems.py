"""The problems of an oracle, which are stored in its file with the answers."""

import json
from collections.abc import Callable, Iterator
from multiprocessing import Pool
from pathlib import Path

ANSWERS = ("values", "envelope", "unstable_poles", "poles", "y", "u")
FINER = 8  # points in a dead time for the envelope of a growing response


def file_of(script: str) -> Path:
    """Return the file that a script makes."""
    name = Path(script).stem.removeprefix("make_")
    return Path(__file__).parents[1] / "tests" / "oracle" / f"{name}.json"


def problems(script: str) -> Iterator[dict]:
    """Return the cases without their answers.

    A case of an optimum has first digits in `start`, and a growing response has `envelope_times`.
    """
    for case in json.loads(file_of(script).read_text(encoding="utf-8"))["cases"]:
        asked = {
            k: v for k, v in case.items() if k not in ANSWERS and not (isinstance(v, dict) and "values" in v)
        }
        if "envelope" in case:
            asked["envelope_times"] = [k / FINER * case["delay"] for k in range(20 * FINER + 1)]
        if "ms" in case and "values" in case:
            asked["start"] = {key: rough(found) for key, found in case["values"].items()}
        yield asked


def rough(found):
    """Convert a text, or each of several, to a number with six digits."""
    return [rough(one) for one in found] if isinstance(found, list) else float(f"{float(found):.6g}")


def store(script: str, digits: int, solve: Callable[[dict], tuple[dict, str]], **more: object) -> None:
    """Solve all cases and write the file. `solve` returns the case with its values, and a line of evidence to print."""
    done = []
    with Pool(2) as pool:
        for case, line in pool.imap(solve, problems(script)):
            print(line, flush=True)
            done.append(case)
    about = f"Made by {Path(script).name}, which says how; see README.md for the format."
    content = json.dumps({"about": about, "digits": digits} | more | {"cases": done}, indent=1)
    file_of(script).write_text(content + "\n", encoding="utf-8")


def rational(num, den):
    """Return a block with coefficients in descending powers."""
    return {"num": [float(x) for x in num], "den": [float(x) for x in den]}


def poly(*factors):
    """Return the product of polynomials."""
    out = [1]
    for factor in factors:
        new = [0] * (len(out) + len(factor) - 1)
        for i, x in enumerate(out):
            for j, y in enumerate(factor):
                new[i + j] += x * y
        out = new
    return out


def add(p, q):
    """Return the sum of two polynomials in descending powers."""
    n = max(len(p), len(q))
    return [x + y for x, y in zip([0] * (n - len(p)) + p, [0] * (n - len(q)) + q, strict=True)]
