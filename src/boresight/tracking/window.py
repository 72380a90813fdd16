"""Reports in the order in which they arrive, tracks as if they had come in the order of validity.

Every look within the window is kept, with copies of the tracks at intervals. A look that is older than the newest one
goes to its place: the nearest copy before it is taken up again and what follows is done anew. The result equals
in-order processing because it is in-order processing.
"""

from __future__ import annotations

import bisect
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from boresight.kernels.tracker import Look, Tracks
from boresight.tracking.core import Plan, copy_tracks, empty_tracks, step

Key = tuple[float, int]  # time of validity, number of arrival
COPY_INTERVAL = 0.5  # s of validity between two copies of the tracks


@dataclass(slots=True, eq=False)
class Entry:
    """One look in the window and what became of its detections (may change while it is in the window)."""

    key: Key
    sensor: int
    look: Look
    fate: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    owner: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    nis: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))


@dataclass(slots=True, eq=False)
class Window:
    """The tracks now, and what is needed to go back."""

    tracks: Tracks
    arrivals: int = 0
    entries: list[Entry] = field(default_factory=list)
    copies: list[tuple[Key, Tracks]] = field(default_factory=list)  # tracks before the entry with this key


def empty_window(plan: Plan) -> Window:
    """Return a window without tracks."""
    return Window(empty_tracks(plan))


def insert(window: Window, plan: Plan, sensor: int, look: Look, length: float) -> bool:
    """Take one look into the window of `length` seconds; False, and nothing is changed, where it is older than that."""
    entry = Entry((look.t, window.arrivals), sensor, look)
    newest = window.entries[-1].key if window.entries else (-np.inf, -1)
    if look.t < newest[0] - length:
        return False
    window.arrivals += 1
    if entry.key > newest:
        window.entries.append(entry)
        _process(window, plan, len(window.entries) - 1, length)
    else:
        at = bisect.bisect(window.entries, entry.key, key=lambda e: e.key)
        window.entries.insert(at, entry)
        while window.copies and window.copies[-1][0] > entry.key:
            window.copies.pop()
        if window.copies:
            key, tracks = window.copies[-1]
            window.tracks = copy_tracks(tracks)
        else:  # older than everything so far, and nothing has left the window yet
            key, window.tracks = entry.key, empty_tracks(plan)
        _process(window, plan, bisect.bisect_left(window.entries, key, key=lambda e: e.key), length)
    return True


def _process(window: Window, plan: Plan, first: int, length: float) -> None:
    for entry in window.entries[first:]:
        if length > 0.0 and (not window.copies or entry.key[0] - window.copies[-1][0][0] >= COPY_INTERVAL):
            window.copies.append((entry.key, copy_tracks(window.tracks)))
        window.tracks, entry.fate, entry.owner, entry.nis = step(window.tracks, plan, entry.sensor, entry.look)


def expire(window: Window, length: float) -> list[Entry]:
    """Drop what `length` seconds of window no longer need; returns the entries that left it, now final."""
    if not window.entries:
        return []
    oldest = window.entries[-1].key[0] - length
    keep = 0
    while keep + 1 < len(window.copies) and window.copies[keep + 1][0][0] <= oldest:
        keep += 1
    del window.copies[:keep]
    limit = window.copies[0][0] if window.copies else window.entries[-1].key
    done = bisect.bisect_left(window.entries, limit, key=lambda e: e.key)
    final = window.entries[:done]
    del window.entries[:done]
    return final
