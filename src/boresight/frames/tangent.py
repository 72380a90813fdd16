"""Directions as unit vectors, and the plane that touches the sphere at one: angles without a pole.

Near the zenith azimuth loses its meaning, and its variance grows as 1/cos²(elevation). A direction's error does not:
it is a vector of two small angles across the line of sight, to the right (growing azimuth) and up.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from boresight.errors import UserError
from boresight.frames._columns import rows
from boresight.types.sensor import FloatArray


def unit(vector: ArrayLike) -> FloatArray:
    """Return vectors (..., 3) at length one; raises UserError for one of no length or not finite."""
    v, shape = rows(vector, 3, what="vector")
    length = np.sqrt((v * v).sum(axis=1))
    wrong = ~(np.isfinite(length) & (length > 0))
    if wrong.any():
        row = int(np.flatnonzero(wrong)[0])
        raise UserError(f"row {row}: {v[row].tolist()} has no direction")
    out: FloatArray = (v / length[:, None]).reshape(*shape, 3)
    return out


def tangent_basis(direction: ArrayLike) -> FloatArray:
    """Return (..., 2, 3): the unit vectors to the right and up across unit ENU directions (..., 3).

    Right is level and up completes it, as azimuth and elevation grow. At the zenith and the nadir, where neither is
    defined, right is east.
    """
    d, shape = rows(direction, 3, what="direction")
    rho = np.hypot(d[:, 0], d[:, 1])
    level = rho > 0
    east = np.where(level, d[:, 1], 1.0) / np.where(level, rho, 1.0)
    south = np.where(level, -d[:, 0], 0.0) / np.where(level, rho, 1.0)
    out = np.zeros((len(d), 2, 3))
    out[:, 0, 0], out[:, 0, 1] = east, south
    out[:, 1, 0] = south * d[:, 2]  # right × d
    out[:, 1, 1] = -east * d[:, 2]
    out[:, 1, 2] = east * d[:, 1] - south * d[:, 0]
    return out.reshape(*shape, 2, 3)


def tangent_from_direction(centre: ArrayLike, direction: ArrayLike) -> FloatArray:
    """Return (..., 2): the angles (rad) right and up from unit `centre` to unit `direction` (..., 3), ENU.

    The length is the angle between them (the logarithm on the sphere), to full precision at any separation; opposite
    directions give π to the right.
    """
    c, shape = rows(centre, 3, what="centre")
    d = np.broadcast_to(np.asarray(direction, dtype=np.float64), (*shape, 3)).reshape(-1, 3)
    across = np.einsum("nij,nj->ni", tangent_basis(c), d)
    length = np.hypot(across[:, 0], across[:, 1])
    angle = np.arctan2(length, (c * d).sum(axis=1))
    scale = np.where(length > 0, angle / np.where(length > 0, length, 1.0), 1.0)
    out = across * scale[:, None]
    out[(length == 0) & (angle > 1)] = [np.pi, 0.0]
    offset: FloatArray = out.reshape(*shape, 2)
    return offset


def direction_from_tangent(centre: ArrayLike, offset: ArrayLike) -> FloatArray:
    """Return unit directions (..., 3) at the angles `offset` (..., 2) (rad) right and up from unit `centre`."""
    c, shape = rows(centre, 3, what="centre")
    o = np.broadcast_to(np.asarray(offset, dtype=np.float64), (*shape, 2)).reshape(-1, 2)
    angle = np.hypot(o[:, 0], o[:, 1])
    across = np.einsum("ni,nij->nj", o, tangent_basis(c))
    d = np.cos(angle)[:, None] * c + np.sinc(angle / np.pi)[:, None] * across
    out: FloatArray = d.reshape(*shape, 3)
    return out


def separation(a: ArrayLike, b: ArrayLike) -> FloatArray:
    """Return the angle (...,) (rad) between vectors (..., 3) of any length, precise at 0 and π (Kahan)."""
    u, v = np.broadcast_arrays(unit(a), unit(b))
    plus, minus = np.linalg.norm(u + v, axis=-1), np.linalg.norm(u - v, axis=-1)
    angle: FloatArray = 2.0 * np.arctan2(minus, plus)
    return angle
