"""One report into one hypothesis of the guide filter (`kernels.guide`)."""

from __future__ import annotations

import math

from numba import njit

from boresight.kernels.guide import (
    DIRECTION,
    LONGEST,
    ORBIT,
    THEN,
    A,
    B,
    F,
    G,
    H,
    R,
    S,
    Y,
    advance,
    compare,
    motion_axes,
    noise,
    predict,
)  # fmt: skip
from boresight.kernels.options import PART
from boresight.kernels.write import write_vector
from boresight.types.sensor import FloatArray

LOG_TURN = math.log(2.0 * math.pi)
CLIP = 30.0  # NIS beyond which a report says no more about a hypothesis than that it does not fit


@njit(cache=True, forceinline=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def spread(n: int, P: FloatArray, k: int, w: FloatArray) -> None:
    """Fill rows G (k, n) with H P and S (k, k) with H P H' + R; call it with `n` a constant."""
    for i in range(k):
        for j in range(n):
            w[G + i, j] = 0.0
        for c in range(n):
            a = w[H + i, c]
            for j in range(n):
                w[G + i, j] += a * P[c, j]
    for i in range(k):
        for j in range(i, k):
            total = w[R + i, j]
            for c in range(n):
                total += w[G + i, c] * w[H + j, c]
            w[S + i, j] = w[S + j, i] = total


@njit(cache=True, forceinline=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def condition(n: int, x: FloatArray, P: FloatArray, k: int, gate: float, w: FloatArray) -> tuple[float, float]:
    """Whiten Y and G by S = L L'; then x += G'y, P -= G'G, unless the NIS is beyond `gate`; NIS, det S."""
    det, nis = 1.0, 0.0
    for j in range(k):
        d = w[S + j, j]
        for c in range(j):
            d -= w[S + j, c] * w[S + j, c]
        det *= d
        d = 1.0 / math.sqrt(d)
        for i in range(j + 1, k):
            total = w[S + i, j]
            for c in range(j):
                total -= w[S + i, c] * w[S + j, c]
            w[S + i, j] = total * d
        for c in range(j):
            a = w[S + j, c]
            w[Y, j] -= a * w[Y, c]
            for i in range(n):
                w[G + j, i] -= a * w[G + c, i]
        w[Y, j] *= d
        for i in range(n):
            w[G + j, i] *= d
        nis += w[Y, j] * w[Y, j]
    if not nis <= gate:  # also one that is not a number
        return nis, det
    for j in range(k):
        a = w[Y, j]
        for i in range(n):
            x[i] += w[G + j, i] * a
        for i in range(n):
            a = w[G + j, i]
            for c in range(n):
                P[i, c] -= a * w[G + j, c]
    return nis, det


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def update(
    x: FloatArray, P: FloatArray, n: int, lag: float, biased: bool, dynamics: int, q: float, kind: int, k: int,
    gate: float, w: FloatArray,
) -> tuple[float, float, float]:  # fmt: skip
    """Condition the first `n` of a state on the report in `w` (`look_at`), in place.

    The report is valid `lag` (s, <= 0) from the state's time: the state is carried back, compared there, and the
    Jacobian carried forth: exact without process noise, which is added to R for the lag. Returns NIS, log-likelihood
    (NIS clipped) and the share of R in S (what an adaptive noise may learn from). Beyond `gate` the state stays.
    """
    m = 6 if dynamics == ORBIT else 9
    then = w[THEN]
    for i in range(m):
        then[i] = x[i]
    advance(then, dynamics, lag, w)
    if biased:
        motion_axes(then, w)
        for i in range(3):
            then[i] += w[B + i, 0] * x[m] + w[B + i, 1] * x[m + 1] + w[B + i, 2] * x[m + 2]
    compare(kind, k, w)
    _jacobian(biased, m, n, k, w)
    if n == 6:
        spread(6, P, k, w)
    elif n == 9:
        spread(9, P, k, w)
    else:
        spread(12, P, k, w)
    if lag < 0.0:
        _late(dynamics, q, -lag, k, w)
    share = 0.0
    for i in range(k):
        share += w[R + i, i] / w[S + i, i]
    if n == 6:
        nis, det = condition(6, x, P, k, gate, w)
    elif n == 9:
        nis, det = condition(9, x, P, k, gate, w)
    else:
        nis, det = condition(12, x, P, k, gate, w)
    return nis, -0.5 * (min(nis, CLIP) + math.log(det) + k * LOG_TURN), share / k


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def _jacobian(biased: bool, m: int, n: int, k: int, w: FloatArray) -> None:
    """Fill rows H (k, n) by the present state, of A by the position then and the transition F to then."""
    for i in range(min(k, 3)):
        a, b, c = w[A + i, 0], w[A + i, 1], w[A + i, 2]
        for j in range(m):
            w[H + i, j] = a * w[F, j] + b * w[F + 1, j] + c * w[F + 2, j]
        for j in range(m, n):
            w[H + i, j] = a * w[B, j - m] + b * w[B + 1, j - m] + c * w[B + 2, j - m] if biased else 0.0
    for i in range(3, k):
        for j in range(n):
            w[H + i, j] = w[F + i, j] if j < m else 0.0


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def _late(dynamics: int, q: float, lag: float, k: int, w: FloatArray) -> None:
    """Add the process noise of `lag` (s) to S: what moved the target since. Backwards its cross term is negative."""
    pp = noise(dynamics, q, lag, 0, 0)
    for i in range(min(k, 3)):
        for j in range(min(k, 3)):
            w[S + i, j] += pp * (w[A + i, 0] * w[A + j, 0] + w[A + i, 1] * w[A + j, 1] + w[A + i, 2] * w[A + j, 2])
    if k > 3:
        pv, vv = noise(dynamics, q, lag, 0, 1), noise(dynamics, q, lag, 1, 1)
        for i in range(3):
            w[S + i, 3 + i] -= pv
            w[S + 3 + i, i] -= pv
            w[S + 3 + i, 3 + i] += vv


@njit(**PART)
def bring_to(
    x: FloatArray, P: FloatArray, n: int, now: float, dynamics: int, q: float, t: float, w: FloatArray
) -> None:
    """Advance the first `n` of a state, and its covariance, in place from `now` to time `t` (s) if that is later."""
    left = t - now
    while left > 0.0:
        step = min(left, LONGEST)
        predict(x, P, n, dynamics, q, step, w)
        left -= step


@njit(**PART)
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
        write_vector(X[h], position)
        write_vector(X[h, 3:], velocity)
        for i in range(m):
            P[h, i, i] = spread[i // 3] ** 2
        for i in range(m, m + 3):
            P[h, i, i] = sigma_bias[h - 1] ** 2 if h > 0 else 0.0


@njit(**PART)
def report_position(kind: int, t: float, z: FloatArray, origin: FloatArray, axes: FloatArray, out: FloatArray) -> bool:
    """Fill `out` (3,) with the report's position in ECEF; false if it has no range."""
    if kind != DIRECTION:
        write_vector(out, z[:3])
        return True
    if math.isnan(z[2]):
        return False
    ce = math.cos(z[1])
    w0, w1, w2 = ce * math.sin(z[0]), ce * math.cos(z[0]), math.sin(z[1])
    for i in range(3):
        out[i] = origin[i] + z[2] * (axes[i, 0] * w0 + axes[i, 1] * w1 + axes[i, 2] * w2)
    return True
