"""Observation kernels: innovation, Jacobian and noise of one report, for the components that it holds.

Every observation kernel, a user's own too, is `kernel(x, z, context, y, H, R) -> m`: `x` (n,), `z` (7,) with NaN where
not measured and `context` (k,) in; the first m rows of `y` (7,), `H` (7, n) and `R` (7, 7) filled.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from boresight.kernels.measurement import measure, wrap
from boresight.types.sensor import FloatArray

IntArray = NDArray[np.int64]

# Layout of the context of `observe`
DIMENSIONS = 0
TANGENT = 1
POSITION = 2  # 3
VELOCITY = 5  # 3
ROTATION = 8  # 9, enu_from_sensor by rows
NOISE = 17  # 49, covariance of the 7 components by rows
CONTEXT_SIZE = 66


@njit(cache=True)
def fill(x: FloatArray, z: FloatArray, context: FloatArray, y: FloatArray, H: FloatArray, rows: IntArray) -> int:
    """Linearise any sensor of this package: y = z - h(x) with angles wrapped and H = ∂h/∂x, for the rows not NaN in z.

    The first m entries of `rows` name the components that were filled; returns m.

    Directions are not defined at zero range, nor azimuth straight above the sensor: those rows are left out there.
    In the tangent form (`context[TANGENT]` 1) azimuth and elevation are compared as directions: y holds the measured
    unit vector's components along the predicted line of sight's azimuth and elevation unit vectors, and the azimuth
    variance is that of the cross-elevation angle, so nothing grows near the zenith.
    """
    d = int(context[DIMENSIONS])
    p = np.zeros(3)
    v = np.zeros(3)
    for a in range(d):
        p[a] = x[a]
        v[a] = x[d + a]
    h = np.empty(7)
    J = np.empty((7, 6))
    rotation = context[ROTATION : ROTATION + 9].reshape((3, 3))
    rho = measure(p, v, context[POSITION : POSITION + 3], context[VELOCITY : VELOCITY + 3], rotation, h, J)
    tangent = context[TANGENT] != 0.0 and not math.isnan(z[1]) and not math.isnan(z[2])
    m = 0
    for c in range(7):
        if math.isnan(z[c]) or (c < 4 and h[0] == 0.0) or (c == 1 and rho <= 1e-12 * h[0]):
            continue
        rows[m] = c
        y[m] = wrap(z[c] - h[c]) if c == 1 or c == 2 else z[c] - h[c]
        scale = 1.0
        if tangent and c == 1:
            scale = math.cos(h[2])
            y[m] = math.cos(z[2]) * math.sin(z[1] - h[1])
        elif tangent and c == 2:
            y[m] = math.sin(z[2]) * math.cos(h[2]) - math.cos(z[2]) * math.sin(h[2]) * math.cos(z[1] - h[1])
        for j in range(x.shape[0]):
            H[m, j] = 0.0
        for a in range(d):
            H[m, a] = scale * J[c, a]
            H[m, d + a] = scale * J[c, 3 + a]
        m += 1
    return m


@njit(cache=True)
def observe(x: FloatArray, z: FloatArray, context: FloatArray, y: FloatArray, H: FloatArray, R: FloatArray) -> int:
    """`fill`, and the noise of the rows that were filled: the observation kernel of every built-in sensor."""
    rows = np.empty(7, np.int64)
    m = fill(x, z, context, y, H, rows)
    for i in range(m):
        for j in range(m):
            R[i, j] = context[NOISE + 7 * rows[i] + rows[j]]
    return m
