"""Weights of sources: what the printed way loses and the others reach."""

from __future__ import annotations

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.fuse.weights import (
    ResidualVariance,
    deviation_variance,
    inverse_variance,
    residual_variance,
    three_cornered_hat,
)

SIGMA = np.array([0.05, 0.1, 1.0])
RNG = np.random.default_rng(15)
NOISE = SIGMA * RNG.standard_normal((200_000, 3))


def fused(variance: np.ndarray) -> float:
    return float(np.sqrt(inverse_variance(variance) ** 2 @ SIGMA**2))


def mean_square(values: np.ndarray) -> np.ndarray:
    return ((values[:, :, None] - values[:, None, :]) ** 2).mean(axis=0)


def test_fused_sigma_of_three_sources() -> None:
    """As printed 0.124 where 0.0447 is possible; the three-cornered hat reaches 0.047.

    It splits the two good sources by the bad one: it takes 2e4 samples until 2·1·0.11/√n is below 0.05².
    """
    assert fused(SIGMA**2) == pytest.approx(0.0447, abs=1e-4)
    assert fused(deviation_variance(NOISE)) == pytest.approx(0.124, abs=0.003)
    assert fused(three_cornered_hat(mean_square(NOISE[:50_000]), np.full(3, 1e-6))) <= 0.047


def test_a_constant_bias_counts_only_in_the_hat() -> None:
    off = NOISE + np.array([0.0, 0.5, 0.0])
    np.testing.assert_allclose(deviation_variance(off), deviation_variance(NOISE))
    hat = three_cornered_hat(mean_square(off), np.full(3, 1e-6))
    assert hat[1] == pytest.approx(0.1**2 + 0.5**2, rel=0.02)


def test_weights_that_cannot_be_are_told() -> None:
    np.testing.assert_allclose(inverse_variance([1.0, np.inf]), [1.0, 0.0])
    with pytest.raises(UserError, match="positive variances"):
        inverse_variance([1.0, 0.0])


def test_residuals_to_the_fused_prediction_reach_the_optimum() -> None:
    """From equal weights: 600 samples of a constant, predicted by the fused ones before, give METHODS' .047 at most."""
    values, variance, mean, P = NOISE[:600], np.ones(3), 0.0, 1.0
    residuals, shares = [], []
    for k, row in enumerate(values):
        residuals.append(row - mean)
        shares.append(P)
        w = inverse_variance(variance)
        R = float(w**2 @ variance)
        gain = max(P / (P + R), 1.0 / 50.0)
        mean += gain * (float(w @ row) - mean)
        P = (1 - gain) ** 2 * P + gain**2 * R
        if k >= 30:
            variance = residual_variance(residuals[10:], np.mean(shares[10:]), np.full(3, 1e-6))
    assert fused(variance) <= 0.047
    # 600 samples: a standard error of 3 % of each deviation, and the first ones' coarse prediction
    np.testing.assert_allclose(np.sqrt(variance), SIGMA, rtol=0.15)


def test_a_running_variance_settles_on_the_ratio() -> None:
    rng = np.random.default_rng(16)
    state = ResidualVariance()
    ratios = []
    for _ in range(4000):
        y = np.array([3.0, 3.0]) * 0.1 * rng.standard_normal(2) + 0.05 * rng.standard_normal(2)
        state = state.after(y, 0.05**2 * np.eye(2), 0.1**2 * np.eye(2))
        ratios.append(state.ratio)
    assert np.mean(ratios[500:]) == pytest.approx(0.91 * 9.0 + 0.09, rel=0.05)  # ten residuals' worth of prior
