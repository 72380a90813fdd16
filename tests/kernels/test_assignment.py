"""The sparse assignment against SciPy's dense one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from boresight.kernels.assignment import assign_sparse


def both(rng: np.random.Generator, n: int, m: int, density: float) -> tuple[float, float]:
    mask = rng.random((n, m)) < density
    cost = np.where(mask, rng.normal(-3.0, 4.0, (n, m)), 0.0)
    start = np.r_[0, np.cumsum(mask.sum(axis=1))].astype(np.int64)
    chosen = np.empty(n, np.int64)
    assign_sparse(start, np.nonzero(mask)[1].astype(np.int64), cost[mask], m, chosen)
    taken = chosen[chosen >= 0]
    assert len(set(taken.tolist())) == len(taken)
    assert mask[np.flatnonzero(chosen >= 0), taken].all()
    dense = np.zeros((n, m + n))
    dense[:, :m] = np.where(mask, cost, 1e6)
    rows, columns = linear_sum_assignment(dense)
    return float(cost[np.flatnonzero(chosen >= 0), taken].sum()), float(dense[rows, columns].sum())


@pytest.mark.parametrize(("n", "density", "runs"), [(8, 0.5, 1500), (60, 0.1, 40), (300, 0.02, 5)])
def test_cost_equals_the_dense_optimum(n: int, density: float, runs: int) -> None:
    rng = np.random.default_rng(n)
    for _ in range(runs):
        ours, dense = both(rng, int(rng.integers(1, n + 1)), int(rng.integers(1, n + 1)), density)
        assert ours == pytest.approx(dense, abs=1e-9)


def test_nothing_to_assign() -> None:
    chosen = np.empty(3, np.int64)
    assign_sparse(np.zeros(4, np.int64), np.zeros(0, np.int64), np.zeros(0), 0, chosen)
    np.testing.assert_array_equal(chosen, [-1, -1, -1])
