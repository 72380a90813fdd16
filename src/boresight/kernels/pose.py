"""Where a platform was and how it was turned between its navigation stamps."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from boresight.kernels import geodesy, rotation
from boresight.kernels.options import PART
from boresight.kernels.write import write_matrix
from boresight.types.sensor import FloatArray

_ecef_from_enu = geodesy.ecef_from_enu
_geodetic_from_ecef = geodesy.geodetic_from_ecef
_ecef_from_enu_rotation = geodesy.ecef_from_enu_rotation
_fill_rotation = geodesy.fill_ecef_from_enu
_fill_matrix = rotation.fill_matrix
_step_between = rotation.step_between
_multiply = rotation.multiply
_from_rotation_vector = rotation.quaternion_from_rotation_vector

FIT_SPAN = 1.0  # s that the last four attitude stamps may span for their curve to be worth following


@njit(**PART)
def segment(nodes: FloatArray, t: float) -> int:
    """Return i with nodes[i] <= t < nodes[i + 1], kept within the first and the last segment."""
    i = int(np.searchsorted(nodes, t, side="right")) - 1
    return min(max(i, 0), max(len(nodes) - 2, 0))


@njit(cache=True)
def interpolate_position(
    nodes: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    hermite: NDArray[np.bool_],
    t: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return position and velocity (n, 3) at `t`: cubic Hermite where `hermite`, else linear in both.

    Before the first and after the last node: constant velocity of that node.
    """
    p = np.empty((len(t), 3))
    v = np.empty((len(t), 3))
    last = len(nodes) - 1
    for k in range(len(t)):
        if t[k] <= nodes[0] or t[k] >= nodes[last]:
            end = 0 if t[k] <= nodes[0] else last
            for j in range(3):
                v[k, j] = velocity[end, j]
                p[k, j] = position[end, j] + velocity[end, j] * (t[k] - nodes[end])
            continue
        i = segment(nodes, t[k])
        h = nodes[i + 1] - nodes[i]
        s = (t[k] - nodes[i]) / h
        for j in range(3):
            p0, p1, v0, v1 = position[i, j], position[i + 1, j], velocity[i, j], velocity[i + 1, j]
            if hermite[i]:
                # p0 + s (h v0 + s (3 d - h (2 v0 + v1) + s (h (v0 + v1) - 2 d))), d = p1 - p0
                d = p1 - p0
                b = 3.0 * d - h * (2.0 * v0 + v1)
                c = h * (v0 + v1) - 2.0 * d
                p[k, j] = p0 + s * (h * v0 + s * (b + s * c))
                v[k, j] = v0 + s * (2.0 * b + 3.0 * s * c) / h
            else:
                p[k, j] = p0 + s * (p1 - p0)
                v[k, j] = v0 + s * (v1 - v0)
    return p, v


