"""Quadratic programmes: a step that makes a quadratic function least and keeps linear limits."""

from __future__ import annotations

import numpy as np

from pidalab._check import Array

FLATTEST = 1e-9  # curvature that a direction has at least


def multipliers(slope: Array, rows: Array, left: Array) -> Array:
    """Prices of the limits that are reached, not negative, which explain the slope best."""
    from scipy.optimize import nnls

    prices = np.zeros(left.size)
    reached = left < 1e-3
    if reached.any():
        prices[reached] = nnls(rows[reached].T, slope)[0]
    return prices


def convex(hessian: Array, reached: Array) -> Array:
    """Second derivatives, made positive: along the limits that are reached where they have to be, off them freely."""
    if reached.size:
        _, sizes, turned = np.linalg.svd(reached)
        free = turned[int(np.sum(sizes > 1e-9 * sizes[0])) :].T
    else:
        free = np.eye(len(hessian))
    values, vectors = np.linalg.eigh(free.T @ hessian @ free)
    along = free @ vectors
    wanted = np.maximum(np.abs(values), FLATTEST)
    hessian = hessian + (along * (wanted - values)) @ along.T
    heavy = max(1e-3, float(np.abs(hessian).max(initial=0.0)))
    off = np.eye(len(hessian)) - free @ free.T
    for factor in 10.0 ** np.arange(0, 8):
        out = np.asarray(hessian + factor * heavy * off)
        if np.linalg.eigvalsh(out)[0] > 0:
            return out
    return out


def solve_qp(
    hessian: Array, slope: Array, rows: Array, left: Array, trust: float
) -> tuple[Array, Array] | None:
    """Step that makes a quadratic function least and keeps limits and trust, and the prices of the limits.

    As a least-distance programme [LaH95]_.
    """
    from scipy.optimize import nnls

    size = slope.size
    rows = np.vstack([rows, np.eye(size), -np.eye(size)])
    left = np.concatenate([left, np.full(2 * size, trust)])
    root = np.linalg.cholesky(hessian)  # lower: hessian = root root^T
    best = np.asarray(-np.linalg.solve(hessian, slope), dtype=float)
    turned = np.linalg.solve(root, rows.T)  # columns: limits in the metric of the function
    wanted = -left - rows @ best
    if np.all(wanted <= 0):
        return best, np.zeros(left.size - 2 * size)
    scale = np.linalg.norm(turned, axis=0)
    system = np.vstack([turned / scale, wanted / scale])
    target = np.append(np.zeros(size), 1.0)
    weights, _ = nnls(system, target)
    rest = system @ weights - target
    if -rest[-1] < 1e-13:
        return None
    prices = weights / scale / -rest[-1]
    step = np.asarray(best + np.linalg.solve(root.T, turned @ prices), dtype=float)
    return step, prices[: left.size - 2 * size]
