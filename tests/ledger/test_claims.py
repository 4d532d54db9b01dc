"""Every claim can fail: the stored tables are complete, and a part is run again; planted faults have their place."""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path
from random import Random
from zlib import crc32

import pytest

from pidalab.ledger import papers, read_rows
from pidalab.ledger.running import has_checks

ROOT = Path(__file__).parents[2]
LEDGERS, TABLES = ROOT / "book" / "ledger", ROOT / "tests" / "claims"
PAPERS = [paper for paper in papers(LEDGERS) if has_checks(paper, LEDGERS)]
sys.path.insert(0, str(ROOT / "tools"))


def table(name):
    with (TABLES / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("paper", PAPERS)
def test_every_claim_was_seen_red(paper):
    """`make claims` writes the table."""
    claims = [row.id for row in read_rows(LEDGERS / f"{paper}.csv") if row.basis != "reading"]
    assert [line["id"] for line in table(paper)] == claims


def test_a_claim_turns_red_again():
    """One section, chosen anew whenever a ledger changes: its claims turn red under the disturbances of the table."""
    seed = crc32(b"".join((LEDGERS / f"{paper}.csv").read_bytes() for paper in PAPERS))
    random = Random(seed)
    paper = random.choice(PAPERS)
    chosen = random.choice(table(paper))
    print(f"seed {seed}: {chosen}")
    script = [sys.executable, str(ROOT / "tools" / "claims.py"), "--look", chosen["turned red by"]]
    plain = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "MPLBACKEND": "Agg", "PYTHONWARNINGS": "ignore"}
    done = subprocess.run(
        [*script, paper, chosen["section"]],
        capture_output=True,
        text=True,
        check=True,
        env=plain,
        timeout=250,
    )
    assert chosen["id"] in json.loads(done.stdout.splitlines()[-1])["red"]


def test_faults_still_have_their_place():
    from faults import FAULTS

    for fault in FAULTS:
        text = (ROOT / "src" / "pidalab" / fault.file).read_text(encoding="utf-8")
        for old, _ in fault.changes:
            assert text.count(old) == 1, f"{fault.name}: {old!r}"


def test_every_fault_is_noticed():
    """`make faults` writes the table: a chapter that stands on a part turns red when the part is wrong."""
    from faults import FAULTS

    lines = table("faults")
    assert {line["fault"] for line in lines} == {fault.name for fault in FAULTS}
    assert [line for line in lines if not line["one of them"]] == []
