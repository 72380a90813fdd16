"""The friendly filter's two steps for position and velocity in space: dense arrays in and out, the algebra of `blocks`.

What a call from Python costs is mostly arguments and arrays: the caller makes the results and nothing is allocated here
but one scratch of slopes.
"""

# Numba caches by file and compiles kernels.blocks and kernels.sight into these: clear __pycache__ when those change.
from __future__ import annotations

import math

import numpy as np
from numba import njit, types

from boresight.kernels.arctan import FAST, INLINE, near
from boresight.kernels.blocks import Belief, Nine, Six, Three, condition_rate, dot, move, spread
from boresight.kernels.observation import NOISE, POSITION, ROTATION, VELOCITY, IntArray
from boresight.kernels.sight import polar, range_rate, turned_polar
from boresight.kernels.signatures import MATRIX, VECTOR
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


@njit(types.boolean(VECTOR, MATRIX, types.float64, types.float64, VECTOR, MATRIX), **FAST)
def predict_space(x: FloatArray, P: FloatArray, dt: float, q: float, x_out: FloatArray, P_out: FloatArray) -> bool:
    """Fill the mean (6,) and covariance (6, 6) moved by `dt` (s) at nearly constant velocity, q in m²/s³.

    Returns False, with nothing done, where x or P have another size.
    """
    if x.shape[0] != 6 or P.shape[0] != 6 or P.shape[1] != 6:
        return False
    p, v, A, B, C = load_dense(x, P)
    p, v, A, B, C = move(p, v, A, B, C, dt, q)
    store_dense(x_out, P_out, p, v, A, B, C)
    return True


@njit(**FAST)
def slopes(p: Three, v: Three, z: FloatArray, columns: IntArray, c: FloatArray, y: FloatArray, H: FloatArray) -> int:
    """Fill innovations and slopes, and the noise variance last: `H` (m, 7), of the components that can be used."""
    d = (p[0] - c[POSITION], p[1] - c[POSITION + 1], p[2] - c[POSITION + 2])
    u = (v[0] - c[VELOCITY], v[1] - c[VELOCITY + 1], v[2] - c[VELOCITY + 2])
    e = ROTATION
    R = (c[e], c[e + 1], c[e + 2], c[e + 3], c[e + 4], c[e + 5], c[e + 6], c[e + 7], c[e + 8])
    if R[0] + R[4] + R[8] == 3.0:  # not turned: no other rotation has this trace
        r, azimuth, elevation, h_r, h_a, h_e = polar(d)
    else:
        r, azimuth, elevation, h_r, h_a, h_e = turned_polar(R, d)
    m = 0
    for i in range(z.shape[0]):
        g = (0.0, 0.0, 0.0)
        if columns[i] == 0:
            h, error = h_r, z[i] - r
        elif columns[i] == 1:
            h, error = h_a, near(z[i] - azimuth)
        elif columns[i] == 2:
            h, error = h_e, near(z[i] - elevation)
        elif columns[i] == 3:
            rate, h, g = range_rate(d, u)
            error = z[i] - rate
        else:
            a = columns[i] - 4
            h = (c[e + a], c[e + 3 + a], c[e + 6 + a])
            error = z[i] - dot(h, d)
        if not math.isnan(error):
            y[m] = error
            H[m, 0], H[m, 1], H[m, 2], H[m, 3], H[m, 4], H[m, 5] = h[0], h[1], h[2], g[0], g[1], g[2]
            H[m, 6] = c[NOISE + 8 * columns[i]]
            m += 1
    return m


THREE_NUMBERS = types.UniTuple(types.float64, 3)  # type: ignore[no-untyped-call]


@njit(
    THREE_NUMBERS(VECTOR, MATRIX, VECTOR, types.int64[::1], VECTOR, VECTOR, MATRIX, VECTOR, MATRIX),
    **FAST,
)
def update_space(
    x: FloatArray,
    P: FloatArray,
    z: FloatArray,
    columns: IntArray,
    context: FloatArray,
    x_out: FloatArray,
    P_out: FloatArray,
    y: FloatArray,
    S: FloatArray,
) -> tuple[float, float, float]:
    """Condition on `z` (m,), whose components are `columns` (m,); fills mean, covariance, y (m,) and S (m, m).

    Returns how many components were used (the first so many of y and S are filled; MISFIT where sizes do not fit), the
    normalised innovation squared (NaN where S is not positive definite) and log N(y; 0, S).
    """
    if z.shape[0] != columns.shape[0] or x.shape[0] != 6 or P.shape[0] != 6 or P.shape[1] != 6:
        return MISFIT, 0.0, 0.0
    H = np.empty((columns.shape[0], 7))
    p, v, A, B, C = load_dense(x, P)
    m = slopes(p, v, z, columns, context, y, H)
    for i in range(m):
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
        p, v, A, B, C, part, s = condition_rate(p, v, A, B, C, here, speed, h, g, y[i], H[i, 6])
        nis += part
        det *= s
    store_dense(x_out, P_out, p, v, A, B, C)
    return m, nis, -0.5 * (nis + math.log(det) + m * math.log(2.0 * math.pi))
