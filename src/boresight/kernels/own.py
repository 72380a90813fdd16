"""A user's own models of six states at speed: dense algebra of fixed size, nothing allocated per report.

A belief is (43,) and more: time, mean (6), covariance (36), then the motion model's parameters. A report is time, the
measurement's columns (7, NaN where not measured), then the sensor's context. The models are kernels by address.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, types

from boresight.kernels.address import motion_at, observation_at
from boresight.kernels.arctan import FAST, INLINE, PASS
from boresight.kernels.gaussian import joseph_update
from boresight.kernels.observation import IntArray
from boresight.kernels.signatures import MATRIX, VECTOR
from boresight.kernels.unwrap import THING, direct, vector
from boresight.kernels.write import write_matrix, write_vector
from boresight.types.sensor import FloatArray

SixNumbers = tuple[float, float, float, float, float, float]

N = 6
TIME, MEAN, COVARIANCE, PARAMETERS = 0, 1, 7, 43
MEASURED, CONTEXT = 1, 8
BACKWARDS, MISFIT = -1.0, -2.0  # what `own_step` returns: report before the belief; arrays of another size or type
WORK = 212
ZEROS = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
Room = tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]


@njit(**INLINE)
def row(A: FloatArray, i: int) -> SixNumbers:
    """Return a row in registers: the compiler cannot know that the array is not written to in between."""
    return A[i, 0], A[i, 1], A[i, 2], A[i, 3], A[i, 4], A[i, 5]


@njit(**INLINE)
def dot(a: SixNumbers, b: SixNumbers) -> float:
    """Return a·b in two chains, half as long."""
    return (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) + (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])


@njit(**INLINE)
def add(a: SixNumbers, f: float, b: SixNumbers) -> SixNumbers:
    """Return a + f b."""
    return a[0] + f * b[0], a[1] + f * b[1], a[2] + f * b[2], a[3] + f * b[3], a[4] + f * b[4], a[5] + f * b[5]


@njit(**INLINE)
def combine(f: SixNumbers, A: FloatArray, start: SixNumbers) -> SixNumbers:
    """Return start + f A: rows of `A` (6, 6) that do not count are left out, and most of F and H are zero."""
    total = start
    for j in range(N):
        if f[j] != 0.0:
            total = add(total, f[j], row(A, j))
    return total


@njit(**PASS)
def advance(F: FloatArray, P: FloatArray, Q: FloatArray, T: FloatArray) -> None:
    """Overwrite `P` (6, 6) with F P Fᵀ + Q, exactly symmetric; `T` (6, 6) is scratch, for (F P)ᵀ."""
    for i in range(N):
        column = combine(row(F, i), P, ZEROS)
        for k in range(N):
            T[k, i] = column[k]
    for i in range(N):
        moved = combine(row(F, i), T, row(Q, i))
        for k in range(N):
            P[i, k] = moved[k]
    for i in range(N):
        for j in range(i):
            P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])


@njit(**INLINE)
def condition(x: FloatArray, P: FloatArray, h: SixNumbers, y: float, r: float) -> float:
    """Condition on one number with innovation `y`, slope `h`, noise variance `r`; returns y²/s, NaN if s ≤ 0.

    With k = P h/√s: x⁺ = x + k y/√s, P⁺ = P - k kᵀ, whole rows and yet exactly symmetric.
    """
    g = combine(h, P, ZEROS)
    s = dot(h, g) + r
    if not s > 0.0:
        return math.nan
    w = math.sqrt(1.0 / s)
    e = w * y
    k = add(ZEROS, w, g)
    mean = add((x[0], x[1], x[2], x[3], x[4], x[5]), e, k)
    for i in range(N):
        x[i] = mean[i]
        left = add(row(P, i), -k[i], k)
        for j in range(N):
            P[i, j] = left[j]
    return float(e * e)


@njit(**PASS)
def take(x: FloatArray, P: FloatArray, m: int, y: FloatArray, H: FloatArray, R: FloatArray) -> float:
    """Condition on m rows: one after another where R is diagonal, else jointly; returns the NIS."""
    alone = True
    for i in range(m):
        for j in range(i):
            alone = alone and R[i, j] == 0.0
    if not alone:
        x_new, P_new, _, nis, _ = joseph_update(x, P, y[:m].copy(), H[:m].copy(), R[:m, :m].copy(), N)
        if nis == nis:
            write_vector(x, x_new)
            write_matrix(P, P_new)
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


@njit(types.float64(THING, THING, types.int64, types.int64), **FAST)
def _own_step(belief: Any, report: Any, motion: int, observe: int) -> float:
    """Move a belief to the report's time and condition it on it, in place; returns as `packed.packed_step`."""
    belief, report = vector(belief), vector(report)
    if belief.shape[0] < PARAMETERS or report.shape[0] < CONTEXT:
        return MISFIT
    dt = report[TIME] - belief[TIME]
    if not dt >= 0.0:
        return BACKWARDS
    move, see = motion_at(motion), observation_at(observe)
    x, P = belief[MEAN:COVARIANCE], belief[COVARIANCE:PARAMETERS].reshape((N, N))
    F, Q, T, H, R, y, moved = room()
    move(x, dt, belief[PARAMETERS:], moved, F, Q)
    write_vector(x, moved)
    advance(F, P, Q, T)
    nis = take(x, P, see(x, report[MEASURED:CONTEXT], report[CONTEXT:], y, H, R), y, H, R)
    belief[TIME] = report[TIME]
    return float(nis)


own_step = direct(_own_step)


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
        write_vector(x, moved)
        advance(F, P, Q, T)
        value = take(x, P, see(x, z[k], contexts[sensor[k]], y, H, R), y, H, R)
        belief[TIME] = t[k]
        if math.isnan(value):
            return k
        if kept.shape[0] > 0:
            write_vector(kept[k], belief[MEAN:PARAMETERS])
        if nis.shape[0] > 0:
            nis[k] = value
    return len(t)
