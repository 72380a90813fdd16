"""Modified spherical coordinates (MSC) of a target relative to its observer, and the paper's printed matrices.

y = [β, β̇, θ, ω, ṙ/r, 1/r], then any further states unchanged: β elevation, θ azimuth (from north clockwise),
ω = θ̇ cos β, r range, in non-rotating axes at the observer. With u the line of sight and e_θ, e_β its azimuth and
elevation unit vectors, p = r u and v = r (ṙ/r u + ω e_θ + β̇ e_β) in ENU. shao2012 (20) in its north/east/down axes
is the same six numbers.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from boresight.kernels.options import PART
from boresight.types.sensor import FloatArray

# transition and noise: through Cartesian; shao2012 (26) and (27) as printed; the same with their mistakes put right
EXACT, PRINTED, MENDED = 0, 1, 2


@njit(**PART)
def _triad(azimuth: float, elevation: float) -> FloatArray:
    """Return rows u, e_θ, e_β in ENU."""
    s, c = math.sin(azimuth), math.cos(azimuth)
    se, ce = math.sin(elevation), math.cos(elevation)
    return np.array([[ce * s, ce * c, se], [c, -s, 0.0], [-se * s, -se * c, ce]])


@njit(cache=True)
def cartesian_from_msc(y: FloatArray) -> FloatArray:
    """Return position and velocity relative to the observer (ENU, m, m/s), further states unchanged."""
    x = y.copy()
    E = _triad(y[2], y[0])
    for a in range(3):
        x[a] = E[0, a] / y[5]
        x[3 + a] = (y[4] * E[0, a] + y[3] * E[1, a] + y[1] * E[2, a]) / y[5]
    return x


@njit(cache=True)
def msc_from_cartesian(x: FloatArray) -> FloatArray:
    """Return MSC of position and velocity relative to the observer; straight above it the azimuth is taken as 0."""
    y = x.copy()
    rho = math.hypot(x[0], x[1])
    r = math.hypot(rho, x[2])
    y[0] = math.atan2(x[2], rho)
    y[2] = math.atan2(x[0], x[1])
    E = _triad(y[2], y[0])
    for row, at in ((0, 4), (1, 3), (2, 1)):
        y[at] = (E[row, 0] * x[3] + E[row, 1] * x[4] + E[row, 2] * x[5]) / r
    y[5] = 1.0 / r
    return y


@njit(cache=True)
def world_from_msc(y: FloatArray, own: FloatArray) -> FloatArray:
    """Return the Cartesian world state of MSC `y` about an observer with position and velocity `own` (6,)."""
    x = cartesian_from_msc(y)
    for i in range(6):
        x[i] += own[i]
    return x


@njit(cache=True)
def msc_from_world(x: FloatArray, own: FloatArray) -> FloatArray:
    """Return MSC of the world state `x` about an observer with position and velocity `own` (6,)."""
    s = x.copy()
    for i in range(6):
        s[i] -= own[i]
    return msc_from_cartesian(s)


@njit(cache=True)
def jacobian(y: FloatArray) -> FloatArray:
    """Return J = ∂(cartesian)/∂(msc) (n, n)."""
    n = y.shape[0]
    J = np.eye(n)
    r = 1.0 / y[5]
    se, ce = math.sin(y[0]), math.cos(y[0])
    E = _triad(y[2], y[0])
    for a in range(3):
        u, t, b = E[0, a], E[1, a], E[2, a]
        for j in range(6):
            J[a, j] = 0.0
            J[3 + a, j] = 0.0
        v = y[4] * u + y[3] * t + y[1] * b
        J[a, 0] = r * b
        J[a, 2] = r * ce * t
        J[a, 5] = -r * r * u
        J[3 + a, 0] = r * (y[4] * b - y[1] * u)
        J[3 + a, 1] = r * b
        J[3 + a, 2] = r * (y[4] * ce * t + y[3] * (se * b - ce * u) - y[1] * se * t)
        J[3 + a, 3] = r * t
        J[3 + a, 4] = r * u
        J[3 + a, 5] = -r * r * v
    return J


@njit(cache=True)
def inverse_jacobian(y: FloatArray) -> FloatArray:
    """Return J⁻¹ = ∂(msc)/∂(cartesian) (n, n), solved block by block; finite however near the zenith."""
    n = y.shape[0]
    out = np.eye(n)
    b = y[5]
    ce = max(math.cos(y[0]), 1e-12)
    E = _triad(y[2], y[0])
    J = jacobian(y)
    for a in range(3):
        for column in (a, 3 + a):
            for i in range(6):
                out[i, column] = 0.0
        out[0, a] = b * E[2, a]
        out[2, a] = b * E[1, a] / ce
        out[5, a] = -b * b * E[0, a]
        for row, at in ((0, 4), (1, 3), (2, 1)):
            s = 0.0
            for c in range(3):
                s -= E[row, c] * (J[3 + c, 0] * out[0, a] + J[3 + c, 2] * out[2, a] + J[3 + c, 5] * out[5, a])
            out[at, a] = b * s
            out[at, 3 + a] = b * E[row, a]
    return out


@njit(cache=True)
def first_order_transition(y: FloatArray, T: float, a: FloatArray, printed: bool) -> FloatArray:
    """Return shao2012 (26), as printed (where it diverges) or with its mistakes mended.

    `a` (3,) is the observer's acceleration along the line of sight, e_θ and e_β·(-1) (the paper's A_x, A_y, A_z).
    Mended: the signs of (2,4), (3,1), (6,5); (3,3) is 1; (5,2), (5,4) stand; and the rates at which the observer's
    acceleration turns with the line of sight: (2,1), (2,3), (4,1), (4,3), (5,1), (5,3).
    """
    beta, rate_b, _, w, rho, b = y[0], y[1], y[2], y[3], y[4], y[5]
    sec, tan = 1.0 / math.cos(beta), math.tan(beta)
    F = np.eye(6)
    F[0, 1] = T
    F[1, 0] = -((w * sec) ** 2) * T
    F[1, 1] = 1.0 - 2.0 * rho * T
    F[1, 3] = 2.0 * T * w * tan
    F[1, 4] = -2.0 * rate_b * T
    F[1, 5] = a[2] * T
    F[2, 0] = -T * w * sec * tan
    F[2, 2] = 0.0
    F[2, 3] = T * sec
    F[3, 0] = T * w * rate_b * sec * sec
    F[3, 1] = T * w * tan
    F[3, 3] = 1.0 + T * (rate_b * tan - 2.0 * rho)
    F[3, 4] = -2.0 * w * T
    F[3, 5] = -a[1] * T
    F[4, 1] = 2.0 * rate_b * T
    F[4, 3] = 2.0 * w * T
    F[4, 4] = 1.0 - 2.0 * rho * T
    F[4, 5] = -a[0] * T
    F[5, 4] = b * T
    F[5, 5] = 1.0 - rho * T
    if not printed:
        F[1, 3] = -F[1, 3]
        F[2, 0] = -F[2, 0]
        F[2, 2] = 1.0
        F[5, 4] = -F[5, 4]
        F[1, 0] += T * b * a[0]
        F[1, 2] += T * b * math.sin(beta) * a[1]
        F[3, 2] += T * b * (math.cos(beta) * a[0] + math.sin(beta) * a[2])
        F[4, 0] += T * b * a[2]
        F[4, 2] -= T * b * math.cos(beta) * a[1]
    return F


@njit(cache=True)
def first_order_noise(y: FloatArray, T: float, F: FloatArray, q: float, printed: bool) -> FloatArray:
    """Return shao2012 (27) for white acceleration q (m²/s³), as printed (indefinite) or with ½ for 1 in q12, q34, q56.

    The paper's α = c σ² is q T b²/3, which makes its q22 equal q T b² at first order.
    """
    b = y[5]
    alpha = q * T * b * b / 3.0
    k = 1.0 if printed else 0.5
    Q = np.zeros((6, 6))
    Q[0, 0] = alpha * T * T
    Q[0, 1] = alpha * F[0, 1] * (k + F[1, 1])
    Q[1, 1] = alpha * (F[1, 1] ** 2 + F[1, 1] + 1.0 + F[1, 3] ** 2 + F[1, 4] ** 2)
    Q[2, 2] = alpha * T * T / math.cos(y[0]) ** 2
    Q[2, 3] = alpha * F[2, 3] * (k + F[3, 3])
    Q[3, 3] = alpha * (F[3, 3] ** 2 + F[3, 3] + 1.0 + F[3, 1] ** 2 + F[3, 4] ** 2)
    Q[4, 4] = alpha * (F[4, 4] ** 2 + F[4, 4] + 1.0 + F[4, 3] ** 2 + F[4, 1] ** 2)
    Q[5, 5] = b * b * alpha * T * T
    Q[1, 5] = alpha * F[5, 4] * F[1, 4]
    Q[3, 5] = alpha * F[3, 4] * F[5, 4]
    Q[4, 5] = F[5, 4] * (k + F[4, 4]) * (1.0 if printed else alpha)
    for i in range(6):
        for j in range(i):
            Q[i, j] = Q[j, i]
    return Q
