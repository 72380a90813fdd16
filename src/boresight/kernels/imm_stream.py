"""Interacting multiple models over a whole stream, in one call."""

# Numba caches by file and compiles kernels.gaussian into these: clear __pycache__ (make clean) when that changes.
from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, types

from boresight.kernels.gaussian import joseph_update, sandwich
from boresight.kernels.imm import INT_MATRIX, INTS, STACKS, combine, learn, markov, mix, rescale, reweigh
from boresight.kernels.observation import IntArray
from boresight.kernels.signatures import MATRIX, MOTION, OBSERVATION, STACK, VECTOR
from boresight.kernels.write import write_matrix, write_vector
from boresight.types.sensor import FloatArray


@njit(
    types.int64(
        MOTION, MATRIX, INTS, INT_MATRIX, MATRIX, OBSERVATION, VECTOR, MATRIX, STACK, types.float64, VECTOR, MATRIX,
        MATRIX, INTS, MATRIX, types.float64, types.float64, types.int64, MATRIX, STACK, MATRIX, STACK, STACKS,
    ),
    cache=True,
)  # fmt: skip
def imm_stream(
    motion: Any,
    parameters: FloatArray,
    sizes: IntArray,
    labels: IntArray,
    rates: FloatArray,
    observe: Any,
    weights0: FloatArray,
    X0: FloatArray,
    P0: FloatArray,
    t0: float,
    t: FloatArray,
    z: FloatArray,
    context: FloatArray,
    sensor: IntArray,
    scale: FloatArray,
    memory: float,
    limit: float,
    n_out: int,
    x_out: FloatArray,
    P_out: FloatArray,
    weights_out: FloatArray,
    X_kept: FloatArray,
    P_kept: FloatArray,
) -> int:
    """Filter k reports with r models that share one motion kernel, told apart by `parameters` (r, p).

    `rates` (r, r) is the generator of the Markov chain between models (1/s, rows add to zero). Filled per report: the
    moment-matched mean and covariance of the first `n_out` components and the weights (k, r); unless they are empty,
    `X_kept` (k, r, N) and `P_kept` (k, r, N, N) with each model's own. Returns reports done.

    `sensor` (k,) says which row of `scale` (s, 7) multiplies the noise variances; with `memory` > 0 (reports) the
    scales are adapted, see `adapt`.
    """
    r = X0.shape[0]
    weights, X, P = weights0.copy(), X0.copy(), P0.copy()
    log_likelihoods = np.empty(r)
    bias, seen = np.zeros_like(scale), np.zeros_like(scale)
    rows = np.empty(7, np.int64)
    y, R = np.empty(7), np.empty((7, 7))
    moved, F, Q, H = np.empty(0), np.empty((0, 0)), np.empty((0, 0)), np.empty((7, 0))
    now = t0
    for k in range(t.shape[0]):
        dt = t[k] - now
        if dt < 0.0:
            return k
        if dt > 0.0:
            weights, X, P = mix(weights, markov(rates, dt), X, P, sizes, labels)
        now = t[k]
        for j in range(r):
            n = sizes[j]
            if moved.shape[0] != n:
                moved, F, Q, H = np.empty(n), np.empty((n, n)), np.empty((n, n)), np.empty((7, n))
            motion(X[j, :n].copy(), dt, parameters[j], moved, F, Q)
            mean, covariance = moved, sandwich(F, P[j, :n, :n].copy(), Q)
            m = observe(moved, z[k], context[k], y, H, R)
            log_likelihoods[j] = 0.0
            if m > 0:
                rescale(scale[sensor[k]], z[k], m, rows, R)
                mean, covariance, _, _, log_likelihoods[j] = joseph_update(
                    moved, covariance, y[:m].copy(), H[:m].copy(), R[:m, :m].copy(), n
                )
                if np.isnan(log_likelihoods[j]):
                    return k
            write_vector(X[j], mean)
            write_matrix(P[j], covariance)
        weights = reweigh(weights, log_likelihoods)
        mean, covariance = combine(weights, X, P, n_out)
        write_vector(x_out[k], mean)
        write_matrix(P_out[k], covariance)
        write_vector(weights_out[k], weights)
        if X_kept.shape[0] > 0:
            write_matrix(X_kept[k], X)
            for j in range(len(P)):
                write_matrix(P_kept[k, j], P[j])
        if memory > 0.0:
            s = sensor[k]
            learn(observe, x_out[k], P_out[k], z[k], context[k], scale[s], bias[s], seen[s], memory, limit)
    return len(t)
