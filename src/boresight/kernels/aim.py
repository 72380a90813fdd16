"""Where a target is from an antenna: its angles, their rates and their covariance, in one call."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from boresight.kernels.direction import azel_from_enu
from boresight.types.sensor import FloatArray

N_AIM = 15


@njit(cache=True)
def aim(
    p: FloatArray, v: FloatArray, C: FloatArray, enu_from_face: FloatArray, pole_from_face: FloatArray
) -> FloatArray:
    """Return the aim (15,) at a target `p` (3,) (m) off with velocity `v` (3,) and covariance `C` (3, 3), all ENU.

    Unit vector (3), azimuth, elevation, their rates, azimuth and elevation in the face's system, its direction cosines
    to the right and up, and the covariance (rad²) right-right, right-up, up-right, up-up across the line of sight.
    NaN where `p` has no direction; at the zenith the rate of azimuth is zero and right is east.
    """
    out = np.full(N_AIM, math.nan)
    rho2 = p[0] * p[0] + p[1] * p[1]
    r2 = rho2 + p[2] * p[2]
    if not (r2 > 0.0 and r2 < math.inf):
        return out
    rho, r = math.sqrt(rho2), math.sqrt(r2)
    out[0], out[1], out[2] = p[0] / r, p[1] / r, p[2] / r
    azimuth, elevation, _ = azel_from_enu(p[0], p[1], p[2])
    out[3], out[4] = azimuth, elevation
    east, south, climb = (p[1] / rho, -p[0] / rho, p[2] / r) if rho > 0.0 else (1.0, 0.0, p[2] / r)
    right = np.array([east, south, 0.0])
    up = np.array([south * climb, -east * climb, rho / r])
    out[5] = (right[0] * v[0] + right[1] * v[1]) / rho if rho > 0.0 else 0.0
    out[6] = (up[0] * v[0] + up[1] * v[1] + up[2] * v[2]) / r if rho > 0.0 else 0.0
    face = np.zeros(3)
    for i in range(3):
        for j in range(3):
            face[i] += enu_from_face[j, i] * out[j]
    turned = np.zeros(3)
    for i in range(3):
        for j in range(3):
            turned[i] += pole_from_face[i, j] * face[j]
    out[7], out[8], _ = azel_from_enu(turned[0], turned[1], turned[2])
    out[9], out[10] = face[0], face[2]
    out[11:] = 0.0
    for i in range(3):
        for j in range(3):
            c = C[i, j] / r2
            out[11] += right[i] * c * right[j]
            out[12] += right[i] * c * up[j]
            out[14] += up[i] * c * up[j]
    out[13] = out[12]
    return out
