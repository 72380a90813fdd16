"""East/north/up and north/east/down at a site, from and to the Earth."""

from __future__ import annotations

import numpy as np

from boresight.frames._columns import Input, Values, triple
from boresight.frames.geodetic import (
    ecef_from_geodetic,
    ecef_from_geodetic_jacobian,
    geodetic_from_ecef,
    geodetic_from_ecef_jacobian,
)
from boresight.kernels import geodesy
from boresight.types import Site
from boresight.types.sensor import FloatArray

ENU_FROM_NED: FloatArray = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
ENU_FROM_NED.flags.writeable = False

_FINITE = "finite, and the site's latitude within ±π/2 rad"


def enu_from_ecef(x: Input, y: Input, z: Input, site: Site) -> Values:
    """Return east, north, up (m) at the site of ECEF x, y, z (m); raises UserError for values not finite."""
    origin = (site.latitude, site.longitude, site.height)
    if isinstance(x, float) and isinstance(y, float) and isinstance(z, float):
        east, north, up = geodesy.enu_from_ecef(x, y, z, *origin)
        if east - east == up - up == 0.0:
            return east, north, up
    return triple(geodesy.enu_from_ecef, geodesy.enu_from_ecef_many, (x, y, z), origin, _FINITE)


def ecef_from_enu(east: Input, north: Input, up: Input, site: Site) -> Values:
    """Return ECEF x, y, z (m) of east, north, up (m) at the site; raises UserError for values not finite."""
    origin = (site.latitude, site.longitude, site.height)
    if isinstance(east, float) and isinstance(north, float) and isinstance(up, float):
        x, y, z = geodesy.ecef_from_enu(east, north, up, *origin)
        if x - x == z - z == 0.0:
            return x, y, z
    return triple(geodesy.ecef_from_enu, geodesy.ecef_from_enu_many, (east, north, up), origin, _FINITE)


def enu_from_geodetic(latitude: Input, longitude: Input, height: Input, site: Site) -> Values:
    """Return east, north, up (m) at the site of latitude, longitude (rad), height (m).

    Raises UserError as `ecef_from_geodetic`.
    """
    if isinstance(latitude, float) and isinstance(longitude, float) and isinstance(height, float):
        east, north, up = geodesy.enu_from_geodetic(
            latitude, longitude, height, site.latitude, site.longitude, site.height
        )
        if east - east == up - up == 0.0:
            return east, north, up
    return enu_from_ecef(*ecef_from_geodetic(latitude, longitude, height), site)


def geodetic_from_enu(east: Input, north: Input, up: Input, site: Site) -> Values:
    """Return latitude, longitude (rad), height (m) of east, north, up (m) at the site.

    Raises UserError as `geodetic_from_ecef`.
    """
    if isinstance(east, float) and isinstance(north, float) and isinstance(up, float):
        latitude, longitude, height = geodesy.geodetic_from_enu(
            east, north, up, site.latitude, site.longitude, site.height
        )
        if height - height == 0.0:
            return latitude, longitude, height
    return geodetic_from_ecef(*ecef_from_enu(east, north, up, site))


def enu_from_ned(north: Input, east: Input, down: Input) -> Values:
    """Return east, north, up of north, east, down: (x, y, z) → (y, x, −z)."""
    return east, north, -down if isinstance(down, float) else np.negative(down)


def ned_from_enu(east: Input, north: Input, up: Input) -> Values:
    """Return north, east, down of east, north, up: (x, y, z) → (y, x, −z)."""
    return north, east, -up if isinstance(up, float) else np.negative(up)


def ned_from_geodetic(latitude: Input, longitude: Input, height: Input, site: Site) -> Values:
    """Return north, east, down (m) at the site of latitude, longitude (rad), height (m)."""
    return ned_from_enu(*enu_from_geodetic(latitude, longitude, height, site))


def geodetic_from_ned(north: Input, east: Input, down: Input, site: Site) -> Values:
    """Return latitude, longitude (rad), height (m) of north, east, down (m) at the site."""
    return geodetic_from_enu(*enu_from_ned(north, east, down), site)


def ecef_from_enu_rotation(site: Site) -> FloatArray:
    """Return the rotation (3, 3) whose columns are the site's east, north, up in ECEF axes.

    It is also the Jacobian of `ecef_from_enu`; its transpose is that of `enu_from_ecef`.
    """
    R: FloatArray = geodesy.ecef_from_enu_rotation(site.latitude, site.longitude)
    return R


def enu_from_geodetic_jacobian(latitude: Input, longitude: Input, height: Input, site: Site) -> FloatArray:
    """Return d(east, north, up)/d(latitude, longitude, height), (..., 3, 3), m and rad."""
    J: FloatArray = ecef_from_enu_rotation(site).T @ ecef_from_geodetic_jacobian(latitude, longitude, height)
    return J


def geodetic_from_enu_jacobian(east: Input, north: Input, up: Input, site: Site) -> FloatArray:
    """Return d(latitude, longitude, height)/d(east, north, up), (..., 3, 3), m and rad."""
    ecef = ecef_from_enu(east, north, up, site)
    J: FloatArray = geodetic_from_ecef_jacobian(*ecef) @ ecef_from_enu_rotation(site)
    return J
