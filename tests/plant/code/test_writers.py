"""Put any text into written files: they compile, run or parse, and no text becomes code."""

import ast
import html.parser
import json
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import drawn
import pytest
from hypothesis import given, strategies as st
from st import Instance, read
from test_total import GCC, compiler

import pidalab
from pidalab import PIDA
from pidalab.digital import from_json
from pidalab.plant.code.files import LANGUAGES

K = PIDA(2.0, 4.0).discretise(0.5, limits=(0.0, 100.0), bias=40.0)
# Ends of comments, strings and lines of any language. Some are nested, so that removing one leaves another.
ENDS = ["*/", "*)", '"""', '*"""/', '"*/""', "**//", "(*", "/*", "\\", "??/", "//"]
ENDS += ["'''", "\\u002a/", "#include"]
ENDS += ["\n", "\r", "\u2028", "\x85", "\x1b", "\x00", "\ud800", "\u202e", "int x = 1;", "x = 1"]
ENDS += ["<script>", "&lt;", "]]>", "-->", "%>", "{{", "{%", "=cmd()"]
TEXTS = st.lists(st.one_of(st.sampled_from(ENDS), st.text(max_size=12)), max_size=12).map("".join)
WITHOUT = {language: getattr(K, language)() for language in LANGUAGES}


def body(code, language):
    """Return the code after the head."""
    end = {"c": "*/", "structured_text": "*)", "python": '"""'}[language]
    return code[code.index(end, 3) + len(end) :]


@drawn.cases(15)
@given(note=TEXTS, record=TEXTS, unit=TEXTS)
def test_text_stays_in_the_head(note, record, unit):
    written = {x: getattr(K, x)(note=note, record=record, time_unit=unit) for x in WITHOUT}
    for language, usual in WITHOUT.items():
        code = written[language]
        assert body(code, language) == body(usual, language)
        code.encode()
        assert not re.search(r"[\x00-\x09\x0b-\x1f\x7f\u2028\u2029\u202e]", code)
        ends = {"c": r"\*/|/\*", "structured_text": r"\(\*|\*\)", "python": r'"""|\\'}[language]
        assert len(re.findall(ends, code)) == len(re.findall(ends, usual))
    tree = ast.parse(written["python"])
    assert [type(x) for x in tree.body] == [type(x) for x in ast.parse(WITHOUT["python"]).body]
    space = {}
    exec(compile(tree, "loop.py", "exec"), space)
    assert space["selftest"]() == 0.0
    stored = K.json(note=note, record=record, time_unit=unit)
    assert from_json(stored) == K
    assert not [line for line in json.loads(stored)["about"] if re.search(r"[*<>\"\\]", line)]
    assert Instance(read(written["structured_text"]), "pida_selftest")().worst == 0.0


@drawn.cases(4)
@given(note=TEXTS, record=TEXTS, unit=TEXTS)
def test_c_compiles_to_the_same_and_tests_itself(note, record, unit):
    compiler()
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder, "loop.c")
        source.write_text(K.c(note=note, record=record, time_unit=unit), encoding="utf-8")
        subprocess.run([*GCC, "-DPIDA_SELFTEST", str(source), "-o", str(source) + "x", "-lm"], check=True)
        assert subprocess.run([str(source) + "x"], capture_output=True, check=False).returncode == 0
        if shutil.which("nm"):
            subprocess.run([*GCC, "-c", str(source), "-o", str(source) + "o"], check=True)
            symbols = subprocess.run(
                ["nm", "-g", str(source) + "o"], capture_output=True, text=True, check=True
            )
            assert sorted(re.findall(r" T (\w+)", symbols.stdout)) == ["pida_init", "pida_reset", "pida_step"]


class Tags(html.parser.HTMLParser):
    def __init__(self):
        super().__init__()
        self.found = []

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, sorted(name for name, _ in attrs)))


def tags(page):
    parser = Tags()
    parser.feed(page)
    return parser.found


@pytest.fixture(scope="module")
def report():
    return pidalab.report(pidalab.lags(3, delay=1.0), kinds=("PI",), rule="simc")


@drawn.cases(3)
@given(title=TEXTS, line=TEXTS)
def test_page_has_no_foreign_tag(report, title, line):
    title, line = (text.encode(errors="replace").decode() for text in (title, line))
    usual, found = (report.page(head, [("Record", text)], []) for head, text in (("a", "b"), (title, line)))
    assert tags(found) == tags(usual)


def test_head_is_reproducible():
    assert K.c() == K.c()
    assert "in the same time unit as the parameters" in K.c()
    assert "Sample time: 0.5 min\n" in K.c(time_unit="min")
    assert "Record: Ofen 3.csv\n" in K.c(record="Ofen/3.csv")
    assert "and 60 more lines" in K.c(note="x\n" * 100)
    with pytest.raises(TypeError, match="record must be a text, found int"):
        K.python(record=3)
    with pytest.raises(TypeError, match="margins must be Margins of a loop, found str"):
        K.c(margins="*/ int x; /*")
