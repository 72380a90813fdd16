"""Attitude: yaw, pitch, roll (NED → FRD body, Z-Y-X), rotation matrices and quaternions (w, x, y, z).

A rotation is named for what it turns into what: `ned_from_body @ v_body` is in NED. The quaternion of an attitude is
the one of `ned_from_body` (Hamilton, scalar first, w >= 0).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from boresight.errors import UserError
from boresight.frames._columns import Input, Values, columns, rows
from boresight.frames.local import ENU_FROM_NED
from boresight.kernels import rotation, rotations
from boresight.types.sensor import FloatArray

_ORTHOGONAL = 1e-6  # how far R R' may be from the identity


def ned_from_body(yaw: Input, pitch: Input, roll: Input) -> FloatArray:
    """Return Rz(yaw) Ry(pitch) Rx(roll), (..., 3, 3), of angles in rad (wang2009 §2.2, transposed).

    The same matrix is `body_from_mount` of a mounting's angles. Raises UserError for angles that are not finite.
    """
    if isinstance(yaw, float) and isinstance(pitch, float) and isinstance(roll, float):
        R: FloatArray = rotation.matrix_from_ypr(yaw, pitch, roll)
        if yaw - yaw == pitch - pitch == roll - roll == 0.0:
            return R
    cols, shape = _finite_angles(yaw, pitch, roll)
    many: FloatArray = rotations.matrix_from_ypr(*cols).reshape(*shape, 3, 3)
    return many


def enu_from_body(yaw: Input, pitch: Input, roll: Input) -> FloatArray:
    """Return the rotation (..., 3, 3) from forward, right, down to east, north, up (rad)."""
    R: FloatArray = ENU_FROM_NED @ ned_from_body(yaw, pitch, roll)
    return R


def ypr_from_rotation(ned_from_body: ArrayLike) -> Values:
    """Return yaw in (-π, π], pitch in [-π/2, π/2], roll (rad) of a rotation (..., 3, 3).

    At gimbal lock (|pitch| = 90° within 1e-9 rad) only yaw ∓ roll is determined: roll is then 0 and yaw carries the
    whole. Raises UserError if the matrix is not a rotation.
    """
    R, shape = _rotation_rows(ned_from_body)
    if shape == ():
        y, p, r = rotation.ypr_from_matrix(R[0])
        return y, p, r
    yaw, pitch, roll = rotations.ypr_from_matrix(R)
    return yaw.reshape(shape), pitch.reshape(shape), roll.reshape(shape)


def quaternion_from_ypr(yaw: Input, pitch: Input, roll: Input) -> FloatArray:
    """Return the unit quaternion (..., 4), w >= 0, of yaw, pitch, roll (rad)."""
    if isinstance(yaw, float) and isinstance(pitch, float) and isinstance(roll, float):
        q: FloatArray = rotation.quaternion_from_ypr(yaw, pitch, roll)
        if q[0] == q[0]:
            return q
    cols, shape = _finite_angles(yaw, pitch, roll)
    many: FloatArray = rotations.quaternion_from_ypr(*cols).reshape(*shape, 4)
    return many


def rotation_from_quaternion(quaternion: ArrayLike) -> FloatArray:
    """Return the rotation (..., 3, 3) of a quaternion (..., 4).

    A norm within 1e-6 of one is normalised; any other raises UserError: it is a mistake, not rounding.
    """
    if type(quaternion) is np.ndarray and quaternion.shape == (4,) and quaternion.dtype == np.float64:
        one: FloatArray = rotation.matrix_from_quaternion(quaternion)
        if one[0, 0] == one[0, 0]:
            return one
    q, shape = rows(quaternion, 4, what="quaternion")
    R: FloatArray = rotations.matrix_from_quaternion(q)
    if not np.isfinite(R).all():
        row = int(np.flatnonzero(~np.isfinite(R[:, 0, 0]))[0])
        raise UserError(f"row {row}: quaternion of norm {np.linalg.norm(q[row]):.9g}; it must be 1: normalise it")
    return R.reshape(*shape, 3, 3)


def quaternion_from_rotation(ned_from_body: ArrayLike) -> FloatArray:
    """Return the unit quaternion (..., 4), w >= 0, of a rotation (..., 3, 3); raises UserError if it is none."""
    R, shape = _rotation_rows(ned_from_body)
    q: FloatArray = rotations.quaternion_from_matrix(R).reshape(*shape, 4)
    return q


def ypr_from_quaternion(quaternion: ArrayLike) -> Values:
    """Return yaw, pitch, roll (rad) of a quaternion (..., 4); gimbal lock as in `ypr_from_rotation`."""
    return ypr_from_rotation(rotation_from_quaternion(quaternion))


def multiply(p: ArrayLike, q: ArrayLike) -> FloatArray:
    """Return the quaternion product p q (..., 4): matrix(p q) = matrix(p) @ matrix(q)."""
    a, shape = rows(p, 4, what="p")
    b, other = rows(q, 4, what="q")
    if shape != other:
        raise UserError(f"quaternions of shapes {shape} and {other}")
    out: FloatArray = rotations.multiply(a, b).reshape(*shape, 4)
    return out


def slerp(p: ArrayLike, q: ArrayLike, fraction: ArrayLike) -> FloatArray:
    """Return the attitude (..., 4) at `fraction` of the shorter way from `p` to `q` (4,), at a constant rate.

    Raises UserError for a quaternion that is not of unit norm. `fraction` outside 0…1 goes on turning.
    """
    rotation_from_quaternion(p)
    rotation_from_quaternion(q)
    (s,), shape = columns(fraction)
    a, b = (np.broadcast_to(np.asarray(v, dtype=np.float64), (len(s), 4)).copy() for v in (p, q))
    out: FloatArray = rotations.slerp(a, b, s).reshape(*shape, 4)
    return out


def _finite_angles(*angles: Input) -> tuple[list[FloatArray], tuple[int, ...]]:
    cols, shape = columns(*angles)
    for name, column in zip(("yaw", "pitch", "roll"), cols):
        if not np.isfinite(column).all():
            raise UserError(f"row {int(np.flatnonzero(~np.isfinite(column))[0])}: {name} is not finite")
    return cols, shape


def _rotation_rows(matrix: ArrayLike) -> tuple[FloatArray, tuple[int, ...]]:
    R, shape = rows(matrix, 3, 3, what="rotation")
    off = rotations.distance_from_rotation(R)
    if not (off <= _ORTHOGONAL).all():
        row = int(np.flatnonzero(~(off <= _ORTHOGONAL))[0])
        raise UserError(f"row {row}: not a rotation (R R' is {off[row]:.2g} from the identity, or it mirrors)")
    return R, shape
