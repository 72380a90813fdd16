"""The friendly filter's two steps for position and velocity in space: dense arrays in and out, the algebra of `blocks`.

What a call from Python costs is mostly arguments and arrays: the caller makes the results, nothing is allocated here
but one scratch of slopes, and the arguments are Python's own (`kernels.unwrap`).
"""

# Numba caches by file and compiles kernels.blocks and kernels.sight into these: clear __pycache__ when those change.
from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, types

from boresight.kernels.arctan import FAST, INLINE, PASS, near
from boresight.kernels.blocks import Belief, Nine, Six, Three, condition_rate, dot, move, spread
from boresight.kernels.observation import CONTEXT_SIZE, NOISE, POSITION, ROTATION, VELOCITY
from boresight.kernels.sight import polar, range_rate, turned_polar
from boresight.kernels.unwrap import THING, direct, matrix, vector
from boresight.types.sensor import FloatArray

MISFIT = -1  # what `update_space` returns where z, x or P have another size


@njit(**INLINE)
def load_dense(x: FloatArray, P: FloatArray) -> Belief:
    """Read a mean (6,) and the upper half of a covariance (6, 6)."""
    return (
        (x[0], x[1], x[2]),
        (x[3], x[4], x[5]),
        (P[0, 0], P[0, 1], P[0, 2], P[1, 1], P[1, 2], P[2, 2]),
        (P[0, 3], P[0, 4], P[0, 5], P[1, 3], P[1, 4], P[1, 5], P[2, 3], P[2, 4], P[2, 5]),
        (P[3, 3], P[3, 4], P[3, 5], P[4, 4], P[4, 5], P[5, 5]),
    )


@njit(**INLINE)
def store_dense(x: FloatArray, P: FloatArray, p: Three, v: Three, A: Six, B: Nine, C: Six) -> None:
    """Write a mean and a covariance, both halves."""
    n = 0
    for i in range(3):
        x[i], x[3 + i] = p[i], v[i]
        for j in range(i, 3):
            P[i, j] = P[j, i] = A[n]
            P[3 + i, 3 + j] = P[3 + j, 3 + i] = C[n]
            n += 1
        for j in range(3):
            P[i, 3 + j] = P[3 + j, i] = B[3 * i + j]


@njit(**INLINE)
def sound(x: FloatArray, P: FloatArray) -> bool:
    """Whether a mean (6,) is finite and a covariance (6, 6) symmetric to rounding, with variances above zero."""
    for i in range(6):
        if not (-math.inf < x[i] < math.inf and 0.0 < P[i, i] < math.inf):
            return False
        for j in range(i):
            if not abs(P[i, j] - P[j, i]) <= 1e-9 * (P[i, i] + P[j, j]):
                return False
    return True


@njit(types.boolean(THING, THING, types.float64, types.float64, THING, THING), **FAST)
def _predict_space(x: Any, P: Any, dt: float, q: float, moved: Any, spread: Any) -> bool:
    """Move by `dt` (s) at nearly constant velocity, q in m²/s³: `moved` (6,) and `spread` (6, 6) are filled.

    Returns False, with nothing done, where an array has another size or type, or x and P are no belief.
    """
    x, P, moved, spread = vector(x), matrix(P), vector(moved), matrix(spread)
    if not (x.shape[0] == 6 and P.shape == (6, 6) and moved.shape[0] == 6 and spread.shape == (6, 6)):
        return False
    if not sound(x, P):
        return False
    p, v, A, B, C = load_dense(x, P)
    p, v, A, B, C = move(p, v, A, B, C, dt, q)
    store_dense(moved, spread, p, v, A, B, C)
    return True


