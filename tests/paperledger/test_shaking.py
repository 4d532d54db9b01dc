"""Perturb a library: computed numbers change, and copied numbers are detected."""

import json
import os
import re
import sys
from contextlib import redirect_stdout
from multiprocessing import get_context

import numpy as np
import pytest
from demo_ledger import write_notebook

from paperledger import Row, read_rows, update, write_rows
from paperledger.shake import Shaker, shake

LIBRARY = '''
"""A library of one rule, with every kind of public name."""
from collections import namedtuple
from dataclasses import dataclass
from functools import cache, cached_property
from types import MappingProxyType

import numpy as np

Pair = namedtuple("Pair", "low high")

def tune(ms):
    """A rule."""
    assert ms > 1
    return Design(inner(ms), MappingProxyType({"ti": 2.8761 * ms}))

def inner(ms):
    return _factor() * ms ** 2

def number(x):
    return float(x)

def named(x):
    """It says which design is meant."""
    return number(x)

@cache
def _factor():
    return 0.70123456

@cache
def kept(x):
    return [0.3 * x, Pair(x, 2.0 * x)]

def poles(ms):
    return 3

def signal(n):
    return np.linspace(0.0, 2.0, n), 1j * np.ones(2)

def law(gain):
    def act(e):
        return gain * e
    return act

@dataclass(frozen=True)
class Design:
    kp: float
    info: MappingProxyType

    def __post_init__(self):
        object.__setattr__(self, "kp", number(self.kp))

    @property
    def doubled(self):
        return 2.0 * self.kp

    @cached_property
    def slow(self):
        return self.kp / 3.0

    @classmethod
    def made(cls, kp):
        return cls(kp, MappingProxyType({}))

    def __call__(self, s):
        return self.kp / (1.0 + s)
'''
SETUP = """from contextlib import suppress
import demolib
from paperledger import Ledger
book = Ledger.open("demo")
C, p = demolib.tune(1.4), book.printed
row = lambda id: book.row(id)
KP = 1.37"""
GUILTY = {  # a row that a page passes as computed, and the resulting message
    "typed": ("KP", "stays at 1.370000000"),
    "text": ("float(str(row('text').printed))", "stays at"),
    "own": ("p('own')", "is its own printed number"),
    "read": ("float(row('read').printed)", "is its own printed number"),
    "getattr": ("float(getattr(row('getattr'), 'pri' + 'nted'))", "is its own printed number"),
    "stored": ("float(row('stored').computed or 1.37)", "stays at"),
    "quotient": ("p('quotient') * C.kp / C.kp", "is its own printed number"),
    "nothing": ("p('nothing') + 0.0 * C.kp", "is its own printed number"),
    "other": ("p('own') * 1.001", "like the printed numbers: declare from-print"),
    "tenth": ("p('tenth') + 0.1 * (C.kp - p('tenth'))", "when only printed numbers change"),
    "tuned": ("C.kp * p('text') / 1.37", "when only printed numbers change"),
    "mixed": ("p('mixed') + 1e-3 * (C.kp - p('mixed'))", "like the printed numbers"),
    "round3": ("round(C.kp, 3)", "stays at 1.374000000"),
    "round6": ("round(C.kp, 6)", "is rounded"),
    "grid": ("C.kp // 0.01 * 0.01", "stays at"),
    "named": ("demolib.named(1.37)", "stays at 1.370000000"),
    "built": ("demolib.Design(1.37, {}).__dict__['kp']", "stays at 1.370000000"),
    "counted": ("demolib.poles(1.4)", "stays at 3"),
    "idle": ("C.kp", "so remove 'page' from 'made'"),
}
INNOCENT = {
    "kp": "C.kp",
    "ti": "C.info['ti']",
    "doubled": "C.doubled",
    "slow": "C.slow",
    "made": "demolib.Design.made(1.37).kp",
    "called": "C(0.5)",
    "kept": "demolib.kept(4.0)[0]",
    "pair": "demolib.kept(4.0)[1].high",
    "signal": "demolib.signal(3)[0][-1]",
    "complex": "abs(demolib.signal(3)[1][0])",
    "law": "demolib.law(2.0)(0.7)",
    "ratio": "demolib.inner(2.0) / demolib.inner(3.0)",
    "page": "3.0 ** 0.5",
    "print": "p('kp') * 2.0",
    "scaled": "C.kp * p('kp')",
}
MADE = {"page": "page: a square root", "idle": "page: nothing of the kind"}


@pytest.fixture
def library(project, monkeypatch):
    if not hasattr(os, "fork"):
        pytest.skip("shaking needs a system that can fork")
    (project / "demolib.py").write_text(LIBRARY, encoding="utf-8")
    monkeypatch.syspath_prepend(str(project))
    yield project
    sys.modules.pop("demolib", None)


