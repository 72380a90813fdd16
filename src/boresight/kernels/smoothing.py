"""The Rauch-Tung-Striebel smoother over what a forward pass left behind."""

from __future__ import annotations

import numpy as np
from numba import njit

from boresight.kernels.gaussian import cholesky, solve_lower, solve_upper
from boresight.kernels.options import PART
from boresight.kernels.write import write_matrix, write_vector
from boresight.types.sensor import FloatArray


@njit(**PART)
def smoother_gain(P: FloatArray, F: FloatArray, P_predicted: FloatArray) -> FloatArray:
    """Return G = P Fᵀ P_predicted⁻¹ (m, n); P (m, n) is the covariance of what is smoothed with what was moved by F."""
    m, n = P.shape
    L = np.zeros((n, n))
    G = np.zeros((m, n))
    if not cholesky(P_predicted, L):
        return G
    row = np.empty(n)
    for i in range(m):
        for j in range(n):
            s = 0.0
            for k in range(n):
                s += P[i, k] * F[j, k]
            row[j] = s
        solve_lower(L, row)
        solve_upper(L, row)
        write_vector(G[i], row)
    return G


@njit(cache=True)
def smooth_back(
    x: FloatArray,
    P: FloatArray,
    x_predicted: FloatArray,
    P_predicted: FloatArray,
    F: FloatArray,
    first: int,
    last: int,
    x_out: FloatArray,
    P_out: FloatArray,
) -> None:
    """Fill `x_out`, `P_out` for steps first…last with the Gaussians given all reports up to `last` (inclusive).

    P_s = (I - GF)P(I - GF)ᵀ + G(P_s⁺ + Q)Gᵀ is used in the form P + G(P_s⁺ - P_predicted)Gᵀ, made symmetric.
    """
    n = x.shape[1]
    write_vector(x_out[last], x[last])
    write_matrix(P_out[last], P[last])
    for k in range(last - 1, first - 1, -1):
        G = smoother_gain(P[k], F[k + 1], P_predicted[k + 1])
        D = P_out[k + 1] - P_predicted[k + 1]
        GD = np.zeros((n, n))
        for i in range(n):
            s = x[k, i]
            for j in range(n):
                s += G[i, j] * (x_out[k + 1, j] - x_predicted[k + 1, j])
                for a in range(n):
                    GD[i, j] += G[i, a] * D[a, j]
            x_out[k, i] = s
        for i in range(n):
            for j in range(i + 1):
                s = 0.5 * (P[k, i, j] + P[k, j, i])
                for a in range(n):
                    s += 0.5 * (GD[i, a] * G[j, a] + GD[j, a] * G[i, a])
                P_out[k, i, j] = s
                P_out[k, j, i] = s


@njit(cache=True)
def smooth_lagged(
    t: FloatArray,
    x: FloatArray,
    P: FloatArray,
    x_predicted: FloatArray,
    P_predicted: FloatArray,
    F: FloatArray,
    lag: float,
    x_out: FloatArray,
    P_out: FloatArray,
) -> None:
    """Fill every step with the Gaussian given the reports up to `lag` seconds later."""
    k = t.shape[0]
    x_work, P_work = np.empty_like(x), np.empty_like(P)
    last = 0
    for i in range(k):
        while last + 1 < k and t[last + 1] <= t[i] + lag:
            last += 1
        smooth_back(x, P, x_predicted, P_predicted, F, i, max(last, i), x_work, P_work)
        write_vector(x_out[i], x_work[i])
        write_matrix(P_out[i], P_work[i])
