"""Number the figures and exercises of a lecture by the lecture, and those of other pages without a number by the page.

Sphinx numbers them by numbered parts of the table of contents, and through all that has no number: an exercise of the
second lecture would be the twelfth. The number of a lecture stands in its title.
"""

import re


def prefix_of(title: str) -> tuple[int, ...]:
    """Return the number that a title begins with."""
    found = re.match(r"(\d+) ", title)
    return (int(found[1]),) if found else ()


def number_by_page(app, env):
    """Renumber what Sphinx has numbered through all pages."""
    for page, kinds in env.toc_fignumbers.items():
        if not env.toc_secnumbers.get(page, {}).get(""):
            prefix = prefix_of(env.titles[page].astext())
            for numbers in kinds.values():
                numbers.update({name: (*prefix, k) for k, name in enumerate(numbers, start=1)})
    return []


def setup(app):
    app.connect("env-get-updated", number_by_page, priority=900)  # after Sphinx has numbered them
    return {"parallel_read_safe": True, "parallel_write_safe": True}