def rows_of(values, **columns):
    made = {id: MADE.get(id, "") for id in values}
    basis = {"print": "from-print", "scaled": "from-print"}
    return [
        Row(
            f"demo.{id}", "Table 1", "gain", "1.37", basis=basis.get(id, "computed"), made=made[id], **columns
        )
        for id in values
    ]


def shaken(project, rows, *cells, stored=True):
    """Store the results of a page, then run it with a changed library."""
    write_rows(project / "book" / "ledger" / "demo.csv", rows)
    (project / "book" / "audit" / "demo.ipynb").unlink(missing_ok=True)
    write_notebook(project / "book" / "demo.ipynb", SETUP, *cells)
    if stored:
        update("demo")
    said = project / "said.txt"
    child = get_context("fork").Process(target=shake_demo, args=(said,))  # a fork has all imports
    child.start()
    child.join()
    return child.exitcode, said.read_text(encoding="utf-8")


def shake_demo(said):
    sys.modules.pop("demolib", None)
    with said.open("w", encoding="utf-8") as file, redirect_stdout(file):
        status = shake(Shaker("demolib", exact=frozenset({"demolib.named"})), None, ["demo"])
    sys.exit(status)


def test_computed_numbers_change(library):
    cells = [f"book.compare({{{id!r}: {code}}})" for id, code in INNOCENT.items()]
    status, said = shaken(library, rows_of(INNOCENT), *cells, "book.close()")
    assert said == "demo: 14 of 15 rows move, 1 need not move\n"
    assert status == 0


def test_each_copied_number_is_detected(library):
    cells = [f"b = book\nb.compare({{{id!r}: {code}}})" for id, (code, _) in GUILTY.items()]
    status, said = shaken(library, rows_of(GUILTY), *cells, "book.close()")
    assert status == 1
    lines = dict(re.findall(r"(?m)^  demo\.(\w+): (.*)$", said))
    assert {id: line for id, line in lines.items() if GUILTY[id][1] not in line} == {}
    assert lines.keys() == GUILTY.keys()
    assert "(demo, cell 2)" in lines["typed"]


def test_statements_change_too(library):
    made = {"s1": "", "s2": "", "s3": "", "s4": "count: poles"}
    relations = {"s1": "A < B", "s2": "A < B", "s3": "residual <= 1e-9 | rounding", "s4": "poles == three"}
    rows = [
        Row(f"demo.{id}", "sec. 1", "statement", "so it is", made=made[id], relation=relation)
        for id, relation in relations.items()
    ]
    cells = [
        "book.decide('s1', {'a': (C.kp, 2.0), 'b': (1.0, 2.0)})",
        "book.decide('s2', {'a': (1.0, 2.0)})",
        "book.decide('s3', C.doubled / C.kp - 2.0)",
        "book.decide('s4', (demolib.poles(1.4), 3))",
        "book.close()",
    ]
    _, said = shaken(library, rows, *cells)
    assert re.findall(r"(?m)^  (demo\.\w+: stays)", said) == ["demo.s2: stays"]
    assert said.startswith("demo: 2 of 4 rows move, 1 need not move, 1 refused")


@pytest.mark.parametrize(
    ("cell", "said"),
    [
        ("with suppress(ValueError):\n    book.compare({'nobody': 1.0})", "nobody: unknown id"),
        ("1 / 0", "cell 3 stops: ZeroDivisionError"),
        ("raise SystemExit", "cell 3 stops: SystemExit"),
        ("import os; os._exit(0)", "its process died"),
        ("%%script true\nbook.compare({'kp': 1.0})", "cell 3 stops: SyntaxError"),
    ],
)
def test_a_page_that_stops_is_refused(library, cell, said):
    rows = rows_of(["kp"], computed="1.374419738", verdict="reproduced", page="demo")
    status, output = shaken(library, rows, "book.compare({'kp': C.kp})", cell, "book.close()", stored=False)
    assert status == 1
    assert said in output


def test_nothing_is_written_beside_the_library(library):
    shaken(library, rows_of(["kp"]), "book.compare({'kp': C.kp})", "book.close()")
    assert read_rows(library / "book" / "ledger" / "demo.csv")[0].computed.startswith("1.3744")
    notebook = json.loads((library / "book" / "demo.ipynb").read_text(encoding="utf-8"))
    assert all(cell["outputs"] == [] for cell in notebook["cells"])


def test_reused_memory_addresses_are_not_confused():
    """Python may reuse an `id` as soon as its object is gone."""
    pair = type("Pair", (), {"__module__": "demo"})
    passing = {"Pair": lambda fields, off: [off(np.full(3, float(k)), "a field") for k in range(1, 9)]}
    fields = Shaker("demo", whole=passing).off(pair(), "door")
    assert np.array(fields).mean(axis=1) == pytest.approx(np.arange(1, 9), rel=1e-4)
