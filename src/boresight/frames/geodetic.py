"""Geodetic latitude, longitude, height (WGS84) and Earth-centred, Earth-fixed x, y, z."""

from __future__ import annotations

from typing import Any

from boresight.frames._columns import Input, Values, columns, triple
from boresight.kernels import geodesy
from boresight.types.sensor import FloatArray

_GEODETIC = "latitude within ±π/2 rad, longitude and height finite"
_ECEF = "finite and at least 50 km from the Earth's centre"


def ecef_from_geodetic(latitude: Input, longitude: Input, height: Input) -> Values:
    """Return ECEF x, y, z (m) of geodetic latitude, longitude (rad) and ellipsoidal height (m).

    Scalars give floats, arrays of one shape (or that broadcast) give arrays. Raises UserError for a latitude
    beyond a pole and for values that are not finite. WGS84: a = 6378137 m, 1/f = 298.257223563.
    """
    if isinstance(latitude, float) and isinstance(longitude, float) and isinstance(height, float):
        x, y, z = geodesy.ecef_from_geodetic(latitude, longitude, height)
        if x - x == 0.0 == z - z:
            return x, y, z
    return triple(
        geodesy.ecef_from_geodetic,
        geodesy.ecef_from_geodetic_many,
        (latitude, longitude, height),
        (),
        _GEODETIC,
    )


def geodetic_from_ecef(x: Input, y: Input, z: Input) -> Values:
    """Return latitude, longitude (rad) and height (m) of ECEF x, y, z (m), by Bowring's iteration.

    On the Earth's axis the longitude is 0. Raises UserError within 50 km of the Earth's centre, where the foot on
    the ellipsoid is not unique, and for values that are not finite.
    """
    if isinstance(x, float) and isinstance(y, float) and isinstance(z, float):
        latitude, longitude, height = geodesy.geodetic_from_ecef(x, y, z)
        if height - height == 0.0:
            return latitude, longitude, height
    return triple(geodesy.geodetic_from_ecef, geodesy.geodetic_from_ecef_many, (x, y, z), (), _ECEF)


def ecef_from_geodetic_jacobian(latitude: Input, longitude: Input, height: Input) -> FloatArray:
    """Return d(x, y, z)/d(latitude, longitude, height), (..., 3, 3), m and rad."""
    ecef_from_geodetic(latitude, longitude, height)  # refuses what is out of bounds
    cols, shape = columns(latitude, longitude, height)
    return _shaped(geodesy.ecef_from_geodetic_jacobian(*cols), shape)


def geodetic_from_ecef_jacobian(x: Input, y: Input, z: Input) -> FloatArray:
    """Return d(latitude, longitude, height)/d(x, y, z), (..., 3, 3), m and rad.

    On the axis longitude has no derivative: its row is zero there. Raises as `geodetic_from_ecef`.
    """
    geodetic_from_ecef(x, y, z)
    cols, shape = columns(x, y, z)
    return _shaped(geodesy.geodetic_from_ecef_jacobian(*cols), shape)


def _shaped(J: Any, shape: tuple[int, ...]) -> FloatArray:
    out: FloatArray = J.reshape(*shape, 3, 3)
    return out
