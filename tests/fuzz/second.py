"""Compute responses, poles and noise by slow, simple methods that share no code with the library.

A response is a Fourier series of its Laplace transform. The number of unstable poles follows from the turns of the
characteristic function along the imaginary axis. A sampled loop is stepped as one linear system.
"""

import numpy as np
from scipy import signal


def response(transform, end, growth=0.0, terms=2**17, fading=14.0):
    """Return times and values of f(t) on [0, end] from F(s), for f that grows no faster than e^(growth t).

    The series of Dubner and Abate along Re s = a has the period 2 end. Values of later periods are damped by e^-fading.
    The terms are tapered smoothly to 0, so that truncation causes no ringing.
    """
    period, n = 2 * end, 2 * terms
    a = max(growth, 0.0) + fading / period
    w = 2 * np.pi * np.arange(terms + 1) / period
    values = transform(a + 1j * w) * np.cos(0.5 * np.pi * w / w[-1]) ** 2
    t = period * np.arange(terms + 1) / n
    return t, np.exp(a * t) * (np.fft.irfft(values, n) * n / period)[: terms + 1]


def unstable_poles(process, controller):
    """Count the unstable poles of a loop whose L vanishes at infinite frequency. Return None if the count fails."""
    (b, a), (bc, ac) = (process.num, process.den), controller.fraction()
    opened, closed = np.polymul(a, ac), np.polymul(b, bc)
    roots = np.roots(opened)

    def characteristic(w):
        return np.polyval(opened, 1j * w) + np.polyval(closed, 1j * w) * np.exp(-1j * w * process.delay)

    # Beyond this frequency |L| is small, so only the rational part turns the function.
    largest = 10 * max(1.0, np.abs(roots).max())
    while abs(np.polyval(closed, 1j * largest) / np.polyval(opened, 1j * largest)) > 1e-3:
        largest *= 3
    step = 0.1 / process.delay if process.delay else largest
    if largest / step > 1e6:
        return None
    w = np.union1d(np.geomspace(1e-7, largest, 20_000), np.arange(0, largest, step))
    for _ in range(20):
        f = characteristic(w)
        if np.any(np.abs(f) < 1e-9 * np.abs(np.polyval(opened, 1j * w))):
            return None
        turn = np.angle(f[1:] / f[:-1])
        coarse = np.abs(turn) > 0.5
        if not coarse.any():
            break
        w = np.sort(np.concatenate([w, 0.5 * (w[1:] + w[:-1])[coarse]]))
    else:
        return None
    # From the last frequency to infinity, each factor jw - p of the rational part turns to pi/2.
    on = np.sum(0.5 * np.pi - np.angle(1j * w[-1] - roots))
    on -= np.angle(f[-1] / np.polyval(opened, 1j * w[-1]))
    count = 0.5 * roots.size - (np.sum(turn) + on) / np.pi
    return round(count) if abs(count - round(count)) < 0.05 else None


def sampled_pulse(process, waits, digital, sample_time, samples):
    """Return the control signal after one sample of noise of height 1, with a dead time of `waits` samples.

    In each sample the process gives y, the controller computes u from the measurement, and the process takes u.
    """
    a, b, c, d, _ = signal.cont2discrete(signal.tf2ss(process.num, process.den), sample_time, "zoh")
    ac, bc, cc, dc = signal.tf2ss(*digital)
    x, z, late = np.zeros(len(a)), np.zeros(len(ac)), [0.0] * waits
    u = np.zeros(samples)
    for k in range(samples):
        if not waits and d.any():
            raise ValueError("the process must wait or have no direct part")
        reaches = late[k % waits] if waits else None
        y = (c @ x)[0] + (d[0, 0] * reaches if waits else 0.0)
        e = -y - (1.0 if k == 0 else 0.0)
        u[k] = (cc @ z)[0] + dc[0, 0] * e
        z = ac @ z + bc[:, 0] * e
        if waits:
            late[k % waits] = u[k]
        x = a @ x + b[:, 0] * (reaches if waits else u[k])
        if abs(u[k]) > 1e6 * (1 + abs(dc[0, 0])):
            raise ArithmeticError("the sampled loop is unstable")
    return u
