"""How a detection conditions a track: linearisation, innovation, update."""

from __future__ import annotations

import math

from numba import njit

from boresight.kernels.measurement import measure, measure_axes, wrap
from boresight.kernels.options import LEAF
from boresight.kernels.registration import N_PARAMETERS, TIME, sensitivity
from boresight.kernels.tracker import HIDDEN, NOTHING, STATIC, IntArray, Look, SensorTable, Settings, Tracks
from boresight.kernels.tracker_workroom import Workroom
from boresight.types.sensor import FloatArray


@njit(**LEAF)
def existence(tr: Tracks, i: int, s: Settings, sensor: SensorTable) -> float:
    """Return the probability with which track `i` competes for detections: that it is there for this sensor to see."""
    w = tr.weight[i]
    there = 1.0 - w[NOTHING] - w[HIDDEN] - (1.0 - sensor.sees_static) * w[STATIC]
    return float(max(min(there, 1.0 - 1e-9), s.doubt, 1e-9))


@njit(**LEAF)
def linearise(
    x: FloatArray, d: int, k: int, dt: float, look: Look, sensor: SensorTable, count: int, room: Workroom
) -> None:
    """Fill `room.z` and `room.H` for a track's state `x` seen with the pose of detection `k`, `dt` after the look.

    Only the `count` components in `room.mask` are sure to be filled. `room.sight` is zero where the state lacks one.
    """
    position, velocity, z, H, h6 = room.sight[0], room.sight[1], room.z, room.H, room.h6
    for a in range(d):
        position[a] = x[a] + dt * x[d + a]
        velocity[a] = x[d + a]
    own, moving, axes = look.sensor_position[k], look.sensor_velocity[k], look.enu_from_sensor[k]
    if room.mask[0] >= 4 and not sensor.registers:
        measure_axes(position, own, axes, z, h6)
    else:
        measure(position, velocity, own, moving, axes, z, h6)
    n = len(x)
    for e in range(count):
        c = room.mask[e]
        for a in range(d):
            H[c, a] = h6[c, a]
            H[c, d + a] = h6[c, 3 + a] + dt * h6[c, a]
        for j in range(2 * d, n):
            H[c, j] = 0.0
        if sensor.bias[c] >= 0:
            H[c, sensor.bias[c]] = 1.0
    if sensor.registers:
        for a in range(3):
            room.v[a] = velocity[a] - moving[a]
        sensitivity(z, h6, room.v, room.errors)
        for p in range(N_PARAMETERS):
            if sensor.constant[p] >= 0:
                for e in range(count):
                    H[room.mask[e], sensor.constant[p]] = room.errors[room.mask[e], p]
    for e in range(count):
        for j in range(2 * d, n):
            z[room.mask[e]] += H[room.mask[e], j] * x[j]


@njit(**LEAF)
def components(z: FloatArray, d: int, mask: IntArray) -> int:
    """Fill `mask` with the measured components that the state can explain and return how many there are."""
    m = 0
    for c in range(7):
        if math.isfinite(z[c]) and not (d == 2 and (c == 2 or c == 6)):
            mask[m] = c
            m += 1
    return m


@njit(**LEAF)
def factor(A: FloatArray, m: int) -> None:
    """Overwrite the lower triangle of a covariance, its first m rows, with its Cholesky factor."""
    for i in range(m):
        for j in range(i + 1):
            acc = A[i, j]
            for k in range(j):
                acc -= A[i, k] * A[j, k]
            A[i, j] = math.sqrt(max(acc, 1e-300)) if i == j else acc / A[j, j]


@njit(**LEAF)
def whiten(y: FloatArray, L: FloatArray, m: int) -> None:
    """Overwrite the first m numbers of `y` with L⁻¹ y, `L` as `factor` leaves it."""
    for i in range(m):
        acc = y[i]
        for k in range(i):
            acc -= L[i, k] * y[k]
        y[i] = acc / L[i, i]


