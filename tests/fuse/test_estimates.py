"""Combining estimates: against closed forms and Monte Carlo with a correlation known only to the test."""

from __future__ import annotations

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.fuse.estimates import covariance_intersection, fuse_tracks, weighted_least_squares

P1, P2 = np.diag([1.0, 9.0]), np.array([[4.0, 1.0], [1.0, 2.0]])


def test_least_squares_is_the_normal_equations() -> None:
    rng = np.random.default_rng(1)
    H, root = rng.normal(size=(6, 3)), rng.normal(size=(6, 6))
    R, z = root @ root.T + np.eye(6), rng.normal(size=6)
    W = np.linalg.inv(R)
    got = weighted_least_squares(z, H, R)
    np.testing.assert_allclose(got.P, np.linalg.inv(H.T @ W @ H), rtol=1e-9)
    np.testing.assert_allclose(got.x, got.P @ H.T @ W @ z, rtol=1e-9)


def test_three_sources_reach_the_optimum() -> None:
    got = weighted_least_squares([1.0, 2.0, 3.0], np.ones((3, 1)), np.diag([0.05, 0.1, 1.0]) ** 2)
    assert np.sqrt(got.P[0, 0]) == pytest.approx(0.0447, abs=5e-5)


@pytest.mark.parametrize("rho", [-0.9, 0.0, 0.6, 0.95])
def test_consistency_with_a_correlation(rho: float) -> None:
    """Known: NEES 2 ± 0.08, 4 standard errors of 10000 runs (√(4/10000) = 0.02). Intersection: below."""
    rng = np.random.default_rng(2)
    L1, L2 = np.linalg.cholesky(P1), np.linalg.cholesky(P2)
    a = rng.normal(size=(10_000, 2))
    e1, e2 = a @ L1.T, (rho * a + np.sqrt(1 - rho**2) * rng.normal(size=a.shape)) @ L2.T
    cross = rho * L1 @ L2.T
    known = [fuse_tracks(x, P1, y, P2, cross) for x, y in zip(e1, e2)]
    nees = np.mean([f.x @ np.linalg.solve(f.P, f.x) for f in known])
    assert nees == pytest.approx(2.0, abs=0.08)
    P = covariance_intersection([e1[0], e2[0]], [P1, P2]).P
    zero = np.zeros(2)
    A = np.array([covariance_intersection([u, zero], [P1, P2]).x for u in np.eye(2)]).T
    B = np.array([covariance_intersection([zero, u], [P1, P2]).x for u in np.eye(2)]).T
    actual = A @ P1 @ A.T + A @ cross @ B.T + B @ cross.T @ A.T + B @ P2 @ B.T
    assert np.linalg.eigvalsh(P - actual).min() >= -1e-9  # the combination is linear: its covariance exactly
    assert np.trace(np.linalg.solve(P, actual)) <= 2.0 + 1e-9  # its mean NEES
    if rho == 0.95:  # taken for independent, two tracks that share their errors are optimistic
        naive = [fuse_tracks(x, P1, y, P2) for x, y in zip(e1, e2)]
        assert np.mean([f.x @ np.linalg.solve(f.P, f.x) for f in naive]) > 2.5


def test_intersection_of_alike_and_of_better() -> None:
    same = covariance_intersection([[1.0, 2.0]] * 3, [P1] * 3)
    np.testing.assert_allclose(same.P, P1, rtol=1e-9)
    better = covariance_intersection([[1.0, 2.0], [5.0, 5.0]], [P1, 100 * P1])
    np.testing.assert_allclose(better.x, [1.0, 2.0], atol=1e-9)


def test_mistakes_are_told() -> None:
    with pytest.raises(UserError, match="do not fix"):
        weighted_least_squares([1.0], [[1.0, 0.0]], [[1.0]])
    with pytest.raises(UserError, match="positive definite"):
        weighted_least_squares([1.0], [[1.0]], [[0.0]])
    with pytest.raises(UserError, match="positive definite"):
        covariance_intersection([[1.0]], [[[0.0]]])
    with pytest.raises(UserError, match="at least one"):
        covariance_intersection([], [])
