"""Is the target in the beam? Its direction in all the angles that an antenna takes, with their uncertainty."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from boresight.errors import UserError
from boresight.frames.array_face import Pole, pole_from_face
from boresight.kernels.aim import aim as aim_kernel
from boresight.types.sensor import FloatArray

_COS2 = np.cos(np.linspace(0.0, 2.0 * np.pi, 256, endpoint=False)) ** 2
_SIN2 = 1.0 - _COS2


class Aim(NamedTuple):
    """Where to point at one time (rad, rad/s)."""

    direction: FloatArray  # (3,) unit, station ENU
    distance: float  # m
    azimuth: float
    elevation: float
    azimuth_rate: float
    elevation_rate: float
    face_azimuth: float
    face_elevation: float
    cosine_right: float  # direction cosines in the face
    cosine_up: float
    covariance: FloatArray  # (2, 2) rad², right and up across the line of sight
    sigma: float  # rad, root mean square of the two
    p_in_beam: float


def probability_in_beam(covariance: ArrayLike, radius: float) -> float:
    """Return the probability that a Gaussian error (2, 2) (rad²) about the axis lies within `radius` (rad).

    In polar coordinates the radius integrates in closed form: P = 1/(2π √det S) ∮ (1 − exp(−½ g ρ²))/g dφ with
    g = e'S⁻¹e; the periodic integral over φ by 256 even points. Raises UserError for a covariance that is none.
    """
    (a, b), (_, c) = np.asarray(covariance, dtype=np.float64).tolist()
    mean, half = 0.5 * (a + c), math.hypot(0.5 * (a - c), b)
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

    `covariance` (3, 3) is of the target's position (m²). Raises UserError for a target without a direction.
    """
    a = aim_kernel(to_target, velocity, covariance, enu_from_face, pole_from_face(pole))
    if math.isnan(a[0]):
        raise UserError(f"a target at {to_target.tolist()} m from the antenna has no direction")
    azimuth, elevation, azimuth_rate, elevation_rate, face_azimuth, face_elevation, right, up = a[3:11].tolist()
    S, distance = a[11:].reshape(2, 2), math.sqrt(float(to_target @ to_target))
    return Aim(
        a[:3], distance, azimuth, elevation, azimuth_rate, elevation_rate, face_azimuth, face_elevation, right, up, S,
        math.sqrt(a[11] + a[14]), probability_in_beam(S, beam_radius),
    )  # fmt: skip
