"""A fixed-lag smoother of one angle, white jerk, many runs and many settings at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from boresight.types.sensor import FloatArray


def white_jerk(step: float) -> tuple[FloatArray, FloatArray]:
    """Return F (3, 3) and Q (3, 3) per unit of q of an angle, its rate and its acceleration."""
    h = step
    F = np.array([[1.0, h, h * h / 2], [0.0, 1.0, h], [0.0, 0.0, 1.0]])
    Q = np.array([[h**5 / 20, h**4 / 8, h**3 / 6], [h**4 / 8, h**3 / 3, h**2 / 2], [h**3 / 6, h**2 / 2, h]])
    return F, Q


def fixed_lag(
    z: FloatArray, variance: FloatArray, q: FloatArray, P0: FloatArray, step: float, epochs: NDArray[np.intp], lag: int
) -> tuple[FloatArray, FloatArray]:
    """Return estimates (b, runs, e) and their variances (b, e) at sample numbers `epochs` (e,) from `lag` samples more.

    Reports `z` (b, runs, n) of variances (b, n), jerk densities `q` (b,), prior covariance `P0` (3, 3) about the first
    report. Kalman filter forward, Rauch–Tung–Striebel back over the lag.
    """
    b, runs, n = z.shape
    F, Q1 = white_jerk(step)
    Q = q[:, None, None] * Q1
    x = np.zeros((b, runs, 3))
    P = np.broadcast_to(P0, (b, 3, 3))
    kept_x, kept_P = np.empty((n, b, runs, 3)), np.empty((n, b, 3, 3))
    for k in range(n):
        if k:
            x, P = x @ F.T, F @ P @ F.T + Q
        S = P[:, 0, 0] + variance[:, k]
        K = P[:, :, 0] / S[:, None]
        x = x + (z[:, :, k] - x[:, :, 0])[..., None] * K[:, None, :]
        P = P - K[:, :, None] * K[:, None, :] * S[:, None, None]
        kept_x[k], kept_P[k] = x, P
    value, spread = np.empty((b, runs, len(epochs))), np.empty((b, len(epochs)))
    for i, epoch in enumerate(epochs):
        xs, Ps = kept_x[epoch + lag], kept_P[epoch + lag]
        for k in range(epoch + lag - 1, epoch - 1, -1):
            ahead = F @ kept_P[k] @ F.T + Q
            G = np.swapaxes(np.linalg.solve(ahead, F @ kept_P[k]), 1, 2)
            xs = kept_x[k] + (xs - kept_x[k] @ F.T) @ np.swapaxes(G, 1, 2)
            Ps = kept_P[k] + G @ (Ps - ahead) @ np.swapaxes(G, 1, 2)
        value[:, :, i], spread[:, i] = xs[:, :, 0], Ps[:, 0, 0]
    return value, spread
