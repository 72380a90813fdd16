"""The tracker's inner loop: predict, gate, assign, update and weigh all tracks for one scan.

A track is a row of the arrays in `Tracks`. Its state is position (d), velocity (d), then one Gauss–Markov bias for
each component of each sensor whose errors are declared to be coloured. Beside it stand four weights, the
probabilities that the track is (0) a target that the sensors can see, (1) a target hidden from them, (2) an object
that does not move, (3) nothing at all.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from boresight.kernels.measurement import measure, wrap
from boresight.kernels.registration import N_PARAMETERS, sensitivity
from boresight.types.sensor import FloatArray

IntArray = NDArray[np.int64]

VISIBLE, HIDDEN, STATIC, NOTHING = 0, 1, 2, 3
# codes of what became of a detection
UNASSOCIATED, UPDATED, INITIATED, OUTSIDE, GATED = 0, 1, 2, 3, 4
AZIMUTH_BINS = 120


class Tracks(NamedTuple):
    """All live tracks, structure of arrays; the first `live[0]` rows are in use."""

    live: IntArray  # (2,) live tracks; scans so far
    time: FloatArray  # (1,) s, the one time to which all tracks are predicted
    birth: IntArray  # (cap,) row of the detection that began the track: its lasting name
    x: FloatArray  # (cap, n)
    P: FloatArray  # (cap, n, n)
    weight: FloatArray  # (cap, 4) probabilities of the four hypotheses
    anchor: FloatArray  # (cap, 3) the position of the object if it does not move, m
    anchor_P: FloatArray  # (cap, 3, 3)
    life: FloatArray  # (cap, 4) time of birth, time of last hit, shown (0 or 1), hits
    last_look: FloatArray  # (n_sensors,) s
    clutter: FloatArray  # (n_sensors, AZIMUTH_BINS + 1) mean false detections of a look, per azimuth bin and in all
    heard: IntArray  # (cap,) bit i set: sensor i has moved the track
    told: FloatArray  # (cap, k, k + 1) what a track was told of the k constant sensor errors: information, vector
    bank: FloatArray  # (k, k + 1) what ended tracks had learned of them
    undetected: FloatArray  # (1,) expected number of targets that no track follows yet
    seen_range: FloatArray  # (n_sensors,) m, longest range so far (stands in for a coverage without end)


class Look(NamedTuple):
    """One scan, ready for the kernel; poses are those of the sensor at each detection's own time."""

    t: float  # s, validity of the look
    dt: FloatArray  # (m,) own time of each detection minus t
    z: FloatArray  # (m, 7)
    R: FloatArray  # (m, 7, 7)
    row: IntArray  # (m,)
    sensor_position: FloatArray  # (m + 1, 3), the last for the look itself
    sensor_velocity: FloatArray  # (m + 1, 3)
    enu_from_sensor: FloatArray  # (m + 1, 3, 3)


class SensorTable(NamedTuple):
    """What the kernel knows of the sensor that looked."""

    number: int  # its place among the recording's sensors
    p_detection: float
    clutter_per_scan: float
    range_low: float
    range_high: float
    azimuth_low: float
    azimuth_span: float
    elevation_low: float
    elevation_high: float
    ranging: bool  # can begin tracks
    bias: IntArray  # (7,) state index of the bias of each component, -1 for none
    registers: bool  # has constant errors among the states
    constant: IntArray  # (5,) state index of time offset, range, scale, azimuth and elevation error, -1 for none
    decorrelation: float  # s: looks closer in time than this are not independent evidence of existence
    fade_range: float  # m: where p_detection has fallen to half
    resolution: float  # m: nearer targets may give one detection together
    report_range: float  # m: targets farther from the sensor are tracked but not shown on its word
    moves_tracks: bool  # False: its detections are evidence that a track exists, but do not move it


class Settings(NamedTuple):
    """Everything else that a scan needs to know."""

    d: int  # dimensions, 2 or 3
    q: float  # m²/s³
    gates: FloatArray  # (8,) chi-square gate by number of components
    speed_sigma: float  # m/s, prior of a new track
    birth_rate: float  # new targets a look
    survival_time: float  # s
    hide_time: float  # s, mean time visible
    show_time: float  # s, mean time hidden
    static_share: float  # of a new track's existence
    static_q: float  # m²/s
    stop_floor: float  # least weight of "it does not move": a target may stop
    targets_at_start: float  # expected number of targets before the first look
    doubt: float  # least existence with which a track competes for detections
    delete_below: float
    show_above: float
    hide_below: float
    bias_sigma: FloatArray  # (n - 2d,)
    bias_tau: FloatArray  # (n - 2d,), infinite for the constant errors, which come last
    n_constant: int  # states that are constant errors of sensors
    farthest_report: float  # m, the largest report range of the sensors in use
    merge_distance: float
    apart: float  # m: a track nearer than this to a shown one is not shown beside it
    lonely_bearings: bool  # bearings update only where nobody else could claim them
    clutter_memory: float  # looks


