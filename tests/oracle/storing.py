"""How the scripts that solve case after case store what they find."""

import json
from collections.abc import Callable, Iterable
from multiprocessing import Pool
from pathlib import Path


def store(script: str, digits: int, solve: Callable[[dict], tuple[dict, str]], cases: Iterable[dict]) -> None:
    """Solve all cases, print a line for each, and write the file that is named after the script."""
    path, done = Path(script), []
    with Pool(2) as pool:
        for case, line in pool.imap(solve, cases):
            print(line, flush=True)
            done.append(case)
    about = f"Made by {path.name}, which says how; see README.md for the format."
    content = json.dumps({"about": about, "digits": digits, "cases": done}, indent=1)
    path.with_name(path.stem.removeprefix("make_") + ".json").write_text(content + "\n")
