"""What a sensor sees of one position and velocity, in scalars and without branches: values and slopes.

The twin of `kernels.measurement.measure` for the kernels that are vectorised over tracks. Directions that are not
defined (zero range; azimuth straight above the sensor) have a NaN value and a finite slope: `blocks.condition` then
leaves them out, as `kernels.observation` does.
"""

from __future__ import annotations

import math

from numba import njit

from boresight.kernels.arctan import INLINE, arctan2
from boresight.kernels.blocks import Nine, Three, dot

Polar = tuple[float, float, float, Three, Three, Three]


@njit(**INLINE)
def polar(d: Three) -> Polar:
    """Return range, azimuth, elevation of `d` (m, sensor axes) and their slopes by `d`."""
    flat2 = d[0] * d[0] + d[1] * d[1]
    r2 = flat2 + d[2] * d[2]
    flat, r = math.sqrt(flat2), math.sqrt(r2)
    aloft = flat <= 1e-12 * r
    other = r if aloft else flat
    w = 1.0 / (r * other if r > 0.0 else 1.0)  # one division for both reciprocals
    i_flat, i_r = (0.0 if aloft else w * r), w * other
    e, n, s, c = d[0] * i_flat, d[1] * i_flat, d[2] * i_r, flat * i_r
    azimuth, elevation = arctan2(d[0], d[1]), arctan2(d[2], flat)
    return (
        r if r > 0.0 else math.nan,
        math.nan if aloft else azimuth,
        elevation if r > 0.0 else math.nan,
        (d[0] * i_r, d[1] * i_r, s),
        (n * i_flat, -e * i_flat, 0.0),
        (-e * s * i_r, -n * s * i_r, c * i_r),
    )


@njit(**INLINE)
def into(R: Nine, d: Three) -> Three:
    """Return Rᵀ d: world to sensor axes, R = enu_from_sensor by rows."""
    return (
        R[0] * d[0] + R[3] * d[1] + R[6] * d[2],
        R[1] * d[0] + R[4] * d[1] + R[7] * d[2],
        R[2] * d[0] + R[5] * d[1] + R[8] * d[2],
    )


@njit(**INLINE)
def out_of(R: Nine, d: Three) -> Three:
    """Return R d: sensor axes to world."""
    return (dot((R[0], R[1], R[2]), d), dot((R[3], R[4], R[5]), d), dot((R[6], R[7], R[8]), d))


@njit(**INLINE)
def turned_polar(R: Nine, d: Three) -> Polar:
    """As `polar` for `d` in world axes and a sensor turned by R: slopes by world position."""
    r, azimuth, elevation, h_r, h_a, h_e = polar(into(R, d))
    return r, azimuth, elevation, out_of(R, h_r), out_of(R, h_a), out_of(R, h_e)


@njit(**INLINE)
def range_rate(d: Three, u: Three) -> tuple[float, Three, Three]:
    """Return range rate d·u/|d| of relative position and velocity, and its slopes by position and velocity."""
    r = math.sqrt(dot(d, d))
    w = 1.0 / r if r > 0.0 else 0.0
    n = (d[0] * w, d[1] * w, d[2] * w)
    rate = dot(n, u)
    slope = ((u[0] - rate * n[0]) * w, (u[1] - rate * n[1]) * w, (u[2] - rate * n[2]) * w)
    return rate if r > 0.0 else math.nan, slope, n
