"""One report into one hypothesis of the guide filter (`kernels.guide`)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from boresight.kernels.guide import (
    BIAS_TIME,
    DIRECTION,
    EARTH_RATE,
    LONGEST,
    LOOK_FAR,
    LOOK_Z,
    N_BIAS,
    ORBIT,
    ROW_A,
    ROW_BIAS,
    ROW_F,
    ROW_G,
    ROW_H,
    ROW_LOOK,
    ROW_MOTION,
    ROW_R,
    ROW_ROOM,
    ROW_S,
    ROW_SECOND,
    ROW_THEN,
    ROW_Y,
    advance,
    compare_direction,
    compare_position,
    motion_axes,
    noise,
    predict,
)  # fmt: skip
from boresight.kernels.options import PART
from boresight.kernels.write import write_vector
from boresight.types.sensor import FloatArray

Columns = NDArray[np.int64]
LOG_TURN = math.log(2.0 * math.pi)
CLIP = 30.0  # NIS beyond which a report says no more about a hypothesis than that it does not fit


@njit(cache=True, forceinline=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def spread(n: int, P: FloatArray, k: int, w: FloatArray) -> None:
    """Fill rows G (k, n) with H P and S (k, k) with H P H' + R; call it with `n` a constant."""
    for i in range(k):
        for j in range(n):
            w[ROW_G + i, j] = 0.0
        for c in range(n):
            a = w[ROW_H + i, c]
            for j in range(n):
                w[ROW_G + i, j] += a * P[c, j]
    for i in range(k):
        for j in range(i, k):
            total = w[ROW_R + i, j]
            for c in range(n):
                total += w[ROW_G + i, c] * w[ROW_H + j, c]
            w[ROW_S + i, j] = w[ROW_S + j, i] = total


