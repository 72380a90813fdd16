"""Reports of a sensor with constant errors, many at once: what it would have said, and every derivative."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from boresight.kernels.measurement import measure
from boresight.kernels.registration import AZIMUTH, ELEVATION, RANGE, SCALE, sensitivity
from boresight.types.sensor import FloatArray


@njit(cache=True)
def reports_of(
    position: FloatArray,
    velocity: FloatArray,
    sensor_position: FloatArray,
    sensor_velocity: FloatArray,
    enu_from_sensor: FloatArray,
    errors: FloatArray,
    z: FloatArray,
    H: FloatArray,
    S: FloatArray,
) -> None:
    """Fill `z` (n, 7), its Jacobian `H` (n, 7, 6) by position and velocity, and `S` (n, 7, 5) by the sensor's errors.

    `errors` (n, 5) are time, range, scale, azimuth, elevation as `kernels.registration` counts them; the time offset
    is not applied: the caller gives positions, velocities and poses of the true times.
    """
    raw = np.empty(7)
    h = np.empty((7, 6))
    for i in range(len(position)):
        measure(position[i], velocity[i], sensor_position[i], sensor_velocity[i], enu_from_sensor[i], raw, h)
        e = errors[i]
        r = raw[0] * (1.0 + e[SCALE]) + e[RANGE]
        az, el = raw[1] + e[AZIMUTH], raw[2] + e[ELEVATION]
        z[i, 0], z[i, 1], z[i, 2], z[i, 3] = r, az, el, raw[3]
        z[i, 4] = r * math.cos(el) * math.sin(az)
        z[i, 5] = r * math.cos(el) * math.cos(az)
        z[i, 6] = r * math.sin(el)
        sensitivity(z[i], h, velocity[i] - sensor_velocity[i], S[i])
        # polar rows hold as they are; Cartesian ones turn and stretch with the errors
        stretch = r / max(raw[0], 1e-9)
        c, s = math.cos(e[AZIMUTH]), math.sin(e[AZIMUTH])
        for k in range(6):
            H[i, 0, k] = h[0, k] * (1.0 + e[SCALE])
            H[i, 1, k], H[i, 2, k], H[i, 3, k] = h[1, k], h[2, k], h[3, k]
            H[i, 4, k] = stretch * (c * h[4, k] + s * h[5, k])
            H[i, 5, k] = stretch * (c * h[5, k] - s * h[4, k])
            H[i, 6, k] = stretch * h[6, k]
