"""What a sampled loop makes of measurement noise, also where the continuous filter is faster than the sample."""

from __future__ import annotations

import math

from pidalab.loop import Loop


def sampled_noise(loop: Loop, sample_time: float) -> tuple[float, str]:
    """Return the noise gain of the sampled loop, or NaN, and a remark: which loop was measured, or what failed."""
    from pidalab.simulation.noise import noise_gain

    try:
        return noise_gain(loop, sample_time), ""
    except ValueError as refusal:
        reason = " ".join(str(refusal).split())
    # a filter faster than the sample: as a PLC would run it
    try:
        digital = loop.controller.discretise(sample_time, "backward", loop.output_filter)
        return noise_gain(Loop(loop.process, digital), sample_time), "noise gain of backward differences"
    except ValueError:
        return math.nan, f"no noise gain: {reason}"
