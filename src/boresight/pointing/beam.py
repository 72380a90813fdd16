"""Is the target in the beam? Its direction in all the angles that an antenna takes, with their uncertainty."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from boresight.errors import UserError
from boresight.frames.array_face import Pole, angles_from_face
from boresight.frames.azel import azel_from_enu, azel_from_enu_jacobian
from boresight.frames.tangent import tangent_basis, unit
from boresight.types.sensor import FloatArray

_COS2 = np.cos(np.linspace(0.0, 2.0 * np.pi, 256, endpoint=False)) ** 2
_SIN2 = 1.0 - _COS2


class Aim(NamedTuple):
    """Where to point at one time (rad, rad/s)."""

    direction: FloatArray  # (3,) unit, station ENU
    azimuth: float
    elevation: float
    azimuth_rate: float
    elevation_rate: float
    face_azimuth: float
    face_elevation: float
    covariance: FloatArray  # (2, 2) rad², right and up across the line of sight
    sigma: float  # rad, root mean square of the two
    p_in_beam: float


def probability_in_beam(covariance: ArrayLike, radius: float) -> float:
    """Return the probability that a Gaussian error (2, 2) (rad²) about the axis lies within `radius` (rad).

    In polar coordinates the radius integrates in closed form: P = 1/(2π √det S) ∮ (1 − exp(−½ g ρ²))/g dφ with
    g = e'S⁻¹e; the periodic integral over φ by 256 even points. Raises UserError for a covariance that is none.
    """
    S = np.asarray(covariance, dtype=np.float64)
    mean, half = 0.5 * float(S[0, 0] + S[1, 1]), float(np.hypot(0.5 * (S[0, 0] - S[1, 1]), S[0, 1]))
    values = (mean - half, mean + half)
    if not (-1e-12 * values[1] <= values[0] < np.inf):
        raise UserError("the direction's covariance is not positive")
    if values[1] == 0.0:
        return 1.0
    low = max(values[0], 1e-8 * values[1])  # a line is a very thin ellipse
    g = _COS2 / low + _SIN2 / values[1]
    if low < 1e-2 * values[1]:  # thin: the average over φ is peaked, integrate over the thick axis instead
        return _thin(low, values[1], radius)
    return float(np.mean(-np.expm1(-0.5 * g * radius**2) / g) / np.sqrt(low * values[1]))


def _thin(low: float, high: float, radius: float) -> float:
    """P over chords: ∫ φ(x/√high) · erf(√(ρ² − x²)/√(2 low)) dx, by Gauss–Legendre in the angle."""
    from scipy.special import erf

    nodes, weights = np.polynomial.legendre.leggauss(200)
    reach = min(radius, 9.0 * np.sqrt(high))
    x = reach * np.sin(0.5 * np.pi * nodes)
    dx = reach * 0.5 * np.pi * np.cos(0.5 * np.pi * nodes) * weights
    density = np.exp(-0.5 * x * x / high) / np.sqrt(2.0 * np.pi * high)
    return float(np.sum(density * erf(np.sqrt(np.maximum(radius**2 - x * x, 0.0) / (2.0 * low))) * dx))


def aim_at(
    to_target: FloatArray,
    velocity: FloatArray,
    covariance: FloatArray,
    enu_from_face: FloatArray,
    pole: Pole,
    beam_radius: float,
) -> Aim:
    """Return the aim at a target `to_target` (3,) from the antenna, moving with `velocity` (3,), all station ENU.

    `covariance` (3, 3) is of the target's position (m²).
    """
    d = unit(to_target)
    r = float(np.linalg.norm(to_target))
    T = tangent_basis(d)
    S = T @ covariance @ T.T / (r * r)
    azimuth, elevation, _ = azel_from_enu(*(float(v) for v in d))
    rates = azel_from_enu_jacobian(*to_target)[:2] @ velocity
    face_azimuth, face_elevation, _ = angles_from_face(enu_from_face.T @ d, pole)
    return Aim(
        d, azimuth, elevation, float(rates[0]), float(rates[1]), float(face_azimuth), float(face_elevation), S,
        float(np.sqrt(np.trace(S))), probability_in_beam(S, beam_radius),
    )  # fmt: skip
