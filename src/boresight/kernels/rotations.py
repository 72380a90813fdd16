"""The rotations of `kernels.rotation`, over many rows in one call."""

from __future__ import annotations

import numpy as np
from numba import njit

from boresight.kernels import rotation as one
from boresight.kernels.geodesy import Arrays
from boresight.kernels.write import write_matrix, write_vector
from boresight.types.sensor import FloatArray

_matrix_from_ypr = one.matrix_from_ypr
_ypr_from_matrix = one.ypr_from_matrix
_quaternion_from_ypr = one.quaternion_from_ypr
_fill_matrix = one.fill_matrix
_quaternion_from_matrix = one.quaternion_from_matrix
_multiply = one.multiply
_slerp = one.slerp
_step_between = one.step_between


@njit(cache=True)
def matrix_from_ypr(yaw: FloatArray, pitch: FloatArray, roll: FloatArray) -> FloatArray:
    """Return rotations (n, 3, 3) of columns (n,)."""
    out = np.empty((len(yaw), 3, 3))
    for i in range(len(yaw)):
        write_matrix(out[i], _matrix_from_ypr(yaw[i], pitch[i], roll[i]))
    return out


@njit(cache=True)
def ypr_from_matrix(R: FloatArray) -> Arrays:
    """Return yaw, pitch, roll (n,) of rotations (n, 3, 3)."""
    n = len(R)
    yaw, pitch, roll = np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        yaw[i], pitch[i], roll[i] = _ypr_from_matrix(R[i])
    return yaw, pitch, roll


@njit(cache=True)
def quaternion_from_ypr(yaw: FloatArray, pitch: FloatArray, roll: FloatArray) -> FloatArray:
    """Return unit quaternions (n, 4) of columns (n,)."""
    out = np.empty((len(yaw), 4))
    for i in range(len(yaw)):
        write_vector(out[i], _quaternion_from_ypr(yaw[i], pitch[i], roll[i]))
    return out


@njit(cache=True)
def matrix_from_quaternion(q: FloatArray) -> FloatArray:
    """Return rotations (n, 3, 3) of quaternions (n, 4)."""
    out = np.empty((len(q), 3, 3))
    for i in range(len(q)):
        _fill_matrix(q[i, 0], q[i, 1], q[i, 2], q[i, 3], out[i])
    return out


@njit(cache=True)
def quaternion_from_matrix(R: FloatArray) -> FloatArray:
    """Return unit quaternions (n, 4) of rotations (n, 3, 3)."""
    out = np.empty((len(R), 4))
    for i in range(len(R)):
        write_vector(out[i], _quaternion_from_matrix(R[i]))
    return out


@njit(cache=True)
def multiply(p: FloatArray, q: FloatArray) -> FloatArray:
    """Return the products p q (n, 4)."""
    out = np.empty((len(p), 4))
    for i in range(len(p)):
        write_vector(out[i], _multiply(p[i], q[i]))
    return out


@njit(cache=True)
def slerp(p: FloatArray, q: FloatArray, fraction: FloatArray) -> FloatArray:
    """Return the attitudes (n, 4) at `fraction` (n,) of the way from `p` to `q` (n, 4)."""
    out = np.empty((len(p), 4))
    for i in range(len(p)):
        write_vector(out[i], _slerp(p[i], q[i], fraction[i]))
    return out


@njit(cache=True)
def steps_between(q: FloatArray) -> FloatArray:
    """Return the rotation vectors (n - 1, 3) from each attitude (n, 4) to the next, in the axes of the first."""
    n = max(len(q) - 1, 0)
    out = np.empty((n, 3))
    for i in range(n):
        write_vector(out[i], _step_between(q[i], q[i + 1]))
    return out


@njit(cache=True)
def distance_from_rotation(R: FloatArray) -> FloatArray:
    """Return max |R R' - I| of each (n, 3, 3); infinite if it mirrors or is not finite."""
    out = np.zeros(len(R))
    for k in range(len(R)):
        a = R[k]
        for i in range(3):
            for j in range(3):
                dot = a[i, 0] * a[j, 0] + a[i, 1] * a[j, 1] + a[i, 2] * a[j, 2]
                off = abs(dot - (1.0 if i == j else 0.0))
                if off > out[k]:
                    out[k] = off
        x = a[1, 1] * a[2, 2] - a[1, 2] * a[2, 1]
        y = a[1, 2] * a[2, 0] - a[1, 0] * a[2, 2]
        z = a[1, 0] * a[2, 1] - a[1, 1] * a[2, 0]
        if not a[0, 0] * x + a[0, 1] * y + a[0, 2] * z > 0.0:
            out[k] = np.inf
    return out
