"""Which detections each track could claim, and how dense false ones are: the candidate list of a look."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from boresight.kernels.registration import TIME
from boresight.kernels.tracker import (
    AZIMUTH_BINS,
    GATED,
    HIDDEN,
    NOTHING,
    STATIC,
    UNASSOCIATED,
    IntArray,
    Look,
    SensorTable,
    Settings,
    Tracks,
)
from boresight.kernels.tracker_place import component_covariance, fix_sensitivity, position_fix, volume_of
from boresight.kernels.tracker_state import components, innovation, linearise
from boresight.types.sensor import FloatArray

LOG_2PI = math.log(2.0 * math.pi)


@njit(cache=True)
def azimuth_bin(azimuth: float) -> int:
    """Return the clutter-map bin of an azimuth (rad)."""
    return int((azimuth + math.pi) / (2.0 * math.pi) * AZIMUTH_BINS) % AZIMUTH_BINS


@njit(cache=True)
def clutter_density(tr: Tracks, s: Settings, sensor: SensorTable, z: FloatArray, mask: IntArray, m: int) -> float:
    """Expected false detections per unit volume of the measured components around `z`, as learned so far."""
    known = tr.clutter[sensor.number]
    high = sensor.range_high
    if not math.isfinite(high):  # nothing declared: twice what was seen, at least 100 s at the prior speed
        high = max(2.0 * tr.seen_range[sensor.number], 100.0 * s.speed_sigma)
    volume = volume_of(mask, m, sensor, high, s.d, s.speed_sigma)
    if sensor.ranging:
        return float(known[AZIMUTH_BINS] / volume)
    share = 2.0 * math.pi / AZIMUTH_BINS / max(sensor.azimuth_span, 1e-9)
    b = azimuth_bin(z[1])
    local = (known[(b - 1) % AZIMUTH_BINS] + 2.0 * known[b] + known[(b + 1) % AZIMUTH_BINS]) / 4.0
    return float(local / (volume * share))


@njit(cache=True)
def log_densities(tr: Tracks, s: Settings, sensor: SensorTable, look: Look, out: FloatArray) -> int:
    """Fill the log clutter density at every detection (m,); returns the largest number of components."""
    most = 0
    mask = np.full(7, -1, np.int64)
    before = np.full(7, -1, np.int64)
    count = -1  # of the components before
    value = 0.0
    for k in range(len(look.dt)):
        c = components(look.z[k], s.d, mask)
        most = max(most, c)
        # for ranging sensors it depends on which components are measured alone
        same = sensor.ranging and c == count
        for j in range(c):
            same = same and mask[j] == before[j]
            before[j] = mask[j]
        count = c
        if not same:
            value = math.log(max(clutter_density(tr, s, sensor, look.z[k], mask, c), 1e-300))
        out[k] = value
    return most


@njit(cache=True)
def learn_clutter(
    tr: Tracks,
    s: Settings,
    sensor: SensorTable,
    look: Look,
    claims: IntArray,
    row_of_col: IntArray,
    usable: NDArray[np.bool_],
) -> None:
    """Let the detections that no shown track took teach the mean number of false detections of a look."""
    known = tr.clutter[sensor.number]
    m = len(look.dt)
    forget = 1.0 / s.clutter_memory
    for b in range(AZIMUTH_BINS + 1):
        known[b] *= 1.0 - forget
    floor = 0.05 * sensor.clutter_per_scan
    for k in range(m):
        i = row_of_col[k]
        far = look.z[k, 0] if math.isfinite(look.z[k, 0]) else math.hypot(look.z[k, 4], look.z[k, 5])
        if far > tr.seen_range[sensor.number]:
            tr.seen_range[sensor.number] = far
        if not usable[k]:
            continue
        share = 1.0
        if i < 0 and claims[k] > 0:
            share = 0.0
        elif i >= 0:
            share = tr.weight[i, NOTHING] + tr.weight[i, STATIC] if sensor.ranging else tr.weight[i, NOTHING]
        if not math.isnan(look.z[k, 1]):
            known[azimuth_bin(look.z[k, 1])] += forget * share
        known[AZIMUTH_BINS] += forget * share
    known[AZIMUTH_BINS] = max(known[AZIMUTH_BINS], floor)
    for b in range(AZIMUTH_BINS):
        known[b] = max(known[b], floor / AZIMUTH_BINS)


@njit(cache=True)
def fix_all(
    s: Settings, sensor: SensorTable, look: Look, usable: NDArray[np.bool_], fixes: FloatArray
) -> tuple[float, float]:
    """Fill the world positions of all detections; return their largest variance (m², bias included) and largest |dt|.

    The variance is infinite where a detection gives no position: then nearness cannot be told beforehand.
    """
    spread = 0.0
    dt_high = 0.0
    R = np.empty((3, 3))
    J = np.zeros((3, 3))
    mask = np.empty(3, np.int64)
    for k in range(len(look.dt)):
        if not usable[k]:
            continue
        if not sensor.ranging or position_fix(look, k, s, sensor, fixes[k], J, mask) == 0:
            return np.inf, 0.0
        component_covariance(look, k, s, sensor, mask, R)
        total = 0.0  # the trace of J R J'
        for e in range(3):
            for f in range(3):
                for a in range(s.d):
                    total += J[a, e] * R[e, f] * J[a, f]
        for e in range(3):
            b = sensor.bias[mask[e]]
            if b >= 0:
                total += (J[0, e] ** 2 + J[1, e] ** 2 + J[2, e] ** 2) * s.bias_sigma[b - 2 * s.d] ** 2
        total += constant_spread(look, k, s, sensor, fixes[k], J, mask)
        spread = max(spread, total)
        dt_high = max(dt_high, abs(look.dt[k]))
    return spread, dt_high


@njit(cache=True)
def constant_spread(
    look: Look, k: int, s: Settings, sensor: SensorTable, fix: FloatArray, J: FloatArray, mask: IntArray
) -> float:
    """Variance (m²) that the declared constant errors of the sensor may add to a detection's world position."""
    total = 0.0
    if not sensor.registers:
        return total
    # the target's own motion is not known yet: a fast one across both axes stands for it
    fast = np.full(3, 3.0 * s.speed_sigma)
    G = fix_sensitivity(look, k, sensor, fix, J, mask, fast)
    for p in range(len(sensor.constant)):
        j = sensor.constant[p]
        if j >= 0:
            total += (G[0, p] ** 2 + G[1, p] ** 2 + G[2, p] ** 2) * s.bias_sigma[j - 2 * s.d] ** 2
    return total


