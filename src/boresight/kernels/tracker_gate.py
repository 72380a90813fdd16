"""Which detections each track could claim: the candidate list of a look."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from boresight.kernels.options import LEAF, PART
from boresight.kernels.registration import TIME
from boresight.kernels.tracker import GATED, UNASSOCIATED, IntArray, Look, Models, SensorTable, Settings, Tracks
from boresight.kernels.tracker_clutter import log_densities
from boresight.kernels.tracker_heights import active_heights, fit
from boresight.kernels.tracker_messages import find_owned, with_address
from boresight.kernels.tracker_place import Places, fix_sensitivity
from boresight.kernels.tracker_state import components, existence, innovation, linearise, log_determinant
from boresight.kernels.tracker_workroom import Workroom
from boresight.types.sensor import FloatArray

LOG_2PI = math.log(2.0 * math.pi)


@njit(**LEAF)
def spread_of(
    s: Settings, sensor: SensorTable, look: Look, usable: NDArray[np.bool_], at: Places, room: Workroom
) -> tuple[float, float]:
    """Return the largest variance (m², bias included) of the detections' world positions and the largest |dt|.

    The variance is infinite where a detection gives no position: then nearness cannot be told beforehand.
    """
    spread = 0.0
    dt_high = 0.0
    for k in range(len(look.dt)):
        if not usable[k]:
            continue
        if not at.there[k]:
            return np.inf, 0.0
        total = 0.0
        for a in range(s.d):
            total += at.covariance[k, a, a]
        for e in range(3):
            b = sensor.bias[at.mask[k, e]]
            if b >= 0:
                total += (at.J[k, 0, e] ** 2 + at.J[k, 1, e] ** 2 + at.J[k, 2, e] ** 2) * s.bias_sigma[b - 2 * s.d] ** 2
        total += constant_spread(look, k, s, sensor, at, room)
        spread = max(spread, total)
        dt_high = max(dt_high, abs(look.dt[k]))
    return spread, dt_high


@njit(**LEAF)
def constant_spread(look: Look, k: int, s: Settings, sensor: SensorTable, at: Places, room: Workroom) -> float:
    """Variance (m²) that the declared constant errors of the sensor may add to a detection's world position."""
    total = 0.0
    if not sensor.registers:
        return total
    # the target's own motion is not known yet: a fast one across both axes stands for it
    fast = 3.0 * s.speed_sigma
    fix_sensitivity(look, k, at.fix[k], at.J[k], at.mask[k], (fast, fast, fast), room)
    G = room.C
    for p in range(len(sensor.constant)):
        j = sensor.constant[p]
        if j >= 0:
            total += (G[0, p] ** 2 + G[1, p] ** 2 + G[2, p] ** 2) * s.bias_sigma[j - 2 * s.d] ** 2
    return total


@njit(**LEAF)
def reach_of(tr: Tracks, i: int, s: Settings, spread: float, dt: float, gate: float) -> float:
    """Distance (m) beyond which no detection can be in the gate of track `i`: NIS >= d² / trace(S), twice over."""
    total = spread
    speed = 0.0
    for a in range(s.d):
        v = s.d + a
        total += tr.P[i, a, a] + 2.0 * dt * abs(tr.P[i, a, v]) + dt * dt * tr.P[i, v, v]
        speed += tr.x[i, v] ** 2
    return 2.0 * math.sqrt(gate * total) + dt * math.sqrt(speed)


