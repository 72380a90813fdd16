"""One scan through the tracker: the order of things is the order of the functions below."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from boresight.kernels.assignment import assign_sparse
from boresight.kernels.options import COUNTED, LEAF
from boresight.kernels.tracker import (
    NOTHING,
    OUTSIDE,
    UNASSOCIATED,
    UPDATED,
    Extras,
    IntArray,
    Look,
    Models,
    SensorTable,
    Settings,
    Tracks,
)
from boresight.kernels.tracker_begin import begin
from boresight.kernels.tracker_clutter import learn_clutter
from boresight.kernels.tracker_end import end_and_merge, show
from boresight.kernels.tracker_gate import gate_all
from boresight.kernels.tracker_heights import settle_heights
from boresight.kernels.tracker_joint import shares, take_shares
from boresight.kernels.tracker_messages import in_message, note_message, note_pace
from boresight.kernels.tracker_place import covered, places_of, within
from boresight.kernels.tracker_predict import predict_all
from boresight.kernels.tracker_split import begin_beside, keep_beside, unplaced
from boresight.kernels.tracker_weigh import evidence, follow_blob, merged, note_hit, take, weigh
from boresight.kernels.tracker_witness import corroborate, in_view, learn_reports, presence, recall, reports
from boresight.kernels.tracker_workroom import Workroom
from boresight.types.sensor import FloatArray


@njit(**COUNTED)
def scan_step(
    tr: Tracks,
    s: Settings,
    sensor: SensorTable,
    look: Look,
    fate: IntArray,
    owner: IntArray,
    nis_of: FloatArray,
    room: Workroom,
    extras: Extras,
    models: Models | None,
) -> None:
    """Take one scan: predict, gate, assign, update, weigh, begin and end tracks; `fate`, `owner`, `nis_of` are (m,).

    `owner` is the birth row of the track that a detection updated, began, or was nearest to (-1: none). The arrays of
    `tr` must have room for m more tracks. Without `extras` there are no constant errors, shares, or second bearings;
    with `models` targets manoeuvre.
    """
    predict_all(tr, s, look.t, models)
    m = len(look.dt)
    n_tracks = tr.live[0]
    usable = np.zeros(m, np.bool_)
    screen(look, sensor, usable, fate, owner, nis_of)
    at = places_of(look, s, sensor, usable)
    p_d = np.zeros(n_tracks)
    temper, elapsed = independence(tr, sensor, look)
    note_pace(tr, sensor, elapsed, m)
    for i in range(n_tracks):
        p_d[i] = detection_probability(tr.x[i], s.d, look, sensor)
        if sensor.single:
            p_d[i] *= in_message(tr, i, sensor, m)
    start, column, cost, distance, loglik = gate_all(
        tr, s, sensor, look, usable, at, p_d, room, fate, owner, nis_of, models
    )
    col_of_row = np.full(n_tracks, -1, np.int64)
    assign_sparse(start, column, cost, m, col_of_row)
    row_of_col = np.full(m, -1, np.int64)
    for i in range(n_tracks):
        if col_of_row[i] >= 0:
            row_of_col[col_of_row[i]] = i
    claims, rivals = np.zeros(m, np.int64), np.zeros(m)
    count_claims(tr, sensor, p_d, start, column, claims, rivals)
    by_chance = recall(tr, sensor, elapsed)
    share = loglik
    if extras is not None and (sensor.joint or (s.blob_share > 0.0 and not sensor.ranging and unplaced(tr))):
        share = shares(tr, s, sensor, start, column, loglik, p_d, m)
    for i in range(n_tracks):
        if p_d[i] <= 0.0:
            pass_over(tr, i, s, sensor, look.t, temper)
            continue
        k = col_of_row[i]
        bearing = not sensor.ranging and not sensor.joint and tr.heard[i] > 0
        confirms = bearing and not sensor.moves_tracks
        own = bearing and credible(tr, i, sensor, p_d[i])
        found, rival = 1, 0.0
        if confirms:
            view = in_view(tr, i, sensor, p_d[i])
            found, rival = presence(start[i], start[i + 1], column, claims, rivals, own, view)
        elif bearing and s.lonely_bearings and contested(start[i], start[i + 1], column, claims, own):
            found = -1
        if k >= 0 and (found < 0 or (confirms and claims[k] > int(own))):  # nobody's
            row_of_col[k] = -1
            fate[k] = UNASSOCIATED
            k = -1
        if found < 0:  # ambiguous: neither evidence nor update
            continue
        if k >= 0:
            e = start[i]
            while column[e] != k:
                e += 1
            fate[k] = UPDATED
            owner[k] = tr.birth[i]
            nis_of[k] = distance[e]
            if sensor.spoken >= 0:
                note_message(tr, i, sensor, look.t + look.dt[k], look.address[k])
        if confirms:
            corroborate(tr, i, sensor, p_d[i], found == 1, rival, temper, by_chance)
            if k >= 0:
                note_hit(tr, i, s, sensor, look.t + look.dt[k], False)
            continue
        blob = merged(tr, i, s, sensor, col_of_row) if k < 0 else -1
        if blob >= 0:
            if at.there[blob]:
                follow_blob(tr, i, s, sensor, look, at.fix[blob], blob, models)
            continue
        if extras is not None and (sensor.joint or (tr.heard[i] == 0 and not sensor.ranging)):
            take_shares(tr, i, s, sensor, look, at, room, start, column, share, k, p_d[i], temper, models)
            if models is not None and k >= 0 and models.heights > 1:
                settle_heights(tr, i, s, sensor, look, k, models)
            continue
        p_seen = p_d[i] * reports(tr, i, sensor)
        log_visible, log_static = evidence(i, start, column, loglik, row_of_col, p_seen, sensor.sees_static)
        learn_reports(tr, i, sensor, log_visible, temper)
        if k >= 0:
            take(tr, i, s, sensor, look, k, at, room, log_visible, log_static, temper, models)
            if models is not None and models.heights > 1:
                settle_heights(tr, i, s, sensor, look, k, models)
        else:
            weigh(tr, i, log_visible, log_static, temper)
    if extras is not None and s.blob_share > 0.0 and unplaced(tr):
        keep_beside(tr, s, sensor, look, col_of_row, usable, room, models)
    learn_clutter(tr, s, sensor, look, claims, row_of_col, usable)
    if sensor.ranging:
        begin(tr, s, sensor, look, fate, owner, row_of_col, usable, at, room, extras, models)
    elif extras is not None and s.blob_share > 0.0 and m > 1:
        begin_beside(tr, s, sensor, look, fate, owner, usable, room, models)
    show(tr, s, extras)
    end_and_merge(tr, s, sensor.ranging, start, extras, models)
    tr.live[1] += 1


@njit(**LEAF)
def screen(
    look: Look,
    sensor: SensorTable,
    usable: NDArray[np.bool_],
    fate: IntArray,
    owner: IntArray,
    nis_of: FloatArray,
) -> None:
    """Fill which detections lie within the coverage, and what is known of the detections so far."""
    for k in range(len(look.dt)):
        usable[k] = covered(look.z[k], sensor)
        fate[k] = UNASSOCIATED if usable[k] else OUTSIDE
        owner[k] = -1
        nis_of[k] = math.nan


@njit(**LEAF)
def credible(tr: Tracks, i: int, sensor: SensorTable, p_d: float) -> bool:
    """Whether track `i` has a say in whose a detection is: it is shown, or this sensor would see it if any.

    `p_d` is the probability that it is detected where it stands.
    """
    return bool(tr.life[i, 2] > 0.0 or in_view(tr, i, sensor, p_d) > 0.5)


@njit(**LEAF)
def count_claims(
    tr: Tracks,
    sensor: SensorTable,
    p_d: FloatArray,
    start: IntArray,
    column: IntArray,
    claims: IntArray,
    rivals: FloatArray,
) -> None:
    """Add to `claims` (m,) how many credible tracks could claim each detection, to `rivals` (m,) what all expect."""
    for i in range(len(start) - 1):
        if start[i + 1] > start[i]:
            there = in_view(tr, i, sensor, p_d[i])
            counts = credible(tr, i, sensor, p_d[i])
            for e in range(start[i], start[i + 1]):
                claims[column[e]] += int(counts)
                rivals[column[e]] += there


@njit(**LEAF)
def contested(first: int, end: int, column: IntArray, claims: IntArray, own: bool) -> bool:
    """Whether a track has several detections in its gate (edges `first` to `end`), or one that another could claim."""
    return end - first > 1 or (end > first and claims[column[first]] > int(own))


@njit(**LEAF)
def independence(tr: Tracks, sensor: SensorTable, look: Look) -> tuple[float, float]:
    """Return how much of a look is new evidence since the sensor's last one, 0 to 1, and how long ago that was (s).

    Notes the look's time and place.
    """
    last = tr.last_look[sensor.number]
    elapsed = max(look.t - last[0], 0.0)
    last[0] = look.t
    for a in range(3):
        last[1 + a] = look.sensor_position[len(look.dt), a]
    return (min(1.0, elapsed / sensor.decorrelation) if sensor.decorrelation > 0.0 else 1.0), elapsed


@njit(**LEAF)
def pass_over(tr: Tracks, i: int, s: Settings, sensor: SensorTable, t: float, temper: float) -> None:
    """Weigh a track that this sensor cannot see at time `t` (s): it may not wait out of sight for ever."""
    if t - tr.life[i, 1] > s.survival_time:  # no sensor has reported it for longer than targets last
        for a in range(4):
            tr.weight[i, a] = 0.0
        tr.weight[i, NOTHING] = 1.0
    elif not sensor.single and tr.life[i, 3] < 2.0 and tr.heard[i] == 1 << (sensor.number % 62):
        # begun at the very edge of the coverage, where it cannot be seen again
        log_miss = math.log(1.0 - sensor.p_detection)
        weigh(tr, i, log_miss, log_miss, temper)


@njit(**LEAF)
def detection_probability(x: FloatArray, d: int, look: Look, sensor: SensorTable) -> float:
    """Probability that the sensor, looking once, reports a visible target with state `x`; 0 outside coverage."""
    m = len(look.dt)
    own, axes = look.sensor_position[m], look.enu_from_sensor[m]
    p0, p1 = x[0] - own[0], x[1] - own[1]
    p2 = (x[2] if d == 3 else 0.0) - own[2]
    d0 = axes[0, 0] * p0 + axes[1, 0] * p1 + axes[2, 0] * p2
    d1 = axes[0, 1] * p0 + axes[1, 1] * p1 + axes[2, 1] * p2
    d2 = axes[0, 2] * p0 + axes[1, 2] * p1 + axes[2, 2] * p2
    range_m = math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    if not within(range_m, math.nan, math.nan, sensor, 0.0):  # angles only where needed: they cost most
        return 0.0
    azimuth = math.atan2(d0, d1) if sensor.azimuth_span < 2.0 * math.pi else math.nan
    limited = sensor.elevation_low > -0.5 * math.pi or sensor.elevation_high < 0.5 * math.pi
    elevation = math.atan2(d2, math.hypot(d0, d1)) if limited else math.nan
    if not within(range_m, azimuth, elevation, sensor, 0.0):
        return 0.0
    p = sensor.p_detection
    if math.isfinite(sensor.fade_range):
        p /= 1.0 + (range_m / sensor.fade_range) ** 4
    return p
