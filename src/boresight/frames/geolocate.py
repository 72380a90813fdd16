"""From a direction to a place on the Earth, with its error ellipse."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri

from boresight.errors import UserError
from boresight.frames.geodetic import geodetic_from_ecef
from boresight.frames.local import ecef_from_enu, ecef_from_enu_rotation
from boresight.frames.tangent import tangent_basis, unit
from boresight.kernels import geodesy
from boresight.types import Site
from boresight.types.sensor import FloatArray

_ROUNDS = 20
_HEIGHT_TOLERANCE = 1e-7  # m


class Place(NamedTuple):
    """Where a line of sight ends; shapes (...). `covariance` (m²) is in the *place's own* east, north, up."""

    latitude: FloatArray  # rad
    longitude: FloatArray  # rad
    height: FloatArray  # m above the ellipsoid
    range: FloatArray  # m from the sensor
    covariance: FloatArray  # (..., 3, 3)


class Ellipse(NamedTuple):
    """A horizontal error ellipse: semi-axes (m) and the azimuth of the longer one (rad, from north, in [0, π))."""

    semi_major: FloatArray
    semi_minor: FloatArray
    azimuth: FloatArray


def place_from_range(
    position: ArrayLike,
    direction: ArrayLike,
    range_m: ArrayLike,
    site: Site,
    *,
    tangent_covariance: ArrayLike = 0.0,
    sigma_range: ArrayLike = 0.0,
    position_covariance: ArrayLike = 0.0,
) -> Place:
    """Return the place at `range_m` (...,) along unit `direction` (..., 3) from `position` (..., 3), all site ENU.

    Its covariance is r² T'ΣT (the direction's, (..., 2, 2)) + σ_r² d d' + that of the position (..., 3, 3).
    Raises UserError for a range that is not positive.
    """
    p, d, r = _broadcast(position, direction, range_m)
    if not (np.isfinite(r) & (r > 0)).all():
        raise UserError("range_m must be positive and finite")
    P = _direction_covariance(d, tangent_covariance) * (r * r)[..., None, None]
    P = P + _square(sigma_range) * d[..., :, None] * d[..., None, :] + np.asarray(position_covariance)
    return _place(p + r[..., None] * d, r, P, site)


def place_at_height(
    position: ArrayLike,
    direction: ArrayLike,
    height: ArrayLike,
    site: Site,
    *,
    tangent_covariance: ArrayLike = 0.0,
    sigma_height: ArrayLike = 0.0,
    position_covariance: ArrayLike = 0.0,
) -> Place:
    """Return where the ray from `position` (..., 3) along unit `direction` (..., 3) first meets a height (...,).

    The height (m) is above the ellipsoid. With n the local up there, an error e across the ray moves the place by
    (I − d n'/(n·d)) e, and one of the height by d/(n·d). Raises UserError where the ray misses the surface or only
    meets it behind the sensor.
    """
    p, d, h = _broadcast(position, direction, height)
    r, n = _meet(p, d, h, site)
    slope = (n * d).sum(axis=-1)
    slide = np.eye(3) - d[..., :, None] * n[..., None, :] / slope[..., None, None]
    P = _direction_covariance(d, tangent_covariance) * (r * r)[..., None, None] + np.asarray(position_covariance)
    along = d / slope[..., None]
    P = slide @ P @ np.swapaxes(slide, -1, -2)
    P = P + _square(sigma_height) * along[..., :, None] * along[..., None, :]
    return _place(p + r[..., None] * d, r, P, site)


def error_ellipse(covariance: ArrayLike, probability: float = 0.95) -> Ellipse:
    """Return the ellipse that holds the place with `probability`, of a covariance (..., 2 or 3, 2 or 3) in ENU."""
    if not 0.0 < probability < 1.0:
        raise UserError(f"probability = {probability} must lie between 0 and 1")
    values, vectors = np.linalg.eigh(np.asarray(covariance, dtype=np.float64)[..., :2, :2])
    scale = np.sqrt(chdtri(2, 1.0 - probability))
    major = vectors[..., :, 1]
    semi = scale * np.sqrt(np.maximum(values, 0.0))
    return Ellipse(semi[..., 1], semi[..., 0], np.arctan2(major[..., 0], major[..., 1]) % np.pi)


