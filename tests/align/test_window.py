"""The polynomial window and compression against exact least squares and Monte Carlo."""

from __future__ import annotations

import numpy as np
import pytest

from boresight.align.compression import compress, compress_innovations, compressed_variance, curvature_bias
from boresight.align.smooth import polynomial_weights
from boresight.align.window import PolynomialWindow
from boresight.errors import UserError

TIMES = 0.05 * np.arange(-60, 11) + 1.3e5  # far from zero: centring matters
SIGMA = np.where(np.arange(71) == 60, 0.447, 0.5)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_weights_are_exact_weighted_least_squares(order: int) -> None:
    window = PolynomialWindow(order)
    ours = window.weights(TIMES, SIGMA, TIMES[60])
    V = (TIMES - TIMES[60])[:, None] ** np.arange(order + 1) / SIGMA[:, None]
    exact = np.linalg.solve(V.T @ V, V.T / SIGMA)[0]
    np.testing.assert_allclose(ours, exact, atol=1e-12)
    for power in range(order + 1):
        value = ours @ (TIMES - TIMES[60] + 2.0) ** power
        assert value == pytest.approx(2.0**power, rel=1e-10)


def test_printed_squares_the_weights() -> None:
    alpha = 1.0 / SIGMA**2 / np.maximum(np.abs(np.arange(-60, 11)), 1)
    V = (np.arange(-60, 11) / 60.0)[:, None] ** np.arange(4)
    for printed, w in ((False, alpha), (True, alpha**2)):
        exact = np.linalg.solve(V.T @ (w[:, None] * V), V.T * w)[0]
        ours = PolynomialWindow(3, time_distance=True, printed=printed).weights(TIMES, SIGMA, TIMES[60])
        np.testing.assert_allclose(ours, exact, atol=1e-9)  # times at 1.3e5 s resolve 1e-11 s


def test_the_variance_is_what_monte_carlo_says() -> None:
    rng = np.random.default_rng(3)
    runs = 40_000  # standard error of a variance √(2/40000) = 0.7 %; 2.5 % is 3.5 of them
    y = SIGMA[:, None] * rng.normal(size=(71, runs))
    for window in (PolynomialWindow(2), PolynomialWindow(3, time_distance=True), PolynomialWindow(3, True, True)):
        fitted = window.fit(TIMES, y, SIGMA, TIMES[60])
        assert fitted.value.var() == pytest.approx(fitted.variance, rel=0.025)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_the_order_is_chosen(order: int) -> None:
    """A polynomial plain to see is found; ln 71 per parameter takes one too many in under 1 run of 20."""
    rng = np.random.default_rng(order)
    t = TIMES - TIMES[60]
    chosen = []
    for _ in range(100):
        y = 3.0 * (t**order) + SIGMA * rng.normal(size=71)
        chosen.append(PolynomialWindow(None).fit(TIMES, y, SIGMA, TIMES[60]).order)
    assert min(chosen) == order
    assert np.mean(np.array(chosen) == order) > 0.9


def test_compression_is_the_line_at_the_newest_and_its_bias_known() -> None:
    for n in (2, 5, 10):
        t = 0.02 * np.arange(n)
        row = polynomial_weights(t, [t[-1]], 1)[0]
        np.testing.assert_allclose(compress(np.eye(n)), row, atol=1e-12)
        assert compressed_variance(0.3, n) == pytest.approx(0.09 * row @ row, rel=1e-12)
        bias = curvature_bias(row, t, float(t[-1]), 4.0)
        assert bias == pytest.approx(-4.0 * 0.02**2 * (n - 1) * (n - 2) / 12, abs=1e-15)
        assert row @ (0.5 * 4.0 * (t - t[-1]) ** 2) == pytest.approx(bias, abs=1e-15)


def test_compressed_innovations_lose_nothing() -> None:
    rng = np.random.default_rng(5)
    P = np.diag([4.0, 9.0, 1.0])
    age = -0.02 * np.arange(10)[::-1]
    H = np.stack([np.ones(10), age, age**2 / 2], axis=1)
    variance = 0.1 + rng.random(10)
    y = rng.normal(size=10)

    def update(y: np.ndarray, H: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        return K @ y, P - K @ H @ P

    short, rows = compress_innovations(y, H, variance)
    assert rows.shape == (3, 3)
    for a, b in zip(update(short, rows, np.eye(3)), update(y, H, np.diag(variance))):
        np.testing.assert_allclose(a, b, atol=1e-10)
    short, rows = compress_innovations(y, np.ones((10, 1)), np.full(10, 0.5))
    assert short[0] / rows[0, 0] == pytest.approx(y.mean())
    assert 1.0 / rows[0, 0] ** 2 == pytest.approx(0.05)


def test_mistakes_are_told() -> None:
    with pytest.raises(UserError, match="order"):
        PolynomialWindow(4)
    with pytest.raises(UserError, match="3 different times"):
        PolynomialWindow(2).weights([1.0, 1.0, 2.0], [1.0, 1.0, 1.0], 2.0)
    with pytest.raises(UserError, match="positive"):
        PolynomialWindow(1).weights([1.0, 2.0], [1.0, 0.0], 2.0)
    with pytest.raises(UserError, match="positive"):
        compress_innovations([1.0], [[1.0]], [0.0])


@pytest.mark.parametrize("n", [2, 5, 10])
def test_compression_varies_as_its_variance_says(n: int) -> None:
    """1 % against Monte Carlo: 4e5 draws give 0.22 %."""
    draws = compress(0.01 * np.random.default_rng(n).standard_normal((400_000, n)))
    assert draws.var() == pytest.approx(compressed_variance(0.01, n), rel=0.01)
