"""Conditioning on several numbers at once against one after another, and against dense matrices."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray

from boresight.kernels.blocks import condition, condition_three, condition_two, load, store

Array = NDArray[np.float64]


@njit(error_model="numpy")
def together(b: Array, h: Array, y: Array, r: Array) -> tuple[float, float]:
    p, v, A, B, C = load(b, 0, 1)
    g = (h[0, 0], h[0, 1], h[0, 2]), (h[1, 0], h[1, 1], h[1, 2])
    if len(y) == 2:
        p, v, A, B, C, nis, s = condition_two(p, v, A, B, C, g[0], y[0], r[0], g[1], y[1], r[1])
    else:
        third = (h[2, 0], h[2, 1], h[2, 2])
        p, v, A, B, C, nis, s = condition_three(p, v, A, B, C, g[0], y[0], r[0], g[1], y[1], r[1], third, y[2], r[2])
    store(b, 0, 1, p, v, A, B, C)
    return nis, s


@njit(error_model="numpy")
def in_turn(b: Array, h: Array, y: Array, r: Array) -> tuple[float, float]:
    p, v, A, B, C = load(b, 0, 1)
    prior, total, det = p, 0.0, 1.0
    for i in range(len(y)):
        p, v, A, B, C, nis, s = condition(p, v, A, B, C, prior, (h[i, 0], h[i, 1], h[i, 2]), y[i], r[i])
        total, det = total + nis, det * s
    store(b, 0, 1, p, v, A, B, C)
    return total, det


def belief(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Return a packed belief (27,), its mean and its covariance."""
    L = rng.normal(size=(6, 6)) * np.array([[30.0, 20.0, 10.0, 3.0, 2.0, 1.0]]).T
    x, P = rng.normal(size=6), L @ L.T
    upper = np.triu_indices(3)
    return np.r_[x, P[:3, :3][upper], P[:3, 3:].ravel(), P[3:, 3:][upper]], x, P


@pytest.mark.parametrize("m", [2, 3])
def test_together_is_in_turn_is_dense(m: int) -> None:
    rng = np.random.default_rng(m)
    for missing in itertools.product((False, True), repeat=m):
        b, x, P = belief(rng)
        h, y, r = rng.normal(size=(m, 3)), rng.normal(size=m), rng.uniform(0.1, 2.0, size=m)
        y[list(missing)] = np.nan
        other = b.copy()
        found, expected = together(b, h, y, r), in_turn(other, h, y, r)
        np.testing.assert_allclose(b, other, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(found, expected, rtol=1e-9)
        seen = ~np.isnan(y)
        H = np.zeros((seen.sum(), 6))
        H[:, :3] = h[seen]
        S = H @ P @ H.T + np.diag(r[seen])
        K = np.linalg.solve(S, H @ P).T if seen.any() else np.zeros((6, 0))
        after, upper = P - K @ H @ P, np.triu_indices(3)
        np.testing.assert_allclose(b[:6], x + K @ y[seen], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(b[6:12], after[:3, :3][upper], rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(b[12:21], after[:3, 3:].ravel(), rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(b[21:], after[3:, 3:][upper], rtol=1e-8, atol=1e-8)
        nis: Any = y[seen] @ np.linalg.solve(S, y[seen]) if seen.any() else 0.0
        np.testing.assert_allclose(found, (nis, np.linalg.det(S)), rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("bad", [0, 1, 2])
def test_a_variance_that_is_not_positive_changes_nothing_and_says_so(bad: int) -> None:
    b, _, _ = belief(np.random.default_rng(9))
    h, y, r = np.eye(3), np.ones(3), np.ones(3)
    r[bad] = -1e6
    other = b.copy()
    found, expected = together(b, h, y, r), in_turn(other, h, y, r)
    assert np.isnan(found[0])
    assert np.isnan(expected[0])
    np.testing.assert_allclose(b, other, rtol=1e-9)
    np.testing.assert_allclose(found[1], expected[1], rtol=1e-9)
