"""Scale designs to equal Ms and noise gain, and keep the proportions of each rule."""

import numpy as np
import pytest

import pidalab
from pidalab.comparison import at_equal_terms
from pidalab.rules import classical

BALANCED = pidalab.lags(3, delay=1.0)
PLANTS = {
    "balanced": BALANCED,
    "negative": pidalab.Process([-2.0], BALANCED.den, 1.0),
    "lag": pidalab.fopdt(1.0, 100.0, 1.0),
    "integrating": pidalab.ipdt(0.5, delay=1.0),
    "oscillating": pidalab.sopdt(1.0, 1.0, 0.4, 1.0),
}


@pytest.mark.parametrize("name", PLANTS)
@pytest.mark.parametrize("noise", [0.4, 1e3])
def test_scaled_designs_have_the_ms_and_noise_asked_for(name, noise):
    process = PLANTS[name]
    model = process if name in ("lag", "integrating") else pidalab.reduction.to_fopdt(process).process
    design = classical.amigo(model)
    noise *= abs(design.controller.kp)
    fair = at_equal_terms(design, process, ms=1.5, noise_gain=noise, sample_time=0.05)
    loop = fair.loop(process)
    assert pidalab.is_stable(loop)
    assert pidalab.max_sensitivity(loop)[0] == pytest.approx(1.5, rel=1e-5)
    assert pidalab.noise_gain(loop, 0.05) == pytest.approx(min(noise, fair.noise_gain), rel=1e-4)
    assert fair.controller.filter_time > 0.05 or fair.noise_gain < noise
    assert fair.controller.gains().standard()[1:] == pytest.approx(design.controller.gains().standard()[1:])


def test_the_gain_is_the_largest_with_this_sensitivity():
    """Compare with a search over gains."""
    design = classical.simc(BALANCED, "PI")
    fair = at_equal_terms(design, BALANCED, ms=1.4, noise_gain=100.0, sample_time=0.01)
    shares = np.linspace(0.5, 1.5, 201)
    loops = [
        pidalab.Loop(
            BALANCED, pidalab.HighOrderPID((k * np.array(fair.controller.coefficients)).tolist(), 0.01, 1)
        )
        for k in shares
    ]
    kept = [pidalab.margins(loop).stable and pidalab.max_sensitivity(loop)[0] <= 1.4001 for loop in loops]
    assert shares[np.flatnonzero(kept).max()] == pytest.approx(1.0, abs=5e-3)


def test_noise_is_kept_where_the_gain_jumps():
    """On this plant the largest allowed gain drops abruptly when the filter gets longer."""
    process = pidalab.Process([1.0], np.convolve([10.0, 1.0], [0.9, 1.0]), 0.1)
    model = pidalab.ipdt(0.0788086, delay=0.692509)
    design = pidalab.rules.mrdp.tune(model, 2, 3, 0.173127)
    w = pidalab.reduction.ultimate_frequency(process)
    noise, sample = 1.5 / abs(process(1j * w)), 2 * np.pi / w / 100
    fair = at_equal_terms(design, process, ms=1.4, noise_gain=noise, sample_time=sample)
    assert fair.noise_gain <= noise * 1.001
