"""Compile every kernel by using it once: ``python -m pidalab.warm_up``.

`pidalab._compiled` runs this module in the background.
"""

from __future__ import annotations

import os


def use_all() -> None:
    """Compute a response, a sampled response, a portrait and a noise gain."""
    import numpy as np

    import pidalab

    pidalab.load_response(
        pidalab.Loop(pidalab.lags(3, delay=1.0), pidalab.PIDA(1.0, 3.0, 1.0, 0.3)), [0.0, 1.0, 2.0]
    )
    controller = pidalab.SeriesPIDA(0.1, 0.4, 0.2, ti=0.6, filter_time=0.2, filter_order=2)
    loop, t = pidalab.Loop(pidalab.ipdt(1.0, delay=1.0), controller), 0.01 * np.arange(3)
    pidalab.simulate_sampled(loop, t)
    pidalab.portrait(loop, {"ka": [0.2]}, t)
    pidalab.noise_gain(loop, sample_time=0.1)


def main() -> None:
    """Compile all kernels at low priority. Record the completion for later processes."""
    os.environ["PIDALAB_COMPILE"] = "1"
    from pidalab._compiled import TIER, declare_complete

    if hasattr(os, "nice"):
        os.nice(19)
    TIER.begin()
    if not TIER.ready:
        raise ImportError("to compile, numba must be installed and not switched off")
    use_all()
    declare_complete()


if __name__ == "__main__":
    main()
