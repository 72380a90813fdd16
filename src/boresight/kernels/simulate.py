"""Random paths from a motion kernel, and what a sensor would measure of many points."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, types

from boresight.kernels.measurement import measure
from boresight.kernels.options import PART
from boresight.kernels.signatures import MATRIX, MOTION, STACK, VECTOR
from boresight.kernels.write import write_vector
from boresight.types.sensor import FloatArray


@njit(**PART)
def root(Q: FloatArray, L: FloatArray) -> None:
    """Fill the lower triangular `L` with L L' = Q for a positive semidefinite Q; a zero pivot gives a zero column."""
    n = Q.shape[0]
    L[:, :] = 0.0
    for j in range(n):
        s = Q[j, j]
        for k in range(j):
            s -= L[j, k] * L[j, k]
        if s <= 1e-14 * Q[j, j]:
            continue
        L[j, j] = math.sqrt(s)
        for i in range(j + 1, n):
            r = Q[i, j]
            for k in range(j):
                r -= L[i, k] * L[j, k]
            L[i, j] = r / L[j, j]


@njit(types.void(MOTION, VECTOR, VECTOR, VECTOR, MATRIX, MATRIX), cache=True)
def walk(
    motion: Any, parameters: FloatArray, x0: FloatArray, t: FloatArray, normals: FloatArray, out: FloatArray
) -> None:
    """Fill `out` (k, n) with a path drawn from the motion model: state x0 at t[0], white `normals` (k, n)."""
    n = x0.shape[0]
    F, Q, L = np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    x, moved = x0.copy(), np.empty(n)
    write_vector(out[0], x)
    for k in range(1, t.shape[0]):
        motion(x, t[k] - t[k - 1], parameters, moved, F, Q)
        root(Q, L)
        for i in range(n):
            s = moved[i]
            for j in range(i + 1):
                s += L[i, j] * normals[k, j]
            x[i] = s
        write_vector(out[k], x)


@njit(types.void(MATRIX, MATRIX, MATRIX, MATRIX, STACK, MATRIX), cache=True)
def measure_many(
    position: FloatArray,
    velocity: FloatArray,
    sensor_position: FloatArray,
    sensor_velocity: FloatArray,
    enu_from_sensor: FloatArray,
    z: FloatArray,
) -> None:
    """Fill `z` (k, 7) with `measure` of k points, each with its own pose of the sensor."""
    H = np.empty((7, 6))
    for k in range(position.shape[0]):
        measure(position[k], velocity[k], sensor_position[k], sensor_velocity[k], enu_from_sensor[k], z[k], H)
