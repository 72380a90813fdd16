"""Azimuth, elevation and range against east/north/up-like Cartesian components."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from boresight.kernels.geodesy import Arrays, Triple
from boresight.kernels.trig import LARGEST, sincos, sincos_of_small
from boresight.types.sensor import FloatArray


@njit(cache=True)
def azel_from_enu(east: float, north: float, up: float) -> Triple:
    """Return azimuth in (-π, π], elevation (rad) and range (m); all zero at the origin."""
    rho2 = east * east + north * north
    azimuth = math.atan2(east, north)
    if azimuth == -math.pi:
        azimuth = math.pi
    return azimuth, math.atan2(up, math.sqrt(rho2)), math.sqrt(rho2 + up * up)


@njit(cache=True)
def enu_from_azel(azimuth: float, elevation: float, range_m: float) -> Triple:
    """Return east, north, up (m) of azimuth, elevation (rad) and range (m)."""
    sa, ca = sincos(azimuth)
    se, ce = sincos(elevation)
    rho = range_m * ce
    return rho * sa, rho * ca, range_m * se


@njit(cache=True)
def azel_from_enu_many(east: FloatArray, north: FloatArray, up: FloatArray) -> Arrays:
    """Apply `azel_from_enu` to columns (n,)."""
    azimuth, elevation, range_m = np.empty_like(east), np.empty_like(east), np.empty_like(east)
    for i in range(len(east)):
        azimuth[i], elevation[i], range_m[i] = azel_from_enu(east[i], north[i], up[i])
    return azimuth, elevation, range_m


@njit(cache=True)
def enu_from_azel_many(azimuth: FloatArray, elevation: FloatArray, range_m: FloatArray) -> Arrays:
    """Apply `enu_from_azel` to columns (n,)."""
    east, north, up = np.empty_like(azimuth), np.empty_like(azimuth), np.empty_like(azimuth)
    small = True
    for i in range(len(azimuth)):
        small &= abs(azimuth[i]) < LARGEST and abs(elevation[i]) < LARGEST
    if not small:
        for i in range(len(azimuth)):
            east[i], north[i], up[i] = enu_from_azel(azimuth[i], elevation[i], range_m[i])
        return east, north, up
    for i in range(len(azimuth)):  # the same without a branch, for vector instructions
        sa, ca = sincos_of_small(azimuth[i])
        se, ce = sincos_of_small(elevation[i])
        rho = range_m[i] * ce
        east[i] = rho * sa
        north[i] = rho * ca
        up[i] = range_m[i] * se
    return east, north, up


@njit(cache=True)
def azel_from_enu_jacobian(east: FloatArray, north: FloatArray, up: FloatArray) -> FloatArray:
    """Return d(azimuth, elevation, range)/d(east, north, up), (n, 3, 3); azimuth's row is zero at the zenith."""
    J = np.zeros((len(east), 3, 3))
    for i in range(len(east)):
        e, n, u = east[i], north[i], up[i]
        rho2 = e * e + n * n
        r2 = rho2 + u * u
        if r2 == 0.0:
            continue
        rho = math.sqrt(rho2)
        r = math.sqrt(r2)
        J[i, 1, 2] = rho / r2
        J[i, 2, 0], J[i, 2, 1], J[i, 2, 2] = e / r, n / r, u / r
        if rho2 > 0.0:
            J[i, 0, 0], J[i, 0, 1] = n / rho2, -e / rho2
            J[i, 1, 0], J[i, 1, 1] = -e * u / (rho * r2), -n * u / (rho * r2)
    return J


@njit(cache=True)
def enu_from_azel_jacobian(azimuth: FloatArray, elevation: FloatArray, range_m: FloatArray) -> FloatArray:
    """Return d(east, north, up)/d(azimuth, elevation, range), (n, 3, 3)."""
    J = np.empty((len(azimuth), 3, 3))
    for i in range(len(azimuth)):
        sa, ca = math.sin(azimuth[i]), math.cos(azimuth[i])
        se, ce = math.sin(elevation[i]), math.cos(elevation[i])
        r = range_m[i]
        J[i, 0, 0], J[i, 0, 1], J[i, 0, 2] = r * ce * ca, -r * se * sa, ce * sa
        J[i, 1, 0], J[i, 1, 1], J[i, 1, 2] = -r * ce * sa, -r * se * ca, ce * ca
        J[i, 2, 0], J[i, 2, 1], J[i, 2, 2] = 0.0, r * ce, se
    return J
