"""Whole streams in one call: extended Kalman filter, Cramér-Rao bound, over any motion and observation kernels."""

# Numba caches by file and compiles kernels.gaussian into these: clear __pycache__ (make clean) when that changes.
from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, types

from boresight.kernels.gaussian import joseph_update, sandwich
from boresight.kernels.iterated import iterated_update
from boresight.kernels.signatures import MATRIX, MOTION, OBSERVATION, STACK, VECTOR
from boresight.kernels.write import write_matrix, write_vector
from boresight.types.sensor import FloatArray


@njit(
    types.int64(
        MOTION, VECTOR, OBSERVATION, VECTOR, MATRIX, types.float64, VECTOR, MATRIX, MATRIX, types.int64,
        MATRIX, STACK, MATRIX, STACK, STACK, MATRIX,
    ),
    cache=True,
)  # fmt: skip
def ekf_stream(
    motion: Any,
    parameters: FloatArray,
    observe: Any,
    x0: FloatArray,
    P0: FloatArray,
    t0: float,
    t: FloatArray,
    z: FloatArray,
    context: FloatArray,
    iterations: int,
    x_out: FloatArray,
    P_out: FloatArray,
    x_predicted: FloatArray,
    P_predicted: FloatArray,
    F_out: FloatArray,
    nis: FloatArray,
) -> int:
    """Filter k reports in order of time from (t0, x0, P0); `iterations` 1 is the EKF, more the iterated EKF.

    In: t (k,), z (k, 7) NaN where not measured, context (k, c). Filled per report: the filtered mean and covariance,
    the predicted ones, F of the prediction, and `nis` (k, 2): normalised innovation squared and its dimension (zero
    where a report held nothing that could be used); with a third column, the log likelihood.

    Returns the number of reports done: less than k where time ran backwards or S was not positive definite.
    """
    n = x0.shape[0]
    x, P = x0.copy(), P0.copy()
    moved, Q = np.empty(n), np.empty((n, n))
    y, H, R = np.empty(7), np.empty((7, n)), np.empty((7, 7))
    now = t0
    for k in range(t.shape[0]):
        dt = t[k] - now
        if dt < 0.0:
            return k
        F = F_out[k]
        motion(x, dt, parameters, moved, F, Q)
        P = sandwich(F, P, Q)
        x = moved.copy()
        now = t[k]
        write_vector(x_predicted[k], x)
        write_matrix(P_predicted[k], P)
        m = observe(x, z[k], context[k], y, H, R)
        nis[k, 0] = 0.0
        nis[k, 1] = m
        if m > 0:
            Rm = R[:m, :m].copy()
            if iterations > 1:
                x_new, P_new, _, value, log_likelihood = iterated_update(observe, x, P, z[k], context[k], iterations)
            else:
                x_new, P_new, _, value, log_likelihood = joseph_update(x, P, y[:m], H[:m], Rm, n)
            if np.isnan(value):
                return k
            x, P = x_new, P_new
            nis[k, 0] = value
            if nis.shape[1] > 2:
                nis[k, 2] = log_likelihood
        write_vector(x_out[k], x)
        write_matrix(P_out[k], P)
    return len(t)


@njit(
    types.int64(
        MOTION, VECTOR, OBSERVATION, MATRIX, MATRIX, types.float64, VECTOR, VECTOR, MATRIX, MATRIX, STACK, STACK, STACK
    ),
    cache=True,
)  # fmt: skip
def bound_stream(
    motion: Any,
    parameters: FloatArray,
    observe: Any,
    truth: FloatArray,
    P0: FloatArray,
    t0: float,
    x0: FloatArray,
    t: FloatArray,
    z: FloatArray,
    context: FloatArray,
    P_out: FloatArray,
    P_predicted: FloatArray,
    F_out: FloatArray,
) -> int:
    """Cramér-Rao recursion: the filter's covariances with every Jacobian taken on the true path `truth` (k, n).

    `x0` (n,) is the true state at `t0`; only which components of `z` are NaN matters. Returns the reports done.
    """
    n = x0.shape[0]
    x, P = x0.copy(), P0.copy()
    moved, Q = np.empty(n), np.empty((n, n))
    y, H, R = np.empty(7), np.empty((7, n)), np.empty((7, 7))
    now = t0
    for k in range(t.shape[0]):
        F = F_out[k]
        motion(x, t[k] - now, parameters, moved, F, Q)
        P = sandwich(F, P, Q)
        write_matrix(P_predicted[k], P)
        x = truth[k].copy()
        now = t[k]
        m = observe(x, z[k], context[k], y, H, R)
        if m > 0:
            Rm = R[:m, :m].copy()
            _, P, _, value, _ = joseph_update(x, P, y[:m], H[:m], Rm, n)
            if np.isnan(value):
                return k
        write_matrix(P_out[k], P)
    return len(t)