@njit(cache=True)
def reach_of(tr: Tracks, i: int, s: Settings, spread: float, dt: float, gate: float) -> float:
    """Distance (m) beyond which no detection can be in the gate of track `i`: NIS >= d² / trace(S), twice over."""
    total = spread
    speed = 0.0
    for a in range(s.d):
        v = s.d + a
        total += tr.P[i, a, a] + 2.0 * dt * abs(tr.P[i, a, v]) + dt * dt * tr.P[i, v, v]
        speed += tr.x[i, v] ** 2
    return 2.0 * math.sqrt(gate * total) + dt * math.sqrt(speed)


@njit(cache=True)
def gate_all(
    tr: Tracks,
    s: Settings,
    sensor: SensorTable,
    look: Look,
    usable: NDArray[np.bool_],
    p_d: FloatArray,
    fate: IntArray,
    owner: IntArray,
    nis_of: FloatArray,
) -> tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray]:
    """Return the candidate list (start, column, cost, NIS, log(likelihood / clutter density)) of all tracks."""
    n_tracks = tr.live[0]
    m = len(look.dt)
    n = tr.x.shape[1]
    start = np.zeros(n_tracks + 1, np.int64)
    room = max(64, 4 * (n_tracks + m))
    column = np.empty(room, np.int64)
    cost = np.empty(room)
    distance = np.empty(room)
    loglik = np.empty(room)
    zhat = np.empty(7)
    H = np.zeros((7, n))
    h6 = np.empty((7, 6))
    y = np.empty(7)
    S = np.empty((7, 7))
    PHt = np.empty((n, 7))
    mask = np.empty(7, np.int64)
    work = np.zeros((2, 3))
    near = np.full(m, np.inf)
    log_density = np.empty(m)
    most = log_densities(tr, s, sensor, look, log_density)
    fixes = np.zeros((m, 3))
    spread, dt_high = fix_all(s, sensor, look, usable, fixes)
    near_only = math.isfinite(spread)
    order = np.argsort(fixes[:, 0]) if near_only else np.arange(m)
    east, north = fixes[order, 0], fixes[order, 1]
    used = 0
    for i in range(n_tracks):
        start[i] = used
        if p_d[i] <= 0.0:
            continue
        there = 1.0 - tr.weight[i, NOTHING] - tr.weight[i, HIDDEN]
        p_there = max(min(there, 1.0 - 1e-9), s.doubt)
        log_hit = math.log(p_there * p_d[i])
        log_miss = math.log(1.0 - p_there * p_d[i])
        last_pose = -1
        first, last = 0, m
        reach = np.inf
        if near_only:
            reach = reach_of(tr, i, s, spread, dt_high, s.gates[most])
            first = np.searchsorted(east, tr.x[i, 0] - reach)
            last = np.searchsorted(east, tr.x[i, 0] + reach, side="right")
        for at in range(first, last):
            if near_only and abs(north[at] - tr.x[i, 1]) > reach:
                continue
            k = order[at]
            if not usable[k]:
                continue
            if last_pose < 0 or look.dt[k] != look.dt[last_pose]:
                linearise(tr.x[i], s.d, k, look.dt[k], look, sensor, zhat, H, h6, work)
                last_pose = k
            c = components(look.z[k], s.d, mask)
            if c == 0:
                continue
            nis, logdet = innovation(
                tr.P[i], zhat, H, look.z[k], look.R[k], mask, c, y, S, PHt, s.d, sensor.constant[TIME]
            )
            if nis < near[k]:
                near[k] = nis
                if nis > s.gates[c]:
                    fate[k] = GATED
                    owner[k] = tr.birth[i]
                    nis_of[k] = nis
            if nis > s.gates[c]:
                continue
            ll = -0.5 * (nis + logdet + c * LOG_2PI) - log_density[k]
            value = log_miss - (log_hit + ll)
            if fate[k] == GATED:
                fate[k] = UNASSOCIATED
            if used == room:
                room *= 2
                column = grown_int(column, room)
                cost, distance, loglik = grown(cost, room), grown(distance, room), grown(loglik, room)
            column[used] = k
            cost[used] = value
            distance[used] = nis
            loglik[used] = ll
            used += 1
    start[n_tracks] = used
    return start, column[:used], cost[:used], distance[:used], loglik[:used]


@njit(cache=True)
def grown(a: FloatArray, room: int) -> FloatArray:
    b = np.empty(room)
    b[: len(a)] = a
    return b


@njit(cache=True)
def grown_int(a: IntArray, room: int) -> IntArray:
    b = np.empty(room, np.int64)
    b[: len(a)] = a
    return b
