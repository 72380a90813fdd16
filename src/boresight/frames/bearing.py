"""The direction of a pixel in the world, with the covariance that its pixel, attitude, mount and position give it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from boresight.errors import UserError
from boresight.frames.attitude import ned_from_body
from boresight.frames.camera import Camera, direction_from_pixel, direction_from_pixel_jacobian
from boresight.frames.tangent import tangent_basis, unit
from boresight.types.sensor import FloatArray

ZENITH = 1e-12  # cosine of the elevation below which azimuth is not defined


class Bearing(NamedTuple):
    """A direction in ENU with its uncertainty, in both forms; shapes (...), rad.

    `tangent_covariance` holds the two angles across the line of sight, right and up (`frames.tangent`): it is right
    everywhere. `covariance` is that of (azimuth, elevation), which the first order gives well up to about 75°; at the
    zenith itself its azimuth is infinite.
    """

    azimuth: FloatArray  # (...,)
    elevation: FloatArray  # (...,)
    covariance: FloatArray  # (..., 2, 2)
    direction: FloatArray  # (..., 3) unit, ENU
    tangent_covariance: FloatArray  # (..., 2, 2)


class Noise(NamedTuple):
    """Covariances of everything between a pixel and a bearing; None where something is exact.

    Attributes:
        pixel: (..., 2, 2) px².
        attitude: (..., 3, 3) rad², of small turns about the body's forward, right, down: `turns_from_ypr` makes it
            of yaw, pitch, roll.
        mount: (..., 3, 3) rad², of small turns about the sensor's own forward, right, down.
        position: (..., 3, 3) m² of target against sensor in ENU, felt through the range.
    """

    pixel: FloatArray | None = None
    attitude: FloatArray | None = None
    mount: FloatArray | None = None
    position: FloatArray | None = None


def bearing_from_direction(direction: ArrayLike, covariance: ArrayLike) -> Bearing:
    """Return the bearing of ENU vectors (..., 3) whose unit directions have `covariance` (..., 3, 3).

    Only the part across the line of sight counts. Raises UserError for a vector of no length.
    """
    d = unit(direction)
    T = tangent_basis(d)
    P = T @ np.asarray(covariance, dtype=np.float64) @ np.swapaxes(T, -1, -2)
    rho = np.hypot(d[..., 0], d[..., 1])
    azimuth = np.arctan2(d[..., 0], d[..., 1])
    azimuth = np.where(azimuth == -np.pi, np.pi, azimuth)
    defined = rho > ZENITH
    i_rho = np.where(defined, 1.0 / np.where(defined, rho, 1.0), np.inf)
    scale = np.stack([i_rho, np.ones_like(rho)], axis=-1)
    scaled = np.zeros_like(P)
    np.multiply(P, scale[..., :, None] * scale[..., None, :], out=scaled, where=P != 0)
    return Bearing(azimuth, np.arctan2(d[..., 2], rho), scaled, d, P)


def bearing_from_pixel(
    camera: Camera,
    px: ArrayLike,
    py: ArrayLike,
    enu_from_body: ArrayLike,
    body_from_mount: ArrayLike = np.eye(3),  # noqa: B008 (a constant)
    noise: Noise = Noise(),  # noqa: B008 (immutable)
    range_m: ArrayLike | None = None,
) -> Bearing:
    """Return the bearing of pixels (...,) of a camera mounted on a body (wang2009 (4), with its covariance).

    d = enu_from_body @ body_from_mount @ direction(px, py); rotations (..., 3, 3). To first order
    cov d = R J Σ_pixel J'R' + [d×] (B Σ_attitude B' + R Σ_mount R') [d×]' + Σ_position / range², where B is
    enu_from_body and R the whole rotation. Raises UserError for a pixel outside the picture, and for position noise
    without a positive range.
    """
    B = np.asarray(enu_from_body, dtype=np.float64)
    R = B @ np.asarray(body_from_mount, dtype=np.float64)
    seen = direction_from_pixel(camera, px, py)
    d = (R @ seen[..., None])[..., 0]
    P = np.zeros((*d.shape, 3))
    if noise.pixel is not None:
        J = R @ direction_from_pixel_jacobian(camera, px, py)
        P = P + J @ noise.pixel @ np.swapaxes(J, -1, -2)
    across = cross_matrix(d)
    for turn, covariance in ((B, noise.attitude), (R, noise.mount)):
        if covariance is not None:
            A = across @ turn
            P = P + A @ covariance @ np.swapaxes(A, -1, -2)
    if noise.position is not None:
        r = np.asarray(np.nan if range_m is None else range_m, dtype=np.float64)
        if not (r > 0).all():
            raise UserError("position noise turns into an angle only with a range: give range_m > 0")
        P = P + noise.position / (r * r)[..., None, None]
    return bearing_from_direction(d, P)


def turns_from_ypr(yaw: ArrayLike, pitch: ArrayLike, roll: ArrayLike) -> FloatArray:
    """Return d(small turn about forward, right, down)/d(yaw, pitch, roll), (..., 3, 3).

    For E of this, E Σ E' turns a covariance of yaw, pitch, roll into that of body turns. At gimbal lock it has no
    inverse, but it stays right. Yaw itself does not enter: turns in body axes do not see the heading.
    """
    y, p, r = np.broadcast_arrays(*(np.asarray(v, dtype=np.float64) for v in (yaw, pitch, roll)))
    E = np.zeros((*y.shape, 3, 3))
    E[..., 0, 0], E[..., 0, 2] = -np.sin(p), 1.0
    E[..., 1, 0], E[..., 1, 1] = np.cos(p) * np.sin(r), np.cos(r)
    E[..., 2, 0], E[..., 2, 1] = np.cos(p) * np.cos(r), -np.sin(r)
    return E


def turned_vector_jacobian(yaw: ArrayLike, pitch: ArrayLike, roll: ArrayLike, vector: ArrayLike) -> FloatArray:
    """Return d(ned_from_body(yaw, pitch, roll) @ vector)/d(yaw, pitch, roll), (..., 3, 3)."""
    R = ned_from_body(yaw, pitch, roll)
    J: FloatArray = -R @ cross_matrix(vector) @ turns_from_ypr(yaw, pitch, roll)
    return J


def cross_matrix(vector: ArrayLike) -> FloatArray:
    """Return [v×] (..., 3, 3), with [v×] w = v × w."""
    v = np.asarray(vector, dtype=np.float64)
    M = np.zeros((*v.shape, 3))
    M[..., 0, 1], M[..., 0, 2] = -v[..., 2], v[..., 1]
    M[..., 1, 0], M[..., 1, 2] = v[..., 2], -v[..., 0]
    M[..., 2, 0], M[..., 2, 1] = -v[..., 1], v[..., 0]
    return M
