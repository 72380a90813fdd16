"""Smoothing rows and predictors against the printed numbers, exact least squares and SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import savgol_coeffs

from boresight.align.delay import align_linear
from boresight.align.smooth import hat_matrix, one_step_predictor, polynomial_weights, weighted_differences
from boresight.errors import UserError

PRINTED = np.array(  # phased_array (4), over 42
    [
        [39, 8, -4, -4, 1, 4, -2], [8, 19, 16, 6, -4, -7, 4], [-4, 16, 19, 12, 2, -4, 1], [-4, 6, 12, 14, 12, 6, -4],
        [1, -4, 2, 12, 19, 16, -4], [4, -7, -4, 6, 16, 19, 8], [-2, 4, 1, -4, -4, 8, 39],
    ]
)  # fmt: skip


def test_all_seven_rows_are_the_papers() -> None:
    np.testing.assert_allclose(hat_matrix(7, 3), PRINTED / 42, atol=1e-12)


def test_predictors() -> None:
    np.testing.assert_allclose(one_step_predictor(5, 1), np.array([-4, -1, 2, 5, 8]) / 10, atol=1e-12)
    np.testing.assert_allclose(one_step_predictor(7, 2), np.array([18, -6, -18, -18, -6, 18, 54]) / 42, atol=1e-12)
    # noise gain 1.0488 and, on a t²/2, a lag of 3.5 a, as METHODS has it
    w = one_step_predictor(5, 1)
    assert np.sqrt(w @ w) == pytest.approx(1.0488, abs=1e-4)
    assert w @ (0.5 * np.arange(5.0) ** 2) - 0.5 * 25.0 == pytest.approx(-3.5)


@pytest.mark.parametrize(("n", "order"), [(5, 2), (9, 3), (11, 4)])
def test_the_middle_row_is_scipys(n: int, order: int) -> None:
    np.testing.assert_allclose(hat_matrix(n, order)[n // 2], savgol_coeffs(n, order)[::-1], atol=1e-12)


def test_uneven_times_are_exact_for_polynomials() -> None:
    t = 1.7e9 + np.array([0.0, 0.9, 2.2, 2.9, 4.4, 5.0])
    w = polynomial_weights(t, [t[-1] + 1.0], 2)[0]
    s = t - t[0]
    assert w @ (3 - 2 * s + 0.5 * s**2) == pytest.approx(3 - 2 * 6.0 + 0.5 * 36.0, abs=1e-6)
    with pytest.raises(UserError, match="different times"):
        polynomial_weights([1.0, 1.0], [2.0], 1)


def test_variance_is_the_sum_of_squares() -> None:
    """1 % against Monte Carlo: 2e5 draws give 0.32 %."""
    w = one_step_predictor(7, 2)
    draws = np.random.default_rng(14).standard_normal((200_000, 7)) @ w
    assert draws.var() == pytest.approx(w @ w, rel=0.011)


def test_the_printed_extrapolation_lags() -> None:
    """(5) on ½t²: between 1 and 2.7 times the acceleration behind (METHODS), the quadratic not at all."""
    y = 0.5 * np.arange(7.0)[:, None] ** 2
    for eta in (np.arange(6.0, 0, -1), np.array([1.0, 0, 0, 0, 0, 0]), np.ones(6)):
        lag = 0.5 * 49.0 - float(weighted_differences(y, eta)[0])
        assert 0.99 <= lag <= 3.6
    assert one_step_predictor(7, 2) @ y[:, 0] == pytest.approx(0.5 * 49.0)


def test_a_line_through_two_reports() -> None:
    got = align_linear(0.3, [1.0, 2.0], 1.3, [2.0, 4.0], 2.0)
    np.testing.assert_allclose(got.value, [2.7, 5.4])
    assert got.gain == pytest.approx(np.hypot(1.7, 0.7))  # √((1 + τ)² + τ²), τ = 0.7
    with pytest.raises(UserError, match="same time"):
        align_linear(1.0, 0.0, 1.0, 0.0, 2.0)
