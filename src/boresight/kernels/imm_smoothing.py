"""Smoothing what an IMM left behind, over models of unequal dimension packed as in `kernels.imm`.

Backwards from each report to the one before, for every pair of a model i before and a model j after: a
Rauch-Tung-Striebel step from i's belief through j's motion, weighed by how probable the pair is given all reports,
collapsed to one Gaussian per model i (Kim 1994; Barber 2006 for the weight by what was found later).
"""

# Numba caches by file and compiles kernels.gaussian into these: clear __pycache__ (make clean) when that changes.
from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, types

from boresight.kernels.gaussian import cholesky, sandwich, solve_lower
from boresight.kernels.imm import INT_MATRIX, INTS, NEGLIGIBLE, STACKS, combine, markov, place
from boresight.kernels.observation import IntArray
from boresight.kernels.options import PART
from boresight.kernels.signatures import MATRIX, MOTION, STACK, VECTOR
from boresight.kernels.smoothing import smoother_gain
from boresight.kernels.write import write_matrix, write_vector
from boresight.types.sensor import FloatArray


@njit(**PART)
def seen_as(
    i: int, j: int, X: FloatArray, P: FloatArray, sizes: IntArray, labels: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return model i's belief in model j's components: mean (nj,), covariance (nj, nj), cross covariance (ni, nj).

    What i lacks is taken from j's own belief, independent of the rest.
    """
    n, m = sizes[j], sizes[i]
    at = np.empty(n, np.int64)
    x, out, cross = np.empty(n), np.zeros((n, n)), np.zeros((m, n))
    for b in range(n):
        at[b] = place(labels, i, m, labels[j, b], b)
        x[b] = X[i, at[b]] if at[b] >= 0 else X[j, b]
        if at[b] >= 0:
            for a in range(m):
                cross[a, b] = P[i, a, at[b]]
    for a in range(n):
        for b in range(n):
            if at[a] >= 0 and at[b] >= 0:
                out[a, b] = P[i, at[a], at[b]]
            elif at[a] < 0 and at[b] < 0:
                out[a, b] = P[j, a, b]
    return x, out, cross


@njit(**PART)
def _log_density(e: FloatArray, P: FloatArray) -> float:
    """Return log N(e; 0, P) without its constant; hardly any where P is not positive definite."""
    n = e.shape[0]
    L = np.zeros((n, n))
    if not cholesky(P, L):
        return -1e300
    white = e.copy()
    solve_lower(L, white)
    out = 0.0
    for a in range(n):
        out -= 0.5 * white[a] * white[a] + math.log(L[a, a])
    return out


@njit(**PART)
def step_back(
    motion: Any,
    parameters: FloatArray,
    sizes: IntArray,
    labels: IntArray,
    rates: FloatArray,
    dt: float,
    weights: FloatArray,
    X: FloatArray,
    P: FloatArray,
    later_weights: FloatArray,
    later_X: FloatArray,
    later_P: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return smoothed weights (r,), means (r, N) and covariances (r, N, N) from filtered ones and those smoothed later.

    P_s = (P - G P_predicted Gᵀ) + G P_later Gᵀ with G = cov(x, x_predicted) P_predicted⁻¹: a sum of two covariances.
    """
    r, N = X.shape
    transition = markov(rates, dt)
    share = np.zeros((r, r))
    means, covariances = np.zeros((r, r, N)), np.zeros((r, r, N, N))
    for j in range(r):
        n = sizes[j]
        logs = np.full(r, -np.inf)
        for i in range(r):
            prior = transition[i, j] * weights[i]
            if prior < NEGLIGIBLE:
                continue
            x, P_own, cross = seen_as(i, j, X, P, sizes, labels)
            moved, F, Q = np.empty(n), np.empty((n, n)), np.empty((n, n))
            motion(x, dt, parameters[j], moved, F, Q)
            predicted = sandwich(F, P_own, Q)
            e = later_X[j, :n] - moved
            logs[i] = math.log(prior)
            if r > 1:
                logs[i] += _log_density(e, predicted)
            G = smoother_gain(cross, F, predicted)
            own = sizes[i]
            for a in range(own):
                means[i, j, a] = X[i, a]
                for b in range(n):
                    means[i, j, a] += G[a, b] * e[b]
            D = later_P[j, :n, :n] - predicted
            write_matrix(covariances[i, j], sandwich(G, D, P[i, :own, :own]))
        best = logs.max()
        for i in range(r):
            share[i, j] = math.exp(logs[i] - best)
        total = later_weights[j] / share[:, j].sum()
        for i in range(r):
            share[i, j] *= total
    out, X_out, P_out = np.zeros(r), np.zeros((r, N)), np.zeros((r, N, N))
    for i in range(r):
        out[i] = share[i].sum()
        if out[i] < NEGLIGIBLE:
            write_vector(X_out[i], X[i])
            write_matrix(P_out[i], P[i])
        else:
            mean, covariance = combine(share[i] / out[i], means[i], covariances[i], N)
            write_vector(X_out[i], mean)
            write_matrix(P_out[i], covariance)
    return out, X_out, P_out


@njit(**PART)
def keep(
    weights: FloatArray,
    X: FloatArray,
    P: FloatArray,
    n_out: int,
    x_out: FloatArray,
    P_out: FloatArray,
    weights_out: FloatArray,
) -> None:
    """Fill the combined mean and covariance of the first `n_out` components, and the weights."""
    mean, covariance = combine(weights, X, P, n_out)
    write_vector(x_out, mean)
    write_matrix(P_out, covariance)
    write_vector(weights_out, weights)


@njit(
    types.void(
        MOTION, MATRIX, INTS, INT_MATRIX, MATRIX, VECTOR, MATRIX, STACK, STACKS, types.float64, types.int64,
        MATRIX, STACK, MATRIX,
    ),
    cache=True,
)  # fmt: skip
def imm_smooth(
    motion: Any,
    parameters: FloatArray,
    sizes: IntArray,
    labels: IntArray,
    rates: FloatArray,
    t: FloatArray,
    weights: FloatArray,
    X: FloatArray,
    P: FloatArray,
    lag: float,
    n_out: int,
    x_out: FloatArray,
    P_out: FloatArray,
    weights_out: FloatArray,
) -> None:
    """Fill the first `n_out` components' mean and covariance and the weights of each report, given later reports.

    In: what `imm_stream` left behind, `weights` (k, r), `X` (k, r, N), `P` (k, r, N, N). `lag` (s) is how much later;
    infinite for all, then in one pass.
    """
    last = t.shape[0] - 1
    w, x, V = weights[last], X[last], P[last]
    if math.isinf(lag):
        for k in range(last, -1, -1):
            if k < last:
                w, x, V = step_back(
                    motion, parameters, sizes, labels, rates, t[k + 1] - t[k], weights[k], X[k], P[k], w, x, V
                )
            keep(w, x, V, n_out, x_out[k], P_out[k], weights_out[k])
        return
    end = 0
    for first in range(last + 1):
        while end < last and (end < first or t[end + 1] <= t[first] + lag):
            end += 1
        w, x, V = weights[end], X[end], P[end]
        for k in range(end - 1, first - 1, -1):
            w, x, V = step_back(
                motion, parameters, sizes, labels, rates, t[k + 1] - t[k], weights[k], X[k], P[k], w, x, V
            )
        keep(w, x, V, n_out, x_out[first], P_out[first], weights_out[first])
