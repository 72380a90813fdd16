"""One report into one hypothesis of the guide filter (`kernels.guide`)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from boresight.kernels.guide import DIRECTION, LONGEST, advance, compare, motion_axes, noise, predict
from boresight.types.sensor import FloatArray

Work = tuple[FloatArray, ...]
LOG_TURN = math.log(2.0 * math.pi)
CLIP = 30.0  # NIS beyond which a report says no more about a hypothesis than that it does not fit


@njit(cache=True)
def work_space(n: int) -> Work:
    """Return the arrays in which `update` and `bring_to` work, for states of size n."""
    m = n - 3
    return (
        np.zeros(n), np.zeros(3), np.zeros(3), np.zeros(6), np.zeros(7), np.zeros((m, m)), np.zeros((3, 3)),
        np.zeros((3, 3)), np.zeros((6, n)), np.zeros((6, n)), np.zeros((6, 6)), np.zeros((2 * m, n)), np.zeros((6, 6)),
    )  # fmt: skip


@njit(cache=True, forceinline=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def spread(n: int, P: FloatArray, H: FloatArray, R: FloatArray, k: int, G: FloatArray, S: FloatArray) -> None:
    """Fill `G` (k, n) with H P and `S` (k, k) with H P H' + R; call it with `n` a constant."""
    for i in range(k):
        for j in range(n):
            G[i, j] = 0.0
        for c in range(n):
            a = H[i, c]
            for j in range(n):
                G[i, j] += a * P[c, j]
    for i in range(k):
        for j in range(i, k):
            total = R[i, j]
            for c in range(n):
                total += G[i, c] * H[j, c]
            S[i, j] = S[j, i] = total


@njit(cache=True, forceinline=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def condition(
    n: int, x: FloatArray, P: FloatArray, S: FloatArray, y: FloatArray, G: FloatArray, k: int, gate: float
) -> tuple[float, float]:
    """Whiten `y` and `G` by S = L L'; then x += G'y, P -= G'G, unless the NIS is beyond `gate`; NIS, log det S."""
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
            for i in range(n):
                G[j, i] -= S[j, c] * G[c, i]
        y[j] /= d
        for i in range(n):
            G[j, i] /= d
        nis += y[j] * y[j]
    if nis > gate:
        return nis, log_det
    for j in range(k):
        for i in range(n):
            x[i] += G[j, i] * y[j]
        for i in range(n):
            a = G[j, i]
            for c in range(n):
                P[i, c] -= a * G[j, c]
    return nis, log_det


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def update(
    x: FloatArray, P: FloatArray, n: int, lag: float, biased: bool, dynamics: int, q: float, kind: int, k: int,
    gate: float, work: Work,
) -> tuple[float, float, float]:  # fmt: skip
    """Condition the first `n` of a state on a report (`look`, `R` of `look_at`, in `work`), in place.

    The report is valid `lag` (s, <= 0) from the state's time: the state is carried back, compared there, and the
    Jacobian carried forth: exact without process noise, which is added to R for the lag. Returns NIS, log-likelihood
    (NIS clipped) and the share of R in S (what an adaptive noise may learn from). Beyond `gate` the state stays.
    """
    then, p, v, y, look, F, B, A, H, G, S, _, R = work
    m = len(F)
    then[:n] = x[:n]
    advance(then, dynamics, lag, F)
    for i in range(3):
        p[i], v[i] = then[i], then[3 + i]
    if biased:
        motion_axes(then, B)
        for i in range(3):
            p[i] += B[i, 0] * x[m] + B[i, 1] * x[m + 1] + B[i, 2] * x[m + 2]
    compare(p, v, kind, k, look, y, A)
    _jacobian(A, F, B, biased, n, k, lag == 0.0, H)
    if n == 6:
        spread(6, P, H, R, k, G, S)
    elif n == 9:
        spread(9, P, H, R, k, G, S)
    else:
        spread(12, P, H, R, k, G, S)
    share = 0.0
    if lag < 0.0:
        _late(S, A, dynamics, q, -lag, k)
    for i in range(k):
        share += R[i, i] / S[i, i] / k
    if n == 6:
        nis, log_det = condition(6, x, P, S, y, G, k, gate)
    elif n == 9:
        nis, log_det = condition(9, x, P, S, y, G, k, gate)
    else:
        nis, log_det = condition(12, x, P, S, y, G, k, gate)
    return nis, -0.5 * (min(nis, CLIP) + log_det + k * LOG_TURN), share


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def _jacobian(
    A: FloatArray, F: FloatArray, B: FloatArray, biased: bool, n: int, k: int, now: bool, H: FloatArray
) -> None:
    """Fill `H` (k, n) by the present state, of `A` (3, 3) by the position then and the transition `F` to then."""
    m = len(F)
    for i in range(min(k, 3)):
        if now:
            for j in range(m):
                H[i, j] = A[i, j] if j < 3 else 0.0
        else:
            for j in range(m):
                H[i, j] = A[i, 0] * F[0, j] + A[i, 1] * F[1, j] + A[i, 2] * F[2, j]
        for j in range(m, n):
            b = j - m
            H[i, j] = A[i, 0] * B[0, b] + A[i, 1] * B[1, b] + A[i, 2] * B[2, b] if biased else 0.0
    for i in range(3, k):
        for j in range(m):
            H[i, j] = F[i, j]
        for j in range(m, n):
            H[i, j] = 0.0


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def _late(S: FloatArray, A: FloatArray, dynamics: int, q: float, lag: float, k: int) -> None:
    """Add the process noise of `lag` (s) to `S`: what moved the target since. Backwards its cross term is negative."""
    pp = noise(dynamics, q, lag, 0, 0)
    for i in range(min(k, 3)):
        for j in range(min(k, 3)):
            S[i, j] += pp * (A[i, 0] * A[j, 0] + A[i, 1] * A[j, 1] + A[i, 2] * A[j, 2])
    if k > 3:
        pv, vv = noise(dynamics, q, lag, 0, 1), noise(dynamics, q, lag, 1, 1)
        for i in range(3):
            S[i, 3 + i] -= pv
            S[3 + i, i] -= pv
            S[3 + i, 3 + i] += vv


@njit(cache=True)
def bring_to(x: FloatArray, P: FloatArray, n: int, now: float, dynamics: int, q: float, t: float, work: Work) -> None:
    """Advance the first `n` of a state, and its covariance, in place from `now` to time `t` (s) if that is later."""
    left = t - now
    while left > 0.0:
        step = min(left, LONGEST)
        predict(x, P, n, dynamics, q, step, work[5], work[11])
        left -= step


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
    if kind != DIRECTION:
        out[:] = z[:3]
        return True
    if math.isnan(z[2]):
        return False
    ce = math.cos(z[1])
    w0, w1, w2 = ce * math.sin(z[0]), ce * math.cos(z[0]), math.sin(z[1])
    for i in range(3):
        out[i] = origin[i] + z[2] * (axes[i, 0] * w0 + axes[i, 1] * w1 + axes[i, 2] * w2)
    return True
