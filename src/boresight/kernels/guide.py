"""The filter behind a beam: reports of several guide sources, each at its own time, in an inertial frame.

The frame is the Earth's at t = 0: ECEF turned by the Earth's rotation since then. A state is position, velocity, for
near-constant acceleration also acceleration; then the constant biases of the sources that declare them (azimuth,
elevation, range, time; every hypothesis estimates all of them); at its end what a hypothesis is about. There is one
state per hypothesis: "no source is off"; "source s is", by a gross bias (along, across, up of the motion, m); and maybe
"all are a little", by biases in angles and range that nobody declared.
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
# What a report holds: azimuth, elevation, range in its axes (NaN: not measured); ECEF x, y, z; these and maybe a
# velocity.
DIRECTION, POSITION, TRACK = 0, 1, 2
ORBIT, ACCELERATION = 0, 1  # dynamics
N_BIAS = 4  # azimuth, elevation (rad), range (m), time (s): what a source may be off by
BIAS_AZIMUTH, BIAS_ELEVATION, BIAS_RANGE, BIAS_TIME = range(N_BIAS)
# Rows of the one work array, each as wide as a state: a state at the report's time, an innovation, a report (its
# numbers, see `look_at`), coefficients of the second order; then matrices: axes of the report, of the motion, Jacobians
# by the position, by the source's biases and by the state, transition, H P, S, R, and room to multiply in.
ROW_THEN, ROW_Y, ROW_LOOK, ROW_SECOND = 0, 1, 2, 3
ROW_AXES, ROW_MOTION, ROW_A, ROW_BIAS, ROW_F = 4, 7, 10, 13, 19
ROW_H, ROW_G, ROW_S, ROW_R, ROW_ROOM = 28, 34, 40, 46, 52
ROWS, LEAST_WIDTH = 70, 12
# Columns of row LOOK: where the report was made, what it says, its variances, and how far the prediction is (m). Of a
# position or track: the value.
LOOK_ORIGIN, LOOK_Z, LOOK_VARIANCE, LOOK_ACROSS, LOOK_FAR = 0, 3, 6, 9, 10


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
            w[ROW_F + i, j] = 1.0 if i == j else 0.0
    if dt == 0.0:
        return
    if dynamics == ACCELERATION:
        for i in range(3):
            w[ROW_F + i, 3 + i] = w[ROW_F + 3 + i, 6 + i] = dt
            w[ROW_F + i, 6 + i] = h2
            x[i] += dt * x[3 + i] + h2 * x[6 + i]
            x[3 + i] += dt * x[6 + i]
        return
    r2 = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
    k = MU / (r2 * math.sqrt(r2))
    k3, h3 = 3.0 * k / r2, h2 * dt / 3.0
    for i in range(3):
        for j in range(3):
            g = k3 * x[i] * x[j] - (k if i == j else 0.0)
            w[ROW_F + i, j] += h2 * g
            w[ROW_F + i, 3 + j] = h3 * g + (dt if i == j else 0.0)
            w[ROW_F + 3 + i, j] = dt * g
            w[ROW_F + 3 + i, 3 + j] += h2 * g
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
            w[ROW_ROOM + j, i] = w[ROW_F + i, j]
    for i in range(m):  # P F'
        for j in range(m):
            w[ROW_ROOM + m + i, j] = 0.0
        for k in range(m):
            a = P[i, k]
            for j in range(m):
                w[ROW_ROOM + m + i, j] += a * w[ROW_ROOM + k, j]
    for i in range(m):
        for j in range(m):
            P[i, j] = 0.0
        for k in range(m):
            a = w[ROW_F + i, k]
            for j in range(m):
                P[i, j] += a * w[ROW_ROOM + m + k, j]
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
            w[ROW_ROOM + i, 0] = P[i, j]
        for i in range(m):
            total = 0.0
            for k in range(m):
                total += w[ROW_F + i, k] * w[ROW_ROOM + k, 0]
            P[i, j] = P[j, i] = total
    for i in range(m // 3):
        for j in range(m // 3):
            a = noise(dynamics, q, dt, i, j)
            for axis in range(3):
                P[3 * i + axis, 3 * j + axis] += a


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def motion_axes(x: FloatArray, w: FloatArray) -> None:
    """Fill rows MOTION of `w` (3, 3) with columns along, across and up of the motion."""
    r = math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    c0, c1, c2 = x[4] * x[2] - x[5] * x[1], x[5] * x[0] - x[3] * x[2], x[3] * x[1] - x[4] * x[0]
    c = math.sqrt(c0 * c0 + c1 * c1 + c2 * c2)
    u0, u1, u2 = x[0] / r, x[1] / r, x[2] / r
    if c < 1e-9 * r:
        c0, c1, c2, c = -u1, u0, 0.0, max(math.sqrt(u0 * u0 + u1 * u1), 1e-12)
    c0, c1, c2 = c0 / c, c1 / c, c2 / c
    w[ROW_MOTION, 0] = u1 * c2 - u2 * c1
    w[ROW_MOTION + 1, 0] = u2 * c0 - u0 * c2
    w[ROW_MOTION + 2, 0] = u0 * c1 - u1 * c0
    w[ROW_MOTION, 1], w[ROW_MOTION + 1, 1], w[ROW_MOTION + 2, 1] = c0, c1, c2
    w[ROW_MOTION, 2], w[ROW_MOTION + 1, 2], w[ROW_MOTION + 2, 2] = u0, u1, u2


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
    """Turn a report to the inertial frame, once for all hypotheses, into row LOOK of `w`; how many numbers it holds.

    `sigma` (4,) of a direction: azimuth, elevation (rad), range (m), and whether the first counts across the line of
    sight (1) or about the vertical (0). A number that is NaN, or that the source has no sigma for, was not measured.
    Of a position or track `sigma[0]` is a factor: rows R hold sigma² axes axes' (turned to the inertial frame).
    """
    c, s = math.cos(EARTH_RATE * t), math.sin(EARTH_RATE * t)
    if kind == DIRECTION:
        w[ROW_LOOK, 0], w[ROW_LOOK, 1], w[ROW_LOOK, 2] = (
            c * origin[0] - s * origin[1],
            s * origin[0] + c * origin[1],
            origin[2],
        )
        for j in range(3):
            w[ROW_AXES, j] = c * axes[0, j] - s * axes[1, j]
            w[ROW_AXES + 1, j] = s * axes[0, j] + c * axes[1, j]
            w[ROW_AXES + 2, j] = axes[2, j]
        held = 0
        for j in range(3):
            measured = sigma[j] > 0.0 and not math.isnan(z[j])
            w[ROW_LOOK, LOOK_Z + j] = z[j] if measured else math.nan
            w[ROW_LOOK, LOOK_VARIANCE + j] = sigma[j] * sigma[j] * scale
            held += measured
        w[ROW_LOOK, LOOK_ACROSS] = sigma[3]
        return held
    a = sigma[0] * sigma[0] * scale
    w[ROW_LOOK, 0], w[ROW_LOOK, 1], w[ROW_LOOK, 2] = c * z[0] - s * z[1], s * z[0] + c * z[1], z[2]
    k = 3
    if kind == TRACK and len(z) > 3:
        k = 6
        w[ROW_LOOK, 3], w[ROW_LOOK, 4] = (
            c * z[3] - s * z[4] - EARTH_RATE * w[ROW_LOOK, 1],
            s * z[3] + c * z[4] + EARTH_RATE * w[ROW_LOOK, 0],
        )
        w[ROW_LOOK, 5] = z[5]
    for i in range(k):
        for j in range(i, k):
            total = 0.0
            for b in range(k):
                total += axes[i, b] * axes[j, b]
            w[ROW_R + i, j] = w[ROW_R + j, i] = total * a
    for first in range(0, k, 3):
        for j in range(k):
            x, y = w[ROW_R + first, j], w[ROW_R + first + 1, j]
            w[ROW_R + first, j], w[ROW_R + first + 1, j] = c * x - s * y, s * x + c * y
    for first in range(0, k, 3):
        for i in range(k):
            x, y = w[ROW_R + i, first], w[ROW_R + i, first + 1]
            w[ROW_R + i, first], w[ROW_R + i, first + 1] = c * x - s * y, s * x + c * y
    return k


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def compare_position(dynamics: int, k: int, w: FloatArray) -> None:
    """Fill rows Y (k,), A (3, 3), the Jacobian by the position (one), and BIAS (k, 4) for a position or track.

    What is in Y beyond the third are velocities, whose Jacobian is one. A bias in time moves both along the way.
    """
    for i in range(3):
        for j in range(3):
            w[ROW_A + i, j] = 1.0 if i == j else 0.0
    for i in range(k):
        w[ROW_Y, i] = w[ROW_LOOK, i] - w[ROW_THEN, i]
        w[ROW_SECOND, i] = 0.0
        for j in range(N_BIAS):
            w[ROW_BIAS + i, j] = 0.0
    w[ROW_BIAS, BIAS_TIME] = -w[ROW_THEN, 3] - EARTH_RATE * w[ROW_THEN, 1]
    w[ROW_BIAS + 1, BIAS_TIME] = -w[ROW_THEN, 4] + EARTH_RATE * w[ROW_THEN, 0]
    w[ROW_BIAS + 2, BIAS_TIME] = -w[ROW_THEN, 5]
    if k > 3:
        if dynamics == ORBIT:
            a0, a1, a2 = gravity(w[ROW_THEN, 0], w[ROW_THEN, 1], w[ROW_THEN, 2])
        else:
            a0, a1, a2 = w[ROW_THEN, 6], w[ROW_THEN, 7], w[ROW_THEN, 8]
        w[ROW_BIAS + 3, BIAS_TIME], w[ROW_BIAS + 4, BIAS_TIME], w[ROW_BIAS + 5, BIAS_TIME] = -a0, -a1, -a2


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def compare_direction(bias_azimuth: float, bias_elevation: float, bias_range: float, w: FloatArray) -> None:
    """Fill rows Y (k,), A (k, 3), the Jacobian by the position, BIAS (k, 4), R (k, k) and SECOND (k,) for a direction.

    The state is in row THEN, the report in LOOK, the biases (rad, rad, m) are those that the state holds. Both angles
    are compared across the predicted line of sight, so that no pole is special: the measurement's own east and up,
    carried to it along the great circle. One angle alone is compared at the prediction; SECOND holds what its
    curvature adds to its variance for the square of the predicted variance.
    """
    d0, d1, d2 = w[ROW_THEN, 0] - w[ROW_LOOK, 0], w[ROW_THEN, 1] - w[ROW_LOOK, 1], w[ROW_THEN, 2] - w[ROW_LOOK, 2]
    r = math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    w[ROW_LOOK, LOOK_FAR] = r
    d0, d1, d2 = d0 / r, d1 / r, d2 / r
    azimuth, elevation = w[ROW_LOOK, LOOK_Z] - bias_azimuth, w[ROW_LOOK, LOOK_Z + 1] - bias_elevation
    both = not (math.isnan(azimuth) or math.isnan(elevation))
    # the prediction in the report's own axes
    p0 = w[ROW_AXES, 0] * d0 + w[ROW_AXES + 1, 0] * d1 + w[ROW_AXES + 2, 0] * d2
    p1 = w[ROW_AXES, 1] * d0 + w[ROW_AXES + 1, 1] * d1 + w[ROW_AXES + 2, 1] * d2
    p2 = w[ROW_AXES, 2] * d0 + w[ROW_AXES + 1, 2] * d1 + w[ROW_AXES + 2, 2] * d2
    if both:
        sa, ca, se, ce = math.sin(azimuth), math.cos(azimuth), math.sin(elevation), math.cos(elevation)
    else:
        ce, se = max(math.sqrt(p0 * p0 + p1 * p1), 1e-6), p2
        sa, ca = p0 / ce, p1 / ce
    # east and up across the line of sight, in the report's axes
    a0, a1, a2 = ca, -sa, 0.0
    e0, e1, e2 = -se * sa, -se * ca, ce
    ya, ye = 0.0, 0.0
    if both:
        u0, u1, u2 = ce * sa, ce * ca, se
        pa = a0 * p0 + a1 * p1
        pe = e0 * p0 + e1 * p1 + e2 * p2
        pu = u0 * p0 + u1 * p1 + u2 * p2
        across = math.sqrt(pa * pa + pe * pe)
        q = math.atan2(across, pu) / across if across > 1e-12 else 1.0
        ya, ye = -q * pa, -q * pe
        if pu > -0.999:
            q = 1.0 / (1.0 + pu)
            a0, a1, a2 = a0 - q * pa * (u0 + p0), a1 - q * pa * (u1 + p1), -q * pa * (u2 + p2)
            e0, e1, e2 = e0 - q * pe * (u0 + p0), e1 - q * pe * (u1 + p1), e2 - q * pe * (u2 + p2)
    elif not math.isnan(azimuth):
        ya = azimuth - math.atan2(p0, p1)
        ya = ce * math.atan2(math.sin(ya), math.cos(ya))
    else:
        ye = elevation - math.atan2(p2, ce)
    va, ve = w[ROW_LOOK, LOOK_VARIANCE], w[ROW_LOOK, LOOK_VARIANCE + 1]
    if w[ROW_LOOK, LOOK_ACROSS] == 0.0:  # about the vertical; at the zenith the noise of the elevation counts in it
        va *= ce * ce + ve
    k = 0
    for part in range(3):
        if math.isnan(w[ROW_LOOK, LOOK_Z + part]):
            continue
        for j in range(3):
            w[ROW_R + k, j] = w[ROW_R + j, k] = 0.0
            w[ROW_BIAS + k, j] = 0.0
        w[ROW_SECOND, k] = 0.0
        if part == 0:
            x0, x1, x2, y, v, slope = a0 / r, a1 / r, a2 / r, ya, va, ce
            if not both:
                w[ROW_SECOND, k] = 1.0 / (ce * ce)
        elif part == 1:
            x0, x1, x2, y, v, slope = e0 / r, e1 / r, e2 / r, ye, ve, 1.0
            if not both:
                w[ROW_SECOND, k] = 0.75 * se * se / (ce * ce)
        else:
            x0, x1, x2, y, v, slope = (
                p0,
                p1,
                p2,
                w[ROW_LOOK, LOOK_Z + 2] - bias_range - r,
                w[ROW_LOOK, LOOK_VARIANCE + 2],
                1.0,
            )
        b0 = w[ROW_AXES, 0] * x0 + w[ROW_AXES, 1] * x1 + w[ROW_AXES, 2] * x2
        b1 = w[ROW_AXES + 1, 0] * x0 + w[ROW_AXES + 1, 1] * x1 + w[ROW_AXES + 1, 2] * x2
        b2 = w[ROW_AXES + 2, 0] * x0 + w[ROW_AXES + 2, 1] * x1 + w[ROW_AXES + 2, 2] * x2
        w[ROW_Y, k] = y
        w[ROW_A + k, 0], w[ROW_A + k, 1], w[ROW_A + k, 2] = b0, b1, b2
        w[ROW_R + k, k] = v
        w[ROW_BIAS + k, part] = slope
        w[ROW_BIAS + k, BIAS_TIME] = -(
            b0 * (w[ROW_THEN, 3] + EARTH_RATE * w[ROW_THEN, 1])
            + b1 * (w[ROW_THEN, 4] - EARTH_RATE * w[ROW_THEN, 0])
            + b2 * w[ROW_THEN, 5]
        )
        k += 1
