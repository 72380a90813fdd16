"""One scan through the tracker: the order of things is the order of the functions below."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from boresight.kernels.assignment import assign_sparse
from boresight.kernels.measurement import measure
from boresight.kernels.registration import TIME, learned, pool
from boresight.kernels.tracker import (
    AZIMUTH_BINS,
    GATED,
    HIDDEN,
    INITIATED,
    NOTHING,
    OUTSIDE,
    STATIC,
    UNASSOCIATED,
    UPDATED,
    VISIBLE,
    IntArray,
    Look,
    SensorTable,
    Settings,
    Tracks,
    apply_update,
    components,
    coverage_of,
    fix_sensitivity,
    innovation,
    linearise,
    position_fix,
    predict_all,
    static_likelihood,
    volume_of,
)
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
def detection_probability(
    tr: Tracks, i: int, s: Settings, look: Look, sensor: SensorTable, z: FloatArray, h6: FloatArray, work: FloatArray
) -> float:
    """Probability that the sensor, looking once, reports a visible target where track `i` is; 0 outside coverage."""
    m = len(look.dt)
    for a in range(s.d):
        work[0, a] = tr.x[i, a]
    measure(work[0], work[1], look.sensor_position[m], look.sensor_velocity[m], look.enu_from_sensor[m], z, h6)
    if not coverage_of(z, sensor, 0.0):
        return 0.0
    p = sensor.p_detection
    if math.isfinite(sensor.fade_range):
        p /= 1.0 + (z[0] / sensor.fade_range) ** 4
    return p


@njit(cache=True)
def scan_step(
    tr: Tracks, s: Settings, sensor: SensorTable, look: Look, fate: IntArray, owner: IntArray, nis_of: FloatArray
) -> None:
    """Take one scan: predict, gate, assign, update, weigh, begin and end tracks; `fate`, `owner`, `nis_of` are (m,).

    `owner` is the birth row of the track that a detection updated, began, or was nearest to (-1: none). The arrays of
    `tr` must have room for m more tracks.
    """
    predict_all(tr, s, look.t)
    m = len(look.dt)
    n_tracks = tr.live[0]
    usable = np.zeros(m, np.bool_)
    for k in range(m):
        fate[k] = UNASSOCIATED
        owner[k] = -1
        nis_of[k] = np.nan
        usable[k] = coverage_of(look.z[k], sensor, 1.0)
        if not usable[k]:
            fate[k] = OUTSIDE
    p_d = np.zeros(n_tracks)
    z = np.empty(7)
    h6 = np.empty((7, 6))
    work = np.zeros((2, 3))
    for i in range(n_tracks):
        p_d[i] = detection_probability(tr, i, s, look, sensor, z, h6, work)
    start, column, cost, distance, loglik = gate_all(tr, s, sensor, look, usable, p_d, fate, owner, nis_of)
    col_of_row = np.full(n_tracks, -1, np.int64)
    assign_sparse(start, column, cost, m, col_of_row)
    row_of_col = np.full(m, -1, np.int64)
    for i in range(n_tracks):
        if col_of_row[i] >= 0:
            row_of_col[col_of_row[i]] = i
    claims = np.zeros(m, np.int64)  # how many credible tracks could claim a detection
    for i in range(n_tracks):
        if tr.life[i, 2] > 0.0 or 1.0 - tr.weight[i, NOTHING] > 0.5:
            for e in range(start[i], start[i + 1]):
                claims[column[e]] += 1
    elapsed = look.t - tr.last_look[sensor.number]
    temper = 1.0
    if sensor.decorrelation > 0.0:
        temper = min(1.0, max(elapsed, 0.0) / sensor.decorrelation)
    tr.last_look[sensor.number] = look.t
    for i in range(n_tracks):
        if p_d[i] <= 0.0:
            if tr.life[i, 3] < 2.0 and tr.heard[i] == 1 << (sensor.number % 62):
                # begun at the very edge of the coverage, where it cannot be seen again: it must not wait there for ever
                log_miss = math.log(1.0 - sensor.p_detection)
                weigh(tr, i, log_miss, log_miss, temper)
            continue
        k = col_of_row[i]
        shy = s.lonely_bearings and not sensor.ranging
        if shy and start[i + 1] > start[i] and (start[i + 1] - start[i] > 1 or claims[column[start[i]]] > 1):
            if k >= 0:  # ambiguous: neither evidence nor update
                row_of_col[k] = -1
                fate[k] = UNASSOCIATED
            continue
        if k >= 0:
            e = start[i]
            while column[e] != k:
                e += 1
            fate[k] = UPDATED
            owner[k] = tr.birth[i]
            nis_of[k] = distance[e]
            take(tr, i, s, sensor, look, k, evidence(i, start, column, loglik, row_of_col, p_d[i]), temper)
        elif not merged(tr, i, s, sensor, start, column, row_of_col):
            log_any = evidence(i, start, column, loglik, row_of_col, p_d[i])
            weigh(tr, i, log_any, log_any, temper)
    learn_clutter(tr, s, sensor, look, claims, row_of_col, usable)
    if sensor.ranging:
        begin(tr, s, sensor, look, fate, owner, row_of_col, usable)
    if sensor.ranging:
        show(tr, s, sensor, look)
    end_and_merge(tr, s, sensor.ranging, start)
    tr.live[1] += 1


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
def grown(a: FloatArray, room: int) -> FloatArray:
    b = np.empty(room)
    b[: len(a)] = a
    return b


@njit(cache=True)
def grown_int(a: IntArray, room: int) -> IntArray:
    b = np.empty(room, np.int64)
    b[: len(a)] = a
    return b


@njit(cache=True)
def evidence(i: int, start: IntArray, column: IntArray, loglik: FloatArray, row_of_col: IntArray, p_d: float) -> float:
    """Log-likelihood of this look if track `i` is a visible target, over that if it is not: missed, or any of the
    detections in its gate that no other track took (Musicki, Evans, Stankovic 1994, the IPDA likelihood ratio)."""
    total = 1.0 - p_d
    for e in range(start[i], start[i + 1]):
        if row_of_col[column[e]] == i or row_of_col[column[e]] < 0:
            total += p_d * math.exp(min(loglik[e], 100.0))
    return math.log(total)


@njit(cache=True)
def merged(
    tr: Tracks, i: int, s: Settings, sensor: SensorTable, start: IntArray, column: IntArray, row_of_col: IntArray
) -> bool:
    """Whether the detection that track `i` would have had may be one with that of a near shown track."""
    for e in range(start[i], start[i + 1]):
        j = row_of_col[column[e]]
        if j < 0 or j == i or tr.life[j, 2] == 0.0:
            continue
        gap = 0.0
        for a in range(s.d):
            gap += (tr.x[i, a] - tr.x[j, a]) ** 2
        if gap < sensor.resolution**2:
            return True
    return False


@njit(cache=True)
def weigh(tr: Tracks, i: int, log_visible: float, log_static: float, temper: float) -> None:
    """Multiply the weights by the likelihoods of the hypotheses (hidden and nothing: 1) and normalise."""
    w = tr.weight[i]
    w[VISIBLE] *= math.exp(temper * log_visible)
    w[STATIC] *= math.exp(temper * log_static)
    total = w[0] + w[1] + w[2] + w[3]
    for a in range(4):
        w[a] /= total


@njit(cache=True)
def allow_stop(tr: Tracks, i: int, s: Settings) -> None:
    """Let a target that moved begin to stand still where it is now: the anchor is dropped anew."""
    w = tr.weight[i]
    target = w[VISIBLE] + w[HIDDEN]
    if w[STATIC] < s.stop_floor * target:
        w[VISIBLE] -= s.stop_floor * w[VISIBLE]
        w[HIDDEN] -= s.stop_floor * w[HIDDEN]
        w[STATIC] += s.stop_floor * target
        for a in range(s.d):
            tr.anchor[i, a] = tr.x[i, a]
            for b in range(s.d):
                tr.anchor_P[i, a, b] = tr.P[i, a, b]


@njit(cache=True)
def take(
    tr: Tracks, i: int, s: Settings, sensor: SensorTable, look: Look, k: int, log_visible: float, temper: float
) -> None:
    """Condition track `i` on detection `k`: state, anchor and hypotheses."""
    n = tr.x.shape[1]
    zhat = np.empty(7)
    H = np.zeros((7, n))
    h6 = np.empty((7, 6))
    y = np.empty(7)
    S = np.empty((7, 7))
    PHt = np.empty((n, 7))
    mask = np.empty(7, np.int64)
    work = np.zeros((2, 3))
    linearise(tr.x[i], s.d, k, look.dt[k], look, sensor, zhat, H, h6, work)
    c = components(look.z[k], s.d, mask)
    innovation(tr.P[i], zhat, H, look.z[k], look.R[k], mask, c, y, S, PHt, s.d, sensor.constant[TIME])
    log_static = log_visible
    fix = np.empty(3)
    fix_R = np.empty((3, 3))
    J = np.zeros((3, 3))
    used = np.empty(3, np.int64)
    if sensor.ranging and world_fix(look, k, s, sensor, fix, fix_R, J, used, np.empty((3, 3))):
        moving = moving_likelihood(tr, i, s, sensor, look, k, fix, fix_R, J, used)
        log_static += static_likelihood(tr, i, s, fix, fix_R, True) - moving
    if sensor.moves_tracks:
        tr.heard[i] |= 1 << (sensor.number % 62)
        # one sensor alone cannot show its own constant errors; where it seems to, linearisation deceives
        alone = tr.heard[i] == 1 << (sensor.number % 62)
        apply_update(tr.x[i], tr.P[i], y, S, PHt, c, n - s.n_constant if alone else n)
    weigh(tr, i, log_visible, log_static, temper)
    if sensor.ranging:
        allow_stop(tr, i, s)
    tr.life[i, 1] = look.t + look.dt[k]
    tr.life[i, 3] += 1.0


@njit(cache=True)
def moving_likelihood(
    tr: Tracks,
    i: int,
    s: Settings,
    sensor: SensorTable,
    look: Look,
    k: int,
    fix: FloatArray,
    fix_R: FloatArray,
    J: FloatArray,
    mask: IntArray,
) -> float:
    """Log-likelihood of a world position under the moving track, biases included: the anchor's rival.

    What the track knows of the sensor's constant errors is taken off `fix`, for the anchor's sake too.
    """
    d = s.d
    n = tr.x.shape[1]
    G = np.zeros((d, n))
    for a in range(d):
        G[a, a] = 1.0
        for e in range(3):
            if sensor.bias[mask[e]] >= 0:
                G[a, sensor.bias[mask[e]]] += J[a, e]
    if sensor.registers:
        velocity = np.zeros(3)
        velocity[:d] = tr.x[i, d : 2 * d]
        C = fix_sensitivity(look, k, sensor, fix, J, mask, velocity)
        for p in range(len(sensor.constant)):
            j = sensor.constant[p]
            if j >= 0:
                G[:, j] = C[:d, p]
                for a in range(d):
                    fix[a] -= C[a, p] * tr.x[i, j]
    GP = G @ tr.P[i]
    L = np.zeros((3, 3))
    y = np.zeros(3)
    value = d * LOG_2PI
    for a in range(d):
        y[a] = fix[a]
        for j in range(n - s.n_constant):  # the constant errors are off already
            y[a] -= G[a, j] * tr.x[i, j]
        for b in range(a + 1):
            acc = fix_R[a, b]
            for j in range(n):
                acc += GP[a, j] * G[b, j]
            for k in range(b):
                acc -= L[a, k] * L[b, k]
            L[a, b] = math.sqrt(max(acc, 1e-300)) if a == b else acc / L[b, b]
        value += 2.0 * math.log(L[a, a])
    for a in range(d):
        acc = y[a]
        for k in range(a):
            acc -= L[a, k] * y[k]
        y[a] = acc / L[a, a]
        value += y[a] * y[a]
    return -0.5 * value


@njit(cache=True)
def world_fix(
    look: Look,
    k: int,
    s: Settings,
    sensor: SensorTable,
    fix: FloatArray,
    fix_R: FloatArray,
    J: FloatArray,
    mask: IntArray,
    work: FloatArray,
) -> bool:
    """Fill a detection's world position (3,) and its white covariance (3, 3); False where it gives no position.

    `work` is (3, 3).
    """
    if position_fix(look, k, s, sensor, fix, J, mask) == 0:
        return False
    component_covariance(look, k, s, sensor, mask, work)
    for a in range(3):
        for b in range(3):
            acc = 0.0
            for e in range(3):
                for f in range(3):
                    acc += J[a, e] * work[e, f] * J[b, f]
            fix_R[a, b] = acc
    return True


@njit(cache=True)
def component_covariance(look: Look, k: int, s: Settings, sensor: SensorTable, mask: IntArray, R: FloatArray) -> None:
    """Fill the covariance (3, 3) of the components in `mask`; what is not measured has its prior spread."""
    for a in range(3):
        for b in range(3):
            value = look.R[k, mask[a], mask[b]]
            R[a, b] = value if math.isfinite(value) else 0.0
        if not math.isfinite(look.R[k, mask[a], mask[a]]):
            spread = 500.0
            if mask[a] == 2:
                spread = min((sensor.elevation_high - sensor.elevation_low) / math.sqrt(12.0), 0.35)
            if s.d == 2:
                spread = 1e-6
            R[a, a] = spread * spread


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
def begin(
    tr: Tracks,
    s: Settings,
    sensor: SensorTable,
    look: Look,
    fate: IntArray,
    owner: IntArray,
    row_of_col: IntArray,
    usable: NDArray[np.bool_],
) -> None:
    """Begin a track at every detection with a position that no track took."""
    d = s.d
    n = tr.x.shape[1]
    J = np.zeros((3, 3))
    fix = np.empty(3)
    mask = np.empty(3, np.int64)
    R = np.zeros((3, 3))
    if tr.live[1] == 0:  # a first look full of targets must not pass for clutter: take them at their number
        spare = 0.0
        for k in range(len(look.dt)):
            spare += 1.0 if usable[k] else 0.0
        tr.undetected[0] = max(tr.undetected[0], spare - tr.clutter[sensor.number, AZIMUTH_BINS])
    pooled = pooled_constants(tr, s)
    expected = tr.undetected[0] * sensor.p_detection
    tr.undetected[0] += s.birth_rate - expected
    for k in range(len(look.dt)):
        if not usable[k] or row_of_col[k] >= 0 or position_fix(look, k, s, sensor, fix, J, mask) == 0:
            continue
        component_covariance(look, k, s, sensor, mask, R)
        i = tr.live[0]
        tr.live[0] += 1
        x, P = tr.x[i], tr.P[i]
        x[:] = 0.0
        P[:, :] = 0.0
        tr.anchor[i] = 0.0
        tr.anchor_P[i] = 0.0
        for j in range(n - 2 * d - s.n_constant):
            P[2 * d + j, 2 * d + j] = s.bias_sigma[j] ** 2
        tell(tr, i, s, pooled)
        for e in range(3):  # position covariance from noise and bias, and what it shares with the bias
            b = sensor.bias[mask[e]]
            for a in range(d):
                if b >= 0:
                    P[a, b] -= J[a, e] * P[b, b]
                    P[b, a] = P[a, b]
        dt = look.dt[k]
        for a in range(d):
            x[a] = fix[a]
            tr.anchor[i, a] = fix[a]
            P[d + a, d + a] = s.speed_sigma**2
            P[a, d + a] = -dt * s.speed_sigma**2  # seen at its own time, kept at the look's
            P[d + a, a] = P[a, d + a]
            for b in range(d):
                acc = 0.0
                shared = 0.0
                for e in range(3):
                    for f in range(3):
                        acc += J[a, e] * R[e, f] * J[b, f]
                    bias = sensor.bias[mask[e]]
                    if bias >= 0:
                        shared += J[a, e] * P[bias, bias] * J[b, e]
                P[a, b] = acc + shared + ((dt * s.speed_sigma) ** 2 if a == b else 0.0)
                tr.anchor_P[i, a, b] = acc
        if sensor.registers:
            apply_constants(tr, i, s, look, k, sensor, fix, J, mask)
        density = tr.clutter[sensor.number, AZIMUTH_BINS]
        born = max(expected / (expected + density), 5.0 * s.delete_below)
        w = tr.weight[i]
        w[VISIBLE] = born * (1.0 - s.static_share)
        w[HIDDEN] = 0.0
        w[STATIC] = born * s.static_share
        w[NOTHING] = 1.0 - born
        tr.birth[i] = look.row[k]
        tr.heard[i] = 1 << (sensor.number % 62)
        tr.life[i, 0] = look.t + look.dt[k]
        tr.life[i, 1] = tr.life[i, 0]
        tr.life[i, 2] = 0.0
        tr.life[i, 3] = 1.0
        fate[k] = INITIATED
        owner[k] = look.row[k]
        if math.isfinite(look.z[k, 3]):
            condition_on_rate(tr, i, s, sensor, look, k)


@njit(cache=True)
def pooled_constants(tr: Tracks, s: Settings) -> FloatArray:
    """Information (k, k + 1) on the constant sensor errors from all shown tracks and those that have ended."""
    k = s.n_constant
    pooled = np.zeros((k, k + 1))
    if k > 0:
        live = tr.live[0]
        sigma = s.bias_sigma[len(s.bias_sigma) - k :]
        pool(tr.x[:live], tr.P[:live], tr.life[:live, 2], tr.told, tr.bank, sigma, pooled)
    return pooled


@njit(cache=True)
def tell(tr: Tracks, i: int, s: Settings, pooled: FloatArray) -> None:
    """Give a new track what is known of the constant errors, and note what it was told."""
    k = s.n_constant
    if k == 0:
        return
    first = tr.x.shape[1] - k
    tr.told[i] = pooled
    covariance = np.linalg.inv(np.ascontiguousarray(pooled[:, :k]))
    for a in range(k):
        tr.x[i, first + a] = 0.0
        for b in range(k):
            tr.x[i, first + a] += covariance[a, b] * pooled[b, k]
            tr.P[i, first + a, first + b] = 0.5 * (covariance[a, b] + covariance[b, a])


@njit(cache=True)
def apply_constants(
    tr: Tracks,
    i: int,
    s: Settings,
    look: Look,
    k: int,
    sensor: SensorTable,
    fix: FloatArray,
    J: FloatArray,
    mask: IntArray,
) -> None:
    """Take the constant errors off a new track's position, with their covariance: pos = fix - C e, e the errors."""
    d = s.d
    n = tr.x.shape[1]
    first = n - s.n_constant
    x, P = tr.x[i], tr.P[i]
    C = fix_sensitivity(look, k, sensor, fix, J, mask, np.zeros(3))
    full = np.zeros((d, n))
    for p in range(len(sensor.constant)):
        j = sensor.constant[p]
        if j >= 0:
            full[:, j] = C[:d, p]
    for a in range(d):
        for j in range(first, n):
            x[a] -= full[a, j] * x[j]
            tr.anchor[i, a] -= full[a, j] * x[j]
    for a in range(d):
        for b in range(d):
            for j in range(first, n):
                for m in range(first, n):
                    P[a, b] += full[a, j] * P[j, m] * full[b, m]
    for a in range(d):
        for j in range(first, n):
            acc = 0.0
            for m in range(first, n):
                acc += full[a, m] * P[m, j]
            P[a, j] -= acc
            P[j, a] = P[a, j]
        if sensor.constant[TIME] >= 0:  # the target moved by an unknown velocity in the unknown time
            lag = sensor.constant[TIME]
            P[a, a] += s.speed_sigma**2 * (P[lag, lag] + x[lag] ** 2)
            P[a, d + a] += s.speed_sigma**2 * x[lag]
            P[d + a, a] = P[a, d + a]


