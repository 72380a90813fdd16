"""A user's own models of six states at speed: dense algebra of fixed size, nothing allocated per report.

A belief is (43,) and more: time, mean (6), covariance (36), then the motion model's parameters. A report is time, the
measurement's columns (7, NaN where not measured), then the sensor's context. The models are kernels by address.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, types

from boresight.kernels.address import motion_at, observation_at
from boresight.kernels.arctan import FAST, INLINE
from boresight.kernels.gaussian import joseph_update
from boresight.kernels.observation import IntArray
from boresight.kernels.signatures import MATRIX, VECTOR
from boresight.types.sensor import FloatArray

SixNumbers = tuple[float, float, float, float, float, float]

N = 6
TIME, MEAN, COVARIANCE, PARAMETERS = 0, 1, 7, 43
MEASURED, CONTEXT = 1, 8
BACKWARDS = -1.0  # what `own_step` returns where the report is before the belief
WORK = 212
Room = tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]


@njit(**INLINE)
def row(A: FloatArray, i: int) -> SixNumbers:
    """Return a row in registers: the compiler cannot know that the array is not written to in between."""
    return A[i, 0], A[i, 1], A[i, 2], A[i, 3], A[i, 4], A[i, 5]


@njit(**INLINE)
def dot(a: SixNumbers, b: SixNumbers) -> float:
    """Return a·b in two chains, half as long."""
    return (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) + (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])


@njit(**FAST)
def advance(F: FloatArray, P: FloatArray, Q: FloatArray, T: FloatArray) -> None:
    """Overwrite `P` (6, 6) with F P Fᵀ + Q, exactly symmetric; `T` (6, 6) is scratch."""
    for j in range(N):
        p = row(P, j)  # = column j
        for i in range(N):
            T[i, j] = dot(row(F, i), p)
    for i in range(N):
        t = row(T, i)
        for j in range(i + 1):
            P[i, j] = P[j, i] = dot(t, row(F, j)) + 0.5 * (Q[i, j] + Q[j, i])


@njit(**FAST)
def condition(x: FloatArray, P: FloatArray, h: SixNumbers, y: float, r: float) -> float:
    """Condition on one number with innovation `y`, slope `h`, noise variance `r`; returns y²/s, NaN if s ≤ 0."""
    g = (
        dot(row(P, 0), h), dot(row(P, 1), h), dot(row(P, 2), h),
        dot(row(P, 3), h), dot(row(P, 4), h), dot(row(P, 5), h),
    )  # fmt: skip
    s = dot(h, g) + r
    if not s > 0.0:
        return math.nan
    w = 1.0 / s
    e = w * y
    for i in range(N):
        x[i] += g[i] * e
        k = w * g[i]
        for j in range(i + 1):
            P[i, j] = P[j, i] = P[i, j] - k * g[j]
    return float(e * y)


@njit(**FAST)
def take(x: FloatArray, P: FloatArray, m: int, y: FloatArray, H: FloatArray, R: FloatArray) -> float:
    """Condition on m rows: one after another where R is diagonal, else jointly; returns the NIS."""
    alone = True
    for i in range(m):
        for j in range(i):
            alone = alone and R[i, j] == 0.0
    if not alone:
        x_new, P_new, _, nis, _ = joseph_update(x, P, y[:m].copy(), H[:m].copy(), R[:m, :m].copy(), N)
        if nis == nis:
            x[:] = x_new
            P[:, :] = P_new
        return float(nis)
    total = 0.0
    here = (x[0], x[1], x[2], x[3], x[4], x[5])
    for i in range(m):
        h = row(H, i)
        moved = (x[0] - here[0], x[1] - here[1], x[2] - here[2], x[3] - here[3], x[4] - here[4], x[5] - here[5])
        total += condition(x, P, h, y[i] - dot(h, moved), R[i, i])
    return total


@njit(**INLINE)
def room() -> Room:
    """Return F, Q, scratch (6, 6), H (7, 6), R (7, 7), y (7,), the moved mean (6,), cut from one array."""
    work = np.empty(WORK)
    return (
        work[:36].reshape((N, N)),
        work[36:72].reshape((N, N)),
        work[72:108].reshape((N, N)),
        work[108:150].reshape((7, N)),
        work[150:199].reshape((7, 7)),
        work[199:206],
        work[206:212],
    )


@njit(types.float64(VECTOR, VECTOR, types.int64, types.int64), **FAST)
def own_step(belief: FloatArray, report: FloatArray, motion: int, observe: int) -> float:
    """Move a belief to the report's time and condition it on it, in place; returns as `packed.packed_step`."""
    dt = report[TIME] - belief[TIME]
    if not dt >= 0.0:
        return BACKWARDS
    move, see = motion_at(motion), observation_at(observe)
    x, P = belief[MEAN:COVARIANCE], belief[COVARIANCE:PARAMETERS].reshape((N, N))
    F, Q, T, H, R, y, moved = room()
    move(x, dt, belief[PARAMETERS:], moved, F, Q)
    x[:] = moved
    advance(F, P, Q, T)
    nis = take(x, P, see(x, report[MEASURED:CONTEXT], report[CONTEXT:], y, H, R), y, H, R)
    belief[TIME] = report[TIME]
    return float(nis)


@njit(
    types.int64(VECTOR, types.int64, types.int64, VECTOR, MATRIX, MATRIX, types.int64[::1], MATRIX, VECTOR),
    nogil=True,
    **FAST,
)
def own_stream(
    belief: FloatArray,
    motion: int,
    observe: int,
    t: FloatArray,
    z: FloatArray,
    contexts: FloatArray,
    sensor: IntArray,
    kept: FloatArray,
    nis: FloatArray,
) -> int:
    """Filter k reports in order of time, in place; arguments as `packed.packed_stream`, `kept` (k, 42) mean and P."""
    move, see = motion_at(motion), observation_at(observe)
    x, P = belief[MEAN:COVARIANCE], belief[COVARIANCE:PARAMETERS].reshape((N, N))
    F, Q, T, H, R, y, moved = room()
    parameters = belief[PARAMETERS:]
    for k in range(t.shape[0]):
        dt = t[k] - belief[TIME]
        if not dt >= 0.0:
            return k
        move(x, dt, parameters, moved, F, Q)
        x[:] = moved
        advance(F, P, Q, T)
        value = take(x, P, see(x, z[k], contexts[sensor[k]], y, H, R), y, H, R)
        belief[TIME] = t[k]
        if math.isnan(value):
            return k
        if kept.shape[0] > 0:
            kept[k] = belief[MEAN:PARAMETERS]
        if nis.shape[0] > 0:
            nis[k] = value
    return len(t)
