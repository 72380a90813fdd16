"""One track in one array: the filter of a single report, in place, and of a whole stream, from `kernels.blocks`.

A packed belief is (29,): time, the motion model's q, then the 27 numbers of `blocks`. A packed report is (74,): time,
the measured components by number (7, NaN where not measured), then the sensor's context as `kernels.observation` has
it (66), of uncorrelated noise, in space, not in the tangent form: `filters.packed` checks that. Two arrays and no more,
because unwrapping the arguments is most of what a call from Python costs.
"""

# Numba caches by file and compiles kernels.blocks and kernels.sight into these: clear __pycache__ when those change.
from __future__ import annotations

import math
from typing import Any

from numba import njit, types

from boresight.kernels.arctan import FAST, INLINE, near
from boresight.kernels.blocks import (
    Nine,
    Six,
    Three,
    condition,
    condition_rate,
    condition_three,
    condition_two,
    load,
    move,
    store,
)
from boresight.kernels.observation import (
    CONTEXT_SIZE,
    DIMENSIONS,
    NOISE,
    POSITION,
    ROTATION,
    TANGENT,
    VELOCITY,
    IntArray,
)
from boresight.kernels.sight import polar, range_rate, turned_polar
from boresight.kernels.signatures import MATRIX, STACK, VECTOR
from boresight.kernels.space import load_dense, store_dense
from boresight.kernels.unwrap import THING, direct, vector
from boresight.types.sensor import FloatArray

Conditioned = tuple[Three, Three, Six, Nine, Six, float, int]

TIME, POWER, NUMBERS = 0, 1, 2  # of a belief
BELIEF_SIZE = NUMBERS + 27
MEASURED, CONTEXT = 1, 8  # of a report
REPORT_SIZE = CONTEXT + CONTEXT_SIZE
UNFIT = -1  # what `space_stream` returns for a sensor that it cannot take
BACKWARDS = -1.0  # what `packed_step` returns where the report is before the belief: NIS cannot be negative
MISFIT = -2.0  # and where an array has another size or type


@njit(**INLINE)
def look(p: Three, v: Three, A: Six, B: Nine, C: Six, z: FloatArray, k: int, c: FloatArray, o: int) -> Conditioned:
    """Condition on the report `z[k:k + 7]`, NaN where not measured, of the sensor with context `c[o:o + 66]`.

    Returns the belief, the normalised innovation squared and how many components were used.
    """
    here, speed = p, v
    d = (p[0] - c[o + POSITION], p[1] - c[o + POSITION + 1], p[2] - c[o + POSITION + 2])
    e = o + ROTATION
    R = (c[e], c[e + 1], c[e + 2], c[e + 3], c[e + 4], c[e + 5], c[e + 6], c[e + 7], c[e + 8])
    n = o + NOISE
    total, used = 0.0, 0
    if R[0] + R[4] + R[8] == 3.0:  # not turned: no other rotation has this trace
        r, azimuth, elevation, h_r, h_a, h_e = polar(d)
    else:
        r, azimuth, elevation, h_r, h_a, h_e = turned_polar(R, d)
    y_r, y_a, y_e = z[k] - r, near(z[k + 1] - azimuth), near(z[k + 2] - elevation)
    if y_r == y_r:
        p, v, A, B, C, total, _ = condition_three(
            p, v, A, B, C, h_r, y_r, c[n], h_a, y_a, c[n + 8], h_e, y_e, c[n + 16]
        )
    elif y_a == y_a or y_e == y_e:
        p, v, A, B, C, total, _ = condition_two(p, v, A, B, C, h_a, y_a, c[n + 8], h_e, y_e, c[n + 16])
    used += (1 if y_r == y_r else 0) + (1 if y_a == y_a else 0) + (1 if y_e == y_e else 0)
    if not math.isnan(z[k + 3]):
        u = (speed[0] - c[o + VELOCITY], speed[1] - c[o + VELOCITY + 1], speed[2] - c[o + VELOCITY + 2])
        rate, h, g = range_rate(d, u)
        p, v, A, B, C, nis, _ = condition_rate(p, v, A, B, C, here, speed, h, g, z[k + 3] - rate, c[n + 24])
        total += nis
        used += 1 if rate == rate else 0
    for a in range(3):
        if not math.isnan(z[k + 4 + a]):
            h = (c[e + a], c[e + 3 + a], c[e + 6 + a])
            seen = h[0] * d[0] + h[1] * d[1] + h[2] * d[2]
            p, v, A, B, C, nis, _ = condition(p, v, A, B, C, here, h, z[k + 4 + a] - seen, c[n + 32 + 8 * a])
            total += nis
            used += 1
    return p, v, A, B, C, total, used


