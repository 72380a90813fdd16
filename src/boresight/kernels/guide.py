"""The filter behind a beam: reports of several guide sources, each at its own time, in an inertial frame.

The frame is the Earth's at t = 0: ECEF turned by the Earth's rotation since then. A state is position, velocity, for
near-constant acceleration also acceleration, and at its end the bias (along, across, up of the motion, m) of one
source. There is one state per hypothesis: "no source is biased", "source s is".
"""

from __future__ import annotations

import math

from numba import njit

from boresight.kernels.options import PART
from boresight.types.sensor import FloatArray

MU = 3.986004418e14  # m³/s²
J2 = 1.08262668e-3
EARTH_RATE = 7.2921150e-5  # rad/s
EQUATOR = 6378137.0  # m
LONGEST = 10.0  # s, of one step of the integration
# What a report holds: azimuth, elevation, range (NaN: none) in its axes; ECEF x, y, z; these and maybe a velocity.
DIRECTION, POSITION, TRACK = 0, 1, 2
ORBIT, ACCELERATION = 0, 1  # dynamics
# Rows of the one work array: a state then, an innovation, a report; matrices of 3, 3, 9, 6, 6, 6, 6 and 18 rows.
THEN, Y, LOOK, B, A, F, H, G, S, R, W = 0, 1, 2, 3, 6, 9, 18, 24, 30, 36, 42
WORK = (60, 12)


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def gravity(x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return the acceleration (m/s²) of two bodies and the oblateness (J2) at an inertial position (m)."""
    r2 = x * x + y * y + z * z
    r = math.sqrt(r2)
    k = -MU / (r2 * r)
    j = 1.5 * J2 * EQUATOR * EQUATOR / r2
    s = 5.0 * z * z / r2
    return k * x * (1.0 + j * (1.0 - s)), k * y * (1.0 + j * (1.0 - s)), k * z * (1.0 + j * (3.0 - s))


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def fly(x: FloatArray, dt: float) -> None:
    """Advance position and velocity (6,) on their orbit by `dt` (s, either sign), in place: Runge–Kutta 4."""
    steps = max(1, math.ceil(abs(dt) / LONGEST))
    h = dt / steps
    for _ in range(steps):
        r0, r1, r2, v0, v1, v2 = x[0], x[1], x[2], x[3], x[4], x[5]
        a0, a1, a2 = gravity(r0, r1, r2)
        k = 0.5 * h
        b0, b1, b2 = gravity(r0 + k * v0, r1 + k * v1, r2 + k * v2)
        q = k * k
        c0, c1, c2 = gravity(r0 + k * v0 + q * a0, r1 + k * v1 + q * a1, r2 + k * v2 + q * a2)
        p = h * k
        d0, d1, d2 = gravity(r0 + h * v0 + p * b0, r1 + h * v1 + p * b1, r2 + h * v2 + p * b2)
        w = h * h / 6.0
        x[0] = r0 + h * v0 + w * (a0 + b0 + c0)
        x[1] = r1 + h * v1 + w * (a1 + b1 + c1)
        x[2] = r2 + h * v2 + w * (a2 + b2 + c2)
        w = h / 6.0
        x[3] = v0 + w * (a0 + 2.0 * (b0 + c0) + d0)
        x[4] = v1 + w * (a1 + 2.0 * (b1 + c1) + d1)
        x[5] = v2 + w * (a2 + 2.0 * (b2 + c2) + d2)


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def advance(x: FloatArray, dynamics: int, dt: float, w: FloatArray) -> None:
    """Advance a state in place by `dt` (s) and fill rows F of `w` with its transition (6, 6) or (9, 9)."""
    m = 6 if dynamics == ORBIT else 9
    h2 = 0.5 * dt * dt
    for i in range(m):
        for j in range(m):
            w[F + i, j] = 1.0 if i == j else 0.0
    if dt == 0.0:
        return
    if dynamics == ACCELERATION:
        for i in range(3):
            w[F + i, 3 + i] = w[F + 3 + i, 6 + i] = dt
            w[F + i, 6 + i] = h2
            x[i] += dt * x[3 + i] + h2 * x[6 + i]
            x[3 + i] += dt * x[6 + i]
        return
    r2 = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
    k = MU / (r2 * math.sqrt(r2))
    k3, h3 = 3.0 * k / r2, h2 * dt / 3.0
    for i in range(3):
        for j in range(3):
            g = k3 * x[i] * x[j] - (k if i == j else 0.0)
            w[F + i, j] += h2 * g
            w[F + i, 3 + j] = h3 * g + (dt if i == j else 0.0)
            w[F + 3 + i, j] = dt * g
            w[F + 3 + i, 3 + j] += h2 * g
    fly(x, dt)


@njit(**PART)
def noise(dynamics: int, q: float, dt: float, i: int, j: int) -> float:
    """Return the process noise between derivatives i and j of one axis over `dt` (s, positive)."""
    if dynamics == ORBIT:  # white acceleration (m²/s³)
        return q * (dt * dt * dt / 3.0 if i + j == 0 else (0.5 * dt * dt if i + j == 1 else dt))
    n = 5 - i - j  # white jerk (m²/s⁵): dt^n / n / (2 - i)! / (2 - j)!
    return q * dt**n / (n * (2.0 if i == 0 else 1.0) * (2.0 if j == 0 else 1.0))


@njit(cache=True, forceinline=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def carry(m: int, P: FloatArray, w: FloatArray) -> None:
    """Set the block (m, m) of `P` to F P F'; call it with `m` a constant, so that the compiler unrolls its loops."""
    for i in range(m):
        for j in range(m):
            w[W + j, i] = w[F + i, j]
    for i in range(m):  # P F'
        for j in range(m):
            w[W + m + i, j] = 0.0
        for k in range(m):
            a = P[i, k]
            for j in range(m):
                w[W + m + i, j] += a * w[W + k, j]
    for i in range(m):
        for j in range(m):
            P[i, j] = 0.0
        for k in range(m):
            a = w[F + i, k]
            for j in range(m):
                P[i, j] += a * w[W + m + k, j]
    for i in range(m):
        for j in range(i):
            P[i, j] = P[j, i]


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def predict(x: FloatArray, P: FloatArray, n: int, dynamics: int, q: float, dt: float, w: FloatArray) -> None:
    """Advance the first `n` of a state and of its covariance in place by `dt` >= 0."""
    advance(x, dynamics, dt, w)
    if dynamics == ORBIT:
        m = 6
        carry(6, P, w)
    else:
        m = 9
        carry(9, P, w)
    for j in range(m, n):
        for i in range(m):
            w[W + i, 0] = P[i, j]
        for i in range(m):
            total = 0.0
            for k in range(m):
                total += w[F + i, k] * w[W + k, 0]
            P[i, j] = P[j, i] = total
    for i in range(m // 3):
        for j in range(m // 3):
            a = noise(dynamics, q, dt, i, j)
            for axis in range(3):
                P[3 * i + axis, 3 * j + axis] += a


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def motion_axes(x: FloatArray, w: FloatArray) -> None:
    """Fill rows B of `w` (3, 3) with columns along, across and up of the motion."""
    r = math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    c0, c1, c2 = x[4] * x[2] - x[5] * x[1], x[5] * x[0] - x[3] * x[2], x[3] * x[1] - x[4] * x[0]
    c = math.sqrt(c0 * c0 + c1 * c1 + c2 * c2)
    u0, u1, u2 = x[0] / r, x[1] / r, x[2] / r
    if c < 1e-9 * r:
        c0, c1, c2, c = -u1, u0, 0.0, max(math.sqrt(u0 * u0 + u1 * u1), 1e-12)
    c0, c1, c2 = c0 / c, c1 / c, c2 / c
    w[B, 0], w[B + 1, 0], w[B + 2, 0] = u1 * c2 - u2 * c1, u2 * c0 - u0 * c2, u0 * c1 - u1 * c0
    w[B, 1], w[B + 1, 1], w[B + 2, 1] = c0, c1, c2
    w[B, 2], w[B + 1, 2], w[B + 2, 2] = u0, u1, u2


@njit(**PART)
def spin(t: float, a: FloatArray, out: FloatArray) -> None:
    """Turn ECEF (3,) at time `t` to the inertial frame."""
    c, s = math.cos(EARTH_RATE * t), math.sin(EARTH_RATE * t)
    out[0], out[1], out[2] = c * a[0] - s * a[1], s * a[0] + c * a[1], a[2]


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def look_at(
    kind: int, t: float, z: FloatArray, origin: FloatArray, axes: FloatArray, sigma: FloatArray, scale: float,
    w: FloatArray,
) -> int:  # fmt: skip
    """Turn a report to the inertial frame, once for all hypotheses, into rows LOOK and R of `w`; the dimension.

    A direction: where from, the unit vector there, range (m, NaN: none); R is diagonal, across (rad²) and along (m²).
    A position or track: position, velocity; R is sigma² axes axes' (both turned to the inertial frame).
    """
    c, s = math.cos(EARTH_RATE * t), math.sin(EARTH_RATE * t)
    a = sigma[0] * sigma[0] * scale
    if kind == DIRECTION:
        w[LOOK, 0], w[LOOK, 1], w[LOOK, 2] = c * origin[0] - s * origin[1], s * origin[0] + c * origin[1], origin[2]
        ce = math.cos(z[1])
        w0, w1, w2 = ce * math.sin(z[0]), ce * math.cos(z[0]), math.sin(z[1])
        u0 = axes[0, 0] * w0 + axes[0, 1] * w1 + axes[0, 2] * w2
        u1 = axes[1, 0] * w0 + axes[1, 1] * w1 + axes[1, 2] * w2
        w[LOOK, 3], w[LOOK, 4] = c * u0 - s * u1, s * u0 + c * u1
        w[LOOK, 5] = axes[2, 0] * w0 + axes[2, 1] * w1 + axes[2, 2] * w2
        w[LOOK, 6] = z[2]
        for i in range(3):
            for j in range(3):
                w[R + i, j] = 0.0
        w[R, 0] = w[R + 1, 1] = a
        w[R + 2, 2] = sigma[1] * sigma[1] * scale
        return 2 if math.isnan(z[2]) else 3
    w[LOOK, 0], w[LOOK, 1], w[LOOK, 2] = c * z[0] - s * z[1], s * z[0] + c * z[1], z[2]
    k = 3
    if kind == TRACK and len(z) > 3:
        k = 6
        w[LOOK, 3], w[LOOK, 4] = (
            c * z[3] - s * z[4] - EARTH_RATE * w[LOOK, 1],
            s * z[3] + c * z[4] + EARTH_RATE * w[LOOK, 0],
        )
        w[LOOK, 5] = z[5]
    for i in range(k):
        for j in range(i, k):
            total = 0.0
            for b in range(k):
                total += axes[i, b] * axes[j, b]
            w[R + i, j] = w[R + j, i] = total * a
    for first in range(0, k, 3):
        for j in range(k):
            x, y = w[R + first, j], w[R + first + 1, j]
            w[R + first, j], w[R + first + 1, j] = c * x - s * y, s * x + c * y
    for first in range(0, k, 3):
        for i in range(k):
            x, y = w[R + i, first], w[R + i, first + 1]
            w[R + i, first], w[R + i, first + 1] = c * x - s * y, s * x + c * y
    return k


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def compare(kind: int, k: int, w: FloatArray) -> None:
    """Fill rows Y (k,) and A (3, 3), the Jacobian by the position, for the state in row THEN and the report in LOOK.

    A direction is compared across the predicted line of sight (two small angles), so that no pole is special.
    What is in Y beyond the third are velocities, whose Jacobian is one.
    """
    if kind != DIRECTION:
        for i in range(3):
            for j in range(3):
                w[A + i, j] = 1.0 if i == j else 0.0
        for i in range(k):
            w[Y, i] = w[LOOK, i] - w[THEN, i]
        return
    d0, d1, d2 = w[THEN, 0] - w[LOOK, 0], w[THEN, 1] - w[LOOK, 1], w[THEN, 2] - w[LOOK, 2]
    u0, u1, u2 = w[LOOK, 3], w[LOOK, 4], w[LOOK, 5]
    r = math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    e0, e1, e2 = d0 / r, d1 / r, d2 / r
    # two unit vectors across the line of sight
    if abs(e2) < 0.9:
        q = 1.0 / math.sqrt(e0 * e0 + e1 * e1)
        f0, f1, f2 = -e1 * q, e0 * q, 0.0
    else:
        q = 1.0 / math.sqrt(e1 * e1 + e2 * e2)
        f0, f1, f2 = 0.0, -e2 * q, e1 * q
    g0, g1, g2 = e1 * f2 - e2 * f1, e2 * f0 - e0 * f2, e0 * f1 - e1 * f0
    a = f0 * u0 + f1 * u1 + f2 * u2
    b = g0 * u0 + g1 * u1 + g2 * u2
    along = e0 * u0 + e1 * u1 + e2 * u2
    across = math.sqrt(a * a + b * b)
    q = math.atan2(across, along) / across if across > 1e-12 else 1.0
    w[Y, 0], w[Y, 1] = q * a, q * b
    w[A, 0], w[A, 1], w[A, 2] = f0 / r, f1 / r, f2 / r
    w[A + 1, 0], w[A + 1, 1], w[A + 1, 2] = g0 / r, g1 / r, g2 / r
    if k == 3:
        w[Y, 2] = w[LOOK, 6] - r
        w[A + 2, 0], w[A + 2, 1], w[A + 2, 2] = e0, e1, e2
