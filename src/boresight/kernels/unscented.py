"""The unscented transform as statistical linearisation, and the unscented filter over a whole stream.

Points go through the function; the slope A and the residual covariance Ω that they show take the place of the
Jacobian, so that prediction and update are the same symmetric, Joseph-form code as the EKF's.
"""

# Numba caches by file and compiles kernels.gaussian into these: clear __pycache__ (make clean) when that changes.
from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, types

from boresight.kernels.gaussian import cholesky, joseph_update, sandwich, solve_upper
from boresight.kernels.signatures import MATRIX, MOTION, OBSERVATION, STACK, VECTOR
from boresight.kernels.write import write_matrix, write_vector
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


@njit(
    types.int64(
        MOTION, VECTOR, OBSERVATION, VECTOR, MATRIX, types.float64, VECTOR, MATRIX, MATRIX, VECTOR,
        MATRIX, STACK, MATRIX, STACK, STACK, MATRIX,
    ),
    cache=True,
)  # fmt: skip
def ukf_stream(
    motion: Any,
    parameters: FloatArray,
    observe: Any,
    x0: FloatArray,
    P0: FloatArray,
    t0: float,
    t: FloatArray,
    z: FloatArray,
    context: FloatArray,
    scaling: FloatArray,
    x_out: FloatArray,
    P_out: FloatArray,
    x_predicted: FloatArray,
    P_predicted: FloatArray,
    F_out: FloatArray,
    nis: FloatArray,
) -> int:
    """Filter k reports with the unscented filter; arguments and results as `ekf_stream`, F the statistical slope."""
    n = x0.shape[0]
    x, P = x0.copy(), P0.copy()
    moved, F, Q = np.empty(n), np.empty((n, n)), np.empty((n, n))
    y, H, R = np.empty(7), np.empty((7, n)), np.empty((7, 7))
    images = np.empty((2 * n + 1, n))
    now = t0
    for k in range(t.shape[0]):
        dt = t[k] - now
        X, L = sigma_points(x, P, scaling)
        if dt < 0.0 or np.isnan(X[0, 0]):
            return k
        for i in range(2 * n + 1):
            motion(X[i], dt, parameters, moved, F, Q)
            write_vector(images[i], moved)
            if i == 0:
                noise = Q.copy()
        x, A, Omega = linearise(L, images, scaling)
        P = sandwich(A, P, Omega + noise)
        write_matrix(F_out[k], A)
        write_vector(x_predicted[k], x)
        write_matrix(P_predicted[k], P)
        now = t[k]
        X, L = sigma_points(x, P, scaling)
        if np.isnan(X[0, 0]):
            return k
        m = observe(x, z[k], context[k], y, H, R)
        nis[k, 0] = 0.0
        nis[k, 1] = m
        if m > 0:
            Rm = R[:m, :m].copy()
            Y = np.empty((2 * n + 1, m))
            for i in range(2 * n + 1):
                if observe(X[i], z[k], context[k], y, H, R) != m:
                    return k
                write_vector(Y[i], y[:m])
            mean, A, Omega = linearise(L, Y, scaling)
            x, P, _, nis[k, 0], _ = joseph_update(x, P, mean, -A, Rm + Omega, n)
            if np.isnan(nis[k, 0]):
                return k
        write_vector(x_out[k], x)
        write_matrix(P_out[k], P)
    return len(t)
