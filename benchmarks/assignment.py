"""Assignment on a sparse cost list against SciPy's dense one."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from boresight.kernels.assignment import assign_sparse

Problem = tuple[np.ndarray, np.ndarray, np.ndarray, int, np.ndarray]


def problem(targets: int) -> Problem:
    """Return (start, column, cost, columns, dense) of `targets` tracks, each with its detection and some neighbours.

    The dense matrix has a private column of cost zero for every row that stays alone.
    """
    rng = np.random.default_rng(targets)
    side = 30.0 * np.sqrt(targets)  # about one neighbour in a gate
    tracks = rng.uniform(0.0, side, (targets, 2))
    clutter = rng.uniform(0.0, side, (targets // 10, 2))
    detections = np.concatenate([tracks + rng.normal(0.0, 4.0, tracks.shape), clutter])
    m = len(detections)
    dense = np.full((targets, m + targets), 1e6)
    dense[:, m:][np.diag_indices(targets)] = 0.0
    start, column, cost = [0], [], []
    for i in range(targets):
        d2 = ((detections - tracks[i]) ** 2).sum(axis=1) / 16.0
        near = np.flatnonzero(d2 < 13.8)
        column.append(near)
        cost.append(0.5 * d2[near] - 8.0)
        dense[i, near] = cost[-1]
        start.append(start[-1] + len(near))
    return np.array(start, np.int64), np.concatenate(column).astype(np.int64), np.concatenate(cost), m, dense


def sparse(p: Problem) -> float:
    """Total cost by the sparse kernel."""
    start, column, cost, m, _ = p
    chosen = np.empty(len(start) - 1, np.int64)
    assign_sparse(start, column, cost, m, chosen)
    total = 0.0
    for i in np.flatnonzero(chosen >= 0):
        part = slice(start[i], start[i + 1])
        total += float(cost[part][column[part] == chosen[i]][0])
    return total


def sparse_only(p: Problem) -> None:
    """The kernel alone: what is timed."""
    assign_sparse(p[0], p[1], p[2], p[3], np.empty(len(p[0]) - 1, np.int64))


def dense(p: Problem) -> float:
    """Total cost by SciPy."""
    rows, columns = linear_sum_assignment(p[4])
    return float(p[4][rows, columns].sum())
