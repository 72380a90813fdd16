"""The window in which looks may still come late: what the kernel `tracker_window` works on, and what leaves it."""

from __future__ import annotations

from dataclasses import dataclass
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
from boresight.kernels.tracker_looks import NO_SENSOR, Looks, chosen, joined, no_looks
from boresight.kernels.tracker_rows import GAPS_KEPT, Clock, RowTable, row_table, rows_with_room
from boresight.kernels.tracker_window import TAKEN, Fates, Queue, advance
from boresight.tracking.core import Plan, copy_tracks
from boresight.types import FloatArray


@dataclass(slots=True, eq=False)
class Window:
    """The tracks now, and what is needed to go back."""

    tracks: Tracks
    copies: Copies
    looks: Looks  # in order of validity
    fates: Fates  # of these
    clock: Clock
    arrivals: int = 0


class Left(NamedTuple):
    """Looks that have left the window, or never got in, and what became of them: final."""

    looks: Looks
    fates: Fates


def empty_window(plan: Plan) -> Window:
    """Return a window without tracks."""
    tracks = tracks_with_room(copy_tracks(copy_at(plan.empty, 0)), 64)
    n = len(plan.sensors)
    clock = Clock(
        np.array([-np.inf, -np.inf, 0.0]), np.full(n, -np.inf), np.zeros((n, GAPS_KEPT)), np.zeros(n, np.int64)
    )
    return Window(tracks, no_copies(tracks), no_looks(), _fresh(no_looks()), clock)


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
    held, new = len(window.looks.t), len(looks.t)
    every = joined([window.looks, looks._replace(number=np.arange(window.arrivals, window.arrivals + new))])
    window.arrivals += new
    fates = Fates(*(np.concatenate(pair) for pair in zip(window.fates, _fresh(looks), strict=True)))
    queue = Queue(np.arange(held + new), np.full(1, held), np.zeros(4, np.int64))
    rows = row_table(64 + 8 * int(window.tracks.live[0]), plan.settings.d)
    done = held
    while True:
        done = advance(
            window.tracks, window.copies, plan.empty, plan.settings, plan.columns, every, fates, queue, done, length,
            window.clock, period, coast_after, rows, plan.extras,
        )  # fmt: skip
        if done == held + new:
            break
        tracks, count, copied, written = (int(1.5 * n) + 16 for n in queue.wanted)
        window.tracks = tracks_with_room(window.tracks, tracks)
        window.copies = copies_with_room(window.copies, count, copied)
        rows = rows_with_room(rows, written)
    order = queue.order[: int(queue.length[0])]
    limit = _needed(window.copies, every, order, length, keep_after)
    rejected = held + np.flatnonzero((fates.outcome[held:] != TAKEN) & (every.sensor[held:] != NO_SENSOR))
    gone = np.concatenate([rejected, order[:limit]])
    if not len(gone) and np.array_equal(order, np.arange(held + new)):  # all stay, in this order
        window.looks, window.fates = every, fates
        return rows, Left(*_NOTHING)
    window.looks, window.fates = _part(every, fates, order[limit:])
    return rows, Left(*(_part(every, fates, gone) if len(gone) else _NOTHING))


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


def _fresh(looks: Looks) -> Fates:
    m = len(looks.dt)
    return Fates(np.zeros(len(looks.t), np.int64), np.zeros(m, np.int64), np.full(m, -1, np.int64), np.full(m, np.nan))


def _part(looks: Looks, fates: Fates, which: IntArray) -> tuple[Looks, Fates]:
    some, at = chosen(looks, which)
    return some, Fates(fates.outcome[which], fates.code[at], fates.owner[at], fates.nis[at])


_NOTHING = no_looks(), _fresh(no_looks())
