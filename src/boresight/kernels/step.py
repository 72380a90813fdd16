"""One prediction or update of the EKF with the built-in models in one call: what a loop over reports pays for."""

# Numba caches by file and compiles kernels.gaussian into these: clear __pycache__ (make clean) when that changes.
from __future__ import annotations

import numpy as np
from numba import njit

from boresight.kernels.gaussian import joseph_update, sandwich
from boresight.kernels.motion import move
from boresight.kernels.observation import observe
from boresight.types.sensor import FloatArray


@njit(cache=True)
def predict_step(x: FloatArray, P: FloatArray, dt: float, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the moved mean (n,) and covariance (n, n)."""
    n = x.shape[0]
    moved, F, Q = np.empty(n), np.empty((n, n)), np.empty((n, n))
    move(x, dt, parameters, moved, F, Q)
    return moved, sandwich(F, P, Q)


@njit(cache=True)
def update_step(
    x: FloatArray, P: FloatArray, z: FloatArray, context: FloatArray, n_estimated: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, float, float]:
    """Return conditioned mean and covariance, innovation (m,), S, NIS, log likelihood; m is 0 where nothing is seen."""
    n = x.shape[0]
    y, H, R = np.empty(7), np.empty((7, n)), np.empty((7, 7))
    m = observe(x, z, context, y, H, R)
    y, H = y[:m].copy(), H[:m].copy()
    x_new, P_new, S, nis, log_likelihood = joseph_update(x, P, y, H, R[:m, :m].copy(), n_estimated)
    return x_new, P_new, y, S, nis, log_likelihood