@njit(cache=True)
def save_lesson(tr: Tracks, i: int, s: Settings) -> None:
    """Keep what a track that ends, or becomes another, has learned of the constant errors."""
    k = s.n_constant
    if k == 0 or tr.life[i, 2] == 0.0:
        return
    info = np.empty((k, k))
    vector = np.empty(k)
    learned(tr.x[i], tr.P[i], tr.x.shape[1] - k, info, vector)
    tr.bank[:, :k] += info - tr.told[i, :, :k]
    tr.bank[:, k] += vector - tr.told[i, :, k]
    tr.told[i, :, :k] = info
    tr.told[i, :, k] = vector


@njit(cache=True)
def condition_on_rate(tr: Tracks, i: int, s: Settings, sensor: SensorTable, look: Look, k: int) -> None:
    """Give a new track what its first range rate tells of the velocity."""
    n = tr.x.shape[1]
    zhat = np.empty(7)
    H = np.zeros((7, n))
    h6 = np.empty((7, 6))
    y = np.empty(7)
    S = np.empty((7, 7))
    PHt = np.empty((n, 7))
    mask = np.empty(7, np.int64)
    work = np.zeros((2, 3))
    mask[0] = 3
    linearise(tr.x[i], s.d, k, 0.0, look, sensor, zhat, H, h6, work)
    innovation(tr.P[i], zhat, H, look.z[k], look.R[k], mask, 1, y, S, PHt, s.d, sensor.constant[TIME])
    apply_update(tr.x[i], tr.P[i], y, S, PHt, 1, n - s.n_constant)


