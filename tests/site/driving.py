"""Use the lab as a reader does."""

COLUMNS = (
    "() => [...document.querySelectorAll('.lab-table tbody tr:has(th)')]"
    ".map(row => [...row.cells].map(cell => cell.innerText.trim()))"
)
FAIR = "fair: equal Ms, equal relative noise gain"
FOLLOW = """() => new Promise((done) => {
  addEventListener("hashchange", () => requestAnimationFrame(done), { once: true });
  %s;
})"""
NEXT_FRAME = "() => new Promise(requestAnimationFrame)"


def press(page, name):
    page.get_by_role("button", name=name).click()


def enter(page, label, value):
    page.get_by_label(f"{label}, number", exact=True).fill(str(value))
    page.keyboard.press("Enter")


def value_of(page, label):
    return page.get_by_label(f"{label}, number", exact=True).input_value()


def choose(page, label, option):
    page.get_by_label(label, exact=True).select_option(option)


def follow(page, state):
    """Go to the address of a state of the lab, written in JavaScript."""
    page.evaluate(FOLLOW % f"location.hash = pidalabModel.write({state})")


def wait_for_columns(page, wanted, of=""):
    """Wait until the table of the lab has these numbers. `of` maps its rows to numbers."""
    page.wait_for_function(f"() => ({COLUMNS})(){of} === {wanted}")


def three_kinds(page):
    """Take PI, PID and PIDA by the chosen rule, and return the rows of the table."""
    press(page, "PI, PID and PIDA by this rule")
    wait_for_columns(page, 3, ".length")
    return page.evaluate(COLUMNS)
