"""Compressing fast angles to a slow sensor's times, and combining two measurements of one thing."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from boresight.errors import UserError
from boresight.kernels.measurement import wrap
from boresight.types.sensor import FloatArray


def compress(angles: FloatArray) -> FloatArray:
    """Return the least-squares line through n equally spaced samples (..., n), evaluated at the newest.

    -2/n Σ z_i + 6/(n(n+1)) Σ i z_i: shao2012 (4) and (6). Angles (rad) are unwrapped along the last axis first. A
    track keeps only 50/33/29 % of the information for n = 2/5/10: update with every sample where that counts.
    """
    n = angles.shape[-1]
    i = np.arange(1, n + 1)
    weights = -2.0 / n + 6.0 * i / (n * (n + 1.0))
    return np.asarray(np.unwrap(angles, axis=-1) @ weights)


def compressed_variance(sigma: float, n: int) -> float:
    """Return the variance 2σ²(2n-1)/(n(n+1)) of `compress`: shao2012 (5) and (7)."""
    return 2.0 * sigma**2 * (2 * n - 1) / (n * (n + 1.0))


def curvature_bias(weights: ArrayLike, times: ArrayLike, at: float, acceleration: float) -> float:
    """Return what `weights` (n,) of samples at `times` (n,) (s) miss by at `at` under a constant second derivative.

    ½ a Σ wᵢ(tᵢ − t)²; for `compress`, samples T apart, it is −a T²(n−1)(n−2)/12 (shao2012, not printed there).
    """
    w, t = np.asarray(weights, dtype=np.float64), np.asarray(times, dtype=np.float64)
    return 0.5 * acceleration * float(w @ (t - at) ** 2)


def compress_innovations(y: ArrayLike, H: ArrayLike, variance: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return m innovations as min(m, n) of unit covariance, y' and H' (·, n), that tell a track exactly as much.

    `y` (m,) are reports less their prediction, `H` (m, n) their Jacobians with respect to the state at the one time of
    the update, so H_i Φ(t_i, t), and `variance` (m,) of independent noise: QR of [H y] weighted by 1/σ. Lossless but
    for process noise between the reports; where H is alike in all it is their mean, of variance σ²/m. Raises UserError
    for variances that are not positive.
    """
    v = np.asarray(variance, dtype=np.float64)
    if not (v > 0).all():
        raise UserError("compressed innovations need positive variances")
    scale = 1.0 / np.sqrt(v)
    Q, R = np.linalg.qr(np.asarray(H, dtype=np.float64) * scale[:, None])
    return Q.T @ (np.asarray(y, dtype=np.float64) * scale), R


def combine(a: FloatArray, variance_a: float, b: FloatArray, variance_b: float) -> tuple[FloatArray, float]:
    """Return the precision-weighted mean of two angles (rad), wrapped, and its variance: shao2012 (8)-(11) mended."""
    variance = 1.0 / (1.0 / variance_a + 1.0 / variance_b)
    return np.vectorize(wrap)(a + variance / variance_b * np.vectorize(wrap)(b - a)), variance
