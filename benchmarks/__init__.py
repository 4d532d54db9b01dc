"""Speed and accuracy beside other libraries; `make bench` runs it."""

import os
import sys

if "numpy" not in sys.modules:  # it reads this once
    # One thread for all: the matrices are small, and waiting for each other threads cost more time than they save.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
