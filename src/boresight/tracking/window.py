"""The window in which looks may still come late: what the kernel `tracker_window` works on, and what leaves it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from boresight.kernels.tracker import IntArray, Tracks
from boresight.kernels.tracker_copies import (
    Copies,
    copies_with_room,
    copy_at,
    drop_oldest,
    no_copies,
    tracks_with_room,
)
from boresight.kernels.tracker_looks import (
    Looks,
    chosen,
    front,
    places_of_looks,
    put_behind,
    room_for,
)
from boresight.kernels.tracker_rows import GAPS_KEPT, Clock, RowTable, row_table, rows_with_room
from boresight.kernels.tracker_window import TAKEN, Fates, Queue, advance
from boresight.kernels.tracker_workroom import workroom
from boresight.tracking.core import Plan, copy_tracks
from boresight.types import FloatArray


@dataclass(slots=True, eq=False)
class Window:
    """The tracks now, and what is needed to go back."""

    tracks: Tracks
    copies: Copies
    looks: Looks  # with room behind them; also such as have left the window
    fates: Fates  # of these
    clock: Clock
    order: IntArray  # (L,) places of the looks in the window, in order of validity
    laid: int = 0  # looks that the tables hold
    arrivals: int = 0


class Left(NamedTuple):
    """Detections of looks that have left the window, or never got in, and what became of them: final."""

    row: IntArray  # (k,)
    outcome: IntArray  # (k,) of the look
    code: IntArray  # (k,)
    owner: IntArray  # (k,)
    nis: FloatArray  # (k,)


def empty_window(plan: Plan) -> Window:
    """Return a window without tracks."""
    tracks = tracks_with_room(copy_tracks(copy_at(plan.empty, 0)), 64)
    n = len(plan.sensors)
    clock = Clock(
        np.array([-np.inf, -np.inf, 0.0]), np.full(n, -np.inf), np.zeros((n, GAPS_KEPT)), np.zeros(n, np.int64)
    )
    return Window(tracks, no_copies(tracks), room_for(0, 0), _room_for_fates(0, 0), clock, np.zeros(0, np.int64))


def take(
    window: Window, plan: Plan, looks: Looks, length: float, keep_after: float, period: FloatArray, coast_after: float
) -> tuple[RowTable, Left]:
    """Take looks in order of arrival; returns the rows due on the way, and the looks that left.

    Args:
        length: of the window (s).
        keep_after: copies of the tracks at later times than this (s) are kept however old.
        period: (S,) s, of each sensor: NaN where it is to be found out, 0 for one that is not used.
        coast_after: time without a hit from which on a track coasts (s).
    """
    _lay(window, looks)
    held, new, total = len(window.order), len(looks.t), window.laid
    every, fates = front(window.looks, total), window.fates
    queue = Queue(np.concatenate([window.order, np.zeros(new, np.int64)]), np.full(1, held), np.zeros(4, np.int64))
    rows = row_table(64 + 8 * int(window.tracks.live[0]), plan.settings.d)
    done, room = total - new, workroom(plan.n_states)
    while True:
        done = advance(
            window.tracks, window.copies, plan.empty, plan.settings, plan.columns, every, fates, queue, done, length,
            window.clock, period, coast_after, rows, room, plan.extras, plan.models,
        )  # fmt: skip
        if done == total:
            break
        tracks, count, copied, written = (int(1.5 * n) + 16 for n in queue.wanted)
        window.tracks = tracks_with_room(window.tracks, tracks)
        window.copies = copies_with_room(window.copies, count, copied)
        rows = rows_with_room(rows, written)
    order = queue.order[: int(queue.length[0])]
    limit = _needed(window.copies, every, order, length, keep_after)
    taken, sensor = fates.outcome[total - new : total] == TAKEN, every.sensor[total - new :]
    rejected = total - new + np.flatnonzero(~taken & (sensor >= 0))
    window.order = order[limit:].copy()
    return rows, what_became(window, np.concatenate([rejected, order[:limit]]))


def what_became(window: Window, which: IntArray) -> Left:
    """Return what became of the detections of the looks at places `which`."""
    looks, fates = window.looks, window.fates
    at, _, first = places_of_looks(looks, which)
    outcome = np.repeat(fates.outcome[which], np.diff(first))
    return Left(looks.row[at], outcome, fates.code[at], fates.owner[at], fates.nis[at])


def held(window: Window) -> Window:
    """Return the same window whose tables hold nothing but the looks in it, in order, and are its own."""
    n = len(window.order)
    looks, fates = _moved(window, n, int(np.diff(window.looks.first)[window.order].sum()))
    return replace(window, looks=looks, fates=fates, order=np.arange(n), laid=n)


def copies_of(window: Window, after: float) -> list[Tracks]:
    """Return the copies of the tracks at times later than `after` (s), in order; their arrays are views."""
    return [copy_at(window.copies, c) for c in range(int(window.copies.used[0])) if window.copies.time[c, 0] > after]


def _needed(copies: Copies, looks: Looks, order: IntArray, length: float, keep_after: float) -> int:
    """Return from which place of `order` on looks may have to be taken again; drops the copies before, once many."""
    if not len(order):
        return 0
    n = int(copies.used[0])
    if n == 0:
        return len(order) - 1
    oldest = min(looks.t[order[-1]] - length, keep_after)
    c = max(int(np.searchsorted(copies.t[:n], oldest, side="right")) - 1, 0)
    at = int(np.flatnonzero(looks.number[order] == copies.number[c])[0])
    if c > n // 2:
        drop_oldest(copies, c)
    return at


def _lay(window: Window, looks: Looks) -> None:
    """Put new looks behind those that are there; without room, make some and drop what has left the window."""
    n, m = len(looks.t), len(looks.dt)
    a = window.laid
    b = int(window.looks.first[a])
    if a + n > len(window.looks.t) or b + m > len(window.looks.dt):
        a = len(window.order)
        b = int(np.diff(window.looks.first)[window.order].sum())
        window.looks, window.fates = _moved(window, 64 + 3 * (a + n) // 2, 64 + 3 * (b + m) // 2)
        window.order = np.arange(a)
    put_behind(window.looks, a, looks)
    window.looks.number[a : a + n] = np.arange(window.arrivals, window.arrivals + n)
    fates = window.fates
    fates.outcome[a : a + n] = 0
    fates.code[b : b + m], fates.owner[b : b + m], fates.nis[b : b + m] = 0, -1, np.nan
    window.laid = a + n
    window.arrivals += n


def _moved(window: Window, looks: int, detections: int) -> tuple[Looks, Fates]:
    """Return tables with room for so many, that begin with the looks in the window in order of validity."""
    out, fates = room_for(looks, detections), _room_for_fates(looks, detections)
    at = chosen(window.looks, window.order, out)
    fates.outcome[: len(window.order)] = window.fates.outcome[window.order]
    for new, old in zip(fates[1:], window.fates[1:], strict=True):
        new[: len(at)] = old[at]
    return out, fates


def _room_for_fates(looks: int, detections: int) -> Fates:
    return Fates(
        np.empty(looks, np.int64), np.empty(detections, np.int64), np.empty(detections, np.int64), np.empty(detections)
    )