@njit(cache=True)
def show(tr: Tracks, s: Settings, sensor: SensorTable, look: Look) -> None:
    """Show the tracks that are probably moving targets within the range for which the sensor answers."""
    last = len(look.dt)
    for i in range(tr.live[0]):
        gap = 0.0
        for a in range(s.d):
            gap += (tr.x[i, a] - look.sensor_position[last, a]) ** 2
        target = tr.weight[i, VISIBLE] + tr.weight[i, HIDDEN]
        if tr.life[i, 2] > 0.0:
            if sensor.report_range == s.farthest_report and gap > (1.1 * sensor.report_range) ** 2:
                save_lesson(tr, i, s)
                tr.life[i, 2] = 0.0
        elif target > s.show_above and gap < sensor.report_range**2 and stands_apart(tr, i, s):
            tr.life[i, 2] = 1.0


@njit(cache=True)
def stands_apart(tr: Tracks, i: int, s: Settings) -> bool:
    """Whether no shown track is so near that `i` may be another part of the same object."""
    for j in range(tr.live[0] if s.apart > 0.0 else 0):
        if tr.life[j, 2] > 0.0 and j != i:
            gap = 0.0
            for a in range(s.d):
                gap += (tr.x[i, a] - tr.x[j, a]) ** 2
            if gap < s.apart**2:
                return False
    return True


