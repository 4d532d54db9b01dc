"""What the library answered when it was last asked: how an answer is written down, and when two are the same.

An answer that changes is no error by itself. It has to be seen, and explained where it is committed:

    python tests/kept/kept.py        # asks everything anew, and says which answers changed
"""

import dataclasses
import json
import math
import re
import sys
import warnings
from collections.abc import Mapping
from pathlib import Path

import control
import numpy as np

from pidalab import Process

FOLDER = Path(__file__).parent
DIGITS = 10  # that are kept of a number
SAME = (
    1e-6  # difference of two numbers, relative to their size or a thousandth of the largest of their answer
)
SOUGHT = {
    "records": 1e-5,
    "files": 1e-5,
    "moving": 1e-5,
    "optima": 1e-4,
}  # the same of numbers that a search ends in
ROUNDING = 1e-9  # difference of two numbers in words that is none
LONG = 12  # numbers of a signal that are kept, from its beginning to its end
OTHERS = re.compile(r"TransferFunction\(\n.*?inputs=1\)", re.DOTALL)  # as python-control writes them
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def leaves(value):
    """Flatten an answer into numbers and words."""
    if value is None or isinstance(value, (str, bool, np.bool_)):
        return [str(value)]
    if isinstance(value, (int, float, np.number)):
        return [complex(value).real, complex(value).imag] if np.iscomplexobj(value) else [float(value)]
    if isinstance(value, np.ndarray):
        flat = value.ravel()
        kept = flat if flat.size <= LONG else flat[np.linspace(0, flat.size - 1, LONG).astype(int)]
        return [float(flat.size), *(leaf for one in kept for leaf in leaves(one))]
    if isinstance(value, Mapping):
        return [leaf for name, one in value.items() for leaf in (str(name), *leaves(one))]
    if isinstance(value, Process):
        return leaves([value.num, value.den, value.delay])
    if isinstance(value, control.TransferFunction):
        return leaves([value.num[0][0], value.den[0][0], value.dt])
    if isinstance(value, (list, tuple)):
        return [leaf for one in value for leaf in leaves(one)]
    if dataclasses.is_dataclass(value):
        names = [field.name for field in dataclasses.fields(value) if not field.name.startswith("_")]
        return [leaf for name in names for leaf in leaves(getattr(value, name))]
    return [repr(value)]


def written(leaf):
    """A leaf as it stands in the file."""
    if isinstance(leaf, str):
        return OTHERS.sub("a block", leaf)
    return float(f"{leaf:.{DIGITS}g}")


def answer(question):
    """Ask, and write down what came: leaves, a refusal, and what was warned of."""
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            found = [written(leaf) for leaf in leaves(question())]
        except (ValueError, TypeError, ArithmeticError, AttributeError, MemoryError) as refusal:
            found = [written(f"{type(refusal).__name__}: {refusal}")]
    own = [
        one for one in warned if issubclass(one.category, UserWarning)
    ]  # others come and go with NumPy and SciPy
    return found + [written(f"{one.category.__name__}: {one.message}") for one in own]


def refused(call):
    """Return what a call answers, or why it refuses: for one answer of several."""
    try:
        return call()
    except ValueError as refusal:
        return str(refusal)


def _same_words(old, new):
    """Whether two texts differ at most by a unit in the last place of their numbers."""
    if NUMBER.split(old) != NUMBER.split(new):
        return False
    pairs = zip(NUMBER.findall(old), NUMBER.findall(new), strict=True)
    return all(one == other or ("." in one and _next_to(one, other)) for one, other in pairs)


def _next_to(one, other):
    """Whether two numbers differ by a unit of the last place, or by rounding."""
    digits, _, power = one.partition("e")
    unit = 10.0 ** (int(power or 0) - len(digits.partition(".")[2]))
    return abs(float(one) - float(other)) < max(1.01 * unit, ROUNDING)


def same(old, new, subject=""):
    """Whether two answers are the same, to the digits that a subject has."""
    if len(old) != len(new):
        return False
    sizes = [abs(leaf) for leaf in old if not isinstance(leaf, str) and math.isfinite(leaf)]
    share, least = SOUGHT.get(subject, SAME), 1e-3 * max(sizes, default=0.0)
    for one, other in zip(old, new, strict=True):
        if isinstance(one, str) or isinstance(other, str):
            if not (isinstance(one, str) and isinstance(other, str) and _same_words(one, other)):
                return False
        elif not (
            one == other
            or (math.isnan(one) and math.isnan(other))
            or abs(one - other) <= share * max(abs(one), least)
        ):
            return False
    return True


def path(subject):
    return FOLDER / f"{subject}.json"


def load(subject):
    """Return the answers of before."""
    return json.loads(path(subject).read_text(encoding="utf-8")) if path(subject).is_file() else {}


def main():
    """Ask everything anew."""
    from asked import SUBJECTS

    for subject, questions in SUBJECTS.items():
        old, new = load(subject), {name: answer(question) for name, question in questions().items()}
        for name in sorted(old.keys() | new.keys()):
            if name not in old or name not in new or not same(old[name], new[name], subject):
                print(f"{subject}: {name}")
        kept = {
            name: old[name] if name in old and same(old[name], one, subject) else one
            for name, one in new.items()
        }
        lines = (f"{json.dumps(name)}: {json.dumps(one, ensure_ascii=False)}" for name, one in kept.items())
        path(subject).write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
