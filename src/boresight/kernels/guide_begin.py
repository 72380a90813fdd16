"""Where a guide filter begins: a position, or directions and ranges of one or several sources put together."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from boresight.kernels.guide import DIRECTION
from boresight.kernels.options import PART
from boresight.kernels.write import write_vector
from boresight.types.sensor import FloatArray

# What is kept of a source of directions before the start: when each number came, the numbers, where from, axes.
SEEN_T, SEEN_Z, SEEN_ORIGIN, SEEN_AXES = 0, 3, 6, 9
N_SEEN = 18
STEEPEST = 0.05  # rad: two directions that cross at less do not begin a target


@njit(**PART)
def note(one: FloatArray, t: float, z: FloatArray, origin: FloatArray, axes: FloatArray) -> None:
    """Keep a report of a direction (azimuth, elevation, range; NaN: not measured) in its source's row (N_SEEN,)."""
    for j in range(3):
        if not math.isnan(z[j]):
            one[SEEN_T + j] = t
            one[SEEN_Z + j] = z[j]
        one[SEEN_ORIGIN + j] = origin[j]
        for i in range(3):
            one[SEEN_AXES + 3 * i + j] = axes[i, j]


@njit(**PART)
def ray(one: FloatArray, t: float, held: float, out: FloatArray) -> bool:
    """Fill `out` (3,) with the ECEF direction that a source saw within `held` (s) of `t`; false if it saw none."""
    if not (abs(t - one[SEEN_T]) <= held and abs(t - one[SEEN_T + 1]) <= held):
        return False
    ce = math.cos(one[SEEN_Z + 1])
    w0, w1, w2 = ce * math.sin(one[SEEN_Z]), ce * math.cos(one[SEEN_Z]), math.sin(one[SEEN_Z + 1])
    for i in range(3):
        a = SEEN_AXES + 3 * i
        out[i] = one[a] * w0 + one[a + 1] * w1 + one[a + 2] * w2
    return True


@njit(**PART)
def first_place(
    seen: FloatArray, source: int, kind: int, t: float, z: FloatArray, origin: FloatArray, axes: FloatArray,
    held: float, out: FloatArray,
) -> bool:  # fmt: skip
    """Fill `out` (3,) with an ECEF position (m) as soon as the reports of the last `held` (s) give one.

    A position; azimuth, elevation and range of one source, in one report or several; a direction of one source and a
    range of another (the farther crossing); directions of two that cross at 3° or more (half-way between the rays).
    `seen` (s, N_SEEN) is what the sources said so far, this report not yet.
    """
    if kind != DIRECTION:
        write_vector(out, z[:3])
        return True
    note(seen[source], t, z, origin, axes)
    u, v = np.empty(3), np.empty(3)
    best, steepest = -1, STEEPEST
    other = -1
    for i in range(len(seen)):
        if not ray(seen[i], t, held, u):
            continue
        one = seen[i]
        if abs(t - one[SEEN_T + 2]) <= held:
            for j in range(3):
                out[j] = one[SEEN_ORIGIN + j] + one[SEEN_Z + 2] * u[j]
            return True
        for k in range(len(seen)):
            d0, d1, d2 = (
                one[SEEN_ORIGIN] - seen[k, SEEN_ORIGIN],
                one[SEEN_ORIGIN + 1] - seen[k, SEEN_ORIGIN + 1],
                one[SEEN_ORIGIN + 2] - seen[k, SEEN_ORIGIN + 2],
            )
            if k != i and abs(t - seen[k, SEEN_T + 2]) <= held:
                along = u[0] * d0 + u[1] * d1 + u[2] * d2
                square = along * along - (d0 * d0 + d1 * d1 + d2 * d2) + seen[k, SEEN_Z + 2] ** 2
                far = -along + math.sqrt(max(square, 0.0))
                if far > 0.0:
                    for j in range(3):
                        out[j] = one[SEEN_ORIGIN + j] + far * u[j]
                    return True
            if k > i and ray(seen[k], t, held, v):
                c = u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
                steep = math.sqrt(max(1.0 - c * c, 0.0))
                if steep > steepest:
                    best, other, steepest = i, k, steep
    if best < 0:
        return False
    crossed: bool = _crossing(seen[best], seen[other], t, held, u, v, out)
    return crossed


@njit(**PART)
def _crossing(
    a: FloatArray, b: FloatArray, t: float, held: float, u: FloatArray, v: FloatArray, out: FloatArray
) -> bool:
    """Fill `out` with the middle of the shortest line between two rays; false if that lies behind either source."""
    ray(a, t, held, u)
    ray(b, t, held, v)
    c, du, dv = 0.0, 0.0, 0.0
    for j in range(3):
        d = b[SEEN_ORIGIN + j] - a[SEEN_ORIGIN + j]
        c += u[j] * v[j]
        du += d * u[j]
        dv += d * v[j]
    q = 1.0 / (1.0 - c * c)
    near, far = q * (du - c * dv), q * (c * du - dv)
    if not (near > 0.0 and far > 0.0):
        return False
    for j in range(3):
        out[j] = 0.5 * (a[SEEN_ORIGIN + j] + near * u[j] + b[SEEN_ORIGIN + j] + far * v[j])
    return True
