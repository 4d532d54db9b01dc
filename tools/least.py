"""Run the notebooks as the least capable x86-64 processor would run them.

The numerical libraries choose their instructions at run time, and the instructions determine how results are rounded.
With this script OpenBLAS uses its oldest kernels, NumPy uses no optional features of the processor, numba compiles for
a generic processor, and the C library uses no fused multiplication.
"""

import json
import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path

from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

ROOT = Path(__file__).resolve().parents[1]
FEATURES = " ".join(name for name in __cpu_dispatch__ if __cpu_features__.get(name))
ASKED = {"OPENBLAS_CORETYPE": "Nehalem", "NUMBA_CPU_NAME": "generic"}
ASKED |= {"NPY_DISABLE_CPU_FEATURES": FEATURES} if FEATURES else {}
# Print the effective settings, under the names of the variables that request them.
PROBE = """
import json, os
import numba, numpy, scipy.linalg
from threadpoolctl import threadpool_info
from numpy._core._multiarray_umath import __cpu_features__ as has
off = os.environ.get("NPY_DISABLE_CPU_FEATURES", "").split()
kernels = {one["architecture"] for one in threadpool_info() if one["internal_api"] == "openblas"}
print(json.dumps({
    "OPENBLAS_CORETYPE": "/".join(sorted(kernels)),
    "NPY_DISABLE_CPU_FEATURES": " ".join(name for name in off if not has[name]),
    "NUMBA_CPU_NAME": str(numba.config.CPU_NAME),
}))
"""


def main() -> int:
    """Return the exit status of pytest, or 1 if a library ignores its setting."""
    environment = os.environ | ASKED | {"OPENBLAS_NUM_THREADS": "1"}
    if platform.libc_ver()[0] == "glibc" and __cpu_features__.get("FMA3"):
        environment["GLIBC_TUNABLES"] = "glibc.cpu.hwcaps=-AVX2,-FMA"
    with tempfile.TemporaryDirectory() as cache:  # empty, so that no code compiled for this processor is used
        environment["NUMBA_CACHE_DIR"] = cache
        probe = [sys.executable, "-W", "error::ImportWarning", "-c", PROBE]
        found = json.loads(subprocess.run(probe, env=environment, check=True, stdout=subprocess.PIPE).stdout)
        if wrong := {name: found[name] for name in ASKED if found[name] != ASKED[name]}:
            print(f"asked for {ASKED}, found {wrong}", file=sys.stderr)
            return 1
        pytest = [sys.executable, "-m", "pytest", "-q", "-n", "auto", "--dist", "loadfile"]
        command = [
            *pytest,
            "--no-loadscope-reorder",
            "-p",
            "no:cacheprovider",
            "--nbval",
            "--nbval-current-env",
        ]
        notebooks = sorted(
            (ROOT / "book").rglob("*.ipynb"), key=lambda path: path.stat().st_size, reverse=True
        )
        return subprocess.run([*command, *notebooks], cwd=ROOT, env=environment, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
