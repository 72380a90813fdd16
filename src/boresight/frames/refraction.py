"""Bending of rays by the air: effective Earth for targets inside it, and the sky's refraction for those beyond."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from boresight.errors import UserError
from boresight.frames._columns import bad, columns
from boresight.types.sensor import FloatArray

EARTH_RADIUS = 6371008.8  # m, mean
RADAR = 4.0 / 3.0  # effective Earth factor of a standard atmosphere for radio waves
OPTICAL = 1.0 / (1.0 - 0.13)  # the same for light: the surveyor's refraction coefficient 0.13
LOWEST = np.radians(-1.0)  # rad: below it the sky's formula says nothing


def true_from_apparent(
    elevation: ArrayLike, range_m: ArrayLike, height: ArrayLike = 0.0, factor: float = RADAR
) -> tuple[FloatArray, FloatArray]:
    """Return the straight line's elevation (rad) and range (m) of a target at an apparent elevation and path length.

    The ray is straight over an Earth `factor` times as large, which gives the target's height and distance along the
    ground; these are then laid on the real Earth (Skolnik; Doviak & Zrnić (2.28b), (2.28c)). `height` (m) is the
    observer's. Shapes (...,). Raises UserError for a range that is negative and values not finite.
    """
    (a, r, h0), shape = _checked(elevation, range_m, height)
    A = factor * EARTH_RADIUS + h0
    rho = np.sqrt(A * A + r * r + 2.0 * A * r * np.sin(a))
    theta = factor * np.arctan2(r * np.cos(a), A + r * np.sin(a))
    radius = EARTH_RADIUS + rho - factor * EARTH_RADIUS
    x = radius * np.sin(theta)
    # radius cos θ - (Re + h0), without taking near-equal numbers from each other
    y = (r * r + 2.0 * A * r * np.sin(a)) / (rho + A) - 2.0 * radius * np.sin(0.5 * theta) ** 2
    return np.arctan2(y, x).reshape(shape), np.hypot(x, y).reshape(shape)


def true_from_apparent_jacobian(
    elevation: ArrayLike, range_m: ArrayLike, height: ArrayLike = 0.0, factor: float = RADAR
) -> FloatArray:
    """Return d(true elevation, true range)/d(apparent elevation, range), (..., 2, 2), rad and m."""
    (a, r, h0), shape = _checked(elevation, range_m, height)
    A = factor * EARTH_RADIUS + h0
    rho2 = A * A + r * r + 2.0 * A * r * np.sin(a)
    rho = np.sqrt(rho2)
    theta = factor * np.arctan2(r * np.cos(a), A + r * np.sin(a))
    radius = EARTH_RADIUS + rho - factor * EARTH_RADIUS
    x = radius * np.sin(theta)
    y = (r * r + 2.0 * A * r * np.sin(a)) / (rho + A) - 2.0 * radius * np.sin(0.5 * theta) ** 2
    d2 = x * x + y * y
    d_rho = np.stack([A * r * np.cos(a) / rho, (r + A * np.sin(a)) / rho], axis=-1)
    d_theta = factor * np.stack([-(A * r * np.sin(a) + r * r) / rho2, A * np.cos(a) / rho2], axis=-1)
    dx = d_rho * np.sin(theta)[:, None] + d_theta * (radius * np.cos(theta))[:, None]
    dy = d_rho * np.cos(theta)[:, None] - d_theta * (radius * np.sin(theta))[:, None]
    d_elevation = (x[:, None] * dy - y[:, None] * dx) / d2[:, None]
    d_range = (x[:, None] * dx + y[:, None] * dy) / np.sqrt(d2)[:, None]
    return np.stack([d_elevation, d_range], axis=1).reshape(*shape, 2, 2)


def apparent_from_true(
    elevation: ArrayLike, range_m: ArrayLike, height: ArrayLike = 0.0, factor: float = RADAR
) -> tuple[FloatArray, FloatArray]:
    """Return the apparent elevation (rad) and path length (m) of a target seen along a straight line.

    The inverse of `true_from_apparent`, in closed form.
    """
    (e, d, h0), shape = _checked(elevation, range_m, height)
    B = EARTH_RADIUS + h0
    radius = np.sqrt(B * B + d * d + 2.0 * B * d * np.sin(e))
    theta = np.arctan2(d * np.cos(e), B + d * np.sin(e)) / factor
    rho = radius + (factor - 1.0) * EARTH_RADIUS
    x = rho * np.sin(theta)
    y = (d * d + 2.0 * B * d * np.sin(e)) / (radius + B) - 2.0 * rho * np.sin(0.5 * theta) ** 2
    return np.arctan2(y, x).reshape(shape), np.hypot(x, y).reshape(shape)


def sky_true_from_apparent(
    elevation: ArrayLike, pressure_hpa: float = 1010.0, temperature_c: float = 10.0
) -> FloatArray:
    """Return the true elevation (rad) of something beyond the air, seen at an apparent elevation (Bennett 1982).

    R = cot(h + 7.31° / (h / 1° + 4.4)) arc minutes × P/1010 × 283/(273 + T); accurate to 0.07' for light. Raises
    UserError below -1°.
    """
    (a,), shape = columns(elevation)
    _above(a)
    return (a - _bennett(a, pressure_hpa, temperature_c)).reshape(shape)


def sky_apparent_from_true(
    elevation: ArrayLike, pressure_hpa: float = 1010.0, temperature_c: float = 10.0
) -> FloatArray:
    """Return the apparent elevation (rad) of something beyond the air: the inverse of `sky_true_from_apparent`."""
    (e,), shape = columns(elevation)
    _above(e)
    a = e.copy()
    for _ in range(100):
        step = e - (a - _bennett(a, pressure_hpa, temperature_c))
        a += step
        if np.abs(step).max(initial=0.0) < 1e-15:
            break
    return a.reshape(shape)


def _bennett(a: FloatArray, pressure_hpa: float, temperature_c: float) -> FloatArray:
    degrees = np.degrees(a)
    angle = np.radians(degrees + 7.31 / (degrees + 4.4))
    minutes: FloatArray = 1.0 / np.tan(angle) * (pressure_hpa / 1010.0) * (283.0 / (273.0 + temperature_c))
    return np.radians(minutes / 60.0)


def _above(elevation: FloatArray) -> None:
    low = ~((elevation >= LOWEST) & (elevation <= np.pi / 2))
    if low.any():
        row = int(np.flatnonzero(low)[0])
        raise UserError(bad("elevation between -1° and 90°", row, [elevation[row]]))


def _checked(*values: ArrayLike) -> tuple[list[FloatArray], tuple[int, ...]]:
    cols, shape = columns(*values)
    wrong = ~(np.isfinite(cols[0]) & np.isfinite(cols[2]) & (cols[1] >= 0) & np.isfinite(cols[1]))
    if wrong.any():
        row = int(np.flatnonzero(wrong)[0])
        raise UserError(bad("elevation and height finite, range not negative", row, [c[row] for c in cols]))
    return cols, shape
