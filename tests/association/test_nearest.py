"""Gate and assignment against brute force and SciPy's dense optimum."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from boresight.association import nearest
from boresight.errors import UserError


def problem(rng: np.random.Generator, n: int, m: int, d: int, side: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tracks of very unequal covariances; detections at some of them and anywhere."""
    A = rng.normal(size=(n, d, d)) * 10.0 ** rng.uniform(-0.5, 1.0, (n, 1, 1))
    S = A @ A.transpose(0, 2, 1) + 0.1 * np.eye(d)
    x = rng.uniform(-side, side, (n, d))
    near = x[rng.integers(0, n, m // 2)] + rng.normal(size=(m // 2, d)) * 3.0
    return x, S, np.concatenate((near, rng.uniform(-side, side, (m - m // 2, d))))


def dense(
    x: np.ndarray, S: np.ndarray, z: np.ndarray, gate: float, p: float, density: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return d² (n, m) and cost (n, m), inf where a pair is forbidden or not worth it."""
    y = z[None] - x[:, None]
    d2 = np.einsum("nmi,nij,nmj->nm", y, np.linalg.inv(S), y)
    d = x.shape[1]
    cost = 0.5 * (d2 + np.linalg.slogdet(S)[1][:, None] + d * math.log(2 * math.pi)) - math.log(p / (1 - p) / density)
    return d2, np.where((d2 < gate) & (cost < 0), cost, np.inf)


@pytest.mark.parametrize(
    ("n", "m", "d", "side"), [(40, 50, 2, 60.0), (30, 60, 3, 40.0), (200, 150, 2, 400.0), (3, 1, 2, 5.0)]
)
def test_pairs_and_cost_equal_the_dense_problem(n: int, m: int, d: int, side: float) -> None:
    rng = np.random.default_rng(n + m)
    for _ in range(20):
        x, S, z = problem(rng, n, m, d, side)
        density = 10.0 ** rng.uniform(-6, -2)
        found = nearest.assign(x, S, z, gate=14.0, p_detection=0.9, clutter_density=density)
        d2, cost = dense(x, S, z, 14.0, 0.9, density)
        for i in range(n):
            own = slice(found.pairs.start[i], found.pairs.start[i + 1])
            assert sorted(found.pairs.detection[own]) == list(np.flatnonzero(np.isfinite(cost[i])))
            np.testing.assert_allclose(found.pairs.cost[own], cost[i, found.pairs.detection[own]], rtol=1e-8, atol=1e-8)
            if found.detection[i] >= 0:
                assert found.d2[i] == pytest.approx(d2[i, found.detection[i]])
        full = np.hstack((np.where(np.isfinite(cost), cost, 1e9), np.where(np.eye(n) > 0, 0.0, 1e9)))
        rows, columns = linear_sum_assignment(full)
        assert found.cost == pytest.approx(full[rows, columns].sum(), abs=1e-7)
        taken = found.detection[found.detection >= 0]
        assert len(set(taken.tolist())) == len(taken)


def test_everything_in_one_spot_and_nothing_at_all() -> None:
    x, S = np.zeros((30, 2)), np.broadcast_to(np.eye(2), (30, 2, 2))
    found = nearest.assign(x, S, np.zeros((20, 2)), gate=9.0, clutter_density=1e-6)
    assert len(found.pairs.cost) == 600
    assert (found.detection >= 0).sum() == 20
    none = nearest.assign(x, S, np.empty((0, 2)), gate=9.0, clutter_density=1e-6)
    assert none.cost == 0.0
    assert (none.detection == -1).all()
    far = nearest.assign(x, S, np.full((3, 2), 1e12), gate=9.0, clutter_density=1e-6)
    assert (far.detection == -1).all()
    assert len(nearest.assign(x[:0], S[:0], np.zeros((2, 2)), gate=9.0, clutter_density=1e-6).detection) == 0


def test_mistakes_are_named() -> None:
    x, S, z = np.zeros((2, 2)), np.array([np.eye(2), -np.eye(2)]), np.zeros((1, 2))
    with pytest.raises(UserError, match="track 1 is not positive definite"):
        nearest.assign(x, S, z, gate=9.0, clutter_density=1.0)
    with pytest.raises(UserError, match="d of 2 or more"):
        nearest.assign(x, S, np.zeros((1, 3)), gate=9.0, clutter_density=1.0)
    with pytest.raises(UserError, match="must be positive"):
        nearest.assign(x, S, z, gate=9.0, clutter_density=0.0)
    with pytest.raises(UserError, match="must be finite"):
        nearest.assign(x, S, z * np.nan, gate=9.0, clutter_density=1.0)
