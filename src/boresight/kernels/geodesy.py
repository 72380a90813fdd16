"""Geodetic (WGS84), Earth-centred and local level coordinates. Results are NaN where an input is out of bounds."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from boresight.types.sensor import FloatArray

A = 6378137.0  # m, semi-major axis of WGS84
F = 1.0 / 298.257223563
B = A * (1.0 - F)
E2 = F * (2.0 - F)
EP2 = E2 / (1.0 - E2)
MIN_RADIUS = 50e3  # m: nearer to the Earth's centre a point has no single foot on the ellipsoid
LATITUDE_SLACK = 1e-12  # rad beyond a pole that rounding may leave

Triple = tuple[float, float, float]
Arrays = tuple[FloatArray, FloatArray, FloatArray]


@njit(cache=True)
def ecef_from_geodetic(latitude: float, longitude: float, height: float) -> Triple:
    """Turn latitude, longitude (rad) and height (m) into ECEF x, y, z (m); NaN for a latitude beyond a pole."""
    if not abs(latitude) <= 0.5 * math.pi + LATITUDE_SLACK:
        return math.nan, math.nan, math.nan
    s = math.sin(latitude)
    c = math.cos(latitude)
    n = A / math.sqrt(1.0 - E2 * s * s)
    p = (n + height) * c
    return p * math.cos(longitude), p * math.sin(longitude), (n * (1.0 - E2) + height) * s


@njit(cache=True)
def geodetic_from_ecef(x: float, y: float, z: float) -> Triple:
    """Turn ECEF x, y, z (m) into latitude, longitude (rad) and height (m); NaN within 50 km of the Earth's centre.

    Bowring's iteration on the reduced latitude, in sines and cosines so that the axis is an ordinary point; three
    rounds leave less than 1e-15 rad from -1000 km to beyond 1e9 m.
    """
    p = math.sqrt(x * x + y * y)
    r = math.sqrt(p * p + z * z)
    if not r >= MIN_RADIUS:
        return math.nan, math.nan, math.nan
    s = z * (1.0 - F) * (1.0 + EP2 * B / r)
    c = p
    for _ in range(3):
        k = 1.0 / math.sqrt(s * s + c * c)
        s *= k
        c *= k
        num = z + EP2 * B * s * s * s
        den = p - E2 * A * c * c * c
        s = (1.0 - F) * num
        c = den
    k = 1.0 / math.sqrt(num * num + den * den)
    sin = num * k
    cos = den * k
    height = p * cos + z * sin - A * math.sqrt(1.0 - E2 * sin * sin)
    return math.atan2(num, den), math.atan2(y, x), height


@njit(cache=True)
def ecef_from_geodetic_many(latitude: FloatArray, longitude: FloatArray, height: FloatArray) -> Arrays:
    """Apply `ecef_from_geodetic` to columns (n,)."""
    x, y, z = np.empty_like(latitude), np.empty_like(latitude), np.empty_like(latitude)
    for i in range(len(x)):
        x[i], y[i], z[i] = ecef_from_geodetic(latitude[i], longitude[i], height[i])
    return x, y, z


@njit(cache=True)
def geodetic_from_ecef_many(x: FloatArray, y: FloatArray, z: FloatArray) -> Arrays:
    """Apply `geodetic_from_ecef` to columns (n,)."""
    latitude, longitude, height = np.empty_like(x), np.empty_like(x), np.empty_like(x)
    for i in range(len(x)):
        latitude[i], longitude[i], height[i] = geodetic_from_ecef(x[i], y[i], z[i])
    return latitude, longitude, height


@njit(cache=True)
def enu_from_ecef(x: float, y: float, z: float, lat0: float, lon0: float, h0: float) -> Triple:
    """Turn ECEF x, y, z (m) into east, north, up (m) at a geodetic origin (rad, rad, m)."""
    x0, y0, z0 = ecef_from_geodetic(lat0, lon0, h0)
    return _turn_to_enu(x - x0, y - y0, z - z0, math.sin(lat0), math.cos(lat0), math.sin(lon0), math.cos(lon0))


@njit(cache=True)
def ecef_from_enu(east: float, north: float, up: float, lat0: float, lon0: float, h0: float) -> Triple:
    """Turn east, north, up (m) at a geodetic origin (rad, rad, m) into ECEF x, y, z (m)."""
    x0, y0, z0 = ecef_from_geodetic(lat0, lon0, h0)
    dx, dy, dz = _turn_to_ecef(east, north, up, math.sin(lat0), math.cos(lat0), math.sin(lon0), math.cos(lon0))
    return x0 + dx, y0 + dy, z0 + dz


@njit(cache=True)
def _turn_to_enu(dx: float, dy: float, dz: float, sp: float, cp: float, sl: float, cl: float) -> Triple:
    outward = cl * dx + sl * dy
    return -sl * dx + cl * dy, cp * dz - sp * outward, cp * outward + sp * dz


@njit(cache=True)
def _turn_to_ecef(east: float, north: float, up: float, sp: float, cp: float, sl: float, cl: float) -> Triple:
    outward = cp * up - sp * north
    return cl * outward - sl * east, sl * outward + cl * east, sp * up + cp * north


@njit(cache=True)
def enu_from_ecef_many(x: FloatArray, y: FloatArray, z: FloatArray, lat0: float, lon0: float, h0: float) -> Arrays:
    """Apply `enu_from_ecef` to columns (n,)."""
    east, north, up = np.empty_like(x), np.empty_like(x), np.empty_like(x)
    x0, y0, z0 = ecef_from_geodetic(lat0, lon0, h0)
    sp, cp, sl, cl = math.sin(lat0), math.cos(lat0), math.sin(lon0), math.cos(lon0)
    for i in range(len(x)):
        east[i], north[i], up[i] = _turn_to_enu(x[i] - x0, y[i] - y0, z[i] - z0, sp, cp, sl, cl)
    return east, north, up


@njit(cache=True)
def ecef_from_enu_many(
    east: FloatArray, north: FloatArray, up: FloatArray, lat0: float, lon0: float, h0: float
) -> Arrays:
    """Apply `ecef_from_enu` to columns (n,)."""
    x, y, z = np.empty_like(east), np.empty_like(east), np.empty_like(east)
    x0, y0, z0 = ecef_from_geodetic(lat0, lon0, h0)
    sp, cp, sl, cl = math.sin(lat0), math.cos(lat0), math.sin(lon0), math.cos(lon0)
    for i in range(len(x)):
        dx, dy, dz = _turn_to_ecef(east[i], north[i], up[i], sp, cp, sl, cl)
        x[i], y[i], z[i] = x0 + dx, y0 + dy, z0 + dz
    return x, y, z


@njit(cache=True)
def enu_from_geodetic(latitude: float, longitude: float, height: float, lat0: float, lon0: float, h0: float) -> Triple:
    """Turn latitude, longitude (rad), height (m) into east, north, up (m) at a geodetic origin."""
    x, y, z = ecef_from_geodetic(latitude, longitude, height)
    return enu_from_ecef(x, y, z, lat0, lon0, h0)


@njit(cache=True)
def geodetic_from_enu(east: float, north: float, up: float, lat0: float, lon0: float, h0: float) -> Triple:
    """Turn east, north, up (m) at a geodetic origin into latitude, longitude (rad), height (m)."""
    x, y, z = ecef_from_enu(east, north, up, lat0, lon0, h0)
    return geodetic_from_ecef(x, y, z)


@njit(cache=True)
def ecef_from_enu_rotation(latitude: float, longitude: float) -> FloatArray:
    """Return the rotation (3, 3) whose columns are east, north, up in ECEF axes."""
    R = np.empty((3, 3))
    fill_ecef_from_enu(math.sin(latitude), math.cos(latitude), math.sin(longitude), math.cos(longitude), R)
    return R


@njit(cache=True)
def fill_ecef_from_enu(sp: float, cp: float, sl: float, cl: float, R: FloatArray) -> None:
    """Fill `R` (3, 3) with east, north, up in ECEF axes, of sine and cosine of latitude and longitude."""
    R[0, 0], R[0, 1], R[0, 2] = -sl, -sp * cl, cp * cl
    R[1, 0], R[1, 1], R[1, 2] = cl, -sp * sl, cp * sl
    R[2, 0], R[2, 1], R[2, 2] = 0.0, cp, sp


@njit(cache=True)
def ecef_from_geodetic_jacobian(latitude: FloatArray, longitude: FloatArray, height: FloatArray) -> FloatArray:
    """Return d(x, y, z)/d(latitude, longitude, height), (n, 3, 3), in m and rad."""
    J = np.empty((len(latitude), 3, 3))
    for i in range(len(latitude)):
        R = ecef_from_enu_rotation(latitude[i], longitude[i])
        meridian, prime = radii_of_curvature(latitude[i])
        for k in range(3):
            J[i, k, 0] = (meridian + height[i]) * R[k, 1]
            J[i, k, 1] = (prime + height[i]) * math.cos(latitude[i]) * R[k, 0]
            J[i, k, 2] = R[k, 2]
    return J


@njit(cache=True)
def geodetic_from_ecef_jacobian(x: FloatArray, y: FloatArray, z: FloatArray) -> FloatArray:
    """Return d(latitude, longitude, height)/d(x, y, z), (n, 3, 3); the longitude's row is zero on the axis."""
    J = np.empty((len(x), 3, 3))
    for i in range(len(x)):
        latitude, longitude, height = geodetic_from_ecef(x[i], y[i], z[i])
        R = ecef_from_enu_rotation(latitude, longitude)
        meridian = radii_of_curvature(latitude)[0]
        p = math.sqrt(x[i] * x[i] + y[i] * y[i])
        i_p = 1.0 / p if p > 0.0 else 0.0
        for k in range(3):
            J[i, 0, k] = R[k, 1] / (meridian + height)
            J[i, 1, k] = R[k, 0] * i_p
            J[i, 2, k] = R[k, 2]
    return J


@njit(cache=True)
def radii_of_curvature(latitude: float) -> tuple[float, float]:
    """Return the meridian's and the prime vertical's radius of curvature (m)."""
    s = math.sin(latitude)
    w2 = 1.0 - E2 * s * s
    prime = A / math.sqrt(w2)
    return prime * (1.0 - E2) / w2, prime
