"""Moving and conditioning a Gaussian: small dense matrices, symmetric by construction."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from boresight.kernels.options import PART
from boresight.types.sensor import FloatArray


@njit(**PART)
def cholesky(A: FloatArray, L: FloatArray) -> bool:
    """Fill `L` with the lower Cholesky factor of symmetric `A` (n, n); False where it is not positive definite."""
    n = A.shape[0]
    for j in range(n):
        for i in range(j):
            L[i, j] = 0.0
        s = A[j, j]
        for k in range(j):
            s -= L[j, k] * L[j, k]
        if not s > 0.0:
            return False
        d = math.sqrt(s)
        L[j, j] = d
        for i in range(j + 1, n):
            s = A[i, j]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            L[i, j] = s / d
    return True


@njit(**PART)
def solve_lower(L: FloatArray, b: FloatArray) -> None:
    """Overwrite `b` (n,) with L⁻¹b."""
    for i in range(L.shape[0]):
        s = b[i]
        for k in range(i):
            s -= L[i, k] * b[k]
        b[i] = s / L[i, i]


@njit(**PART)
def solve_upper(L: FloatArray, b: FloatArray) -> None:
    """Overwrite `b` (n,) with L⁻ᵀb."""
    n = L.shape[0]
    for i in range(n - 1, -1, -1):
        s = b[i]
        for k in range(i + 1, n):
            s -= L[k, i] * b[k]
        b[i] = s / L[i, i]


@njit(cache=True)
def sandwich(A: FloatArray, P: FloatArray, Q: FloatArray) -> FloatArray:
    """Return A P Aᵀ + Q for symmetric P and Q, exactly symmetric; A is (m, n)."""
    m, n = A.shape
    AP = np.empty((m, n))
    out = np.empty((m, m))
    for i in range(m):
        for j in range(n):
            s = 0.0
            for k in range(n):
                s += A[i, k] * P[k, j]
            AP[i, j] = s
    for i in range(m):
        for j in range(i + 1):
            s = 0.5 * (Q[i, j] + Q[j, i])
            for k in range(n):
                s += AP[i, k] * A[j, k]
            out[i, j] = s
            out[j, i] = s
    return out


@njit(**PART)
def _joseph(A: FloatArray, P: FloatArray, K: FloatArray, R: FloatArray) -> FloatArray:
    """Return A P Aᵀ + K R Kᵀ, exactly symmetric."""
    n, m = K.shape
    AP, KR, out = np.empty((n, n)), np.empty((n, m)), np.empty((n, n))
    for i in range(n):
        for j in range(n):
            s = 0.0
            for k in range(n):
                s += A[i, k] * P[k, j]
            AP[i, j] = s
        for a in range(m):
            s = 0.0
            for b in range(m):
                s += K[i, b] * 0.5 * (R[b, a] + R[a, b])
            KR[i, a] = s
    for i in range(n):
        for j in range(i + 1):
            s = 0.0
            for k in range(n):
                s += AP[i, k] * A[j, k]
            for a in range(m):
                s += KR[i, a] * K[j, a]
            out[i, j] = s
            out[j, i] = s
    return out


@njit(cache=True)
def joseph_update(
    x: FloatArray, P: FloatArray, y: FloatArray, H: FloatArray, R: FloatArray, n_estimated: int
) -> tuple[FloatArray, FloatArray, FloatArray, float, float]:
    """Condition the Gaussian (x, P) on an innovation y (m,) = z - h(x) with Jacobian H (m, n) and covariance R (m, m).

    S = HPHᵀ + R, K = PHᵀS⁻¹, x⁺ = x + Ky, P⁺ = (I - KH)P(I - KH)ᵀ + KRKᵀ, exactly symmetric. The rows of K from
    `n_estimated` on are zero: those states are considered (Schmidt), not estimated; n for an ordinary update.

    Returns x⁺, P⁺, S, the normalised innovation squared yᵀS⁻¹y and log N(y; 0, S). Where S is not positive definite
    nothing is changed and the last two are NaN.
    """
    n = x.shape[0]
    m = y.shape[0]
    K = np.empty((n, m))  # first PHᵀ
    S, L = np.empty((m, m)), np.empty((m, m))
    for i in range(n):
        for a in range(m):
            s = 0.0
            for k in range(n):
                s += P[i, k] * H[a, k]
            K[i, a] = s
    for a in range(m):
        for b in range(a + 1):
            s = 0.5 * (R[a, b] + R[b, a])
            for k in range(n):
                s += 0.5 * (H[a, k] * K[k, b] + H[b, k] * K[k, a])
            S[a, b] = s
            S[b, a] = s
    if not cholesky(S, L):
        return x.copy(), P.copy(), S, np.nan, np.nan
    for i in range(n):
        if i < n_estimated:
            solve_lower(L, K[i])
            solve_upper(L, K[i])
        else:
            K[i, :] = 0.0
    white = y.copy()
    solve_lower(L, white)
    nis, log_det = 0.0, 0.0
    for a in range(m):
        nis += white[a] * white[a]
        log_det += 2.0 * math.log(L[a, a])
    x_new = x.copy()
    A = np.empty((n, n))
    for i in range(n):
        for a in range(m):
            x_new[i] += K[i, a] * y[a]
        for j in range(n):
            s = 1.0 if i == j else 0.0
            for a in range(m):
                s -= K[i, a] * H[a, j]
            A[i, j] = s
    P_new = _joseph(A, P, K, R)
    return x_new, P_new, S, nis, -0.5 * (nis + log_det + m * math.log(2.0 * math.pi))
