"""How a track begins, and what it is told of the sensors' constant errors."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from boresight.kernels.options import LEAF, PART
from boresight.kernels.registration import TIME, learned, pool
from boresight.kernels.tracker import (
    AZIMUTH_BINS,
    HIDDEN,
    INITIATED,
    NOTHING,
    STATIC,
    VISIBLE,
    Extras,
    IntArray,
    Look,
    Models,
    SensorTable,
    Settings,
    Tracks,
)
from boresight.kernels.tracker_heights import CELL, how_many, lift, narrow, prior_weight
from boresight.kernels.tracker_messages import find_owned, forget_messages, note_message, part_told
from boresight.kernels.tracker_models import begin_component, begin_models, combine_models, give_up_heights
from boresight.kernels.tracker_place import (
    Places,
    fix_sensitivity,
    heights,
    lacks_height,
    place_covariance,
    put_at_height,
)
from boresight.kernels.tracker_state import apply_update, innovation, linearise
from boresight.kernels.tracker_workroom import Workroom
from boresight.kernels.write import write_matrix, write_vector
from boresight.types.sensor import FloatArray


@njit(**PART)
def begin(
    tr: Tracks,
    s: Settings,
    sensor: SensorTable,
    look: Look,
    fate: IntArray,
    owner: IntArray,
    row_of_col: IntArray,
    usable: NDArray[np.bool_],
    at: Places,
    room: Workroom,
    extras: Extras,
    models: Models | None,
) -> None:
    """Begin a track at every detection with a position that no track took."""
    if tr.live[1] == 0:  # a first look full of targets must not pass for clutter: take them at their number
        spare = 0.0
        for k in range(len(look.dt)):
            spare += 1.0 if usable[k] else 0.0
        tr.undetected[0] = max(tr.undetected[0], spare - tr.clutter[sensor.number, AZIMUTH_BINS])
    pooled = tr.bank
    if extras is not None:
        pooled = pooled_constants(tr, s)
    part = part_told(tr, sensor, len(look.dt))
    expected = tr.undetected[0] * sensor.p_detection * part
    tr.undetected[0] += s.birth_rate * part - expected
    owned = np.zeros(len(look.dt))
    if sensor.spoken >= 0:
        find_owned(tr, sensor, look, owned)
    for k in range(len(look.dt)):
        if row_of_col[k] >= 0 or not at.there[k]:
            continue
        i = new_track(tr, s, look, k, 1 << (sensor.number % 62))
        if sensor.witness >= 0:
            tr.witness[i, sensor.witness, 0] = 1.0  # it does report this one
        if extras is not None:
            tell(tr, i, s, pooled)
        if models is not None and lacks_height(look.z[k], s):
            begin_on_arc(tr, i, s, sensor, look, k, at, room, extras, models)
        else:
            first_state(tr, i, s, sensor, look, k, at, room, extras, look_has_height(look.z[k], s))
            if models is not None:
                begin_models(tr, i, models)
        density = tr.clutter[sensor.number, AZIMUTH_BINS]
        new = expected * (sensor.wrong_id if owned[k] > 0.0 else 1.0)
        born = max(new / (new + density), 5.0 * s.delete_below)
        w = tr.weight[i]
        w[VISIBLE] = born * (1.0 - s.static_share)
        w[HIDDEN] = 0.0
        w[STATIC] = born * s.static_share
        w[NOTHING] = 1.0 - born
        fate[k] = INITIATED
        owner[k] = look.row[k]
        if sensor.spoken >= 0:
            note_message(tr, i, sensor, look.t + look.dt[k], look.address[k])


@njit(**LEAF)
def look_has_height(z: FloatArray, s: Settings) -> bool:
    """Whether a detection that gives a place gives its height too, or there is none to give."""
    return bool(s.d == 2 or math.isfinite(z[2]) or math.isfinite(z[6]))


@njit(**PART)
def first_state(
    tr: Tracks,
    i: int,
    s: Settings,
    sensor: SensorTable,
    look: Look,
    k: int,
    at: Places,
    room: Workroom,
    extras: Extras,
    height_known: bool,
) -> None:
    """Give the new track `i` the place of detection `k` as `at` has it, and a velocity that nobody knows yet."""
    d = s.d
    fix, J, R, mask = at.fix[k], at.J[k], at.R[k], at.mask[k]
    x, P = tr.x[i], tr.P[i]
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
        speed = s.speed_sigma if height_known or a < 2 else s.climb_sigma
        P[d + a, d + a] = speed**2
        P[a, d + a] = -dt * speed**2  # seen at its own time, kept at the look's
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
            P[a, b] = acc + shared + ((dt * speed) ** 2 if a == b else 0.0)
            tr.anchor_P[i, a, b] = acc
    if extras is not None and sensor.registers:
        apply_constants(tr, i, s, look, k, sensor, fix, J, mask, room)
    if math.isfinite(look.z[k, 3]):
        condition_on_rate(tr, i, s, sensor, look, k, room)


@njit(**PART)
def begin_on_arc(
    tr: Tracks,
    i: int,
    s: Settings,
    sensor: SensorTable,
    look: Look,
    k: int,
    at: Places,
    room: Workroom,
    extras: Extras,
    models: Models,
) -> None:
    """Give the new track `i` several heights along the arc on which detection `k` leaves it (`tracker_heights`)."""
    n, own = tr.x.shape[1], look.sensor_position[k, 2]
    x, P = tr.x[i].copy(), tr.P[i].copy()
    for c in range(tr.mode.shape[1]):
        tr.mode[i, c] = 0.0
    low, high = heights(look, k, s, sensor)
    begin_, span = lift(look, k, low), lift(look, k, high) - lift(look, k, low)
    count = how_many(span, narrow(look, k), models.heights)
    width = span / count / CELL
    for h in range(count):
        angle = begin_ + span * (h + 0.5) / count
        up = own + look.z[k, 0] * math.sin(angle)
        share = math.cos(angle) * prior_weight(look, k, s, sensor, up, np.inf)  # every metre of height alike
        for a in range(n):
            tr.x[i, a] = x[a]
            for b in range(n):
                tr.P[i, a, b] = P[a, b]
        put_at_height(look, k, s, sensor, at, up)
        at.R[k, 2, 2] = width * width
        place_covariance(at, k)
        first_state(tr, i, s, sensor, look, k, at, room, extras, False)
        begin_component(tr, i, h, max(share, 1e-12), models)
    give_up_heights(tr, i, models)
    combine_models(tr, i)
    put_at_height(look, k, s, sensor, at, tr.x[i, 2])  # what does not move stands anywhere on the arc too
    for a in range(3):
        tr.anchor[i, a] = at.fix[k, a]
        for b in range(3):
            tr.anchor_P[i, a, b] = at.covariance[k, a, b]


@njit(**LEAF)
def new_track(tr: Tracks, s: Settings, look: Look, k: int, heard: int) -> int:
    """Return the row of a track that detection `k` begins: all zero but for the variance of the wandering biases."""
    i = tr.live[0]
    tr.live[0] += 1
    n = tr.x.shape[1]
    for a in range(n):
        tr.x[i, a] = 0.0
        for b in range(n):
            tr.P[i, a, b] = 0.0
    for j in range(2 * s.d, n - s.n_constant):
        tr.P[i, j, j] = s.bias_sigma[j - 2 * s.d] ** 2
    for a in range(3):
        tr.anchor[i, a] = 0.0
        for b in range(3):
            tr.anchor_P[i, a, b] = 0.0
    for a in range(tr.witness.shape[1]):
        for b in range(2):
            tr.witness[i, a, b] = -1.0
    forget_messages(tr, i)
    tr.birth[i] = look.row[k]
    tr.heard[i] = heard
    tr.life[i, 0] = look.t + look.dt[k]
    tr.life[i, 1] = tr.life[i, 0]
    tr.life[i, 2] = 0.0
    tr.life[i, 3] = 1.0
    return int(i)


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


@njit(**PART)
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


@njit(**PART)
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
    room: Workroom,
) -> None:
    """Take the constant errors off a new track's position, with their covariance: pos = fix - C e, e the errors."""
    d = s.d
    n = tr.x.shape[1]
    first = n - s.n_constant
    x, P = tr.x[i], tr.P[i]
    fix_sensitivity(look, k, fix, J, mask, (0.0, 0.0, 0.0), room)
    C = room.C
    full = np.zeros((d, n))
    for p in range(len(sensor.constant)):
        j = sensor.constant[p]
        if j >= 0:
            for a in range(d):
                full[a, j] = C[a, p]
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


@njit(**PART)
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
    write_matrix(tr.told[i], info)
    write_vector(tr.told[i, :, k], vector)


@njit(**PART)
def condition_on_rate(tr: Tracks, i: int, s: Settings, sensor: SensorTable, look: Look, k: int, room: Workroom) -> None:
    """Give a new track what its first range rate tells of the velocity."""
    room.mask[0] = 3
    linearise(tr.x[i], s.d, k, 0.0, look, sensor, 1, room)
    innovation(tr.P[i], look.z[k], look.R[k], 1, room, s.d, sensor.constant[TIME])
    apply_update(tr.x[i], tr.P[i], 1, room, tr.x.shape[1] - s.n_constant)