@njit(types.float64(THING, THING), **FAST)
def _packed_step(belief: Any, report: Any) -> float:
    """Move a packed belief (29,) to the report's time at nearly constant velocity and condition it on it, in place.

    Returns the normalised innovation squared; NaN where an innovation variance was not positive, and BACKWARDS, with
    nothing changed, where the report is before the belief or its time is not a number; MISFIT, likewise, where an array
    has another size or type.
    """
    belief, report = vector(belief), vector(report)
    if belief.shape[0] != BELIEF_SIZE or report.shape[0] != REPORT_SIZE:
        return MISFIT
    dt = report[TIME] - belief[TIME]
    if not dt >= 0.0:
        return BACKWARDS
    p, v, A, B, C = load(belief, NUMBERS, 1)
    p, v, A, B, C = move(p, v, A, B, C, dt, belief[POWER])
    p, v, A, B, C, nis, _ = look(p, v, A, B, C, report, MEASURED, report, CONTEXT)
    store(belief, NUMBERS, 1, p, v, A, B, C)
    belief[TIME] = report[TIME]
    return float(nis)


packed_step = direct(_packed_step)


@njit(
    types.int64(VECTOR, VECTOR, MATRIX, MATRIX, types.int64[::1], MATRIX, VECTOR),
    nogil=True,
    **FAST,
)
def packed_stream(
    belief: FloatArray,
    t: FloatArray,
    z: FloatArray,
    contexts: FloatArray,
    sensor: IntArray,
    kept: FloatArray,
    nis: FloatArray,
) -> int:
    """Filter k reports in order of time, in place: z (k, 7), `sensor` (k,) which row of `contexts` (s, 66) each is of.

    Filled per report unless they are empty: `kept` (k, 27) with the belief after it, `nis` (k,). Returns the reports
    done: less than k where time ran backwards or an innovation variance was not positive.
    """
    p, v, A, B, C = load(belief, NUMBERS, 1)
    q = belief[POWER]
    now = belief[TIME]
    flat_z, flat_c, flat_kept = z.reshape(-1), contexts.reshape(-1), kept.reshape(-1)
    width = contexts.shape[1]
    done = 0
    for k in range(t.shape[0]):
        dt = t[k] - now
        if not dt >= 0.0:
            break
        p, v, A, B, C = move(p, v, A, B, C, dt, q)
        now = t[k]
        p, v, A, B, C, value, _ = look(p, v, A, B, C, flat_z, 7 * k, flat_c, sensor[k] * width)
        if math.isnan(value):
            break
        if kept.shape[0] > 0:
            store(flat_kept, 27 * k, 1, p, v, A, B, C)
        if nis.shape[0] > 0:
            nis[k] = value
        done += 1
    store(belief, NUMBERS, 1, p, v, A, B, C)
    belief[TIME] = now
    return done


@njit(**INLINE)
def separable(c: FloatArray, o: int) -> bool:
    """Return whether `look` can take the context at `c[o:]`: in space, not tangent, noise not correlated."""
    apart = c[o + DIMENSIONS] == 3.0 and c[o + TANGENT] == 0.0
    for i in range(7):
        for j in range(i):
            apart = apart and c[o + NOISE + 7 * i + j] == 0.0
    return bool(apart)


@njit(
    types.int64(
        types.float64, VECTOR, MATRIX, types.float64, VECTOR, MATRIX, MATRIX,
        MATRIX, STACK, MATRIX, STACK, STACK, MATRIX,
    ),
    nogil=True,
    **FAST,
)  # fmt: skip
def space_stream(
    q: float,
    x0: FloatArray,
    P0: FloatArray,
    t0: float,
    t: FloatArray,
    z: FloatArray,
    context: FloatArray,
    x_out: FloatArray,
    P_out: FloatArray,
    x_predicted: FloatArray,
    P_predicted: FloatArray,
    F_out: FloatArray,
    nis: FloatArray,
) -> int:
    """`stream.ekf_stream` for nearly constant velocity in space: everything kept, by the algebra of `blocks`.

    Returns the reports done; UNFIT where a report's context is not `separable`, and then another kernel has to do it.
    """
    p, v, A, B, C = load_dense(x0, P0)
    now = t0
    flat_z, flat_c, width = z.reshape(-1), context.reshape(-1), context.shape[1]
    for k in range(t.shape[0]):
        dt = t[k] - now
        if not separable(flat_c, k * width):
            return UNFIT
        if not dt >= 0.0:
            return k
        now = t[k]
        for i in range(6):
            for j in range(6):
                F_out[k, i, j] = 1.0 if i == j else 0.0
        for i in range(3):
            F_out[k, i, 3 + i] = dt
        p, v, A, B, C = move(p, v, A, B, C, dt, q)
        store_dense(x_predicted[k], P_predicted[k], p, v, A, B, C)
        p, v, A, B, C, value, used = look(p, v, A, B, C, flat_z, 7 * k, flat_c, k * width)
        if math.isnan(value):
            return k
        nis[k, 0], nis[k, 1] = value, used
        store_dense(x_out[k], P_out[k], p, v, A, B, C)
    return len(t)