@njit(cache=True, forceinline=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def condition(n: int, x: FloatArray, P: FloatArray, k: int, gate: float, w: FloatArray) -> tuple[float, float]:
    """Whiten Y and G by S = L L'; then x += G'y, P -= G'G, unless the NIS is beyond `gate`; NIS, det S."""
    det, nis = 1.0, 0.0
    for j in range(k):
        d = w[ROW_S + j, j]
        for c in range(j):
            d -= w[ROW_S + j, c] * w[ROW_S + j, c]
        det *= d
        d = 1.0 / math.sqrt(d)
        for i in range(j + 1, k):
            total = w[ROW_S + i, j]
            for c in range(j):
                total -= w[ROW_S + i, c] * w[ROW_S + j, c]
            w[ROW_S + i, j] = total * d
        for c in range(j):
            a = w[ROW_S + j, c]
            w[ROW_Y, j] -= a * w[ROW_Y, c]
            for i in range(n):
                w[ROW_G + j, i] -= a * w[ROW_G + c, i]
        w[ROW_Y, j] *= d
        for i in range(n):
            w[ROW_G + j, i] *= d
        nis += w[ROW_Y, j] * w[ROW_Y, j]
    if not nis <= gate:  # also one that is not a number
        return nis, det
    for j in range(k):
        a = w[ROW_Y, j]
        for i in range(n):
            x[i] += w[ROW_G + j, i] * a
        for i in range(n):
            a = w[ROW_G + j, i]
            for c in range(n):
                P[i, c] -= a * w[ROW_G + j, c]
    return nis, det


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def update(
    x: FloatArray, P: FloatArray, n: int, lag: float, biased: bool, at: Columns, dynamics: int, q: float, kind: int,
    k: int, gate: float, w: FloatArray,
) -> tuple[float, float, float]:  # fmt: skip
    """Condition the first `n` of a state on the report in `w` (`look_at`), in place.

    `at` (4,): where the state holds the source's biases in azimuth, elevation, range and time (-1: it does not).
    `biased`: the last three of the state are the source's gross bias. The report is valid `lag` (s, <= 0) from the
    state's time: the state is carried back, compared there, and the Jacobian carried forth: exact without process
    noise, which is added to R for the lag. Returns NIS, log-likelihood (NIS clipped) and the share of R in S (what an
    adaptive noise may learn from). Beyond `gate` the state stays.
    """
    m = 6 if dynamics == ORBIT else 9
    then = w[ROW_THEN]
    for i in range(m):
        then[i] = x[i]
    ba, be, br, bt = _held(x, at)
    advance(then, dynamics, lag - bt, w)
    if bt != 0.0:  # the report was turned to the inertial frame by its stamp
        _turn(then, EARTH_RATE * bt)
    if biased:
        motion_axes(then, w)
        for i in range(3):
            then[i] += (
                w[ROW_MOTION + i, 0] * x[n - 3] + w[ROW_MOTION + i, 1] * x[n - 2] + w[ROW_MOTION + i, 2] * x[n - 1]
            )
    if kind == DIRECTION:
        compare_direction(ba, be, br, w)
    else:
        compare_position(dynamics, k, w)
    _jacobian(biased, m, n, k, at, w)
    if n == 6:
        spread(6, P, k, w)
    elif n == 9:
        spread(9, P, k, w)
    elif n == 12:
        spread(12, P, k, w)
    else:
        spread(n, P, k, w)
    if kind == DIRECTION:
        for i in range(k):
            a = w[ROW_S + i, i] - w[ROW_R + i, i]
            w[ROW_S + i, i] += w[ROW_SECOND, i] * a * a
        if not math.isnan(w[ROW_LOOK, LOOK_Z + 2]):
            _curvature(P, k - 1, w)
    if at[BIAS_TIME] >= 0:
        _time_by_velocity(P, at[BIAS_TIME], k, w)
    if lag < 0.0:
        _late(dynamics, q, -lag, k, w)
    share = 0.0
    for i in range(k):
        share += w[ROW_R + i, i] / w[ROW_S + i, i]
    if n == 6:
        nis, det = condition(6, x, P, k, gate, w)
    elif n == 9:
        nis, det = condition(9, x, P, k, gate, w)
    elif n == 12:
        nis, det = condition(12, x, P, k, gate, w)
    else:
        nis, det = condition(n, x, P, k, gate, w)
    return nis, -0.5 * (min(nis, CLIP) + math.log(det) + k * LOG_TURN), share / k


@njit(**PART)
def _held(x: FloatArray, at: Columns) -> tuple[float, float, float, float]:
    """Return a source's biases in azimuth, elevation, range and time as a state holds them."""
    ba = x[at[0]] if at[0] >= 0 else 0.0
    be = x[at[1]] if at[1] >= 0 else 0.0
    br = x[at[2]] if at[2] >= 0 else 0.0
    bt = x[at[3]] if at[3] >= 0 else 0.0
    return ba, be, br, bt


@njit(**PART)
def _turn(x: FloatArray, angle: float) -> None:
    """Turn position and velocity (6,) by `angle` (rad) with the Earth, in place."""
    c, s = math.cos(angle), math.sin(angle)
    for i in range(0, 6, 3):
        a, b = x[i], x[i + 1]
        x[i], x[i + 1] = c * a - s * b, s * a + c * b


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def _jacobian(biased: bool, m: int, n: int, k: int, at: Columns, w: FloatArray) -> None:
    """Fill rows H (k, n) by the present state, of A by the position then and the transition F to then."""
    for i in range(min(k, 3)):
        a, b, c = w[ROW_A + i, 0], w[ROW_A + i, 1], w[ROW_A + i, 2]
        for j in range(m):
            w[ROW_H + i, j] = a * w[ROW_F, j] + b * w[ROW_F + 1, j] + c * w[ROW_F + 2, j]
        for j in range(m, n):
            w[ROW_H + i, j] = 0.0
        if biased:
            for j in range(3):
                w[ROW_H + i, n - 3 + j] = a * w[ROW_MOTION, j] + b * w[ROW_MOTION + 1, j] + c * w[ROW_MOTION + 2, j]
    for i in range(3, k):
        for j in range(n):
            w[ROW_H + i, j] = w[ROW_F + i, j] if j < m else 0.0
    for j in range(N_BIAS):
        if at[j] >= 0:
            for i in range(k):
                w[ROW_H + i, at[j]] = w[ROW_BIAS + i, j]


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def _curvature(P: FloatArray, row: int, w: FloatArray) -> None:
    """Add to S and Y what the curvature of a sphere of equal range makes of the uncertainty across the line of sight.

    Ranges are often known far better than directions: 40 km across at 20,000 km are 40 m along. Without this the first
    ranges of several stations would be believed where their spheres do not cross.
    """
    trace, squares, along, twice = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        v = 0.0
        for j in range(3):
            v += P[i, j] * w[ROW_A + row, j]
            squares += P[i, j] * P[i, j]
        trace += P[i, i]
        along += v * w[ROW_A + row, i]
        twice += v * v
    r = w[ROW_LOOK, LOOK_FAR]
    w[ROW_Y, row] -= 0.5 * (trace - along) / r
    w[ROW_S + row, row] += 0.5 * (squares - 2.0 * twice + along * along) / (r * r)


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def _time_by_velocity(P: FloatArray, b: int, k: int, w: FloatArray) -> None:
    """Add to S and Y the second order of a time bias (number `b` of the state) times the velocity.

    While both are little known their product is what counts: without it the first reports of a target whose velocity
    is not known would say how late they are.
    """
    for i in range(min(k, 3)):
        total = 0.0
        for c in range(3):
            total += w[ROW_A + i, c] * P[3 + c, b]
        w[ROW_ROOM, i] = total
    for i in range(min(k, 3)):
        w[ROW_Y, i] += w[ROW_ROOM, i]
        for j in range(min(k, 3)):
            total = 0.0
            for c in range(3):
                for d in range(3):
                    total += w[ROW_A + i, c] * P[3 + c, 3 + d] * w[ROW_A + j, d]
            w[ROW_S + i, j] += P[b, b] * total + w[ROW_ROOM, i] * w[ROW_ROOM, j]


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def _late(dynamics: int, q: float, lag: float, k: int, w: FloatArray) -> None:
    """Add the process noise of `lag` (s) to S: what moved the target since. Backwards its cross term is negative."""
    pp = noise(dynamics, q, lag, 0, 0)
    for i in range(min(k, 3)):
        for j in range(min(k, 3)):
            w[ROW_S + i, j] += pp * (
                w[ROW_A + i, 0] * w[ROW_A + j, 0]
                + w[ROW_A + i, 1] * w[ROW_A + j, 1]
                + w[ROW_A + i, 2] * w[ROW_A + j, 2]
            )
    if k > 3:
        pv, vv = noise(dynamics, q, lag, 0, 1), noise(dynamics, q, lag, 1, 1)
        for i in range(3):
            w[ROW_S + i, 3 + i] -= pv
            w[ROW_S + 3 + i, i] -= pv
            w[ROW_S + 3 + i, 3 + i] += vv


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
    X: FloatArray, P: FloatArray, m: int, held: int, position: FloatArray, velocity: FloatArray, spread: FloatArray,
    columns: Columns, priors: FloatArray, sigma_bias: FloatArray,
) -> None:  # fmt: skip
    """Set every hypothesis (h, n) to a position and velocity (3,) with wide variances `spread` (m, m/s, m/s²).

    The biases are as little known as their `priors` (2, s, 4) say at their `columns` (`guide_run.step`), and the gross
    ones by `sigma_bias` (s,) from number `held` on.
    """
    X[:] = 0.0
    P[:] = 0.0
    sources = len(sigma_bias)
    for h in range(len(X)):
        write_vector(X[h], position)
        write_vector(X[h, 3:], velocity)
        for i in range(m):
            P[h, i, i] = spread[i // 3] ** 2
        table = 1 if h > sources else 0
        for s in range(sources):
            for j in range(N_BIAS):
                at = columns[table, s, j]
                if at >= 0:
                    P[h, at, at] = priors[table, s, j] ** 2
        if 0 < h <= sources:
            for i in range(held, held + 3):
                P[h, i, i] = sigma_bias[h - 1] ** 2
