"""Compute the uncertainty of a model, and find out if noise, drift or feedback prevent its identification."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter
from scipy.special import chdtri

from pidalab._check import Array
from pidalab.plant.fitting.searching import FIRST_ORDER, MOST_DAMPED, FitData, FitResult
from pidalab.plant.record import Record
from pidalab.plant.record.cleaning import FEWEST, FOLLOWER, MANY_LEVELS, MOVING

BLIND = 1e7  # a model is identifiable only if its scaled sensitivities have at most this condition number
SURE = 3.0  # the sign of a gain is known if the gain differs from 0 by this number of standard uncertainties
# A model must explain this share of the output's variance. If it explains less, the true response may have the
# opposite sign, hidden by the noise.
EXPLAINED = 0.5
FED_BACK = 0.3  # feedback is assumed if `_agreement` of the changes of u and y is at least this
COLOURED = 1.5  # if `samples_per_error` is above this, the residuals are not white noise
# Factors of closed-loop uncertainties, for coloured and for white residuals.
CLOSED_LOOP, CLOSED_LOOP_WHITE = 7.0, 1.3
CHANCE = 0.003  # accepted probability of mistaking a drift for a response, or a coincidence for feedback
OPPOSED = 0.8  # feedback is assumed if abs(agreement) of the changes of u and the residuals is at least this

DRIFTS = (
    "the response to the input is not clearly above noise and a drift in time. Record the output at rest for a while, "
    "step the input, wait for rest, and step the input back: a response reverses then, but a drift does not. "
    "Meanwhile nothing else (a load, a lid, another heater) may move the output"
)


def drifts(data: FitData) -> bool:
    """Return True if a parabola in time fits nearly as well as a parabola plus first-order responses to the input.

    If the record does not begin at rest, exponential decays are added to the parabola.
    """
    x = (data.t - data.t[0]) / np.ptp(data.t)
    parabola = np.vander(x, 3)
    if data.free:
        parabola = np.column_stack([parabola, *(np.exp(-x / share) for share in (0.03, 0.1, 0.3, 1.0))])
    answers = [data.simulated(FIRST_ORDER, [lag], 0.0) for lag in np.ptp(data.t) * np.geomspace(0.01, 0.5, 5)]
    drift, both = (
        data.y - basis @ np.linalg.lstsq(basis, data.y, rcond=None)[0]
        for basis in (parabola, np.column_stack([parabola, *answers]))
    )
    gained, left = float(drift @ drift - both @ both), float(both @ both)
    return left > 0 and gained * data.t.size < float(chdtri(5, CHANCE)) * samples_per_error(both) * left


def unsettled(data: FitData, result: FitResult) -> str:
    """Return why a model is not identifiable and which experiment would help. Return "" if it is identifiable."""
    shape, values, J = result.shape, result.values, result.jacobian
    if values[0] == 0 or not np.all(np.isfinite(values)):
        return "the output does not respond to the input: no gain can be found"
    answer = float(np.ptp(J[:, 0] * values[0]))
    if answer < 3 * result.deviation:
        return (
            f"the response of {answer:.3g} is not clearly above the residuals of {result.deviation:.3g}: the step is "
            "too small compared with the noise, or something else moved the output; make a larger step, from rest"
        )
    # Scale each column of sensitivities to length 1.
    scaled = J / np.linalg.norm(J, axis=0)
    if not np.all(np.isfinite(scaled)) or np.linalg.cond(scaled) > BLIND:
        return (
            f"different parameters of {shape.name} fit this record equally well: in closed loop, move the set point "
            "more; in open loop, step the input"
        )
    sigma = np.sqrt(np.diag(covariance(result)))
    if abs(values[0]) < SURE * sigma[0]:
        return (
            f"the record does not determine the sign of the gain: {values[0]:.3g} ± {sigma[0]:.2g}; let the plant come "
            "to rest, then make a larger step or wait longer"
        )
    for name, value, error in zip(shape.parameters, values[2:-1], sigma[2:], strict=False):
        if error > abs(value) or (name == "damping" and value > 0.99 * MOST_DAMPED):
            return (
                f"the record does not determine the {name} of {shape.name}: {value:.3g} ± {error:.2g}; record until "
                "the output rests again, or step the input more than once"
            )
    return ""


def unexplained(data: FitData, result: FitResult) -> str:
    """Return why a model explains too little of the output, or an empty text if it explains enough."""
    share = 1.0 - result.cost / float(np.sum((data.y - data.y.mean()) ** 2))
    if share >= EXPLAINED:
        return ""
    return (
        f"{result.shape.name} explains {100 * share:.0f} % of the variance of the output (NRMSE "
        f"{1 - np.sqrt(1 - share):.2f}), and a model has to explain {100 * EXPLAINED:.0f} %: something else moved the "
        "output, or the samples are too far apart; make a larger step, from rest, with several samples while the "
        "output responds"
    )


def covariance(result: FitResult) -> Array:
    """Return the covariance of the parameters for white residuals, multiplied by `samples_per_error`."""
    r, J = result.residuals, result.jacobian
    freedom = max(1, r.size - J.shape[1])
    variance = float(r @ r) / freedom
    if variance == 0.0:
        return np.zeros((J.shape[1], J.shape[1]))
    scale = np.linalg.norm(J, axis=0)
    inverse = np.linalg.pinv((J / scale).T @ (J / scale), hermitian=True)
    return np.asarray(variance * samples_per_error(r) * inverse / np.outer(scale, scale))


def rough(x: Array) -> Array:
    """Subtract the running median from a signal."""
    return np.asarray(x - median_filter(x, 9, mode="mirror"), dtype=float)


def closed_loop_factor(record: Record, result: FitResult) -> float:
    """Return the factor by which the uncertainties grow in closed loop. It is 1 in open loop.

    Notes
    -----
    White noise does not bias a fit from u to y. Slower disturbances bias it by an amount that the record does not show.
    The factors were calibrated with simulated loops of random first-order plants. The gain has the
    largest errors. The 95 % quantile of (error of the gain) / (1.96 standard uncertainties) is 1.22 in 99 loops with
    white noise, and 6.8 in 114 loops with a wandering load. The factors are these numbers, rounded up. In other random
    loops, at least 90 % of all intervals contained the true value of their parameter.
    """
    # Compare only signs, so that a set-point step weighs no more than any other sample.
    du, dy = np.sign(rough(np.diff(record.u))), np.sign(rough(np.diff(record.y)))
    by_hand = record.experiment not in (FOLLOWER, MANY_LEVELS, MOVING)
    if by_hand or max(_agreement(du, dy), _agreement(du[1:], dy[:-1])) < FED_BACK:
        return 1.0
    return CLOSED_LOOP if samples_per_error(result.residuals) > COLOURED else CLOSED_LOOP_WHITE


def runs_away(record: Record, data: FitData, result: FitResult) -> str:
    """Return why a model contradicts the feedback that the record shows, or "" if there is no contradiction.

    In closed loop the controller reacts to disturbances. Then u and the residuals change at the same samples, with
    opposite signs if the gain of the plant is positive. In open loop their signs agree only by chance.
    """
    left = _residuals(record, data, result)
    du, dy = np.sign(rough(np.diff(record.u))), np.sign(rough(np.diff(left)))
    both, gain = int(np.count_nonzero(du * dy)), result.values[0]
    agreement = float(du @ dy) / (both or 1)
    chance = both * agreement**2 < float(chdtri(1, CHANCE)) or abs(agreement) < OPPOSED
    if chance or agreement * gain < 0:
        return ""
    return (
        f"u reacts to y in this record, as in a closed loop. With the fitted gain of {gain:.3g} this loop would be "
        "unstable. Either the recorded u did not reach the plant, or something else moved the output. Record the "
        "limited u that the actuator receives, or step u by hand"
    )


def _agreement(a: Array, b: Array) -> float:
    """Return abs(agreements - disagreements) / (agreements + disagreements) of nonzero signs.

    The result is near 0 if the signs agree only by chance, and 0 if there are too few signs.
    """
    both = np.count_nonzero(a * b)
    return abs(float(a @ b)) / both if both > FEWEST else 0.0


def samples_per_error(r: Array) -> float:
    """Return how many correlated samples tell as much as one independent sample.

    The number is 1 + 2 (sum of the autocorrelations before their first zero).
    """
    spectrum = np.abs(np.fft.rfft(r, 2 * r.size)) ** 2
    correlation = np.fft.irfft(spectrum)[: r.size]
    correlation = correlation / correlation[0]
    end = int(np.argmax(correlation <= 0)) or r.size
    return 1.0 + 2.0 * float(correlation[1:end].sum())


def noise_of(record: Record, data: FitData, result: FitResult) -> float:
    """Return the larger of two estimates of noise: at rest, and from the second differences of the residuals."""
    changes = np.diff(_residuals(record, data, result), 2)
    return max(record.noise.deviation, float(np.sqrt(np.mean(changes**2) / 6)))


def _residuals(record: Record, data: FitData, result: FitResult) -> Array:
    """Return the residuals at all samples of the record."""
    return np.asarray(record.y - np.interp(record.t, data.t, data.y - result.residuals), dtype=float)
