"""Looks in the order in which they arrive, tracks as if they had come in the order of validity.

Every look within the window is kept, with copies of the tracks at intervals. A look that is older than the newest one
goes to its place: the nearest copy before it is taken up again and what follows is done anew. The result equals
in-order processing because it is in-order processing.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from boresight.kernels.tracker import IntArray, SensorTable, Settings, Tracks
from boresight.kernels.tracker_copies import Copies, drop, keep, restore, with_room
from boresight.kernels.tracker_looks import NO_SENSOR, Looks, look_at, sensor_at
from boresight.kernels.tracker_rows import (
    ARRIVAL,
    PENDING,
    Clock,
    RowTable,
    note_arrival,
    row_table,
    rows_at_arrival,
    rows_before,
)
from boresight.kernels.tracker_scan import scan_step
from boresight.types.sensor import FloatArray

COPY_INTERVAL = 0.5  # s of validity between two copies of the tracks
TAKEN, LATE, NO_POSE = 0, 1, 2  # what became of a look


class Fates(NamedTuple):
    """What became of the looks and of their detections; may change while a look is in the window."""

    outcome: IntArray  # (L,) TAKEN, LATE or NO_POSE
    code: IntArray  # (M,)
    owner: IntArray  # (M,) birth row of a track
    nis: FloatArray  # (M,)


@njit(cache=True)
def advance(
    tr: Tracks,
    copies: Copies,
    empty: Tracks,
    s: Settings,
    sensors: SensorTable,
    looks: Looks,
    fates: Fates,
    held: int,
    length: float,
    keep_after: float,
    clock: Clock,
    period: FloatArray,
    coast_after: float,
) -> tuple[Tracks, Copies, IntArray, RowTable]:
    """Take looks in order of arrival; consumes `tr` and `copies`.

    Args:
        tr, copies: the tracks now, and those to which one may go back.
        empty: the tracks before the first look.
        s, sensors: settings, all sensors (`columns_of`).
        looks, fates: the first `held` lie in the window already, in order of validity; the others are new.
        length: of the window (s); copies of a later time than `keep_after` (s) are kept however old.
        clock, period, coast_after: when rows are due (`tracker_rows`).

    Returns:
        tracks, copies, the places of all looks in the window in order of validity, and the rows due on the way.
    """
    total = len(looks.t)
    order = np.empty(total, np.int64)
    for k in range(held):
        order[k] = k
    n = held
    rows = row_table(16, s.d)
    for k in range(held, total):
        t_recv = looks.arrival[k]
        if clock.now[PENDING] != 0.0 and t_recv > clock.now[ARRIVAL]:
            rows = rows_at_arrival(tr, s, clock, period, coast_after, rows)
            rows = rows_before(tr, s, clock, t_recv, coast_after, rows)
        if looks.sensor[k] == NO_SENSOR:
            if t_recv > clock.now[ARRIVAL] > -math.inf:
                clock.now[ARRIVAL], clock.now[PENDING] = t_recv, 1.0
            continue
        note_arrival(clock, looks.sensor[k], t_recv)
        t = looks.t[k]
        if math.isnan(t):
            fates.outcome[k] = NO_POSE
            continue
        newest = looks.t[order[n - 1]] if n > 0 else -math.inf
        if t < newest - length:
            fates.outcome[k] = LATE
            continue
        at = n
        while at > 0 and looks.t[order[at - 1]] > t:
            order[at] = order[at - 1]
            at -= 1
        order[at] = k
        n += 1
        if at < n - 1:
            tr, at = go_back(tr, copies, empty, looks, order, at)
        for j in range(at, n):
            k_now = order[j]
            t_now = looks.t[k_now]
            c = copies.used[0]
            if length > 0.0 and (c == 0 or t_now - copies.t[c - 1] >= COPY_INTERVAL):
                copies = keep(copies, tr, t_now, looks.number[k_now])
            a, b = looks.first[k_now], looks.first[k_now + 1]
            if tr.live[0] + b - a > len(tr.birth):
                tr = with_room(tr, 2 * (tr.live[0] + b - a))
            sensor = sensor_at(sensors, looks.sensor[k_now])
            scan_step(tr, s, sensor, look_at(looks, k_now), fates.code[a:b], fates.owner[a:b], fates.nis[a:b])
        forget(copies, min(looks.t[order[n - 1]] - length, keep_after))
    return tr, copies, order[:n], rows


@njit(cache=True)
def go_back(tr: Tracks, copies: Copies, empty: Tracks, looks: Looks, order: IntArray, at: int) -> tuple[Tracks, int]:
    """Take up the newest copy before the look at place `at` of `order`; returns tracks and the place to go on from."""
    t = looks.t[order[at]]
    c = copies.used[0]
    while c > 0 and copies.t[c - 1] > t:
        c -= 1
    copies.used[0] = c
    if c == 0:  # older than everything so far, and nothing has left the window yet
        fresh = with_room(empty, len(tr.birth))
        tr = Tracks(
            fresh.live.copy(),
            fresh.time.copy(),
            fresh.birth.copy(),
            fresh.x.copy(),
            fresh.P.copy(),
            fresh.weight.copy(),
            fresh.anchor.copy(),
            fresh.anchor_P.copy(),
            fresh.life.copy(),
            fresh.last_look.copy(),
            fresh.clutter.copy(),
            fresh.heard.copy(),
            fresh.told.copy(),
            fresh.bank.copy(),
            fresh.undetected.copy(),
            fresh.seen_range.copy(),
        )
        return tr, 0
    tr = restore(copies, c - 1, tr, 1)
    while looks.number[order[at]] != copies.number[c - 1]:
        at -= 1
    return tr, at


@njit(cache=True)
def forget(copies: Copies, oldest: float) -> None:
    """Drop the copies before the last one that is not younger than `oldest` (s), once they are many."""
    c = 0
    while c + 1 < copies.used[0] and copies.t[c + 1] <= oldest:
        c += 1
    if c > copies.used[0] // 2:
        drop(copies, c)
