"""Bring a source's reports to one time: on a line, a great circle, or between geodetic fixes (phased_array (1)).

Never azimuth and elevation by themselves: near zenith and through south a straight line in them goes astray.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from boresight.errors import UserError
from boresight.frames.azel import azel_from_enu, enu_from_azel
from boresight.frames.geodetic import ecef_from_geodetic, geodetic_from_ecef
from boresight.types.sensor import FloatArray


class Aligned(NamedTuple):
    """A value at one time, and how much noise the line makes of that of one report."""

    value: FloatArray  # (...,)
    gain: float  # standard deviation against that of one report


def align_linear(t0: float, y0: ArrayLike, t1: float, y1: ArrayLike, t: float) -> Aligned:
    """Return the line through two reports at time `t` (s): inter- or extrapolation, phased_array (1).

    With τ the steps beyond the newer report the noise gain is √((1 + τ)² + τ²). Give positions (ECEF) or direction
    vectors, not azimuths. The values of neighbouring times share reports: they are correlated, and are not to be
    counted as independent. Raises UserError for two reports of one time.
    """
    if t1 == t0:
        raise UserError(f"two reports of the same time ({t0:.6f} s) make no line")
    s = (t - t0) / (t1 - t0)
    a, b = np.asarray(y0, dtype=np.float64), np.asarray(y1, dtype=np.float64)
    return Aligned((1.0 - s) * a + s * b, float(np.hypot(1.0 - s, s)))


class Direction(NamedTuple):
    """A direction at one time, and the noise gain of each angular component across it."""

    azimuth: float  # rad
    elevation: float  # rad
    gain: float


def align_direction(t0: float, a: tuple[float, float], t1: float, b: tuple[float, float], t: float) -> Direction:
    """Return the direction at `t` (s) on the great circle through directions `a`, `b` (azimuth, elevation; rad).

    The turn rate is constant; beyond the newer report it goes on (phased_array (1) on the sphere). The gain is that of
    the line: tangent-plane noise (σ, and σ/cos el in azimuth) times it. Raises UserError for two reports of one time,
    or opposite directions.
    """
    if t1 == t0:
        raise UserError(f"two reports of the same time ({t0:.6f} s) make no line")
    u = np.array(enu_from_azel(float(a[0]), float(a[1])))
    v = np.array(enu_from_azel(float(b[0]), float(b[1])))
    s = (t - t0) / (t1 - t0)
    angle = float(np.arctan2(np.linalg.norm(np.cross(u, v)), u @ v))
    if angle > np.pi - 1e-9:
        raise UserError("two opposite directions lie on no single great circle")
    w = v if angle == 0.0 else (np.sin((1.0 - s) * angle) * u + np.sin(s * angle) * v) / np.sin(angle)
    azimuth, elevation, _ = azel_from_enu(float(w[0]), float(w[1]), float(w[2]))
    return Direction(float(azimuth), float(elevation), float(np.hypot(1.0 - s, s)))


def align_geodetic(t0: float, a: ArrayLike, t1: float, b: ArrayLike, t: float) -> Aligned:
    """Return latitude, longitude (rad), height (m) at `t` (s) on the line in ECEF through two fixes (3,) like it.

    The gain is that of the line: position noise times it. Raises UserError as `align_linear`, and for what is no fix.
    """
    ends = [ecef_from_geodetic(*(float(x) for x in np.asarray(fix, dtype=np.float64))) for fix in (a, b)]
    line = align_linear(t0, np.array(ends[0]), t1, np.array(ends[1]), t)
    x, y, z = (float(c) for c in line.value)
    return Aligned(np.array(geodetic_from_ecef(x, y, z)), line.gain)
