"""Test an installed pidalab outside a clone, in an environment that has only the dependencies.

`tools/release.py` runs this file with the interpreter of an empty environment, in an empty folder.
"""

import subprocess
import sys
from importlib.metadata import distribution
from pathlib import Path

import numpy as np

import pidalab
from paperledger import Ledger, LedgerError

COMMAND = [str(Path(sys.executable).with_name("pidalab"))]


def package() -> str:
    """Check that the installed package is used, and that it has type information and a licence."""
    home = Path(pidalab.__file__).parent
    assert "site-packages" in home.parts, f"{home} is no installed package"
    assert (home / "py.typed").is_file()
    names = [path.name for path in distribution("pidalab").files or []]
    assert "LICENSE" in names
    return f"pidalab {pidalab.__version__} with {sum(name.endswith('.py') for name in names)} modules"


def loop() -> str:
    """Tune a controller, and check that abs(integral of the error) is ti/kp after a unit step of the load."""
    process = pidalab.lags(3, delay=1.0)
    design = pidalab.rules.haalman.tune(process, ms=1.6)
    t = np.linspace(0, 200, 20001)
    response = pidalab.load_response(design.loop(), t)
    integral = float(np.trapezoid(response.e, t))
    assert abs(abs(integral) - design.controller.ti / design.controller.kp) < 1e-6, integral
    ms = pidalab.margins(design.loop()).ms
    assert ms < 2, ms
    return f"Haalman PIDA: IAE {response.iae():.4f}, Ms {ms:.4f}"


def command_line() -> str:
    """Write code in four formats from a record, and check that a wrong argument gives a one-line error."""
    t = np.arange(0.0, 60.0, 0.25)
    y = np.interp(t - 5.0, t, pidalab.open_loop_step(pidalab.fopdt(1.0, 4.0, 1.0), t).y, left=0.0)
    table = np.column_stack([t, np.where(t < 5.0, 0.0, 1.0), y])
    np.savetxt("step.csv", table, delimiter=",", header="time,u,y", comments="")
    options = ["--model", "fopdt", "--rule", "simc", "--kind", "PI", "--sample-time", "0.2", "--out", "code"]
    options += ["--ms-worst", "2.2"]  # the rule cannot design for a given Ms
    subprocess.run([*COMMAND, "tune", "step.csv", *options], check=True, stdout=subprocess.DEVNULL)
    written = sorted(path.name for path in Path("code").iterdir())
    assert {"controller.c", "controller.st", "controller.py", "controller.json", "report.html"} <= set(
        written
    )
    refused = subprocess.run(
        [*COMMAND, "compare", "--num", "x", "--den", "1"], capture_output=True, text=True
    )
    assert refused.returncode == 2, refused
    assert "numbers with commas between them, found 'x'" in refused.stderr, refused.stderr
    return f"pidalab tune: {', '.join(written)}"


def ledger() -> str:
    """Check that a message explains the missing ledgers outside a clone."""
    try:
        Ledger.open("haalman2024")
    except LedgerError as missing:
        said = str(missing)
    else:
        said = "found where none can be"
    assert "use a clone" in said, said
    return f"ledger: {said}"


if __name__ == "__main__":
    for use in (package, loop, command_line, ledger):
        print(use(), flush=True)
