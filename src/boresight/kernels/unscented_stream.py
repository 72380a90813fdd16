"""The unscented filter over a whole stream, in one call."""

# Numba caches by file and compiles kernels.gaussian into these: clear __pycache__ (make clean) when that changes.
from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, types

from boresight.kernels.gaussian import joseph_update, sandwich
from boresight.kernels.signatures import MATRIX, MOTION, OBSERVATION, STACK, VECTOR
from boresight.kernels.unscented import linearise, sigma_points
from boresight.kernels.write import write_matrix, write_vector
from boresight.types.sensor import FloatArray


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
