"""Plant gross errors in a copy of the library, one at a time, and see which row of each chapter turns red first.

A chapter is executed cell by cell. It turns red where its ledger refuses a value, and where a cell shows another number
than the stored one. ``book/data/faults.csv`` keeps what happened, for *How we know*.

    python tools/faults.py             # all faults, all chapters that hand over numbers
    python tools/faults.py Ms "IAE"    # only faults whose name contains one of these
"""

import builtins
import csv
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import textwrap
from pathlib import Path

ROOT = Path(__file__).parents[1]
TABLE = ROOT / "book" / "data" / "faults.csv"
# file of the library: what occurs there once -> what is planted; `met` returns its number, and notes that it was met
FAULTS = {
    "dead time of the exact engine 1 % too long": [
        "simulation/realisation.py: states.x0, loop.delay, settled -> states.x0, met(1.01) * loop.delay, settled",
    ],
    "output y of every response 1 % too high": [
        "simulation/exact.py: n=n, y=y, u=u, area=area -> n=n, y=met(1.01) * y, u=u, area=1.01 * area",
        "simulation/sampled.py: n=n, y=y, u=u, area=area -> n=n, y=met(1.01) * y, u=u, area=1.01 * area",
    ],
    "IAE, ITAE and ISE 1.5 % too high": [
        "response.py: float(self.step * np.sum(pieces)) -> float(met(1.015) * self.step * np.sum(pieces))",
        "response.py: self.step * np.sum(s * square) -> self.step * np.sum(s * square) * met(1.015)",
    ],
    "Ms 1 % too high": [
        "robustness/peaks_and_crossovers.py: return peak, where -> return met(1.01) * peak, where",
    ],
    "noise gain 2 % too small": ["simulation/noise.py: return largest * -> return met(0.98) * largest *"],
    "stable and unstable exchanged": [
        "robustness/poles.py: return unstable_poles(loop) == 0 -> return unstable_poles(loop) != met(0)",
    ],
    "filter ratio of the multiple dominant pole 2 % too large": [
        "rules/mrdp.py: return pole / ((n + 1) -> return met(1.02) * pole / ((n + 1)",
    ],
    "a sign in the system of the magnitude optimum": [
        "rules/magnitude_optimum/system.py: [Fraction(-1, 2), -> [Fraction(met(1), 2),",
    ],
    "a sign in Table 2 of heo2023": [
        "rules/itae.py: (2.055 + 0.072 * r) * xi -> (2.055 - met(0.072) * r) * xi"
    ],
    "reset of a series controller 2 % too slow": [
        "rules/automatic_reset.py: *gains, setting.ti * delay, -> *gains, met(1.02) * setting.ti * delay,",
    ],
    "acceleration time of haalman2024 2 % too long": [
        "rules/haalman.py: a3 / a1, n, ratio), ms) -> met(1.02) * a3 / a1, n, ratio), ms)",
    ],
}
Seen = dict[str, str | bool]


def chapters() -> dict[str, Path]:
    """Chapters that hand over numbers, by paper."""
    from paperledger import papers
    from paperledger.running import cells

    found = {paper: ROOT / "book" / f"{paper}.ipynb" for paper in papers(ROOT / "book" / "ledger")}
    return {paper: path for paper, path in found.items() if ".compare(" in "".join(cells(path))}


def plant(fault: str, library: Path) -> None:
    """Change a copy of the library; times and sizes of files stay, by which compiled code is kept."""
    for change in FAULTS[fault]:
        name, old, new = re.split(": | -> ", change, maxsplit=2)
        path = library / name
        text, stat = path.read_text(encoding="utf-8"), path.stat()
        if text.count(old) != 1:
            raise ValueError(f"{fault}: {old!r} occurs {text.count(old)} times in {name}")
        text = text.replace(old, new)
        for example in re.findall(r"(?m)^ +>>> .+", text):  # examples make room
            surplus = len(text.encode()) - stat.st_size
            text = text.replace(example, example[: max(8, len(example) - surplus)], 1) if surplus else text
        path.write_text(text, encoding="utf-8")
        os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))
        for stale in path.parent.glob(f"__pycache__/{path.stem}.*.pyc"):
            stale.unlink()