@njit(**LEAF)
def innovation(P: FloatArray, z: FloatArray, R: FloatArray, m: int, room: Workroom, d: int, lag: int) -> float:
    """Fill `y`, the Cholesky factor of S in `S` and P H' in `PHt` of `room`; return the NIS.

    Of the m components in `room.mask`, predicted by `linearise`.

    `lag` is the state index of the sensor's time offset (-1: none): it multiplies the velocity, and where both are
    uncertain their product adds to mean and covariance (the second-order terms, exact for a product of Gaussians).
    """
    n = P.shape[0]
    zhat, H, mask, y, S, PHt = room.z, room.H, room.mask, room.y, room.S, room.PHt
    for i in range(m):
        c = mask[i]
        y[i] = z[c] - zhat[c]
        if lag >= 0:
            for a in range(d):
                y[i] += H[c, a] * P[d + a, lag]
        if c == 1 or c == 2:
            y[i] = wrap(y[i])
        for a in range(n):
            PHt[a, i] = 0.0
        for b in range(n):
            if H[c, b] != 0.0:  # most states do not show in a component
                for a in range(n):
                    PHt[a, i] += P[a, b] * H[c, b]
    for i in range(m):
        for j in range(i + 1):
            acc = R[mask[i], mask[j]]
            for a in range(n):
                if H[mask[i], a] != 0.0:
                    acc += H[mask[i], a] * PHt[a, j]
            if lag >= 0:
                for a in range(d):
                    for b in range(d):
                        product = P[d + a, d + b] * P[lag, lag] + P[d + a, lag] * P[d + b, lag]
                        acc += H[mask[i], a] * product * H[mask[j], b]
            S[i, j] = acc
    factor(S, m)
    whiten(y, S, m)
    nis = 0.0
    for i in range(m):
        nis += y[i] * y[i]
    return nis


@njit(**LEAF)
def log_determinant(m: int, room: Workroom) -> float:
    """Return the log determinant of S, of m components, as `innovation` leaves its factor in `room`."""
    total = 0.0
    for i in range(m):
        total += 2.0 * math.log(room.S[i, i])
    return total


@njit(**LEAF)
def learners(tr: Tracks, i: int, s: Settings, sensor: SensorTable) -> int:
    """Return how many of the states of track `i` may learn from a detection: constant errors not from one sensor alone.

    One sensor cannot show its own; where it seems to, linearisation deceives.
    """
    n: int = tr.x.shape[1]
    bit = 1 << (sensor.number % 62)
    return n - s.n_constant if tr.heard[i] | bit == bit else n


@njit(**LEAF)
def look_along(
    x: FloatArray, P: FloatArray, d: int, k: int, look: Look, sensor: SensorTable, room: Workroom
) -> tuple[int, float]:
    """Hold (x, P) at the time of a look against its detection `k`: fills `room` for `apply_update`.

    Returns how many components it has, and their log-likelihood but for a constant.
    """
    m = components(look.z[k], d, room.mask)
    linearise(x, d, k, look.dt[k], look, sensor, m, room)
    nis = innovation(P, look.z[k], look.R[k], m, room, d, sensor.constant[TIME])
    return m, -0.5 * (nis + log_determinant(m, room))


@njit(**LEAF)
def condition(
    x: FloatArray, P: FloatArray, d: int, k: int, look: Look, sensor: SensorTable, room: Workroom, considered: int
) -> float:
    """Condition (x, P) at the time of a look on its detection `k`; the first `considered` states learn.

    Returns the log-likelihood but for a constant.
    """
    m, log_likelihood = look_along(x, P, d, k, look, sensor, room)
    apply_update(x, P, m, room, considered)
    return float(log_likelihood)


@njit(**LEAF)
def apply_update(x: FloatArray, P: FloatArray, m: int, room: Workroom, considered: int) -> None:
    """Condition (x, P) on whitened innovations with S = L L': P -= W W', W = P H' L^-T, exactly symmetric.

    What `innovation` left in `room` is used up.

    States from `considered` on count with their covariance but learn nothing (Schmidt 1966): n for none.
    """
    n = len(x)
    y, L, PHt = room.y, room.S, room.PHt
    for i in range(m):
        for a in range(n):
            acc = PHt[a, i]
            for k in range(i):
                acc -= PHt[a, k] * L[i, k]
            PHt[a, i] = acc / L[i, i]
    for a in range(considered):
        for i in range(m):
            x[a] += PHt[a, i] * y[i]
    for a in range(n):
        for b in range(min(a + 1, considered)):
            acc = P[a, b]
            for i in range(m):
                acc -= PHt[a, i] * PHt[b, i]
            P[a, b] = acc
            P[b, a] = acc
