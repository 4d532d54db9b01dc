"""Responses of a loop, and their measures of performance."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pidalab import _check
from pidalab._check import Array
from pidalab.roots import quadratic_roots
from pidalab.signals import FEWEST_JUDGED, Curve, Signals

# If y may still rise after the record, the last y must differ from the final value by at most this share.
ARRIVED_SHARE = 0.1


class Response(Signals):
    r"""Sampled signals of one experiment on a loop, simulated or recorded.

    Between two samples, the control error is the parabola that passes through both end values and has the integral
    given by `area`. So IE is exact if `area` is exact. IAE, ISE and ITAE are integrals of the same parabolas and
    include changes of sign between samples.

    Measures of a response from `simulate` are computed on finer grids until their relative change is at most 2e-4. If
    this takes too many points and the estimated relative error exceeds 1e-3, a warning is issued. For other records
    with a given `area`, measures of y and e are compared with measures of every second sample. If the relative
    difference exceeds 3e-3, a warning is issued. This comparison needs constant signals r and d and an odd number of
    samples, at least 20. Three further cases are not tested: a record with noise, a record without `area`, and a
    measure of u if the record is not from `simulate`. Without a test, a sample time of a thirtieth of the shortest time
    constant usually keeps the error below 1e-3.

    Parameters
    ----------
    t : ndarray, shape (k,)
        Uniform times from 0.
    r, d, n : ndarray, shape (k,)
        Set point, load disturbance and measurement noise, each held from its sample to the next.
    y, u : ndarray, shape (k,)
        Process output and control signal. At a jump, give the value just after the jump.
    area : ndarray, shape (k,), optional
        Running integral of y from t = 0. By default the trapezoidal rule is used.
    held : ndarray, shape (k,), optional
        The part of y that is held between samples, such as noise in a measured record. By default 0.
    final : float, optional
        Value that y approaches, by default the final set point. `open_loop_step` sets `final` for a stable process.

    Raises
    ------
    ValueError
        If the times are not uniform from 0, or if a signal differs in length from `t` or contains NaN or infinity.

    Warns
    -----
    RuntimeWarning
        If the samples are too coarse for a measure. The warning contains an estimate of the error.

    Examples
    --------
    >>> import numpy as np
    >>> from pidalab import Response
    >>> t = np.linspace(0.0, 20.0, 2001)
    >>> record = Response(t, r=1.0, d=0.0, n=0.0, y=1 - np.exp(-t), u=1.0)
    >>> print(f"{record.iae():.4f} {record.settling_time(0.05):.3f}")
    1.0000 2.996
    """

    def ie(self, horizon: float | None = None) -> float:
        r"""Return the integral of the control error, :math:`\int e\,dt`.

        Parameters
        ----------
        horizon : float, optional
            Upper limit, by default the end of the record. ``math.inf`` requires a settled record, in whose last tenth
            :math:`|e|` is at most 1e-6 times its maximum.

        Returns
        -------
        float
            IE, in units of y times time.

        Raises
        ------
        ValueError
            If the horizon is beyond the record, if it is infinite and the record has not settled, or if no horizon is
            given and the error diverges.

        Examples
        --------
        >>> from pidalab import Response
        >>> Response(t=[0.0, 1.0, 2.0], r=1.0, d=0.0, n=0.0, y=[0.0, 2.0, 0.0], u=0.0).ie()
        0.0
        """
        pieces = self._pieces(self._require_integrable(horizon))
        return float(
            self.step * sum(np.sum(s * (c0 + s * (c1 / 2 + s * c2 / 3))) for (c0, c1, c2), s, _ in pieces)
        )

    def iae(self, horizon: float | None = None) -> float:
        r"""Return the integral of the absolute control error, :math:`\int |e|\,dt`.

        Parameters
        ----------
        horizon : float, optional
            Upper limit, as for `ie`.

        Returns
        -------
        float
            IAE, in units of y times time.

        Raises
        ------
        ValueError
            As for `ie`.

        Examples
        --------
        >>> from pidalab import Response
        >>> Response(t=[0.0, 1.0, 2.0], r=1.0, d=0.0, n=0.0, y=[0.0, 2.0, 0.0], u=0.0).iae()
        1.0
        """
        horizon = self._require_integrable(horizon)
        return self._settle("iae", lambda record: record._absolute(horizon, 1.0, 0.0))

    def itae(self, horizon: float | None = None, origin: float = 0.0) -> float:
        r"""Return the integral of the time-weighted absolute error, :math:`\int (t - t_0)\,|e|\,dt`.

        Parameters
        ----------
        horizon : float, optional
            Upper limit, as for `ie`.
        origin : float, optional
            Time :math:`t_0` at which the weight is zero, at most 0.

        Returns
        -------
        float
            ITAE, in units of y times time squared.

        Raises
        ------
        ValueError
            As for `ie`, or if the origin is after 0.

        Examples
        --------
        >>> from pidalab import Response
        >>> record = Response(t=[0.0, 1.0, 2.0], r=1.0, d=0.0, n=0.0, y=0.0, u=0.0)
        >>> record.itae(), record.itae(origin=-1.0)
        (2.0, 4.0)
        """
        origin = _check.real("origin", origin)
        if origin > 0:
            raise ValueError(f"origin must not be after the start of the record (0), found {origin:g}")
        horizon = self._require_integrable(horizon)
        return self._settle("itae", lambda record: record._absolute(horizon, -origin, 1.0))

    def _absolute(self, horizon: float | None, base: float, slope: float) -> float:
        """Integrate |e| times the weight base + slope t."""

        def areas_until(curve: Curve, s: Array) -> tuple[Array, Array]:
            """Integrate e from 0 to s. If the weight depends on t, also integrate s e."""
            c0, c1, c2 = curve
            plain = s * (c0 + s * (c1 / 2 + s * (c2 / 3)))
            return plain, s * s * (c0 / 2 + s * (c1 / 3 + s * (c2 / 4))) if slope else np.zeros_like(plain)

        def weighted(plain: Array, rising: Array, start: Array) -> Array:
            return (base + slope * start) * np.abs(plain) + slope * self.step * np.abs(rising)

        total = 0.0
        for curve, end, start in self._pieces(horizon):
            areas = weighted(*areas_until(curve, end), start)
            # Where e may change its sign, split the integral at the zeros.
            few = np.flatnonzero(np.abs(curve[0]) <= np.abs(curve[1]) + np.abs(curve[2]))
            if few.size:
                c0, c1, c2 = (c[few] for c in curve)
                cuts = np.vstack([np.zeros(few.size), end[few], quadratic_roots(c0, c1, c2)])
                cuts = np.sort(np.clip(cuts, 0.0, end[few]), axis=0)
                plain, rising = (np.diff(part, axis=0) for part in areas_until((c0, c1, c2), cuts))
                areas[few] = weighted(plain, rising, start[few]).sum(axis=0)
            total += self.step * np.sum(areas)
        return float(total)

    def ise(self, horizon: float | None = None) -> float:
        r"""Return the integral of the squared control error, :math:`\int e^2\,dt`.

        Parameters
        ----------
        horizon : float, optional
            Upper limit, as for `ie`.

        Returns
        -------
        float
            ISE, in squared units of y times time.

        Raises
        ------
        ValueError
            As for `ie`.

        Examples
        --------
        >>> from pidalab import Response
        >>> print(f"{Response(t=[0.0, 1.0, 2.0], r=1.0, d=0.0, n=0.0, y=[0.0, 2.0, 0.0], u=0.0).ise():.6f}")
        0.666667
        """
        horizon = self._require_integrable(horizon)
        return self._settle("ise", lambda record: record._integral_of_square(horizon))

    def tv(self, signal: str = "u", horizon: float | None = None, *, final: float | None = None) -> float:
        r"""Return the total variation :math:`\sum |x_{i+1} - x_i|`, including the jump at t = 0.

        Parameters
        ----------
        signal : {"u", "y"}
            Signal to measure.
        horizon : float, optional
            End of the sum, by default the end of the record.
        final : float, optional
            Value that the signal approaches after the horizon. The change to this value is added.

        Returns
        -------
        float
            Total variation over the samples, in units of the signal.

        Raises
        ------
        ValueError
            If the signal name is unknown, if the horizon is beyond the record, or if no horizon is given and the signal
            diverges.

        Examples
        --------
        >>> from pidalab import Response
        >>> record = Response(t=[0.0, 1.0, 2.0], r=1.0, d=0.0, n=0.0, y=0.0, u=[3.0, 1.0, 2.0])
        >>> record.tv("u"), record.tv("u", 1.0), record.tv("u", final=0.0)
        (6.0, 5.0, 8.0)
        """
        return self._variation("tv", signal, horizon, final, lambda path: 0.0)

    def tv1(self, signal: str = "u", horizon: float | None = None, *, final: float | None = None) -> float:
        r"""Return the total variation in excess of one pulse (huba2024, eq. (24)).

        The excess is :math:`\sum |x_{i+1} - x_i| - |2 x_m - x_\infty - x_0|`. It is zero for a signal with two
        monotonic intervals, such as an ideal control signal. Here :math:`x_0 = 0` is the value at rest, and :math:`x_m`
        the value farthest from the mean of :math:`x_0` and :math:`x_\infty`.

        Parameters
        ----------
        signal : {"u", "y"}
            Signal to measure.
        horizon : float, optional
            End of the sum. By default the end of the record.
        final : float, optional
            Value :math:`x_\infty` that the signal approaches, by default the last sample.

        Returns
        -------
        float
            Excess total variation in units of the signal. Not negative, except for rounding.

        Raises
        ------
        ValueError
            If the signal name is unknown, if the horizon is beyond the record, or if no horizon is given and the signal
            diverges.

        Examples
        --------
        >>> from pidalab import Response
        >>> Response(t=[0.0, 1.0, 2.0], r=1.0, d=0.0, n=0.0, y=0.0, u=[3.0, 1.0, 2.0]).tv1("u")
        2.0
        """

        def pulse(path: Array) -> float:
            return float(np.max(np.abs(2 * path - path[0] - path[-1])))

        return self._variation("tv1", signal, horizon, final, pulse)

    def _variation(
        self,
        name: str,
        signal: str,
        horizon: float | None,
        final: float | None,
        less: Callable[[Array], float],
    ) -> float:
        """Return the total variation of a signal minus ``less(path)``."""
        self._require_path(signal, horizon)

        def excess(record: Response) -> float:
            path = record._path(signal, horizon, final)
            return _variation(path) - less(path)

        def missed(record: Response) -> float:
            return 2 * float(np.sum(_missed(record._path(signal, horizon))))

        return self._settle(
            name, excess, signal, missed, least=_variation(self._path(signal, horizon, final))
        )

    def _require_path(self, signal: str, horizon: float | None) -> None:
        _check.choice("signal", signal, ("u", "y"))
        if horizon is None:
            self._require_bounded(signal, getattr(self, signal))

    def _path(self, signal: str, horizon: float | None = None, final: float | None = None) -> Array:
        """Return the rest level 0, the samples of a signal up to the horizon, and `final` if it is given."""
        last = [] if final is None else [_check.real("final", final)]
        within = self.t <= self._horizon(horizon) * (1 + 1e-12)
        return np.concatenate([[0.0], getattr(self, signal)[within], last])

    def _final(self, final: float | None, measure: str) -> float:
        """Return the final value, by default the final set point."""
        final = self.final if final is None else final
        target = float(self.r[-1]) if final is None else _check.real("final", final)
        self._require_bounded("y", self.y, measure)
        if target == 0:
            raise ValueError(
                f"{measure} needs a final value other than 0, found a set point ending at 0; give final or use peak()"
            )
        return target

    def overshoot(self, final: float | None = None) -> float:
        """Return the overshoot of y in per cent of its final value, or 0 if there is none.

        Parameters
        ----------
        final : float, optional
            The final value. By default ``final`` of the response or, if this is None, the final set point. In a
            response from `open_loop_step`, ``final`` is the static gain of a stable process.

        Returns
        -------
        float
            Overshoot in per cent, including extremes between samples.

        Raises
        ------
        ValueError
            If the final value is 0 (see `peak`), if the response diverges, or if it ends before its peak.

        Examples
        --------
        >>> import numpy as np, pidalab
        >>> record = pidalab.Response(t=[0, 1, 2, 3], r=2.0, d=0.0, n=0.0, y=[0.0, 2.5, 2.0, 2.0], u=0.0)
        >>> swing = pidalab.open_loop_step(pidalab.sopdt(3.0, 1.0, damping=0.5, delay=0.0), np.linspace(0, 20, 2001))
        >>> print(f"{record.overshoot():.1f} {swing.overshoot():.2f}")
        25.0 16.30
        """
        target = self._passed_peak(final, "overshoot")

        def share(record: Response) -> float:
            return max(0.0, 100 * (record._top(target)[1] - 1))

        def missed(record: Response) -> float:
            path = record.y / target
            # `_top` uses the exact area, and is assumed to miss only a quarter of the excess that the samples miss.
            return 25 * _missed_top(path, path) if np.max(path) > 1 else 0.0

        return self._settle("overshoot", share, missed=missed, least=1.0)

    def peak_time(self, final: float | None = None) -> float:
        """Return the time at which y is farthest beyond its final value, including times between samples.

        Parameters
        ----------
        final : float, optional
            The final value, as for `overshoot`.

        Returns
        -------
        float

        Raises
        ------
        ValueError
            As for `overshoot`, and if y does not pass its final value.

        Examples
        --------
        >>> import numpy as np, pidalab
        >>> swing = pidalab.open_loop_step(pidalab.sopdt(3.0, 1.0, damping=0.5, delay=0.0), np.linspace(0, 20, 2001))
        >>> print(f"{swing.peak_time():.3f} {np.pi / np.sqrt(1 - 0.5**2):.3f}")
        3.628 3.628
        """
        target = self._passed_peak(final, "peak_time")
        if (share := self._top(target)[1]) <= 1:
            raise ValueError(
                f"peak_time needs an overshoot, found a y of at most {share:.6g} times the final value"
            )
        return self._settle("peak_time", lambda record: record._top(target)[0])

    def _passed_peak(self, final: float | None, measure: str) -> float:
        """Return the final value. Raise if the record ends before the peak of y."""
        target = self._final(final, measure)
        time, share = self._top(target)
        missing = abs(1 - float(self.y[-1]) / target)
        ends_early = share < 1 or time >= self.t[-1] - self.step
        if self.t.size >= FEWEST_JUDGED and missing > ARRIVED_SHARE and ends_early:
            raise ValueError(
                f"{measure} needs a record that passes the peak or comes within {100 * ARRIVED_SHARE:g} % of the final "
                f"value, found a distance of {100 * missing:.3g} % at t = {self.t[-1]:g}; simulate longer"
            )
        return target

    def _top(self, target: float) -> tuple[float, float]:
        """Return the time at which y / (final value) is largest, and this ratio."""
        [((c0, c1, c2), _, start)] = self._pieces(None, self.t.size)
        with np.errstate(divide="ignore", invalid="ignore"):
            top = np.nan_to_num(np.clip(-c1 / (2 * c2), 0.0, 1.0))
        places = np.stack([np.zeros(top.size), top, np.ones(top.size)])
        shares = (self.r[:-1] - (c0 + places * (c1 + places * c2))) / target
        where = np.unravel_index(np.argmax(shares), shares.shape)
        return float(start[where[1]] + self.step * places[where]), float(shares[where])

    def undershoot(self, final: float | None = None) -> float:
        """Return how far y moves in the wrong direction, in per cent of its final value. A jump at t = 0 counts.

        Parameters
        ----------
        final : float, optional
            The final value, as for `overshoot`.

        Returns
        -------
        float
            Undershoot in per cent at the samples, or 0 if there is none.

        Raises
        ------
        ValueError
            If the final value is 0, or if the response diverges.

        Examples
        --------
        >>> from pidalab import Response
        >>> Response(t=[0, 1, 2, 3], r=2.0, d=0.0, n=0.0, y=[0.0, -0.5, 2.0, 2.0], u=0.0).undershoot()
        25.0
        """
        target = self._final(final, "undershoot")

        def share(record: Response) -> float:
            return float(100 * np.max(-record._path("y") / target))

        def missed(record: Response) -> float:
            path = -record._path("y") / target
            return 100 * _missed_top(path, path)

        return self._settle("undershoot", share, missed=missed, least=1.0)

    def saturated(self, limits: tuple[float, float], start: float = 0.0, stop: float | None = None) -> float:
        """Return the time for which the control signal is at a limit.

        Parameters
        ----------
        limits : tuple of float
            Smallest and largest control signal.
        start, stop : float, optional
            Times between which the signal is examined. By default the whole record.

        Returns
        -------
        float
            Number of samples at a limit, multiplied by the sample time.

        Raises
        ------
        TypeError, ValueError
            If the limits are not two numbers in order, or the times are not in order or not in the record.

        Examples
        --------
        >>> from pidalab import Response
        >>> Response(t=[0.0, 1.0, 2.0, 3.0], r=1.0, d=0.0, n=0.0, y=0.0, u=[2.0, 2.0, 1.0, 0.5]).saturated((0.0, 2.0))
        2.0
        """
        low, high = _check.limits(limits)
        first, last = self._samples(start, self.t.size * self.step if stop is None else stop)
        u = self.u[first:last]
        return float(self.step * np.count_nonzero((u <= low) | (u >= high)))

    def peak(self, signal: str = "y", horizon: float | None = None) -> float:
        """Return the sample of a signal that is farthest from 0.

        Parameters
        ----------
        signal : {"u", "y"}
            Signal to examine.
        horizon : float, optional
            End of the search. By default the end of the record, which must not diverge.

        Returns
        -------
        float
            The value, with its sign.

        Raises
        ------
        ValueError
            If the signal name is unknown, the response diverges, or the horizon is beyond the record.

        Examples
        --------
        >>> from pidalab import Response
        >>> Response(t=[0.0, 1.0, 2.0], r=1.0, d=0.0, n=0.0, y=0.0, u=[1.0, -3.0, 2.0]).peak("u")
        -3.0
        """
        self._require_path(signal, horizon)

        def extreme(record: Response) -> float:
            path = record._path(signal, horizon)
            return float(path[np.argmax(np.abs(path))])

        def missed(record: Response) -> float:
            path = record._path(signal, horizon)
            return _missed_top(np.abs(path), path)

        return self._settle("peak", extreme, signal, missed)

    def rise_time(self, low: float = 0.1, high: float = 0.9, final: float | None = None) -> float:
        """Return the time in which y rises from a low share to a high share of its final value.

        If y starts above a share, t = 0 counts as the time at which y passes this share.

        Parameters
        ----------
        low, high : float, optional
            Shares of the final value, ``0 < low < high < 1``.
        final : float, optional
            The final value, as for `overshoot`.

        Returns
        -------
        float
            The time, interpolated linearly between samples.

        Raises
        ------
        ValueError
            If the final value is 0, if the response diverges, if y never reaches the high share, or if the shares
            violate ``0 < low < high < 1``.

        Examples
        --------
        >>> from pidalab import Response
        >>> record = Response(t=[0.0, 1.0, 2.0, 3.0], r=2.0, d=0.0, n=0.0, y=[0.0, 1.0, 2.0, 2.0], u=0.0)
        >>> print(f"{record.rise_time():.2f}")
        1.60
        """
        if not 0 < _check.real("low", low) < _check.real("high", high) < 1:
            raise ValueError(f"low and high must obey 0 < low < high < 1, found {low!r} and {high!r}")
        target = self._final(final, "rise_time")
        highest = float(np.max(self.y / target))
        if highest < high:
            raise ValueError(
                f"y must reach {high:g} of its final value, found {highest:.6g} at most; simulate longer"
            )

        def duration(record: Response) -> float:
            share = record.y / target
            return record._passage(share, high) - record._passage(share, low)

        return self._settle("rise_time", duration)

    def _passage(self, share: Array, level: float) -> float:
        """Return the time at which `share` first reaches a level, or 0 if it starts above the level."""
        i = int(np.argmax(share >= level))
        return float(np.interp(level, share[i - 1 : i + 1], self.t[i - 1 : i + 1])) if i else 0.0

    def settling_time(self, band: float = 0.02, final: float | None = None) -> float:
        """Return the time after which the error stays within a band.

        Parameters
        ----------
        band : float, optional
            Half width of the band as a share of the final value, between 0 and 1 (0.02 for 2 %). If the final value is
            0, the half width is a share of the largest error.
        final : float, optional
            Final value, as for `overshoot`. If `final` is given or the response has a ``final``, the error is the final
            value minus y. Otherwise the error is r - y.

        Returns
        -------
        float
            Time of the last crossing, interpolated linearly between samples. 0 if the error never left the band.

        Raises
        ------
        ValueError
            If the error leaves the band in the last tenth of the record, or the band is not between 0 and 1.

        Examples
        --------
        >>> from pidalab import Response
        >>> Response(t=[0.0, 1.0, 2.0, 3.0], r=1.0, d=0.0, n=0.0, y=[0.0, 0.5, 1.0, 1.0], u=0.0).settling_time(0.25)
        1.5
        """
        final = self.final if final is None else _check.real("final", final)
        error = self.e if final is None else final - self.y
        target = self.r[-1] if final is None else final
        if _check.real("band", band, above=0.0) >= 1:
            raise ValueError(f"band must be a share between 0 and 1 (0.02 for 2 %), found {band!r}")

        def width(error: Array) -> float:
            return float(band * (abs(target) or np.max(np.abs(error))))

        limit, tail = width(error), float(np.max(np.abs(error[-max(1, self.t.size // 10) :])))
        if tail > limit:
            raise ValueError(
                f"band must contain the error in the last tenth of the record, which reaches {tail:.3g}, found a half "
                f"width of {limit:.3g}; simulate longer or widen the band"
            )

        def entry(record: Response) -> float:
            deviation = record.e if final is None else final - record.y
            limit = width(deviation)
            outside = np.flatnonzero(np.abs(deviation[:-1]) > limit)
            if outside.size == 0:
                return 0.0
            i = outside[-1]
            before, after = deviation[i], deviation[i + 1]
            return float(
                record.t[i] + record.step * (before - math.copysign(limit, before)) / (before - after)
            )

        return self._settle("settling_time", entry)


def _variation(path: Array) -> float:
    return float(np.sum(np.abs(np.diff(path))))


def _missed_top(size: Array, path: Array) -> float:
    """Estimate by how much a signal exceeds its largest sample. `path` holds the samples.

    `size` is `path` or its modulus.
    """
    return float(np.max(size + _missed(path)) - np.max(size))


def _missed(path: Array) -> Array:
    """Estimate by how much the signal exceeds each local extreme of its samples. Return 0 at other samples.

    Let c be the larger of the two changes from the extreme to its neighbouring samples. Between the samples, a smooth
    signal exceeds the extreme by at most c/8, a signal with a corner by c/2 on average, and any signal by at most c.
    The function returns c/4. A change that is more than three times the neighbouring change may be a jump, so it counts
    as three times the neighbouring change.
    """
    rises = np.diff(path)
    steps = np.pad(np.abs(rises), 2)  # gives each sample two steps before and two steps after it
    before = np.minimum(steps[1:-2], 3 * steps[:-3])
    after = np.minimum(steps[2:-1], 3 * steps[3:])
    turns = np.zeros(path.size, dtype=bool)
    turns[1:-1] = rises[:-1] * rises[1:] < 0.0
    turns[1:-2] |= (rises[1:-1] == 0.0) & (rises[:-2] * rises[2:] < 0.0)
    turns[1] = False  # the jump from rest to the first sample is exact
    return np.where(turns, 0.25 * np.maximum(before, after), 0.0)
