"""Search for sections of the site without a server. Chapters come before the reference.

While several processes write the pages, the text of every section is stored next to the page's doctree. At the end
these texts become one script for MiniSearch, since a search page opened from disk could not load a data file.
"""

import json
import re
from html.parser import HTMLParser
from pathlib import Path

HEADINGS = {"h1", "h2", "h3", "h4"}
# Readers do not search for code, the source of formulas and buttons.
LEFT_OUT = {"script", "style", "summary", "button"}
LEFT_OUT_CLASSES = {"cell_input", "headerlink", "toctree-wrapper", "dataframe", "only-dark"}
MATHS = re.compile(r"\\[()\[\]]")
VOID = {"br", "col", "hr", "img", "input", "link", "meta", "source", "wbr"}  # elements without an end tag
TASKS = 0.4  # relative weight of exercises, which mention many terms without explaining them
LONGEST = 6000  # largest number of characters of a section
# Weight of a hit by the beginning of the page's name. The first match counts.
WEIGHTS = (
    ("book/api", 0.05),
    ("book/audit", 0.15),
    ("book/scoreboard", 0.5),
    ("book/errata", 0.5),
    ("book/bibliography", 0.1),
    ("book/learn/index", 0.5),
    ("book/learn", 1.3),
    ("", 1.0),
)

# Additional search words by section. These sections have the weight 1, even in the reference.
ALSO = {
    "book/heo2023.html#the-idea": "dead time",
    "book/how-do-i.html#install-pidalab": "install installation setup download pip PyPI Binder Colab",
    "book/how-do-i.html#cite-the-book-or-one-of-its-numbers": "cite citation DOI BibTeX licence license copyright",
    "book/how-do-i.html#weigh-the-set-point-b-and-c": "set point weighting derivative kick proportional kick "
    "2DOF 2-DOF two degrees of freedom",
    "book/how-do-i.html#hand-a-controller-to-python-control-control-tf-c": "export Matlab Simulink",
    "book/how-do-i.html#also-not-supported": "MIMO relay autotuning adaptive stiction "
    "dead time compensation compensator predictor",
    "book/heater.html#a-heater-on-the-desk": "temperature control Arduino TCLab thermostat oven",
    "book/design.html#design-for-your-process": "step response identification tune from data autotune bump test",
    "book/design.html#fit": "system identification estimate model from data",
    "book/design.html#write": "PLC code IEC 61131 structured text generate C code",
    "book/learn/what-acceleration-does.html#what-acceleration-does": "acceleration term second derivative",
    "book/learn/what-acceleration-does.html#names": "PIDD2 PIDD",
    "book/learn/tuning.html#what-ms-means": "maximum sensitivity gain margin phase margin robustness",
    "book/learn/limits.html#four-ways-out": "anti-windup reset windup integrator windup saturation",
    "book/learn/digital.html#bumpless-transfer": "bumpless transfer manual automatic switching",
    "book/learn/digital.html#choose-h": "sampling time sample period sampling rate aliasing",
    "book/learn/filter-and-noise.html#why-filter-at-all": "derivative filter low pass measurement noise",
    "book/across/rules-compared.html#the-rules-as-published": "SIMC Skogestad tuning rules",
    "book/across/rules-compared.html#your-rule-here": "SIMC improved own rule benchmark compare 134 plants",
    "book/notation.html#conventions": "definition of IAE ISE ITAE TV settling time overshoot",
    "book/api/data.html#pidalab.fopdt": "first order plus dead time FOPDT FOLPD",
    "book/api/rules.html#module-pidalab.rules.classical": "Ziegler–Nichols lambda tuning",
    "book/api/rules.html#pidalab.rules.itae.imc_pid": "IMC internal model control",
}