def first_red(path: Path) -> str:
    """Execute a chapter up to the first row, or cell, that is not as stored; empty if all are."""
    from paperledger import LedgerError
    from paperledger.running import execute

    stored = [cell["outputs"] for cell in json.loads(path.read_text("utf-8"))["cells"] if "outputs" in cell]
    number = 0
    try:
        for number, (outputs, new) in enumerate(zip(stored, execute(path), strict=True), start=1):
            plain = (out.get("text") or out.get("data", {}).get("text/plain", "") for out in outputs)
            texts = ["".join(text) for text in plain if "<Figure" not in "".join(text)]
            for was, now in differing("\n".join(texts), new):
                return f"cell {number}: {now} for {was}"
    except LedgerError as error:
        return str(error).split(": ")[0].partition(".")[2]
    except Exception as error:
        return f"cell {number + 1} stops: {textwrap.shorten(str(error), 60, placeholder=' …')}"
    return ""


def differing(old: str, new: str) -> list[tuple[str, str]]:
    """Numbers of two texts that differ, if all but the numbers is the same."""
    number = re.compile(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?")
    if number.sub("#", old).split() != number.sub("#", new).split():
        return []
    pairs = zip(number.findall(old), number.findall(new), strict=True)
    return [(a, b) for a, b in pairs if float(a) != float(b)]


def look(paths: list[Path]) -> list[Seen]:
    """Say of each chapter what turned red, and whether it met the fault; in a process of its own, on a copy."""
    import pandas as pd

    pd.set_option("display.max_columns", 20)  # as in a kernel
    met: list[float] = []
    builtins.met = lambda number: (met.append(number), number)[1]
    found = []
    for path in paths:
        met.clear()
        red = first_red(path)
        found.append({"red": red, "met": bool(met)})
    return found


def planted(fault: str, papers: dict[str, Path]) -> dict[str, Seen]:
    """Plant a fault in a copy of the library and look at chapters with it."""
    with tempfile.TemporaryDirectory() as folder:
        library = shutil.copytree(ROOT / "src", Path(folder, "src")) / "pidalab"
        plant(fault, library)
        fixed = {"PYTHONPATH": str(library.parent), "OPENBLAS_NUM_THREADS": "1", "PYTHONWARNINGS": "ignore"}
        command = [sys.executable, __file__, "--look", *map(str, papers.values())]
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=os.environ | fixed)
    return dict(zip(papers, json.loads(done.stdout.splitlines()[-1]), strict=True))


def noticed(fault: str, paper: str, seen: Seen) -> str:
    """Say what turned red first in a chapter, or else in an audit; empty if the chapter does not meet the fault."""
    from paperledger.running import pages

    audits = pages(paper, ROOT / "book" / "ledger")[1:] if seen["met"] and not seen["red"] else []
    for audit in audits:
        if red := planted(fault, {paper: audit})[paper]["red"]:
            return f"audit, {red}"
    return str(seen["red"] or ("nothing" if seen["met"] else ""))


def main(words: list[str]) -> int:
    """Plant faults and store what happened; 0 if every chapter that met one, or its audit, turned red."""
    if words[:1] == ["--look"]:
        print(json.dumps(look([Path(name) for name in words[1:]])))
        return 0
    rows = []
    for fault in (fault for fault in FAULTS if not words or any(word in fault for word in words)):
        for paper, seen in planted(fault, chapters()).items():
            red = noticed(fault, paper, seen)
            print(f"{fault}: {paper}: {red or 'does not meet it'}", flush=True)
            rows += [(fault, paper, red)] if red else []
    if not words:
        with TABLE.open("w", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([("fault", "paper", "first red"), *rows])
    return int(any(red == "nothing" for *_, red in rows))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
