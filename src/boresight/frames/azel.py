"""Azimuth (from north, clockwise), elevation (up positive) and range against Cartesian east/north/up."""

from __future__ import annotations

from boresight.frames._columns import Input, Values, columns, triple
from boresight.frames.local import enu_from_geodetic, geodetic_from_enu
from boresight.kernels import direction
from boresight.types import Site
from boresight.types.sensor import FloatArray

_FINITE = "finite"


def azel_from_enu(east: Input, north: Input, up: Input) -> Values:
    """Return azimuth in (-π, π], elevation (rad) and range (m) of east, north, up (m).

    Straight up and down the azimuth is 0, and at the origin all three are 0. Raises UserError for values that are
    not finite.
    """
    if isinstance(east, float) and isinstance(north, float) and isinstance(up, float):
        azimuth, elevation, range_m = direction.azel_from_enu(east, north, up)
        if range_m - range_m == 0.0:
            return azimuth, elevation, range_m
    return triple(direction.azel_from_enu, direction.azel_from_enu_many, (east, north, up), (), _FINITE)


def enu_from_azel(azimuth: Input, elevation: Input, range_m: Input = 1.0) -> Values:
    """Return east, north, up (m) of azimuth, elevation (rad) and range (m; a unit vector if left out)."""
    if isinstance(azimuth, float) and isinstance(elevation, float) and isinstance(range_m, float):
        east, north, up = direction.enu_from_azel(azimuth, elevation, range_m)
        if east - east == up - up == 0.0:
            return east, north, up
    return triple(direction.enu_from_azel, direction.enu_from_azel_many, (azimuth, elevation, range_m), (), _FINITE)


def azel_from_enu_jacobian(east: Input, north: Input, up: Input) -> FloatArray:
    """Return d(azimuth, elevation, range)/d(east, north, up), (..., 3, 3), rad and m.

    Straight up and down azimuth has no derivative: its row is zero there. Use `frames.tangent` near the zenith.
    """
    azel_from_enu(east, north, up)
    cols, shape = columns(east, north, up)
    J: FloatArray = direction.azel_from_enu_jacobian(*cols).reshape(*shape, 3, 3)
    return J


def enu_from_azel_jacobian(azimuth: Input, elevation: Input, range_m: Input = 1.0) -> FloatArray:
    """Return d(east, north, up)/d(azimuth, elevation, range), (..., 3, 3), rad and m."""
    enu_from_azel(azimuth, elevation, range_m)
    cols, shape = columns(azimuth, elevation, range_m)
    J: FloatArray = direction.enu_from_azel_jacobian(*cols).reshape(*shape, 3, 3)
    return J


def azel_from_geodetic(latitude: Input, longitude: Input, height: Input, site: Site) -> Values:
    """Return azimuth, elevation (rad) and range (m), seen from the site, of latitude, longitude (rad), height (m)."""
    return azel_from_enu(*enu_from_geodetic(latitude, longitude, height, site))


def geodetic_from_azel(azimuth: Input, elevation: Input, range_m: Input, site: Site) -> Values:
    """Return latitude, longitude (rad), height (m) of azimuth, elevation (rad) and range (m) seen from the site."""
    return geodetic_from_enu(*enu_from_azel(azimuth, elevation, range_m), site)