class Sections(HTMLParser):
    """Parser of a page that stores anchor, title and text of each section.

    An entry of the reference, a definition list whose first term has an anchor, is also a section.
    """

    def __init__(self):
        super().__init__()
        self.found = []  # anchor, words of the title and words of the text, in the order of the page
        self.open = []  # tag of each open element, and its section if it is one
        self.left_out = self.title = 0  # depth of the open ignored element and title, or 0

    def section(self):
        """Return the innermost section that has a title."""
        return next((section for _, section in reversed(self.open) if section and section[1]), None)

    def handle_starttag(self, tag, attrs):
        if tag in VOID:
            return
        given = dict(attrs)
        section = None
        if not self.left_out:
            parent = self.open[-1][1] if self.open else None
            if tag in LEFT_OUT or LEFT_OUT_CLASSES.intersection((given.get("class") or "").split()):
                self.left_out = len(self.open) + 1
            elif tag == "section":
                section = (given.get("id", ""), [], [])
            elif tag in HEADINGS and parent and not parent[1]:
                self.title, self.heading = len(self.open) + 1, parent
            elif tag == "dt" and "id" in given and self.open and self.open[-1] == ("dl", None):
                entry = (given["id"], [given["id"]], [])
                self.open[-1] = ("dl", entry)
                self.found.append(entry)
                self.left_out = len(self.open) + 1  # the signature
        if section:
            self.found.append(section)
        self.open.append((tag, section))

    def handle_endtag(self, tag):
        if tag not in (name for name, _ in self.open):
            return
        while self.open.pop()[0] != tag:
            pass
        if len(self.open) < self.left_out:
            self.left_out = 0
        if len(self.open) < self.title:
            self.title = 0

    def handle_data(self, data):
        # Remove the delimiters of formulas.
        words = MATHS.sub("", data).strip()
        if not words or self.left_out:
            return
        if self.title:
            self.heading[1].append(words)
        elif section := self.section():
            section[2].append(words)


def sections(body: str) -> list[tuple[str, str, str]]:
    """Return (anchor, title, text) of each section of a page, without the text of its subsections."""
    page = Sections()
    page.feed(body)
    page.close()
    return [
        (anchor, " ".join(title), " ".join(text)[:LONGEST]) for anchor, title, text in page.found if title
    ]


def words_of(html: str) -> str:
    """Return a line of HTML as plain text."""
    ((_, title, _),) = sections(f"<section><h1>{html}</h1></section>")
    return title


def collect(app, pagename, templatename, context, doctree):
    """Store the sections of a page, and add the scripts to the search page."""
    if pagename == "search":
        for script in (
            "vendor/minisearch/minisearch.min.js",
            "sections.js",
            "section_search.js",
        ):
            app.add_js_file(script)
    if doctree is None or "body" not in context:
        return
    weight = next(value for start, value in WEIGHTS if pagename.startswith(start))
    page = words_of(context.get("title", pagename))
    found = []
    for anchor, title, text in sections(context["body"]):
        url = app.builder.get_target_uri(pagename) + (f"#{anchor}" if anchor else "")
        entry = {"page": page, "title": title, "text": text, "url": url}
        if url in ALSO:
            entry |= {"also": ALSO[url], "weight": 1.0}
        else:
            entry["weight"] = weight * (TASKS if title == "Exercises" else 1.0)
        found.append(entry)
    kept(app, pagename).write_text(json.dumps(found), encoding="utf-8")


def kept(app, pagename):
    """Return the file for the sections of a page."""
    return Path(app.doctreedir, f"{pagename}.sections.json")


def write_index(app, exception):
    """Write the collected sections as a script."""
    if exception or app.builder.format != "html":
        return
    pages = (kept(app, name) for name in sorted(app.env.found_docs))
    found = [entry for page in pages for entry in json.loads(page.read_text(encoding="utf-8"))]
    index = [{"id": k, **entry} for k, entry in enumerate(found)]
    text = json.dumps(index, ensure_ascii=False, separators=(",", ":"))
    Path(app.outdir, "_static", "sections.js").write_text(f"window.bookSections={text};\n", encoding="utf-8")


def leave_words_out(app, env):
    """Leave the unused word index of Sphinx empty, which saves a tenth of the build time."""
    for page in env.found_docs:
        env.metadata[page]["nosearch"] = True


def setup(app):
    app.connect("env-updated", leave_words_out)
    app.connect("html-page-context", collect, priority=900)  # after the dark figures are added
    app.connect("build-finished", write_index)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