@njit(**PART)
def gate_all(
    tr: Tracks,
    s: Settings,
    sensor: SensorTable,
    look: Look,
    usable: NDArray[np.bool_],
    at: Places,
    p_d: FloatArray,
    room: Workroom,
    fate: IntArray,
    owner: IntArray,
    nis_of: FloatArray,
    models: Models | None,
) -> tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray]:
    """Return the candidate list (start, column, cost, NIS, log(likelihood / clutter density)) of all tracks."""
    n_tracks = tr.live[0]
    m = len(look.dt)
    start = np.zeros(n_tracks + 1, np.int64)
    size = max(64, 4 * (n_tracks + m))
    column = np.empty(size, np.int64)
    cost = np.empty(size)
    distance = np.empty(size)
    loglik = np.empty(size)
    near = np.full(m, np.inf)
    log_density = np.empty(m)
    most = log_densities(tr, s, sensor, look, log_density)
    owned = np.zeros(m)
    if sensor.spoken >= 0:
        find_owned(tr, sensor, look, owned)
    spread, dt_high = spread_of(s, sensor, look, usable, at, room)
    near_only = m > 0 and math.isfinite(spread)
    order, east, north = np.arange(m), near, near
    if near_only:
        order = np.argsort(at.fix[:, 0])
        east, north = at.fix[order, 0], at.fix[order, 1]
    used = 0
    for i in range(n_tracks):
        start[i] = used
        if p_d[i] <= 0.0:
            continue
        there = existence(tr, i, s, sensor)
        log_hit = log_miss = 0.0  # filled where they are needed: most tracks have no candidate
        last_pose, last_kind = -1, 0
        several = False
        if models is not None:
            several = active_heights(tr, i, models) > 1
        first, last = 0, m
        reach = np.inf
        if near_only:
            reach = reach_of(tr, i, s, spread, dt_high, s.gates[most])
            first = place_in(east, tr.x[i, 0] - reach)
            last = place_in(east, tr.x[i, 0] + reach)
        for near_by in range(first, last):
            if near_only and abs(north[near_by] - tr.x[i, 1]) > reach:
                continue
            k = order[near_by]
            if not usable[k]:
                continue
            c = components(look.z[k], s.d, room.mask)
            if c == 0:
                continue
            if several:
                nis, log_likelihood, c = fit(tr, i, s.d, k, look, sensor, sensor.constant[TIME], room)
            else:
                kind = kind_of(room.mask, c)
                if kind != last_kind or look.dt[k] != look.dt[last_pose]:
                    linearise(tr.x[i], s.d, k, look.dt[k], look, sensor, c, room)
                    last_pose, last_kind = k, kind
                nis = innovation(tr.P[i], look.z[k], look.R[k], c, room, s.d, sensor.constant[TIME])
                log_likelihood = 0.0  # filled where it is needed
            if nis < near[k]:
                near[k] = nis
                if nis > s.gates[c]:
                    fate[k] = GATED
                    owner[k] = tr.birth[i]
                    nis_of[k] = nis
            if nis > s.gates[c]:
                continue
            if fate[k] == GATED:
                fate[k] = UNASSOCIATED
            if used == size:
                size *= 2
                column = grown_int(column, size)
                cost, distance, loglik = grown(cost, size), grown(distance, size), grown(loglik, size)
            column[used] = k
            distance[used] = nis
            if used == start[i]:
                log_hit, log_miss = math.log(there * p_d[i]), math.log(1.0 - there * p_d[i])
            if not several:
                log_likelihood = -0.5 * (nis + log_determinant(c, room))
            loglik[used] = log_likelihood - 0.5 * c * LOG_2PI - log_density[k]
            if sensor.spoken >= 0:
                loglik[used] = with_address(tr, i, sensor, look.address[k], owned[k], loglik[used], nis, p_d[i])
            cost[used] = log_miss - (log_hit + loglik[used])
            used += 1
    start[n_tracks] = used
    return start, column[:used], cost[:used], distance[:used], loglik[:used]


@njit(**LEAF)
def kind_of(mask: IntArray, count: int) -> int:
    """Return one number for the set of the `count` components in `mask`, not 0."""
    bits = 0
    for e in range(count):
        bits |= 1 << mask[e]
    return bits


@njit(**LEAF)
def place_in(ascending: FloatArray, value: float) -> int:
    """Return how many of the ascending values lie below `value`."""
    first, last = 0, len(ascending)
    while first < last:
        middle = (first + last) // 2
        if ascending[middle] < value:
            first = middle + 1
        else:
            last = middle
    return first


@njit(**PART)
def grown(a: FloatArray, room: int) -> FloatArray:
    b = np.empty(room)
    for i in range(len(a)):  # an assignment of slices takes two seconds to compile
        b[i] = a[i]
    return b


@njit(**PART)
def grown_int(a: IntArray, room: int) -> IntArray:
    b = np.empty(room, np.int64)
    for i in range(len(a)):
        b[i] = a[i]
    return b
