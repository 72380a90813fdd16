"""One JSON line: what it may hold, and its values as the filter and the navigation take them."""

from __future__ import annotations

import math

import msgspec
import numpy as np

from boresight.frames.local import ecef_from_enu, ecef_from_enu_rotation, enu_from_ecef
from boresight.kernels.geodesy import ecef_from_geodetic
from boresight.pointing.guide import GuideSource
from boresight.types import Site
from boresight.types.sensor import FloatArray

DEG = math.pi / 180.0
LEAST = 1e-12  # of a variance


class Line(msgspec.Struct, frozen=True):
    """What a line may hold; the rest of it is ignored."""

    t_s: float
    source: str | None = None
    platform: str | None = None
    azimuth_deg: float | None = None
    elevation_deg: float | None = None
    range_m: float | None = None
    face_az_deg: float | None = None
    face_el_deg: float | None = None
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    height_m: float | None = None
    x_m: float | None = None
    y_m: float | None = None
    z_m: float | None = None
    east_m: float | None = None
    north_m: float | None = None
    up_m: float | None = None
    vx_m_s: float | None = None
    vy_m_s: float | None = None
    vz_m_s: float | None = None
    ve_m_s: float | None = None
    vn_m_s: float | None = None
    vu_m_s: float | None = None
    covariance: tuple[float, ...] | None = None
    yaw_deg: float | None = None
    pitch_deg: float | None = None
    roll_deg: float | None = None


def position(m: Line, site: Site) -> tuple[FloatArray, FloatArray] | None:
    """Return the position in ECEF (3,) (m) and the rotation (3, 3) to ECEF of the axes its velocity is given in.

    None if there is no position, or one that cannot be: the axes are the local level for latitude and longitude, ECEF
    itself for x, y, z, and the site's for east, north, up.
    """
    if m.latitude_deg is not None and m.longitude_deg is not None and m.height_m is not None:
        if not (abs(m.latitude_deg) <= 90.0 and abs(m.longitude_deg) <= 720.0 and -1e5 <= m.height_m <= 1e9):
            return None
        at = Site(m.latitude_deg * DEG, m.longitude_deg * DEG, m.height_m)
        return np.array(ecef_from_geodetic(at.latitude, at.longitude, at.height)), ecef_from_enu_rotation(at)
    if m.x_m is not None and m.y_m is not None and m.z_m is not None:
        xyz = (m.x_m, m.y_m, m.z_m)
        return (np.array(xyz), np.eye(3)) if 1e5 < math.hypot(*xyz) < 1e12 else None
    if m.east_m is not None and m.north_m is not None and m.up_m is not None:
        if not math.hypot(m.east_m, m.north_m, m.up_m) < 1e12:
            return None
        return np.array(ecef_from_enu(m.east_m, m.north_m, m.up_m, site)), ecef_from_enu_rotation(site)
    return None


def velocity(m: Line) -> FloatArray | None:
    """Return the velocity (3,) (m/s) in the axes of `position`; None if there is none, NaN if it cannot be."""
    local, ecef = (m.ve_m_s, m.vn_m_s, m.vu_m_s), (m.vx_m_s, m.vy_m_s, m.vz_m_s)
    a, b, c = local if m.x_m is None or m.latitude_deg is not None else ecef
    if a is None or b is None or c is None:
        return None
    return np.array([a, b, c]) if math.hypot(a, b, c) < 1e6 else np.full(3, math.nan)


def placed(m: Line, source: GuideSource, site: Site) -> tuple[FloatArray, FloatArray] | None:
    """Return `z` (3,) or (6,) and `axes` of a position or track (`GuideFilter.step`); None if they cannot be."""
    where = position(m, site)
    if where is None:
        return None
    at, R = where
    if m.covariance is None:
        return (at, np.eye(3)) if source.correlation is None else None
    k = {6: 3, 21: 6}.get(len(m.covariance))
    v = velocity(m)
    if k is None or (k == 6 and (v is None or source.correlation is None)):
        return None
    C, turn = np.zeros((k, k)), np.kron(np.eye(k // 3), R)
    C[np.triu_indices(k)] = m.covariance
    C += np.triu(C, 1).T
    if not (np.isfinite(C).all() and np.diag(C).min() > LEAST and np.diag(C).max() < 1e18):
        return None
    try:
        axes = source.axes_of(turn @ C @ turn.T)
    except np.linalg.LinAlgError:
        return None
    z = at if k == 3 or v is None else np.concatenate([at, R @ v])
    return (z, axes) if np.isfinite(z).all() and np.isfinite(axes).all() else None


def navigation(m: Line, site: Site) -> FloatArray | None:
    """Return a row of navigation (9,): site ENU position (m), velocity (m/s), yaw, pitch, roll (rad), NaN if not given.

    None if it holds nothing of use, or something that cannot be.
    """
    row = np.full(9, math.nan)
    where = position(m, site)
    if where is not None:
        at, R = where
        row[:3] = enu_from_ecef(float(at[0]), float(at[1]), float(at[2]), site)
        v = velocity(m)
        if v is not None:
            row[3:6] = ecef_from_enu_rotation(site).T @ R @ v
    if m.yaw_deg is not None and m.pitch_deg is not None and m.roll_deg is not None:
        if not (abs(m.yaw_deg) <= 720.0 and abs(m.pitch_deg) <= 90.0 and abs(m.roll_deg) <= 360.0):
            return None
        row[6:] = m.yaw_deg * DEG, m.pitch_deg * DEG, m.roll_deg * DEG
    return row if np.isfinite(row[:3]).all() or np.isfinite(row[6:]).all() else None