@njit(**PASS)
def slopes(p: Three, v: Three, z: FloatArray, c: FloatArray, H: FloatArray) -> int:
    """Fill rows of `H` (m, 8), of the components that can be used: slope (6,), noise variance, innovation."""
    d = (p[0] - c[POSITION], p[1] - c[POSITION + 1], p[2] - c[POSITION + 2])
    u = (v[0] - c[VELOCITY], v[1] - c[VELOCITY + 1], v[2] - c[VELOCITY + 2])
    e = ROTATION
    R = (c[e], c[e + 1], c[e + 2], c[e + 3], c[e + 4], c[e + 5], c[e + 6], c[e + 7], c[e + 8])
    if R[0] + R[4] + R[8] == 3.0:  # not turned: no other rotation has this trace
        r, azimuth, elevation, h_r, h_a, h_e = polar(d)
    else:
        r, azimuth, elevation, h_r, h_a, h_e = turned_polar(R, d)
    m, i = 0, -1
    for column in range(7):
        if not c[NOISE + 8 * column] > 0.0:
            continue
        i += 1
        g = (0.0, 0.0, 0.0)
        if column == 0:
            h, error = h_r, z[i] - r
        elif column == 1:
            h, error = h_a, near(z[i] - azimuth)
        elif column == 2:
            h, error = h_e, near(z[i] - elevation)
        elif column == 3:
            rate, h, g = range_rate(d, u)
            error = z[i] - rate
        else:
            a = column - 4
            h = (c[e + a], c[e + 3 + a], c[e + 6 + a])
            error = z[i] - dot(h, d)
        if not math.isnan(error):
            H[m, 0], H[m, 1], H[m, 2], H[m, 3], H[m, 4], H[m, 5] = h[0], h[1], h[2], g[0], g[1], g[2]
            H[m, 6], H[m, 7] = c[NOISE + 8 * column], error
            m += 1
    return m


USED = types.Tuple((types.int64, types.float64, types.float64))


@njit(USED(THING, THING, THING, THING, THING, THING, THING, THING), **FAST)
def _update_space(
    x: Any, P: Any, z: Any, context: Any, mean: Any, covariance: Any, y: Any, S: Any
) -> tuple[int, float, float]:
    """Condition on `z` (m,), the components with noise in `context`, in order; m ≤ 6.

    `mean` (6,), `covariance` (6, 6), `y` (m,) and `S` (m, m) are filled; caller and context must agree on m. Returns
    how many components were used (the first so many of y and S are filled; MISFIT where an array has another size or
    type, or holds what cannot be), the normalised innovation squared (NaN where S is not positive definite) and
    log N(y; 0, S).
    """
    x, P, z, context = vector(x), matrix(P), vector(z), vector(context)
    mean, covariance, y, S = vector(mean), matrix(covariance), vector(y), matrix(S)
    size = z.shape[0]
    if not (x.shape[0] == 6 and P.shape == (6, 6) and mean.shape[0] == 6 and covariance.shape == (6, 6)):
        return MISFIT, 0.0, 0.0
    if not (context.shape[0] == CONTEXT_SIZE and 0 < size <= 6 and y.shape[0] == size and S.shape == (size, size)):
        return MISFIT, 0.0, 0.0
    if not sound(x, P):
        return MISFIT, 0.0, 0.0
    for i in range(size):
        if math.isinf(z[i]) or (i == 0 and z[0] < 0.0 and context[NOISE] > 0.0):
            return MISFIT, 0.0, 0.0
    H = np.empty((6, 8))
    p, v, A, B, C = load_dense(x, P)
    m = slopes(p, v, z, context, H)
    for i in range(m):
        y[i] = H[i, 7]
        h, g = (H[i, 0], H[i, 1], H[i, 2]), (H[i, 3], H[i, 4], H[i, 5])
        a, b = spread(A, B, C, h, g)
        for j in range(i + 1):
            S[i, j] = S[j, i] = (
                H[j, 0] * a[0] + H[j, 1] * a[1] + H[j, 2] * a[2] + H[j, 3] * b[0] + H[j, 4] * b[1] + H[j, 5] * b[2]
            )
        S[i, i] += H[i, 6]
    nis, det = 0.0, 1.0
    here, speed = p, v
    for i in range(m):
        h, g = (H[i, 0], H[i, 1], H[i, 2]), (H[i, 3], H[i, 4], H[i, 5])
        p, v, A, B, C, part, s = condition_rate(p, v, A, B, C, here, speed, h, g, H[i, 7], H[i, 6])
        nis += part
        det *= s
    if not (A[0] > 0.0 and A[3] > 0.0 and A[5] > 0.0 and C[0] > 0.0 and C[3] > 0.0 and C[5] > 0.0):
        return MISFIT, 0.0, 0.0
    store_dense(mean, covariance, p, v, A, B, C)
    return m, nis, -0.5 * (nis + math.log(det) + m * math.log(2.0 * math.pi))


predict_space, update_space = direct(_predict_space), direct(_update_space)