@njit(cache=True)
def predict_all(tr: Tracks, s: Settings, t: float) -> None:
    """Predict every track to time `t`: state (exact white-acceleration CV), biases, hypotheses."""
    dt = t - tr.time[0]
    tr.time[0] = t
    if dt <= 0.0:
        return
    n = tr.x.shape[1]
    d = s.d
    q3, q2, q1 = s.q * dt**3 / 3.0, s.q * dt**2 / 2.0, s.q * dt
    n_bias = n - 2 * d
    decay = np.empty(n_bias)
    for k in range(n_bias):
        decay[k] = math.exp(-dt / s.bias_tau[k])
    p_survive = math.exp(-dt / s.survival_time)
    rate = 1.0 / s.hide_time + 1.0 / s.show_time
    settle = 1.0 - math.exp(-dt * rate)
    to_hidden = settle / (s.hide_time * rate)
    to_visible = settle / (s.show_time * rate)
    for i in range(tr.live[0]):
        x = tr.x[i]
        P = tr.P[i]
        for a in range(d):
            x[a] += dt * x[d + a]
        for a in range(d):  # rows: F P
            for j in range(n):
                P[a, j] += dt * P[d + a, j]
        for a in range(d):  # columns: (F P) F'
            for j in range(n):
                P[j, a] += dt * P[j, d + a]
        for k in range(n_bias):
            b = 2 * d + k
            x[b] *= decay[k]
            for j in range(n):
                P[b, j] *= decay[k]
            for j in range(n):
                P[j, b] *= decay[k]
            P[b, b] += s.bias_sigma[k] ** 2 * (1.0 - decay[k] ** 2)
        for a in range(d):
            P[a, a] += q3
            P[d + a, d + a] += q1
            P[a, d + a] += q2
            P[d + a, a] += q2
            tr.anchor_P[i, a, a] += s.static_q * dt
        w = tr.weight[i]
        v, h = w[VISIBLE] * p_survive, w[HIDDEN] * p_survive
        w[NOTHING] += (1.0 - p_survive) * (w[VISIBLE] + w[HIDDEN])
        w[VISIBLE] = v * (1.0 - to_hidden) + h * to_visible
        w[HIDDEN] = h * (1.0 - to_visible) + v * to_hidden


@njit(cache=True)
def coverage_of(z: FloatArray, sensor: SensorTable, margin: float) -> bool:
    """Whether a direction and range (z[0:3], sensor axes) lies within the declared coverage, widened by `margin`."""
    slack_r = margin * max(50.0, 0.02 * sensor.range_high) if math.isfinite(sensor.range_high) else 0.0
    if math.isfinite(z[0]) and not (sensor.range_low - slack_r <= z[0] <= sensor.range_high + slack_r):
        return False
    slack_a = margin * 0.035
    if math.isfinite(z[1]) and sensor.azimuth_span < 2.0 * math.pi - 1e-9:
        a = z[1] - sensor.azimuth_low + slack_a
        a -= 2.0 * math.pi * math.floor(a / (2.0 * math.pi))
        if a > sensor.azimuth_span + 2.0 * slack_a:
            return False
    return not math.isfinite(z[2]) or sensor.elevation_low - slack_a <= z[2] <= sensor.elevation_high + slack_a


@njit(cache=True)
def volume_of(mask: IntArray, m: int, sensor: SensorTable, range_high: float, d: int, speed: float) -> float:
    """Volume of the coverage in the measured components: what clutter is uniform in (m, rad, m/s)."""
    r1, r2 = sensor.range_low, range_high
    volume = 1.0
    cartesian = False
    for j in range(m):
        if mask[j] == 0:
            volume *= r2 - r1
        elif mask[j] == 1:
            volume *= sensor.azimuth_span
        elif mask[j] == 2:
            volume *= sensor.elevation_high - sensor.elevation_low
        elif mask[j] == 3:
            volume *= 4.0 * speed
        else:
            cartesian = True
    if cartesian:
        if d == 2:
            volume *= 0.5 * (r2 * r2 - r1 * r1) * sensor.azimuth_span
        else:
            lift = math.sin(sensor.elevation_high) - math.sin(sensor.elevation_low)
            volume *= (r2**3 - r1**3) / 3.0 * sensor.azimuth_span * lift
    return volume


