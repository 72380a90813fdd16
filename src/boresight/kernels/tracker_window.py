"""Looks in the order in which they arrive, tracks as if they had come in the order of validity.

Every look within the window is kept, with copies of the tracks at intervals. A look that is older than the newest one
goes to its place: the nearest copy before it is taken up again and what follows is done anew. The result equals
in-order processing because it is in-order processing.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from numba import njit

from boresight.kernels.options import BARE, KERNEL
from boresight.kernels.tracker import Extras, IntArray, Models, SensorTable, Settings, Tracks
from boresight.kernels.tracker_copies import Copies, keep, restore
from boresight.kernels.tracker_looks import NO_LOOK, NO_SENSOR, Looks, look_at, sensor_at
from boresight.kernels.tracker_rows import (
    ARRIVAL,
    PENDING,
    Clock,
    RowTable,
    note_arrival,
    rows_at_arrival,
    rows_before,
    times_due,
)
from boresight.kernels.tracker_scan import scan_step
from boresight.kernels.tracker_workroom import Workroom
from boresight.types.sensor import FloatArray

COPY_INTERVAL = 0.5  # s of validity between two copies of the tracks
TAKEN, LATE, NO_POSE = 0, 1, 2  # what became of a look


class Fates(NamedTuple):
    """What became of the looks and of their detections; may change while a look is in the window."""

    outcome: IntArray  # (L,) TAKEN, LATE or NO_POSE
    code: IntArray  # (M,)
    owner: IntArray  # (M,) birth row of a track
    nis: FloatArray  # (M,)


class Queue(NamedTuple):
    """The looks in the window in order of validity, and what was missing."""

    order: IntArray  # (L,) places of looks
    length: IntArray  # (1,)
    wanted: IntArray  # (4,) room for tracks, copies, tracks in copies, and rows, where `advance` stopped for want of it


@njit(**KERNEL)
def advance(
    tr: Tracks,
    copies: Copies,
    empty: Copies,
    s: Settings,
    sensors: SensorTable,
    looks: Looks,
    fates: Fates,
    queue: Queue,
    begin: int,
    length: float,
    clock: Clock,
    period: FloatArray,
    coast_after: float,
    rows: RowTable,
    room: Workroom,
    extras: Extras,
    models: Models | None,
) -> int:
    """Take looks in order of arrival, in place; returns the place of the first for which there was no room.

    Args:
        tr, copies: the tracks now, and those to which one may go back.
        empty: one copy: the tracks before the first look.
        s, sensors: settings, all sensors (`columns_of`).
        looks, fates: those before `begin` have been taken already, `queue` holds those of them that are in the window.
        length: of the window (s).
        clock, period, coast_after: when rows are due (`tracker_rows`).
        rows: gets the rows due on the way.
        room: written over.
        extras, models: as `tracker_scan.scan_step` takes them.
    """
    order = queue.order
    for k in range(begin, len(looks.t)):
        t_recv = looks.arrival[k]
        n = queue.length[0]
        t = looks.t[k]
        at = n
        while at > 0 and looks.t[order[at - 1]] > t:
            at -= 1
        later = t_recv > clock.now[ARRIVAL] > -math.inf
        if not _has_room(
            tr, copies, looks, queue, k, at, times_due(tr, s, clock, period, t_recv) if later else 0, rows
        ):
            return k
        if later:
            if clock.now[PENDING] != 0.0:
                rows_at_arrival(tr, s, clock, period, coast_after, rows, models)
            rows_before(tr, s, clock, t_recv, coast_after, rows, models)
        if looks.sensor[k] == NO_LOOK:
            continue
        if looks.sensor[k] == NO_SENSOR:
            if t_recv > clock.now[ARRIVAL] > -math.inf:
                clock.now[ARRIVAL], clock.now[PENDING] = t_recv, 1.0
            continue
        note_arrival(clock, looks.sensor[k], t_recv)
        if math.isnan(t):
            fates.outcome[k] = NO_POSE
            continue
        if n > 0 and t < looks.t[order[n - 1]] - length:
            fates.outcome[k] = LATE
            continue
        for j in range(n, at, -1):
            order[j] = order[j - 1]
        order[at] = k
        queue.length[0] = n + 1
        if at < n:
            at = go_back(tr, copies, empty, looks, order, at, models)
        for j in range(at, n + 1):
            next_, c = order[j], copies.used[0]
            if length > 0.0 and (c == 0 or looks.t[next_] - copies.t[c - 1] >= COPY_INTERVAL):
                keep(copies, tr, looks.t[next_], looks.number[next_], models)
            a, b = looks.first[next_], looks.first[next_ + 1]
            sensor = sensor_at(sensors, looks.sensor[next_])
            fate = fates.code[a:b], fates.owner[a:b], fates.nis[a:b]
            scan_step(tr, s, sensor, look_at(looks, next_), *fate, room, extras, models)
    return len(looks.t)


@njit(**BARE)
def go_back(
    tr: Tracks, copies: Copies, empty: Copies, looks: Looks, order: IntArray, at: int, models: Models | None
) -> int:
    """Take up the newest copy before the look at place `at` of `order`; returns the place to go on from."""
    t = looks.t[order[at]]
    c = copies.used[0]
    while c > 0 and copies.t[c - 1] > t:
        c -= 1
    copies.used[0] = c
    if c == 0:  # older than everything so far, and nothing has left the window yet
        restore(empty, 0, tr, models)
        return 0
    restore(copies, c - 1, tr, models)
    while looks.number[order[at]] != copies.number[c - 1]:
        at -= 1
    return at


@njit(**BARE)
def _has_room(
    tr: Tracks, copies: Copies, looks: Looks, queue: Queue, k: int, at: int, times: int, rows: RowTable
) -> bool:
    """Whether look k, `at` its place in the queue, can be taken with rows at so many times; else says what it wants.

    Every detection may begin a track. Looks from the copy before it on are taken again, with copies between.
    """
    c = copies.used[0]
    live = tr.live[0]
    if at < queue.length[0]:
        c = max(c - 1, 0)
        while c > 0 and copies.t[c] > looks.t[k]:
            c -= 1
        for i in range(c, copies.used[0]):
            live = max(live, copies.first[i + 1] - copies.first[i])
    again = 0
    live += looks.first[k + 1] - looks.first[k]
    for j in range(queue.length[0] - 1, -1, -1):
        i = queue.order[j]
        if c == copies.used[0] or (copies.used[0] > 0 and looks.t[i] < copies.t[c]):
            break
        live += looks.first[i + 1] - looks.first[i]
        again += 1
    wanted = queue.wanted
    wanted[0], wanted[3] = live, rows.used[0] + times * tr.live[0]
    if again == 0:  # one copy at most, of the tracks as they are
        wanted[1], wanted[2] = copies.used[0] + 1, copies.first[copies.used[0]] + tr.live[0]
    else:
        wanted[1], wanted[2] = c + again + 2, copies.first[c] + (again + 2) * live
    enough = wanted[0] <= len(tr.birth) and wanted[1] <= len(copies.t)
    return bool(enough and wanted[2] <= len(copies.birth) and wanted[3] <= len(rows.t))