@njit(cache=True)
def end_and_merge(tr: Tracks, s: Settings, merging: bool, start: IntArray) -> None:
    """Drop tracks that are probably nothing, and the weaker of two that have become one.

    `start` is the candidate list of this look: a track whose gate holds many detections needs the more weight to live,
    since the next one in it will be its own the less probably.
    """
    n_tracks = tr.live[0]
    keep = np.ones(n_tracks, np.bool_)
    for i in range(n_tracks):
        w = tr.weight[i]
        target = w[VISIBLE] + w[HIDDEN]
        crowd = start[i + 1] - start[i] if i + 1 < len(start) else 1
        if target + w[STATIC] < s.delete_below * max(1, crowd):
            save_lesson(tr, i, s)
            keep[i] = False
        elif target < s.hide_below:
            save_lesson(tr, i, s)
            tr.life[i, 2] = 0.0
    order = np.argsort(tr.x[:n_tracks, 0])  # neighbours lie next to each other in the east
    for a in range(n_tracks if merging else 0):
        i = order[a]
        for b in range(a + 1, n_tracks):
            j = order[b]
            if tr.x[j, 0] - tr.x[i, 0] > s.merge_distance or not keep[i]:
                break
            if keep[j] and are_one(tr, i, j, s):
                weaker = j if rank(tr, i) >= rank(tr, j) else i
                keep[weaker] = False
                save_lesson(tr, weaker, s)
    at = 0
    for i in range(n_tracks):
        if keep[i]:
            if at != i:
                tr.birth[at] = tr.birth[i]
                tr.x[at] = tr.x[i]
                tr.P[at] = tr.P[i]
                tr.weight[at] = tr.weight[i]
                tr.anchor[at] = tr.anchor[i]
                tr.anchor_P[at] = tr.anchor_P[i]
                tr.life[at] = tr.life[i]
                tr.told[at] = tr.told[i]
                tr.heard[at] = tr.heard[i]
            at += 1
    tr.live[0] = at


@njit(cache=True)
def are_one(tr: Tracks, i: int, j: int, s: Settings) -> bool:
    """Whether two tracks, each hit more than once, are at one place and move alike."""
    if tr.life[i, 3] < 2.0 or tr.life[j, 3] < 2.0:
        return False
    gap = 0.0
    speed = 0.0
    spread = 0.0
    for a in range(s.d):
        v = s.d + a
        gap += (tr.x[i, a] - tr.x[j, a]) ** 2
        speed += (tr.x[i, v] - tr.x[j, v]) ** 2
        spread += tr.P[i, v, v] + tr.P[j, v, v]
    return bool(gap <= s.merge_distance**2 and speed <= 4.0 * spread)


@njit(cache=True)
def rank(tr: Tracks, i: int) -> float:
    """Which of two tracks that are one should stay: a shown one, then the more probable, then the older."""
    return float(tr.life[i, 2] + tr.weight[i, VISIBLE] + tr.weight[i, HIDDEN] - 1e-9 * tr.birth[i])
