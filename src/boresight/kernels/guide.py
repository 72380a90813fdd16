"""The filter behind a beam: reports of several guide sources, each at its own time, in an inertial frame.

The frame is the Earth's at t = 0: ECEF turned by the Earth's rotation since then. A state is position, velocity, for
near-constant acceleration also acceleration, and at its end the bias (along, across, up of the motion, m) of one
source. There is one state per hypothesis: "no source is biased", "source s is".
"""

from __future__ import annotations

import math

from numba import njit

from boresight.types.sensor import FloatArray

MU = 3.986004418e14  # m³/s²
J2 = 1.08262668e-3
EARTH_RATE = 7.2921150e-5  # rad/s
EQUATOR = 6378137.0  # m
LONGEST = 10.0  # s, of one step of the integration
DIRECTION, POSITION = 0, 1  # what a report holds: azimuth, elevation, range (NaN: none) in its axes; or ECEF x, y, z
ORBIT, ACCELERATION = 0, 1  # dynamics


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
def advance(x: FloatArray, dynamics: int, dt: float, F: FloatArray) -> None:
    """Advance a state in place by `dt` (s) and fill `F` (m, m), m = 6 or 9, with its transition."""
    F[:] = 0.0
    h2 = 0.5 * dt * dt
    for i in range(len(F)):
        F[i, i] = 1.0
    if dt == 0.0:
        return
    if dynamics == ACCELERATION:
        for i in range(3):
            F[i, 3 + i] = F[3 + i, 6 + i] = dt
            F[i, 6 + i] = h2
            x[i] += dt * x[3 + i] + h2 * x[6 + i]
            x[3 + i] += dt * x[6 + i]
        return
    r2 = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
    k = MU / (r2 * math.sqrt(r2))
    h3 = h2 * dt / 3.0
    for i in range(3):
        for j in range(3):
            g = 3.0 * k * x[i] * x[j] / r2 - (k if i == j else 0.0)
            F[i, j] += h2 * g
            F[i, 3 + j] = h3 * g + (dt if i == j else 0.0)
            F[3 + i, j] = dt * g
            F[3 + i, 3 + j] += h2 * g
    fly(x, dt)


