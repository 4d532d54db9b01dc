"""Use every compiled function once, so that its machine code is there: ``python -m pidalab.warm_up``.

The library starts this beside the first process that finds no machine code (`pidalab._compiled`).
"""

from __future__ import annotations

import os


def respond() -> None:
    """Compute the margins and a response of a loop."""
    import numpy as np

    import pidalab

    loop = pidalab.Loop(pidalab.lags(3, delay=1.0), pidalab.PIDA(1.0, 3.0, 1.0, 0.3))
    pidalab.margins(loop)
    pidalab.load_response(loop, np.arange(3.0))


def sample() -> None:
    """Run a sampled loop and a portrait."""
    import numpy as np

    import pidalab

    controller = pidalab.SeriesPIDA(0.1, 0.4, 0.2, ti=0.6, filter_time=0.2, filter_order=2)
    loop, t = pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), controller), 0.01 * np.arange(3)
    pidalab.simulate_sampled(loop, t)
    pidalab.portrait(loop, {"ka": [0.2]}, t)
    pidalab.noise_gain(loop, sample_time=0.1)


def main() -> None:
    """Compile, then say so to later processes."""
    from pidalab._compiled import stamp

    if hasattr(os, "nice"):
        os.nice(10)
    lock = stamp().with_suffix(".lock")
    try:
        respond()
        sample()
        stamp().parent.mkdir(parents=True, exist_ok=True)  # Python makes none where it writes no byte code
        stamp().touch()
    finally:
        lock.unlink(missing_ok=True)


if __name__ == "__main__":
    main()
