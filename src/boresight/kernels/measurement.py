"""The one measurement function: every component of every sensor, with its Jacobian."""

from __future__ import annotations

import math

from numba import njit

from boresight.kernels.options import KERNEL, LEAF, SMALL
from boresight.types.sensor import FloatArray


@njit(**LEAF)
def measure_axes(
    position: FloatArray, sensor_position: FloatArray, enu_from_sensor: FloatArray, z: FloatArray, H: FloatArray
) -> None:
    """Fill only the position in the sensor's axes, z[4:7], and its Jacobian H[4:7], as `measure` does."""
    R = enu_from_sensor
    p0 = position[0] - sensor_position[0]
    p1 = position[1] - sensor_position[1]
    p2 = position[2] - sensor_position[2]
    for i in range(3):
        z[4 + i] = R[0, i] * p0 + R[1, i] * p1 + R[2, i] * p2
        for j in range(3):
            H[4 + i, j] = R[j, i]
            H[4 + i, 3 + j] = 0.0


@njit(**KERNEL)
def measure(
    position: FloatArray,
    velocity: FloatArray,
    sensor_position: FloatArray,
    sensor_velocity: FloatArray,
    enu_from_sensor: FloatArray,
    z: FloatArray,
    H: FloatArray,
) -> float:
    """Fill `z` (7,) with the components that a sensor would measure and `H` (7, 6) with their Jacobian.

    With d = R'(p - s) and d' = R'(v - u), in the sensor's east/north/up-like axes (R = `enu_from_sensor`):
    range |d|, azimuth atan2(d0, d1), elevation atan2(d2, hypot(d0, d1)), range rate d·d'/|d|, then d itself.
    `H` is with respect to (position, velocity) in world ENU. Positions in m, velocities in m/s, angles in rad.
    The sensor's own turning is left out of d': range rate does not depend on it.

    Returns the horizontal range hypot(d0, d1) in sensor axes: the caller decides what to do at zero, where azimuth
    and its Jacobian are not defined (they are set to zero there, as everything is at zero range).
    """
    R = enu_from_sensor
    measure_axes(position, sensor_position, R, z, H)
    d0, d1, d2 = z[4], z[5], z[6]
    p0 = position[0] - sensor_position[0]
    p1 = position[1] - sensor_position[1]
    p2 = position[2] - sensor_position[2]
    v0 = velocity[0] - sensor_velocity[0]
    v1 = velocity[1] - sensor_velocity[1]
    v2 = velocity[2] - sensor_velocity[2]
    rho2 = d0 * d0 + d1 * d1
    rho = math.sqrt(rho2)
    r2 = rho2 + d2 * d2
    r = math.sqrt(r2)
    z[0] = r
    z[1] = math.atan2(d0, d1)
    z[2] = math.atan2(d2, rho)
    i_r = 1.0 / r if r > 0.0 else 0.0
    i_rho2 = 1.0 / rho2 if rho2 > 0.0 else 0.0
    rate = (p0 * v0 + p1 * v1 + p2 * v2) * i_r
    z[3] = rate
    # derivatives with respect to d, then turned to world axes by R
    a0 = d1 * i_rho2
    a1 = -d0 * i_rho2
    i_r2 = i_r * i_r
    i_rho = math.sqrt(i_rho2)
    e0 = -d0 * d2 * i_rho * i_r2
    e1 = -d1 * d2 * i_rho * i_r2
    e2 = rho * i_r2
    for j in range(3):
        H[1, j] = R[j, 0] * a0 + R[j, 1] * a1
        H[2, j] = R[j, 0] * e0 + R[j, 1] * e1 + R[j, 2] * e2
        for i in range(3):
            H[i, 3 + j] = 0.0
    H[0, 0] = p0 * i_r
    H[0, 1] = p1 * i_r
    H[0, 2] = p2 * i_r
    H[3, 0] = (v0 - rate * p0 * i_r) * i_r
    H[3, 1] = (v1 - rate * p1 * i_r) * i_r
    H[3, 2] = (v2 - rate * p2 * i_r) * i_r
    H[3, 3] = p0 * i_r
    H[3, 4] = p1 * i_r
    H[3, 5] = p2 * i_r
    return rho


@njit(**SMALL)
def wrap(angle: float) -> float:
    """Wrap an angle to [-π, π) (rad)."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))
