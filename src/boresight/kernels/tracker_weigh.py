"""What a look says of a track: visible target, hidden, standing still, or nothing; and its update."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from boresight.kernels.options import LEAF, PART
from boresight.kernels.tracker import HIDDEN, STATIC, VISIBLE, IntArray, Look, Models, SensorTable, Settings, Tracks
from boresight.kernels.tracker_models import combine_models, condition_models
from boresight.kernels.tracker_place import Places, fix_sensitivity, lacks_height, put_at_height
from boresight.kernels.tracker_state import condition, factor, learners, whiten
from boresight.kernels.tracker_workroom import Workroom
from boresight.types.sensor import FloatArray

LOG_2PI = math.log(2.0 * math.pi)


@njit(**LEAF)
def evidence(
    i: int, start: IntArray, column: IntArray, loglik: FloatArray, row_of_col: IntArray, p_d: float, share: float
) -> tuple[float, float]:
    """Log-likelihoods of this look if track `i` is a visible target, and if it is an object that does not move.

    Over that if it is nothing: missed, or any of the detections in its gate that no other track took (Musicki, Evans,
    Stankovic 1994, the IPDA likelihood ratio). The object is detected with `share` of the probability `p_d`.
    """
    ratio = 0.0
    for e in range(start[i], start[i + 1]):
        if row_of_col[column[e]] == i or row_of_col[column[e]] < 0:
            ratio += math.exp(min(loglik[e], 100.0))
    visible = math.log(1.0 - p_d + p_d * ratio)
    if share == 1.0:
        return visible, visible
    return visible, math.log(1.0 - share * p_d + share * p_d * ratio)


@njit(**LEAF)
def merged(tr: Tracks, i: int, s: Settings, sensor: SensorTable, col_of_row: IntArray) -> int:
    """Return the detection of a near shown track that may be one with what track `i` would have had, -1 for none.

    Near is nearer than what the sensor resolves, as far as the two places are known.
    """
    if sensor.resolution <= 0.0:
        return -1
    for j in range(len(col_of_row)):
        if col_of_row[j] < 0 or j == i or tr.life[j, 2] == 0.0:
            continue
        gap = 0.0
        for a in range(s.d):
            gap += (tr.x[i, a] - tr.x[j, a]) ** 2 - (tr.P[i, a, a] + tr.P[j, a, a])
        if gap < sensor.resolution**2:
            return int(col_of_row[j])
    return -1


@njit(cache=True)
def follow_blob(
    tr: Tracks,
    i: int,
    s: Settings,
    sensor: SensorTable,
    look: Look,
    fix: FloatArray,
    k: int,
    models: Models | None,
) -> None:
    """Keep a track that was not detected alone near the detection `k` at `fix` (3,) that may hold it too.

    Where only bearings placed the track, across the line of sight is theirs.
    """
    axes = 1 if tr.heard[i] == 0 else 2
    if models is None:
        draw_in(tr.x[i], tr.P[i], s.d, axes, sensor, look, fix, k)
    else:
        for j in range(tr.mode.shape[1]):
            draw_in(tr.mode_x[i, j], tr.mode_P[i, j], s.d, axes, sensor, look, fix, k)
        combine_models(tr, i)


@njit(**PART)
def draw_in(
    x: FloatArray, P: FloatArray, d: int, axes: int, sensor: SensorTable, look: Look, fix: FloatArray, k: int
) -> None:
    """Draw (x, P) to a blob at `fix` (3,): along the line of sight, and with two `axes` across it.

    A variance that has grown beyond that of the blob (half its size) comes down to it and never lower: the second look
    at a blob says nothing that the first did not.
    """
    n = len(x)
    east, north = fix[0] - look.sensor_position[k, 0], fix[1] - look.sensor_position[k, 1]
    far = max(math.hypot(east, north), 1e-9)
    axis = np.zeros(d)
    for turn in range(axes):
        axis[0], axis[1] = (east / far, north / far) if turn == 0 else (north / far, -east / far)
        Pa = np.zeros(n)
        for a in range(n):
            for b in range(d):
                Pa[a] += P[a, b] * axis[b]
        variance = 0.0
        off = 0.0
        for a in range(d):
            variance += axis[a] * Pa[a]
            off += axis[a] * (fix[a] - x[a])
        wanted = (0.5 * sensor.resolution) ** 2
        if variance > wanted:
            gain = (1.0 - wanted / variance) / variance
            for a in range(n):
                x[a] += gain * Pa[a] * off
                for b in range(n):
                    P[a, b] -= gain * Pa[a] * Pa[b]


@njit(**LEAF)
def weigh(tr: Tracks, i: int, log_visible: float, log_static: float, temper: float) -> None:
    """Multiply the weights by the likelihoods of the hypotheses (hidden and nothing: 1) and normalise.

    Against the best of them, in logarithms: however improbable a look, something remains.
    """
    w = tr.weight[i]
    best = -math.inf
    for a in range(4):
        if w[a] > 0.0:
            w[a] = math.log(w[a])
            if a == VISIBLE:
                w[a] += temper * log_visible
            elif a == STATIC:
                w[a] += temper * log_static
            best = max(best, w[a])
        else:
            w[a] = -math.inf
    total = 0.0
    for a in range(4):
        w[a] = math.exp(w[a] - best)
        total += w[a]
    for a in range(4):
        w[a] /= total


@njit(**LEAF)
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


@njit(**LEAF)
def static_likelihood(tr: Tracks, i: int, s: Settings, fix: FloatArray, fix_R: FloatArray, room: Workroom) -> float:
    """Log-likelihood of a position fix (world ENU) under "it does not move", on which the anchor is conditioned."""
    d = s.d
    L, W, y = room.L, room.W, room.v
    for a in range(d):
        y[a] = fix[a] - tr.anchor[i, a]
        for b in range(a + 1):
            L[a, b] = tr.anchor_P[i, a, b] + fix_R[a, b]
    factor(L, d)
    whiten(y, L, d)
    nis = 0.0
    logdet = 0.0
    for a in range(d):
        nis += y[a] * y[a]
        logdet += math.log(L[a, a])
    for c in range(d):
        for a in range(d):
            acc = tr.anchor_P[i, a, c]
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
    return -0.5 * (nis + 2.0 * logdet + d * LOG_2PI)


@njit(**LEAF)
def moving_likelihood(
    tr: Tracks, i: int, s: Settings, sensor: SensorTable, look: Look, k: int, at: Places, room: Workroom
) -> float:
    """Log-likelihood of a detection's place under the moving track, biases included: the anchor's rival.

    What the track knows of the sensor's constant errors is taken off `room.fix`, for the anchor's sake too.
    """
    d = s.d
    n = tr.x.shape[1]
    x, P, G, fix, mask, J = tr.x[i], tr.P[i], room.G, room.fix, at.mask[k], at.J[k]
    L, y = room.L, room.v
    for a in range(d):  # G holds what is beside the position: biases and constant errors
        fix[a] = at.fix[k, a]
        for j in range(2 * d, n):
            G[a, j] = 0.0
        for e in range(3):
            if sensor.bias[mask[e]] >= 0:
                G[a, sensor.bias[mask[e]]] += J[a, e]
    if sensor.registers:
        fix_sensitivity(look, k, at.fix[k], J, mask, (x[d], x[d + 1], x[d + 2] if d == 3 else 0.0), room)
        C = room.C
        for p in range(len(sensor.constant)):
            j = sensor.constant[p]
            if j >= 0:
                for a in range(d):
                    G[a, j] = C[a, p]
                    fix[a] -= C[a, p] * x[j]
    dt = look.dt[k]  # the place is that of the detection's own time
    for a in range(d):
        y[a] = fix[a] - x[a] - dt * x[d + a]
        for j in range(2 * d, n - s.n_constant):  # the constant errors are off already
            y[a] -= G[a, j] * x[j]
        for b in range(a + 1):
            acc = at.covariance[k, a, b] + P[a, b] + dt * (P[a, d + b] + P[d + a, b] + dt * P[d + a, d + b])
            for j in range(2 * d, n):
                acc += (P[a, j] + dt * P[d + a, j]) * G[b, j] + G[a, j] * (P[j, b] + dt * P[j, d + b])
                for m in range(2 * d, n):
                    acc += G[a, j] * P[j, m] * G[b, m]
            L[a, b] = acc
    factor(L, d)
    whiten(y, L, d)
    value = d * LOG_2PI
    for a in range(d):
        value += 2.0 * math.log(L[a, a])
    for a in range(d):
        value += y[a] * y[a]
    return -0.5 * value


@njit(**LEAF)
def still_over_moving(
    tr: Tracks, i: int, s: Settings, sensor: SensorTable, look: Look, k: int, at: Places, room: Workroom
) -> float:
    """Log-likelihood of a detection's place if track `i` does not move, over that if it does; conditions the anchor.

    A detection without height is put at the height of what it is held against: only in the plane does it say where.
    """
    level = lacks_height(look.z[k], s)
    if level:
        put_at_height(look, k, s, sensor, at, tr.x[i, 2])
    moving = moving_likelihood(tr, i, s, sensor, look, k, at, room)
    if level and not sensor.registers:
        put_at_height(look, k, s, sensor, at, tr.anchor[i, 2])
        for a in range(3):
            room.fix[a] = at.fix[k, a]
    return float(static_likelihood(tr, i, s, room.fix, at.covariance[k], room) - moving)


@njit(**LEAF)
def take(
    tr: Tracks,
    i: int,
    s: Settings,
    sensor: SensorTable,
    look: Look,
    k: int,
    at: Places,
    room: Workroom,
    log_visible: float,
    log_static: float,
    temper: float,
    models: Models | None,
) -> None:
    """Condition track `i` on detection `k`: state, anchor and hypotheses."""
    if at.there[k]:
        log_static += still_over_moving(tr, i, s, sensor, look, k, at, room)
    if sensor.moves_tracks:
        considered = learners(tr, i, s, sensor)
        if models is None:
            condition(tr.x[i], tr.P[i], s.d, k, look, sensor, room, considered)
        else:
            condition_models(tr, i, s, k, look, sensor, room, considered, models)
    weigh(tr, i, log_visible, log_static, temper)
    note_hit(tr, i, s, sensor, look.t + look.dt[k], sensor.moves_tracks)


@njit(**LEAF)
def note_hit(tr: Tracks, i: int, s: Settings, sensor: SensorTable, t: float, moved: bool) -> None:
    """Remember that track `i` was detected at time `t` (s), and whether that moved it."""
    if sensor.ranging:
        allow_stop(tr, i, s)
    if moved:
        tr.heard[i] |= 1 << (sensor.number % 62)
    tr.life[i, 1] = t
    tr.life[i, 3] += 1.0
