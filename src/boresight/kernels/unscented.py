"""The unscented transform as statistical linearisation, and the unscented filter over a whole stream.

Points go through the function; the slope A and the residual covariance Ω that they show take the place of the
Jacobian, so that prediction and update are the same symmetric, Joseph-form code as the EKF's.
"""

# Numba caches by file and compiles kernels.gaussian into these: clear __pycache__ (make clean) when that changes.
from __future__ import annotations

import math

import numpy as np
from numba import njit

from boresight.kernels.gaussian import cholesky, solve_upper
from boresight.kernels.write import write_vector
from boresight.types.sensor import FloatArray


@njit(cache=True)
def sigma_points(x: FloatArray, P: FloatArray, scaling: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the points (2n+1, n) and the Cholesky factor (n, n); `scaling` = (alpha, beta, kappa).

    α = 1, β = 0, κ = 0 are the cubature points (Arasaratnam and Haykin 2009). Points are NaN where P is not positive
    definite.
    """
    n = x.shape[0]
    L = np.zeros((n, n))
    X = np.empty((2 * n + 1, n))
    if not cholesky(P, L):
        X[:, :] = np.nan
        return X, L
    s = math.sqrt(scaling[0] ** 2 * (n + scaling[2]))
    for j in range(n):
        X[0, j] = x[j]
        for i in range(n):
            X[1 + i, j] = x[j] + s * L[j, i]
            X[1 + n + i, j] = x[j] - s * L[j, i]
    return X, L


@njit(cache=True)
def linearise(L: FloatArray, Y: FloatArray, scaling: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return mean (m,), slope A (m, n) and residual covariance Ω (m, m) of the points' images `Y` (2n+1, m).

    A = CᵀP⁻¹ with C the cross-covariance; cov(Y) = APAᵀ + Ω.
    """
    n, m = L.shape[0], Y.shape[1]
    total = scaling[0] ** 2 * (n + scaling[2])
    s = math.sqrt(total)
    w = 0.5 / total
    w0 = 1.0 - n / total
    w0c = w0 + 1.0 - scaling[0] ** 2 + scaling[1]
    mean, A, Omega = np.empty(m), np.empty((m, n)), np.empty((m, m))
    column = np.empty(n)
    for a in range(m):
        shift = 0.0
        for i in range(1, 2 * n + 1):
            shift += w * (Y[i, a] - Y[0, a])
        mean[a] = Y[0, a] + shift
        for i in range(n):
            column[i] = w * s * (Y[1 + i, a] - Y[1 + n + i, a])
        solve_upper(L, column)
        write_vector(A[a], column)
    slope = np.zeros((m, n))  # A L
    for a in range(m):
        for i in range(n):
            for k in range(i, n):
                slope[a, i] += A[a, k] * L[k, i]
    for a in range(m):
        for b in range(a + 1):
            value = w0c * (Y[0, a] - mean[a]) * (Y[0, b] - mean[b])
            for i in range(1, 2 * n + 1):
                value += w * (Y[i, a] - mean[a]) * (Y[i, b] - mean[b])
            for i in range(n):
                value -= slope[a, i] * slope[b, i]
            Omega[a, b] = value
            Omega[b, a] = value
    return mean, A, Omega