def _meet(p: FloatArray, d: FloatArray, h: FloatArray, site: Site) -> tuple[FloatArray, FloatArray]:
    """Return the distance along the ray and the local up (site ENU) where it first meets the height."""
    R = ecef_from_enu_rotation(site)
    origin = np.stack(ecef_from_enu(p[..., 0], p[..., 1], p[..., 2], site), axis=-1)
    ray = d @ R.T
    start = _height(origin) - h
    r = _meet_ellipsoid(origin, ray, h, start)
    if not np.isfinite(r).all():
        row = int(np.flatnonzero(~np.isfinite(np.atleast_1d(r)))[0])
        raise UserError(
            f"row {row}: the line of sight does not meet the height {np.atleast_1d(h)[row]:g} m ahead of it"
        )
    for _ in range(_ROUNDS):
        x = origin + r[..., None] * ray
        latitude, longitude, height = geodetic_from_ecef(x[..., 0], x[..., 1], x[..., 2])
        up = _up(latitude, longitude)
        miss = height - h
        if np.abs(miss).max(initial=0.0) < _HEIGHT_TOLERANCE:
            return r, up @ R
        slope = (up * ray).sum(axis=-1)
        r = np.maximum(r - miss / np.where(np.abs(slope) > 1e-9, slope, np.copysign(1e-9, slope)), 0.0)
    raise UserError("the line of sight only grazes the height: there is no single place")


def _meet_ellipsoid(origin: FloatArray, ray: FloatArray, h: FloatArray, start: FloatArray) -> FloatArray:
    """Return the first distance ahead at which the ray meets the ellipsoid grown by h; NaN if none.

    The surface of one height is that ellipsoid to h · f²: a start for Newton's steps.
    """
    scale = np.stack([1.0 / (geodesy.A + h), 1.0 / (geodesy.A + h), 1.0 / (geodesy.B + h)], axis=-1)
    o, v = origin * scale, ray * scale
    a = (v * v).sum(axis=-1)
    b = (o * v).sum(axis=-1)
    c = (o * o).sum(axis=-1) - 1.0
    square = b * b - a * c
    root = np.sqrt(np.where(square >= 0, square, np.nan))
    near, far = (-b - root) / a, (-b + root) / a
    first = np.where(start >= 0, near, far)
    return np.where(first > 0, first, np.nan)


def _square(sigma: ArrayLike) -> FloatArray:
    out: FloatArray = np.square(np.asarray(sigma, dtype=np.float64))[..., None, None]
    return out


def _height(x: FloatArray) -> FloatArray:
    out: FloatArray = np.asarray(geodetic_from_ecef(x[..., 0], x[..., 1], x[..., 2])[2])
    return out


def _up(latitude: FloatArray, longitude: FloatArray) -> FloatArray:
    c = np.cos(latitude)
    return np.stack([c * np.cos(longitude), c * np.sin(longitude), np.sin(latitude)], axis=-1)


def _direction_covariance(d: FloatArray, tangent_covariance: ArrayLike) -> FloatArray:
    T = tangent_basis(d)
    S = np.broadcast_to(np.asarray(tangent_covariance, dtype=np.float64), (*d.shape[:-1], 2, 2))
    P: FloatArray = np.swapaxes(T, -1, -2) @ S @ T
    return P


def _broadcast(
    position: ArrayLike, direction: ArrayLike, scalar: ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    p, d = np.asarray(position, dtype=np.float64), unit(direction)
    s = np.asarray(scalar, dtype=np.float64)
    shape = np.broadcast_shapes(p.shape[:-1], d.shape[:-1], s.shape)
    return np.broadcast_to(p, (*shape, 3)), np.broadcast_to(d, (*shape, 3)), np.broadcast_to(s, shape)


def _place(enu: FloatArray, r: FloatArray, P: FloatArray, site: Site) -> Place:
    x, y, z = ecef_from_enu(enu[..., 0], enu[..., 1], enu[..., 2], site)
    latitude, longitude, height = (np.asarray(v) for v in geodetic_from_ecef(x, y, z))
    east = np.stack([-np.sin(longitude), np.cos(longitude), np.zeros_like(longitude)], axis=-1)
    up = _up(latitude, longitude)
    local_from_ecef = np.stack([east, np.cross(up, east), up], axis=-2)
    R = local_from_ecef @ ecef_from_enu_rotation(site)
    return Place(latitude, longitude, height, r, R @ P @ np.swapaxes(R, -1, -2))
