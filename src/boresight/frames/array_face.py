"""The face of a phased array: directions against its two customary angle systems and direction cosines.

Face axes are right, boresight (the normal), up, in that order, so that they read like east, north, up. Right and up
are as seen from behind the array, looking out.
"""

from __future__ import annotations

from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike

from boresight.errors import UserError
from boresight.frames._columns import Input, Values, bad, columns, rows
from boresight.frames.attitude import ned_from_body
from boresight.frames.azel import azel_from_enu, azel_from_enu_jacobian, enu_from_azel, enu_from_azel_jacobian
from boresight.types.sensor import FloatArray


class Pole(StrEnum):
    """Where the pole of a face's angles lies."""

    IN_FACE = "in_face"  # azimuth about the face's up: 0, 0 is the normal
    ON_NORMAL = "on_normal"  # azimuth about the normal: elevation 90° is the normal


# (right, boresight, up) as the east, north, up of the angles: with the pole on the normal north is the face's down,
# so that a face that lies flat with boresight azimuth 0 has the angles of the sky.
_POLE_FROM_FACE = {
    Pole.IN_FACE: np.eye(3),
    Pole.ON_NORMAL: np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
}


def pole_from_face(pole: Pole) -> FloatArray:
    """Return the rotation (3, 3) from face axes to those whose azimuth and elevation are the system's angles."""
    return _POLE_FROM_FACE[pole]


def enu_from_face(azimuth: Input, elevation: Input, skew: Input = 0.0) -> FloatArray:
    """Return the rotation (..., 3, 3) whose columns are right, boresight, up of a face, in ENU (or body-like) axes.

    `azimuth`, `elevation` (rad) point the boresight, `skew` turns the face clockwise about it, seen from behind.
    """
    R = ned_from_body(azimuth, elevation, skew)  # columns forward, right, down in NED
    right, boresight, up = R[..., :, 1], R[..., :, 0], -R[..., :, 2]
    ned = np.stack([right, boresight, up], axis=-1)
    return np.stack([ned[..., 1, :], ned[..., 0, :], -ned[..., 2, :]], axis=-2)


def angles_from_face(vector: ArrayLike, pole: Pole) -> Values:
    """Return azimuth, elevation (rad) and length of vectors (..., 3) in face axes, in one angle system."""
    v = _turn(vector, pole)
    return azel_from_enu(v[..., 0], v[..., 1], v[..., 2])


def face_from_angles(azimuth: Input, elevation: Input, pole: Pole, length: Input = 1.0) -> FloatArray:
    """Return vectors (..., 3) in face axes of azimuth, elevation (rad) in one angle system."""
    out: FloatArray = np.stack(enu_from_azel(azimuth, elevation, length), axis=-1) @ _POLE_FROM_FACE[pole]
    return out


def angles_from_face_jacobian(vector: ArrayLike, pole: Pole) -> FloatArray:
    """Return d(azimuth, elevation, length)/d(right, boresight, up), (..., 3, 3)."""
    v = _turn(vector, pole)
    J: FloatArray = azel_from_enu_jacobian(v[..., 0], v[..., 1], v[..., 2]) @ _POLE_FROM_FACE[pole]
    return J


def face_from_angles_jacobian(azimuth: Input, elevation: Input, pole: Pole, length: Input = 1.0) -> FloatArray:
    """Return d(right, boresight, up)/d(azimuth, elevation, length), (..., 3, 3)."""
    J: FloatArray = _POLE_FROM_FACE[pole].T @ enu_from_azel_jacobian(azimuth, elevation, length)
    return J


def cosines_from_face(vector: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return the direction cosines u (right) and v (up), (...,), of vectors (..., 3) in face axes.

    Raises UserError for a vector in or behind the plane of the face: it has the cosines of its mirror image.
    """
    w, shape = rows(vector, 3, what="vector")
    behind = ~(w[:, 1] > 0)
    if behind.any():
        row = int(np.flatnonzero(behind)[0])
        raise UserError(bad("in front of the face", row, w[row].tolist()))
    n = np.sqrt((w * w).sum(axis=1))
    return (w[:, 0] / n).reshape(shape), (w[:, 2] / n).reshape(shape)


def face_from_cosines(u: ArrayLike, v: ArrayLike) -> FloatArray:
    """Return unit vectors (..., 3) in face axes of direction cosines u (right), v (up).

    Raises UserError where u² + v² >= 1: no direction in front of the face has them.
    """
    (a, b), shape = columns(u, v)
    rest = 1.0 - a * a - b * b
    if not (rest > 0).all():
        row = int(np.flatnonzero(~(rest > 0))[0])
        raise UserError(bad("u² + v² < 1", row, [a[row], b[row]]))
    return np.stack([a, np.sqrt(rest), b], axis=-1).reshape(*shape, 3)


def cosines_from_face_jacobian(vector: ArrayLike) -> FloatArray:
    """Return d(u, v)/d(right, boresight, up), (..., 2, 3)."""
    cosines_from_face(vector)
    w, shape = rows(vector, 3, what="vector")
    n = np.sqrt((w * w).sum(axis=1))[:, None, None]
    d = w / n[:, :, 0]
    across = np.eye(3) - d[:, :, None] * d[:, None, :]
    out: FloatArray = (across[:, [0, 2], :] / n).reshape(*shape, 2, 3)
    return out


def face_from_cosines_jacobian(u: ArrayLike, v: ArrayLike) -> FloatArray:
    """Return d(right, boresight, up)/d(u, v), (..., 3, 2), of unit vectors."""
    d = face_from_cosines(u, v)
    J = np.zeros((*d.shape, 2))
    J[..., 0, 0] = J[..., 2, 1] = 1.0
    J[..., 1, 0], J[..., 1, 1] = -d[..., 0] / d[..., 1], -d[..., 2] / d[..., 1]
    return J


def _turn(vector: ArrayLike, pole: Pole) -> FloatArray:
    out: FloatArray = np.asarray(vector, dtype=np.float64) @ _POLE_FROM_FACE[pole].T
    return out
