"""The MSC filter: one cycle, and a whole stream in one call."""

# Numba caches by file and compiles kernels.gaussian into these: clear __pycache__ (make clean) when that changes.
from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, types

from boresight.kernels.gaussian import joseph_update, sandwich
from boresight.kernels.measurement import wrap
from boresight.kernels.msc import (
    EXACT,
    PRINTED,
    first_order_noise,
    first_order_transition,
    inverse_jacobian,
    jacobian,
    msc_from_world,
    world_from_msc,
)
from boresight.kernels.options import PART
from boresight.kernels.signatures import MATRIX, MOTION, OBSERVATION, STACK, VECTOR
from boresight.kernels.write import write_matrix, write_vector
from boresight.types.sensor import FloatArray


@njit(**PART)
def msc_condition(
    y: FloatArray, P: FloatArray, innovation: FloatArray, H: FloatArray, R: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Condition MSC (y, P) on an innovation whose Jacobian `H` is with respect to the Cartesian state.

    A step that would take 1/r to zero or below is cut at a tenth of it: range stays positive.
    """
    n = y.shape[0]
    J = jacobian(y)
    HJ = np.zeros((H.shape[0], n))
    for i in range(H.shape[0]):
        for j in range(n):
            for k in range(n):
                HJ[i, j] += H[i, k] * J[k, j]
    y_new, P_new, _, nis, _ = joseph_update(y, P, innovation, HJ, R, n)
    y_new[5] = max(y_new[5], 0.1 * y[5])
    y_new[2] = wrap(y_new[2])
    return y_new, P_new, nis


@njit(
    types.int64(
        MOTION, VECTOR, OBSERVATION, VECTOR, MATRIX, types.float64, VECTOR, VECTOR, MATRIX, MATRIX, MATRIX, types.int64,
        MATRIX, STACK, MATRIX, STACK, STACK, MATRIX,
    ),
    cache=True,
)  # fmt: skip
def msc_stream(
    motion: Any,
    parameters: FloatArray,
    observe: Any,
    y0: FloatArray,
    P0: FloatArray,
    t0: float,
    own0: FloatArray,
    t: FloatArray,
    z: FloatArray,
    context: FloatArray,
    own: FloatArray,
    variant: int,
    y_out: FloatArray,
    P_out: FloatArray,
    y_predicted: FloatArray,
    P_predicted: FloatArray,
    F_out: FloatArray,
    nis: FloatArray,
) -> int:
    """Filter k reports in MSC about an observer at `own0` (6,) at t0 and `own` (k, 6) at the reports.

    The mean goes through Cartesian, so that the observer's own acceleration enters there; Φ = J(y⁺)⁻¹ F J(y),
    Q = J(y⁺)⁻¹ Q J(y⁺)⁻ᵀ. Variants: EXACT; PRINTED takes shao2012 (26) and (27) for Φ and Q; MENDED takes them with
    their mistakes put right. Otherwise as `ekf_stream`.
    """
    n = y0.shape[0]
    y, P = y0.copy(), P0.copy()
    before = own0.copy()
    moved, F, Q = np.empty(n), np.empty((n, n)), np.empty((n, n))
    r, H, R = np.empty(7), np.empty((7, n)), np.empty((7, 7))
    now = t0
    for k in range(t.shape[0]):
        dt = t[k] - now
        if dt < 0.0:
            return k
        motion(world_from_msc(y, before), dt, parameters, moved, F, Q)
        after = msc_from_world(moved, own[k])
        if variant == EXACT:
            inverse = inverse_jacobian(after)
            Phi = inverse @ F @ jacobian(y)
            noise = sandwich(inverse, Q, np.zeros((n, n)))
        else:
            a = (own[k, 3:] - before[3:]) / dt if dt > 0.0 else np.zeros(3)
            los = inverse_jacobian(y)[:, 3:].copy()
            a = np.array([(los[4] @ a), (los[3] @ a), -(los[1] @ a)]) / y[5]
            Phi = first_order_transition(y, dt, a, variant == PRINTED)
            noise = first_order_noise(y, dt, Phi, Q[3, 3] / dt if dt > 0.0 else 0.0, variant == PRINTED)
        P = sandwich(Phi, P, noise)
        y = after
        before = own[k]
        now = t[k]
        write_vector(y_predicted[k], y)
        write_matrix(P_predicted[k], P)
        write_matrix(F_out[k], Phi)
        m = observe(world_from_msc(y, before), z[k], context[k], r, H, R)
        nis[k, 0] = 0.0
        nis[k, 1] = m
        if m > 0:
            y, P, nis[k, 0] = msc_condition(y, P, r[:m].copy(), H[:m].copy(), R[:m, :m].copy())
            if np.isnan(nis[k, 0]):
                return k
        write_vector(y_out[k], y)
        write_matrix(P_out[k], P)
    return len(t)