@njit(cache=True)
def noise(dynamics: int, q: float, dt: float, i: int, j: int) -> float:
    """Return the process noise between derivatives i and j of one axis over `dt` (s, positive)."""
    if dynamics == ORBIT:  # white acceleration (m²/s³)
        return q * (dt * dt * dt / 3.0 if i + j == 0 else (0.5 * dt * dt if i + j == 1 else dt))
    n = 5 - i - j  # white jerk (m²/s⁵): dt^n / n / (2 - i)! / (2 - j)!
    return q * dt**n / (n * (2.0 if i == 0 else 1.0) * (2.0 if j == 0 else 1.0))


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def predict(x: FloatArray, P: FloatArray, dynamics: int, q: float, dt: float, F: FloatArray, W: FloatArray) -> None:
    """Advance state (n,) and covariance (n, n) in place by `dt` >= 0; `F` (m, m) and `W` (m, n) are work space."""
    m, n = len(F), len(x)
    advance(x, dynamics, dt, F)
    for i in range(m):
        for j in range(n):
            total = 0.0
            for k in range(m):
                total += F[i, k] * P[k, j]
            W[i, j] = total
    for i in range(m):
        for j in range(i, m):
            total = 0.0
            for k in range(m):
                total += W[i, k] * F[j, k]
            P[i, j] = P[j, i] = total
        for j in range(m, n):
            P[i, j] = P[j, i] = W[i, j]
    for axis in range(3):
        for i in range(m // 3):
            for j in range(m // 3):
                P[3 * i + axis, 3 * j + axis] += noise(dynamics, q, dt, i, j)


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def motion_axes(x: FloatArray, B: FloatArray) -> None:
    """Fill `B` (3, 3) with columns along, across and up of the motion."""
    r = math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    c0, c1, c2 = x[4] * x[2] - x[5] * x[1], x[5] * x[0] - x[3] * x[2], x[3] * x[1] - x[4] * x[0]
    c = math.sqrt(c0 * c0 + c1 * c1 + c2 * c2)
    u0, u1, u2 = x[0] / r, x[1] / r, x[2] / r
    if c < 1e-9 * r:
        c0, c1, c2, c = -u1, u0, 0.0, max(math.sqrt(u0 * u0 + u1 * u1), 1e-12)
    c0, c1, c2 = c0 / c, c1 / c, c2 / c
    B[0, 0], B[1, 0], B[2, 0] = u1 * c2 - u2 * c1, u2 * c0 - u0 * c2, u0 * c1 - u1 * c0
    B[0, 1], B[1, 1], B[2, 1] = c0, c1, c2
    B[0, 2], B[1, 2], B[2, 2] = u0, u1, u2


@njit(cache=True)
def spin(t: float, a: FloatArray, out: FloatArray) -> None:
    """Turn ECEF (3,) at time `t` to the inertial frame."""
    c, s = math.cos(EARTH_RATE * t), math.sin(EARTH_RATE * t)
    out[0], out[1], out[2] = c * a[0] - s * a[1], s * a[0] + c * a[1], a[2]


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def compare(
    p: FloatArray, kind: int, t: float, z: FloatArray, origin: FloatArray, axes: FloatArray,
    y: FloatArray, A: FloatArray, s: FloatArray, u: FloatArray,
) -> int:  # fmt: skip
    """Fill innovation `y` (3,) and Jacobian `A` (3, 3) against an inertial position `p` (3,); return the dimension.

    A direction is compared across the predicted line of sight (two small angles), so that no pole is special.
    `s`, `u` (3,) are work space.
    """
    if kind == POSITION:
        spin(t, z, s)
        for i in range(3):
            y[i] = s[i] - p[i]
            for j in range(3):
                A[i, j] = 1.0 if i == j else 0.0
        return 3
    spin(t, origin, s)
    d0, d1, d2 = p[0] - s[0], p[1] - s[1], p[2] - s[2]
    r = math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    e0, e1, e2 = d0 / r, d1 / r, d2 / r
    ce = math.cos(z[1])
    w0, w1, w2 = ce * math.sin(z[0]), ce * math.cos(z[0]), math.sin(z[1])
    for i in range(3):
        u[i] = axes[i, 0] * w0 + axes[i, 1] * w1 + axes[i, 2] * w2
    spin(t, u, s)
    # two unit vectors across the line of sight
    if abs(e2) < 0.9:
        k = 1.0 / math.sqrt(e0 * e0 + e1 * e1)
        f0, f1, f2 = -e1 * k, e0 * k, 0.0
    else:
        k = 1.0 / math.sqrt(e1 * e1 + e2 * e2)
        f0, f1, f2 = 0.0, -e2 * k, e1 * k
    g0, g1, g2 = e1 * f2 - e2 * f1, e2 * f0 - e0 * f2, e0 * f1 - e1 * f0
    a = f0 * s[0] + f1 * s[1] + f2 * s[2]
    b = g0 * s[0] + g1 * s[1] + g2 * s[2]
    along = e0 * s[0] + e1 * s[1] + e2 * s[2]
    across = math.sqrt(a * a + b * b)
    k = math.atan2(across, along) / across if across > 1e-12 else 1.0
    y[0], y[1] = k * a, k * b
    A[0, 0], A[0, 1], A[0, 2] = f0 / r, f1 / r, f2 / r
    A[1, 0], A[1, 1], A[1, 2] = g0 / r, g1 / r, g2 / r
    if math.isnan(z[2]):
        return 2
    y[2] = z[2] - r
    A[2, 0], A[2, 1], A[2, 2] = e0, e1, e2
    return 3
