"""Compressing fast angles to a slow sensor's times, and combining two measurements of one thing."""

from __future__ import annotations

import numpy as np

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


def combine(a: FloatArray, variance_a: float, b: FloatArray, variance_b: float) -> tuple[FloatArray, float]:
    """Return the precision-weighted mean of two angles (rad), wrapped, and its variance: shao2012 (8)-(11) mended."""
    variance = 1.0 / (1.0 / variance_a + 1.0 / variance_b)
    return np.vectorize(wrap)(a + variance / variance_b * np.vectorize(wrap)(b - a)), variance