@njit(cache=True)
def linearise(
    x: FloatArray,
    d: int,
    k: int,
    dt: float,
    look: Look,
    sensor: SensorTable,
    z: FloatArray,
    H: FloatArray,
    h6: FloatArray,
    work: FloatArray,
) -> None:
    """Fill `z` (7,) and `H` (7, n) for a track's state `x` seen with the pose of detection `k`, `dt` after the look.

    `work` (2, 3) holds position and velocity; zero in the components that the state lacks.
    """
    position, velocity = work[0], work[1]
    for a in range(d):
        position[a] = x[a] + dt * x[d + a]
        velocity[a] = x[d + a]
    measure(position, velocity, look.sensor_position[k], look.sensor_velocity[k], look.enu_from_sensor[k], z, h6)
    n = len(x)
    for c in range(7):
        for a in range(d):
            H[c, a] = h6[c, a]
            H[c, d + a] = h6[c, 3 + a] + dt * h6[c, a]
        for j in range(2 * d, n):
            H[c, j] = 0.0
        b = sensor.bias[c]
        if b >= 0:
            H[c, b] = 1.0
    if sensor.registers:
        S = np.empty((7, N_PARAMETERS))
        sensitivity(z, h6, velocity - look.sensor_velocity[k], S)
        for p in range(N_PARAMETERS):
            if sensor.constant[p] >= 0:
                for c in range(7):
                    H[c, sensor.constant[p]] = S[c, p]
    if n > 2 * d:
        for c in range(7):
            for j in range(2 * d, n):
                z[c] += H[c, j] * x[j]


@njit(cache=True)
def fix_sensitivity(
    look: Look, k: int, sensor: SensorTable, fix: FloatArray, J: FloatArray, mask: IntArray, velocity: FloatArray
) -> FloatArray:
    """Return (3, 5): how the world position of detection `k` changes with the sensor's constant errors."""
    z = np.empty(7)
    h6 = np.empty((7, 6))
    S = np.empty((7, N_PARAMETERS))
    measure(fix, velocity, look.sensor_position[k], look.sensor_velocity[k], look.enu_from_sensor[k], z, h6)
    sensitivity(z, h6, velocity - look.sensor_velocity[k], S)
    out = np.zeros((3, N_PARAMETERS))
    for a in range(3):
        for p in range(N_PARAMETERS):
            for e in range(3):
                out[a, p] += J[a, e] * S[mask[e], p]
    return out


@njit(cache=True)
def components(z: FloatArray, d: int, mask: IntArray) -> int:
    """Fill `mask` with the measured components that the state can explain and return how many there are."""
    m = 0
    for c in range(7):
        if math.isfinite(z[c]) and not (d == 2 and (c == 2 or c == 6)):
            mask[m] = c
            m += 1
    return m


@njit(cache=True)
def innovation(
    P: FloatArray,
    zhat: FloatArray,
    H: FloatArray,
    z: FloatArray,
    R: FloatArray,
    mask: IntArray,
    m: int,
    y: FloatArray,
    S: FloatArray,
    PHt: FloatArray,
    d: int,
    lag: int,
) -> tuple[float, float]:
    """Fill `y`, the Cholesky factor of S in `S` and P H' in `PHt`; return (NIS, log determinant of S).

    `lag` is the state index of the sensor's time offset (-1: none): it multiplies the velocity, and where both are
    uncertain their product adds to mean and covariance (the second-order terms, exact for a product of Gaussians).
    """
    n = P.shape[0]
    for i in range(m):
        c = mask[i]
        y[i] = z[c] - zhat[c]
        if lag >= 0:
            for a in range(d):
                y[i] += H[c, a] * P[d + a, lag]
        if c == 1 or c == 2:
            y[i] = wrap(y[i])
        for a in range(n):
            acc = 0.0
            for b in range(n):
                acc += P[a, b] * H[c, b]
            PHt[a, i] = acc
    for i in range(m):
        for j in range(i + 1):
            acc = R[mask[i], mask[j]]
            for a in range(n):
                acc += H[mask[i], a] * PHt[a, j]
            if lag >= 0:
                for a in range(d):
                    for b in range(d):
                        product = P[d + a, d + b] * P[lag, lag] + P[d + a, lag] * P[d + b, lag]
                        acc += H[mask[i], a] * product * H[mask[j], b]
            S[i, j] = acc
    # in-place Cholesky and forward substitution
    nis = 0.0
    logdet = 0.0
    for i in range(m):
        for j in range(i + 1):
            acc = S[i, j]
            for k in range(j):
                acc -= S[i, k] * S[j, k]
            if i == j:
                S[i, i] = math.sqrt(max(acc, 1e-300))
            else:
                S[i, j] = acc / S[j, j]
        logdet += 2.0 * math.log(S[i, i])
    for i in range(m):
        acc = y[i]
        for k in range(i):
            acc -= S[i, k] * y[k]
        y[i] = acc / S[i, i]  # whitened
        nis += y[i] * y[i]
    return nis, logdet


