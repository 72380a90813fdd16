"""One report into one hypothesis of the guide filter (`kernels.guide`)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from boresight.kernels.guide import POSITION, advance, compare, motion_axes, noise, predict
from boresight.types.sensor import FloatArray

Work = tuple[FloatArray, ...]
CLIP = 30.0  # NIS beyond which a report says no more about a hypothesis than that it does not fit


@njit(cache=True)
def work_space(n: int) -> Work:
    """Return the arrays in which `update` and `bring_to` work, for states of size n."""
    m = n - 3
    return (
        np.zeros(n), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros((m, m)), np.zeros((3, 3)),
        np.zeros((3, 3)), np.zeros((3, n)), np.zeros((n, 3)), np.zeros((3, 3)), np.zeros((m, n)),
    )  # fmt: skip


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def update(
    x: FloatArray, P: FloatArray, lag: float, biased: bool, dynamics: int, q: float, kind: int, t: float,
    z: FloatArray, origin: FloatArray, axes: FloatArray, R: FloatArray, gate: float, work: Work,
) -> tuple[float, float, int, float]:  # fmt: skip
    """Condition a state on a report that is valid `lag` (s, <= 0) from the state's time; in place.

    The state is carried back to the report's time t, compared there, and the Jacobian carried forth: exact without
    process noise, which is added to R (3,) for the lag. Returns NIS, log-likelihood (NIS clipped), dimension and the
    share of R in S (what an adaptive noise may learn from); the state is left alone beyond `gate`.
    """
    n = len(x)
    m = n - 3
    then, p, y, a3, b3, F, B, A, H, G, S, _ = work
    then[:] = x
    advance(then, dynamics, lag, F)
    p[0], p[1], p[2] = then[0], then[1], then[2]
    if biased:
        motion_axes(then, B)
        for i in range(3):
            p[i] += B[i, 0] * x[m] + B[i, 1] * x[m + 1] + B[i, 2] * x[m + 2]
    k = compare(p, kind, t, z, origin, axes, y, A, a3, b3)
    for i in range(k):
        for j in range(m, n):
            H[i, j] = 0.0
        for j in range(m):
            H[i, j] = A[i, 0] * F[0, j] + A[i, 1] * F[1, j] + A[i, 2] * F[2, j]
        if biased:
            for j in range(3):
                H[i, m + j] = A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j]
    for i in range(n):
        for j in range(k):
            total = 0.0
            for c in range(n):
                total += P[i, c] * H[j, c]
            G[i, j] = total
    late = noise(dynamics, q, abs(lag), 0, 0)
    share = 0.0
    for i in range(k):
        for j in range(k):
            total = late * (A[i, 0] * A[j, 0] + A[i, 1] * A[j, 1] + A[i, 2] * A[j, 2])
            for c in range(n):
                total += H[i, c] * G[c, j]
            S[i, j] = total
        S[i, i] += R[i]
        share += R[i] / S[i, i] / k
    nis, log_det = _whiten(S, y, G, k)
    log_likelihood = -0.5 * (min(nis, CLIP) + log_det + k * math.log(2.0 * math.pi))
    if nis > gate:
        return nis, log_likelihood, k, share
    # after whitening: x += G y, P -= G G'
    for i in range(n):
        for j in range(k):
            x[i] += G[i, j] * y[j]
        for j in range(i, n):
            total = P[i, j]
            for c in range(k):
                total -= G[i, c] * G[j, c]
            P[i, j] = P[j, i] = total
    return nis, log_likelihood, k, share


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def _whiten(S: FloatArray, y: FloatArray, G: FloatArray, k: int) -> tuple[float, float]:
    """Turn `y` to L⁻¹ y and `G` to G L⁻ᵀ in place, S = L L'; return y'S⁻¹y and log det S."""
    log_det, nis = 0.0, 0.0
    for j in range(k):
        d = S[j, j]
        for c in range(j):
            d -= S[j, c] * S[j, c]
        d = math.sqrt(d)
        S[j, j] = d
        log_det += 2.0 * math.log(d)
        for i in range(j + 1, k):
            total = S[i, j]
            for c in range(j):
                total -= S[i, c] * S[j, c]
            S[i, j] = total / d
        for c in range(j):
            y[j] -= S[j, c] * y[c]
        y[j] /= d
        nis += y[j] * y[j]
        for i in range(len(G)):
            total = G[i, j]
            for c in range(j):
                total -= S[j, c] * G[i, c]
            G[i, j] = total / d
    return nis, log_det


@njit(cache=True)
def bring_to(clock: FloatArray, X: FloatArray, P: FloatArray, dynamics: int, q: float, t: float, work: Work) -> None:
    """Advance every hypothesis (h, n) in place to time `t` (s) if that is later than `clock[0]`."""
    dt = t - clock[0]
    if dt <= 0.0:
        return
    F, W = work[5], work[11]
    for h in range(len(X)):
        left = dt
        while left > 0.0:
            step = min(left, 10.0)
            predict(X[h], P[h], dynamics, q, step, F, W)
            left -= step
    clock[0] = t


@njit(cache=True)
def start(
    X: FloatArray,
    P: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    spread: FloatArray,
    sigma_bias: FloatArray,
) -> None:
    """Set every hypothesis (h, n) to a position and velocity (3,) with wide variances `spread` (m, m/s, m/s²)."""
    m = X.shape[1] - 3
    X[:] = 0.0
    P[:] = 0.0
    for h in range(len(X)):
        X[h, :3] = position
        X[h, 3:6] = velocity
        for i in range(m):
            P[h, i, i] = spread[i // 3] ** 2
        for i in range(m, m + 3):
            P[h, i, i] = sigma_bias[h - 1] ** 2 if h > 0 else 0.0


@njit(cache=True)
def report_position(kind: int, t: float, z: FloatArray, origin: FloatArray, axes: FloatArray, out: FloatArray) -> bool:
    """Fill `out` (3,) with the report's position in ECEF; false if it has no range."""
    if kind == POSITION:
        out[:] = z
        return True
    if math.isnan(z[2]):
        return False
    ce = math.cos(z[1])
    w0, w1, w2 = ce * math.sin(z[0]), ce * math.cos(z[0]), math.sin(z[1])
    for i in range(3):
        out[i] = origin[i] + z[2] * (axes[i, 0] * w0 + axes[i, 1] * w1 + axes[i, 2] * w2)
    return True
