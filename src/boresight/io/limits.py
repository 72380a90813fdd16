"""Values that say "not available" and values that cannot be, by the name of their column; for files and live alike."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from boresight.types import FloatArray

INT32, UINT32, INT16, UINT16 = 2147483647.0, 4294967295.0, 32767.0, 65535.0
# What formats write where they know nothing: AIS (ITU-R M.1371), MAVLink's largest integers, as they are and in the
# unit of the field (1e-7 degrees, centidegrees, millimetres, centimetres).
_WHOLE = {INT32: "the largest int32", -INT32 - 1.0: "the smallest int32", UINT32: "the largest uint32"}
_SHORT = {INT16: "the largest int16", -INT16 - 1.0: "the smallest int16", UINT16: "the largest uint16"}
_METRES = {**_WHOLE, **_SHORT, INT32 / 1e3: "the largest int32 of mm", (-INT32 - 1.0) / 1e3: "the smallest int32 of mm"}
_SPEED = {
    **_WHOLE,
    **_SHORT,
    INT16 / 100.0: "the largest int16 of cm/s",
    -(INT16 + 1.0) / 100.0: "the smallest int16 of cm/s",
    UINT16 / 100.0: "the largest uint16 of cm/s",
    INT16 / 10.0: "the largest int16 of dm/s",
}
_ANGLE = {
    **_WHOLE,
    **_SHORT,
    INT16 / 100.0: "the largest int16 of 0.01°",
    UINT16 / 100.0: "the largest uint16 of 0.01°",
}
_PLACE = {INT32 / 1e7: "the largest int32 of 1e-7°", (-INT32 - 1.0) / 1e7: "the smallest int32 of 1e-7°", **_WHOLE}
KNOT = 1852.0 / 3600.0  # m/s
AIS_SPEED = 102.3  # knots
NOT_AVAILABLE: dict[str, dict[float, str]] = {
    "latitude_deg": {91.0: "AIS", **_PLACE},
    "longitude_deg": {181.0: "AIS", **_PLACE},
    "height_m": _METRES,
    "up_m": _METRES,
    "east_m": _WHOLE,
    "north_m": _WHOLE,
    "yaw_deg": {511.0: "AIS", **_ANGLE},
    "heading_deg": {511.0: "AIS", **_ANGLE},
    "course_deg": {360.0: "AIS", **_ANGLE},
    "pitch_deg": _ANGLE,
    "roll_deg": _ANGLE,
    "speed_kn": {AIS_SPEED: "AIS", 1023.0: "AIS", **_SHORT},
    "speed_m_s": {round(AIS_SPEED * KNOT, 4): "AIS", AIS_SPEED: "AIS", **_SPEED},
    **dict.fromkeys(("ve_m_s", "vn_m_s", "vu_m_s", "range_rate_m_s"), _SPEED),
    "azimuth_deg": {511.0: "AIS", **_ANGLE},
    "elevation_deg": _ANGLE,
    **dict.fromkeys(("range_m", "x_m", "y_m", "z_m"), _METRES),
    "sigma_position_m": {**_METRES, UINT16 / 100.0: "the largest uint16 of cm"},
    "sigma_attitude_deg": _ANGLE,
}
# Least and largest value; what turns comes as -180 .. 180 or 0 .. 360.
RANGES: dict[str, tuple[float, float]] = {
    "latitude_deg": (-90.0, 90.0),
    "longitude_deg": (-180.0, 180.0),
    "yaw_deg": (-360.0, 360.0),
    "heading_deg": (-360.0, 360.0),
    "course_deg": (-360.0, 360.0),
    "pitch_deg": (-90.0, 90.0),
    "roll_deg": (-180.0, 180.0),
    "azimuth_deg": (-360.0, 360.0),
    "elevation_deg": (-90.0, 90.0),
    "range_m": (0.0, math.inf),
    "speed_kn": (0.0, math.inf),
    "speed_m_s": (0.0, math.inf),
}


def is_absent(name: str, value: float) -> bool:
    """Return whether the value of a column says "not available" in one of the known formats."""
    return any(math.isclose(value, word, rel_tol=1e-9, abs_tol=0.0) for word in NOT_AVAILABLE.get(name, ()))


def is_outside(name: str, value: float) -> bool:
    """Return whether the value of a column cannot be: not finite, or outside its range."""
    low, high = RANGES.get(name, (-math.inf, math.inf))
    return not (math.isfinite(value) and low <= value <= high)


def problem(name: str, value: float) -> str | None:
    """Return why a value of a column cannot be used, None if it can.

    >>> problem("latitude_deg", 91.0)
    'latitude_deg = 91 says "not available" (AIS)'
    >>> problem("longitude_deg", -180.0001)
    'longitude_deg = -180.0001, outside -180 .. 180'
    >>> problem("yaw_deg", 350.0) is None
    True
    """
    if is_absent(name, value):
        return f'{name} = {value:.10g} says "not available" ({source(name, value)})'
    if is_outside(name, value):
        if not math.isfinite(value):
            return f"{name} = {value} is not finite"
        return f"{name} = {value:.10g}, outside {span(name)}"
    return None


def source(name: str, value: float) -> str:
    """Return whose word for "not available" a value is; an empty string if it is none."""
    return next((by for word, by in NOT_AVAILABLE.get(name, {}).items() if math.isclose(value, word)), "")


def span(name: str) -> str:
    """Return the range of a column in words."""
    low, high = RANGES.get(name, (-math.inf, math.inf))
    return f"{low:g} .. {high:g}"


def absent(name: str, values: FloatArray) -> NDArray[np.bool_]:
    """Return (n,) which values of a column say "not available"."""
    out = np.zeros(values.shape, dtype=bool)
    for word in NOT_AVAILABLE.get(name, ()):
        out |= np.isclose(values, word, rtol=1e-9, atol=0.0)
    return out


def outside(name: str, values: FloatArray) -> NDArray[np.bool_]:
    """Return (n,) which values of a column are outside its range; NaN is not."""
    low, high = RANGES.get(name, (-math.inf, math.inf))
    out: NDArray[np.bool_] = (values < low) | (values > high)
    return out
