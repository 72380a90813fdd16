"""One scan through the tracker: the order of things is the order of the functions below."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from boresight.kernels.assignment import assign_sparse
from boresight.kernels.measurement import measure
from boresight.kernels.tracker import (
    NOTHING,
    OUTSIDE,
    UNASSOCIATED,
    UPDATED,
    IntArray,
    Look,
    SensorTable,
    Settings,
    Tracks,
)
from boresight.kernels.tracker_begin import begin
from boresight.kernels.tracker_end import end_and_merge, show
from boresight.kernels.tracker_gate import gate_all, learn_clutter
from boresight.kernels.tracker_place import coverage_of
from boresight.kernels.tracker_state import predict_all
from boresight.kernels.tracker_weigh import evidence, merged, take, weigh
from boresight.types.sensor import FloatArray


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