@njit(cache=True)
def interpolate_attitude(
    nodes: FloatArray, quaternion: FloatArray, steps: FloatArray, t: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return rotations (n, 3, 3) and body rates (n, 3) (rad/s, in body axes) at `t` by slerp.

    `steps` (m - 1, 3) are the rotation vectors between the nodes. Before the first and after
    the last node the turning goes on, after it with the change of rate that the last four stamps show.
    """
    R = np.empty((len(t), 3, 3))
    rate = np.zeros((len(t), 3))
    last = len(nodes) - 1
    steady = last >= 3 and nodes[last] - nodes[last - 3] <= FIT_SPAN
    for k in range(len(t)):
        if steady and t[k] > nodes[last]:
            _foretell(nodes[last - 3 :], quaternion[last - 3 :], t[k], R[k], rate[k])
            continue
        i = segment(nodes, t[k])
        w, x, y, z = quaternion[i, 0], quaternion[i, 1], quaternion[i, 2], quaternion[i, 3]
        if len(nodes) > 1:
            h = nodes[i + 1] - nodes[i]
            a, b, c = steps[i, 0] / h, steps[i, 1] / h, steps[i, 2] / h
            rate[k, 0], rate[k, 1], rate[k, 2] = a, b, c
            dw, dx, dy, dz = _turn(a, b, c, t[k] - nodes[i])
            w, x, y, z = (
                w * dw - x * dx - y * dy - z * dz,
                w * dx + x * dw + y * dz - z * dy,
                w * dy - x * dz + y * dw + z * dx,
                w * dz + x * dy - y * dx + z * dw,
            )
        _fill_matrix(w, x, y, z, R[k])
    return R, rate


@njit(**PART)
def _foretell(nodes: FloatArray, quaternion: FloatArray, t: float, R: FloatArray, rate: FloatArray) -> None:
    """Fill `R` and `rate` at `t` after the last of four stamps: a quadratic of the turns by least squares.

    A rolling platform's rate changes: to go on with the last one is wrong by half the angular acceleration times the
    age squared (0.07° at 30° of roll in 9 s and 10 Hz, more than a sensor's sigma). Beyond one and a half stamps the
    rate goes on as it is there.
    """
    h = nodes[3] - nodes[0]
    s0, s1, s2, s3, s4 = 4.0, 0.0, 0.0, 0.0, 0.0
    b = np.zeros((3, 3))
    for i in range(4):
        s = (nodes[i] - nodes[3]) / h
        v = _step_between(quaternion[3], quaternion[i])
        s1 += s
        s2 += s * s
        s3 += s * s * s
        s4 += s * s * s * s
        for j in range(3):
            b[0, j] += v[j]
            b[1, j] += s * v[j]
            b[2, j] += s * s * v[j]
    # the inverse of [[s0, s1, s2], [s1, s2, s3], [s2, s3, s4]] by its cofactors
    a, e, f = s2 * s4 - s3 * s3, s2 * s3 - s1 * s4, s1 * s3 - s2 * s2
    g, m, n = s0 * s4 - s2 * s2, s1 * s2 - s0 * s3, s0 * s2 - s1 * s1
    det = s0 * a + s1 * e + s2 * f
    far = (t - nodes[3]) / h
    near = min(far, 1.5 * (nodes[3] - nodes[2]) / h)
    v = np.empty(3)
    for j in range(3):
        c0 = (a * b[0, j] + e * b[1, j] + f * b[2, j]) / det
        c1 = (e * b[0, j] + g * b[1, j] + m * b[2, j]) / det
        c2 = (f * b[0, j] + m * b[1, j] + n * b[2, j]) / det
        slope = c1 + 2.0 * c2 * near
        v[j] = c0 + near * (c1 + c2 * near) + slope * (far - near)
        rate[j] = slope / h
    q = _multiply(quaternion[3], _from_rotation_vector(v))
    _fill_matrix(q[0], q[1], q[2], q[3], R)


@njit(**PART)
def _turn(a: float, b: float, c: float, dt: float) -> tuple[float, float, float, float]:
    """Return the quaternion of turning at the rate (a, b, c) (rad/s) for `dt` (s)."""
    rate = math.sqrt(a * a + b * b + c * c)
    half = 0.5 * rate * dt
    k = math.sin(half) / rate if rate > 0.0 else 0.0
    return math.cos(half), k * a, k * b, k * c


@njit(cache=True)
def add_lever_arm(
    position: FloatArray, velocity: FloatArray, enu_from_body: FloatArray, rate: FloatArray, arm: FloatArray
) -> None:
    """Move positions (n, 3) by the turned lever arm (3,) (FRD, m), and velocities by rate × arm, in place."""
    spin = np.empty(3)
    for k in range(len(position)):
        w, R = rate[k], enu_from_body[k]
        spin[0] = w[1] * arm[2] - w[2] * arm[1]
        spin[1] = w[2] * arm[0] - w[0] * arm[2]
        spin[2] = w[0] * arm[1] - w[1] * arm[0]
        for j in range(3):
            position[k, j] += R[j, 0] * arm[0] + R[j, 1] * arm[1] + R[j, 2] * arm[2]
            velocity[k, j] += R[j, 0] * spin[0] + R[j, 1] * spin[1] + R[j, 2] * spin[2]


@njit(cache=True)
def sensor_axes(enu_from_body: FloatArray, body_from_mount: FloatArray) -> FloatArray:
    """Return (n, 3, 3): columns right, forward, up of a sensor mounted by `body_from_mount` (3, 3), in ENU."""
    out = np.empty_like(enu_from_body)
    for k in range(len(out)):
        for i in range(3):
            f, r, d = 0.0, 0.0, 0.0
            for j in range(3):
                f += enu_from_body[k, i, j] * body_from_mount[j, 0]
                r += enu_from_body[k, i, j] * body_from_mount[j, 1]
                d += enu_from_body[k, i, j] * body_from_mount[j, 2]
            out[k, i, 0], out[k, i, 1], out[k, i, 2] = r, f, -d
    return out


@njit(cache=True)
def local_level(position: FloatArray, lat0: float, lon0: float, h0: float) -> FloatArray:
    """Return (n, 3, 3): the site's ENU from the ENU of a platform at `position` (n, 3), over the ellipsoid."""
    out = np.empty((len(position), 3, 3))
    site = _ecef_from_enu_rotation(lat0, lon0)
    local = np.empty((3, 3))
    for k in range(len(position)):
        p, before = position[k], position[max(k - 1, 0)]
        if k > 0 and p[0] == before[0] and p[1] == before[1] and p[2] == before[2]:  # many detections of one look
            write_matrix(out[k], out[k - 1])
            continue
        x, y, z = _ecef_from_enu(p[0], p[1], p[2], lat0, lon0, h0)
        latitude, longitude, _ = _geodetic_from_ecef(x, y, z)
        _fill_rotation(math.sin(latitude), math.cos(latitude), math.sin(longitude), math.cos(longitude), local)
        for i in range(3):
            for j in range(3):
                out[k, i, j] = site[0, i] * local[0, j] + site[1, i] * local[1, j] + site[2, i] * local[2, j]
    return out


@njit(cache=True)
def first_uncovered(nodes: FloatArray, t: FloatArray, max_gap: float, max_extrapolation: float) -> tuple[int, float]:
    """Return the first row of `t` that the nodes do not cover and its gap (s; 0 beyond the ends); (-1, 0) if none."""
    last = len(nodes) - 1
    for k in range(len(t)):
        if not (nodes[0] - max_extrapolation <= t[k] <= nodes[last] + max_extrapolation):
            return k, 0.0
        if nodes[0] < t[k] < nodes[last]:
            i = segment(nodes, t[k])
            if nodes[i + 1] - nodes[i] > max_gap and t[k] != nodes[i]:
                return k, nodes[i + 1] - nodes[i]
    return -1, 0.0


@njit(cache=True)
def slopes(nodes: FloatArray, position: FloatArray, window: float, begin: int) -> FloatArray:
    """Return velocities (n - begin, 3) at the nodes from `begin` on.

    Least-squares slopes over the nodes within ±window (s), at least the neighbours.
    """
    n = len(nodes)
    v = np.zeros((n - begin, 3))
    if n == 1:
        return v
    first, last = 0, 0
    for k in range(begin, n):
        while nodes[k] - nodes[first] > window:
            first += 1
        while last + 1 < n and nodes[last + 1] - nodes[k] <= window:
            last += 1
        i = min(first, max(k - 1, 0))
        j = max(last, min(k + 1, n - 1))
        mean = 0.0
        for m in range(i, j + 1):
            mean += (nodes[m] - nodes[k]) / (j - i + 1)
        total = 0.0
        for m in range(i, j + 1):
            dt = nodes[m] - nodes[k] - mean
            total += dt * dt
            for c in range(3):
                v[k - begin, c] += dt * (position[m, c] - position[k, c])
        for c in range(3):
            v[k - begin, c] /= total
    return v