@njit(cache=True)
def apply_update(
    x: FloatArray, P: FloatArray, y: FloatArray, L: FloatArray, PHt: FloatArray, m: int, considered: int
) -> None:
    """Condition (x, P) on whitened innovations `y` with S = L L': P -= W W', W = P H' L^-T, exactly symmetric.

    States from `considered` on count with their covariance but learn nothing (Schmidt 1966): n for none.
    """
    n = len(x)
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


@njit(cache=True)
def static_likelihood(tr: Tracks, i: int, s: Settings, fix: FloatArray, fix_R: FloatArray, update: bool) -> float:
    """Log-likelihood of a position fix (world ENU) under "it does not move"; with `update`, condition the anchor."""
    d = s.d
    L = np.zeros((3, 3))
    y = np.zeros(3)
    nis = 0.0
    logdet = 0.0
    for a in range(d):
        y[a] = fix[a] - tr.anchor[i, a]
        for b in range(a + 1):
            acc = tr.anchor_P[i, a, b] + fix_R[a, b]
            for k in range(b):
                acc -= L[a, k] * L[b, k]
            L[a, b] = math.sqrt(max(acc, 1e-300)) if a == b else acc / L[b, b]
        logdet += 2.0 * math.log(L[a, a])
    for a in range(d):
        acc = y[a]
        for k in range(a):
            acc -= L[a, k] * y[k]
        y[a] = acc / L[a, a]
        nis += y[a] * y[a]
    if update:
        W = tr.anchor_P[i].copy()
        for c in range(d):
            for a in range(d):
                acc = W[a, c]
                for k in range(c):
                    acc -= W[a, k] * L[c, k]
                W[a, c] = acc / L[c, c]
        for a in range(d):
            for c in range(d):
                tr.anchor[i, a] += W[a, c] * y[c]
        for a in range(d):
            for b in range(d):
                for c in range(d):
                    tr.anchor_P[i, a, b] -= W[a, c] * W[b, c]
    return -0.5 * (nis + logdet + d * math.log(2.0 * math.pi))


@njit(cache=True)
def position_fix(
    look: Look, k: int, s: Settings, sensor: SensorTable, fix: FloatArray, J: FloatArray, mask: IntArray
) -> int:
    """Turn a ranging detection into a world position `fix` (3,) and `J` (3, m), its Jacobian by the components.

    Returns the number m of components used (written to `mask`), or 0 where the detection gives no position. Where
    elevation is not measured, the middle of the sensor's elevation coverage stands for it, with its spread.
    """
    z = look.z[k]
    R = look.enu_from_sensor[k]
    if math.isfinite(z[4]) and math.isfinite(z[5]):
        e, n, u = z[4], z[5], z[6] if math.isfinite(z[6]) else 0.0
        for a in range(3):
            mask[a] = 4 + a
            for b in range(3):
                J[a, b] = R[a, b]
    elif math.isfinite(z[0]) and math.isfinite(z[1]):
        el = z[2]
        if not math.isfinite(el):
            el = 0.0
            if s.d == 2:  # the target is in the plane up = 0: take the depression that follows from the range
                drop = -look.sensor_position[k, 2]
                el = math.asin(max(-1.0, min(1.0, drop / max(z[0], 1.0))))
            else:
                el = 0.5 * (sensor.elevation_low + sensor.elevation_high)
        ce, se, ca, sa = math.cos(el), math.sin(el), math.cos(z[1]), math.sin(z[1])
        e, n, u = z[0] * ce * sa, z[0] * ce * ca, z[0] * se
        for a in range(3):
            mask[a] = a
            J[a, 0] = R[a, 0] * ce * sa + R[a, 1] * ce * ca + R[a, 2] * se
            J[a, 1] = R[a, 0] * n - R[a, 1] * e
            J[a, 2] = -R[a, 0] * z[0] * se * sa - R[a, 1] * z[0] * se * ca + R[a, 2] * z[0] * ce
    else:
        return 0
    for a in range(3):
        fix[a] = look.sensor_position[k, a] + R[a, 0] * e + R[a, 1] * n + R[a, 2] * u
    return 3
