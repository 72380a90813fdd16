"""Rotations as matrices, unit quaternions (w, x, y, z) and yaw-pitch-roll angles."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from boresight.types.sensor import FloatArray

GIMBAL_LOCK = 1e-9  # cosine of pitch below which yaw and roll are one angle
UNIT_TOLERANCE = 1e-6  # how far from one the norm of a quaternion may be: such a one is normalised


@njit(cache=True)
def matrix_from_ypr(yaw: float, pitch: float, roll: float) -> FloatArray:
    """Return Rz(yaw) Ry(pitch) Rx(roll), (3, 3): NED from FRD body (wang2009 (1), transposed chain)."""
    R = np.empty((3, 3))
    sy, cy = math.sin(yaw), math.cos(yaw)
    sp, cp = math.sin(pitch), math.cos(pitch)
    sr, cr = math.sin(roll), math.cos(roll)
    R[0, 0], R[0, 1], R[0, 2] = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr
    R[1, 0], R[1, 1], R[1, 2] = sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr
    R[2, 0], R[2, 1], R[2, 2] = -sp, cp * sr, cp * cr
    return R


@njit(cache=True)
def ypr_from_matrix(R: FloatArray) -> tuple[float, float, float]:
    """Return yaw, pitch, roll of a rotation (3, 3); at gimbal lock roll is zero and yaw carries the rest."""
    cp = math.sqrt(R[0, 0] * R[0, 0] + R[1, 0] * R[1, 0])
    pitch = math.atan2(-R[2, 0], cp)
    if cp < GIMBAL_LOCK:
        return math.atan2(-R[0, 1], R[1, 1]), pitch, 0.0
    return math.atan2(R[1, 0], R[0, 0]), pitch, math.atan2(R[2, 1], R[2, 2])


@njit(cache=True)
def quaternion_from_ypr(yaw: float, pitch: float, roll: float) -> FloatArray:
    """Return the unit quaternion (4,) of yaw, pitch, roll, with w >= 0."""
    sy, cy = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
    sp, cp = math.sin(0.5 * pitch), math.cos(0.5 * pitch)
    sr, cr = math.sin(0.5 * roll), math.cos(0.5 * roll)
    q = np.empty(4)
    q[0] = cy * cp * cr + sy * sp * sr
    q[1] = cy * cp * sr - sy * sp * cr
    q[2] = cy * sp * cr + sy * cp * sr
    q[3] = sy * cp * cr - cy * sp * sr
    if q[0] < 0.0:
        for k in range(4):
            q[k] = -q[k]
    return q


@njit(cache=True)
def matrix_from_quaternion(q: FloatArray) -> FloatArray:
    """Return the rotation (3, 3) of a quaternion (4,); NaN where its norm is not one within 1e-6."""
    R = np.empty((3, 3))
    fill_matrix(q[0], q[1], q[2], q[3], R)
    return R


@njit(cache=True)
def fill_matrix(w: float, x: float, y: float, z: float, R: FloatArray) -> None:
    """Fill `R` (3, 3) with the rotation of the quaternion (w, x, y, z); NaN where its norm is not one."""
    norm2 = w * w + x * x + y * y + z * z
    k = 2.0 / norm2 if abs(math.sqrt(norm2) - 1.0) <= UNIT_TOLERANCE else math.nan
    R[0, 0], R[0, 1], R[0, 2] = 1.0 - k * (y * y + z * z), k * (x * y - w * z), k * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = k * (x * y + w * z), 1.0 - k * (x * x + z * z), k * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = k * (x * z - w * y), k * (y * z + w * x), 1.0 - k * (x * x + y * y)


@njit(cache=True)
def quaternion_from_matrix(R: FloatArray) -> FloatArray:
    """Return the unit quaternion (4,) of a rotation (3, 3), with w >= 0 (Shepperd: from the largest component)."""
    q = np.empty(4)
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    if trace > 0.0:
        s = math.sqrt(1.0 + trace)
        q[0] = 0.5 * s
        k = 0.5 / s
        q[1], q[2], q[3] = k * (R[2, 1] - R[1, 2]), k * (R[0, 2] - R[2, 0]), k * (R[1, 0] - R[0, 1])
        return q
    i = 0
    if R[1, 1] > R[0, 0]:
        i = 1
    if R[2, 2] > R[i, i]:
        i = 2
    j, m = (i + 1) % 3, (i + 2) % 3
    s = math.sqrt(1.0 + R[i, i] - R[j, j] - R[m, m])
    k = 0.5 / s
    q[0] = k * (R[m, j] - R[j, m])
    q[1 + i] = 0.5 * s
    q[1 + j] = k * (R[j, i] + R[i, j])
    q[1 + m] = k * (R[m, i] + R[i, m])
    if q[0] < 0.0:
        for k in range(4):
            q[k] = -q[k]
    return q


@njit(cache=True)
def multiply(p: FloatArray, q: FloatArray) -> FloatArray:
    """Return the quaternion product p q (4,): the rotation q first, then p."""
    o = np.empty(4)
    o[0] = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3]
    o[1] = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2]
    o[2] = p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1]
    o[3] = p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0]
    return o


@njit(cache=True)
def quaternion_from_rotation_vector(v: FloatArray) -> FloatArray:
    """Return the unit quaternion (4,) of a rotation vector (3,) (rad, axis times angle)."""
    q = np.empty(4)
    angle2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    angle = math.sqrt(angle2)
    k = math.sin(0.5 * angle) / angle if angle > 1e-4 else 0.5 - angle2 / 48.0
    q[0] = math.cos(0.5 * angle)
    q[1], q[2], q[3] = k * v[0], k * v[1], k * v[2]
    return q


@njit(cache=True)
def rotation_vector_from_quaternion(q: FloatArray) -> FloatArray:
    """Return the rotation vector (3,) of a unit quaternion, by the shorter way round (angle <= π)."""
    v = np.empty(3)
    sign = -1.0 if q[0] < 0.0 else 1.0
    s = math.sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    k = sign * (2.0 * math.atan2(s, abs(q[0])) / s if s > 1e-12 else 2.0)
    v[0], v[1], v[2] = k * q[1], k * q[2], k * q[3]
    return v


@njit(cache=True)
def step_between(p: FloatArray, q: FloatArray) -> FloatArray:
    """Return the rotation vector (3,), in the axes of `p`, that takes the attitude `p` to `q` the shorter way."""
    inverse = p.copy()
    for k in range(1, 4):
        inverse[k] = -inverse[k]
    return rotation_vector_from_quaternion(multiply(inverse, q))


@njit(cache=True)
def slerp(p: FloatArray, q: FloatArray, fraction: float) -> FloatArray:
    """Return the attitude (4,) at `fraction` of the shorter way from `p` to `q`, turning at a constant rate."""
    return multiply(p, quaternion_from_rotation_vector(fraction * step_between(p, q)))
