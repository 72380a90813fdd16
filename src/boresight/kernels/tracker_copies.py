"""Copies of all tracks at times past, one behind the other in long arrays: what the tracker goes back to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from boresight.kernels.tracker import IntArray, Tracks
from boresight.types.sensor import FloatArray

WHOLE = ("live", "time", "last_look", "clutter", "bank", "undetected", "seen_range")
EACH = ("birth", "x", "P", "weight", "anchor", "anchor_P", "life", "heard", "told")


class Copies(NamedTuple):
    """C copies at most, of N tracks in all; those of copy c are `first[c]` to `first[c + 1]`."""

    used: IntArray  # (1,) copies held
    t: FloatArray  # (C,) s, and
    number: IntArray  # (C,) of the look before which the copy was taken
    first: IntArray  # (C + 1,)
    # of each copy
    live: IntArray  # (C, 2)
    time: FloatArray  # (C, 1)
    last_look: FloatArray  # (C, S)
    clutter: FloatArray  # (C, S, bins)
    bank: FloatArray  # (C, k, k + 1)
    undetected: FloatArray  # (C, 1)
    seen_range: FloatArray  # (C, S)
    # of each track in each copy
    birth: IntArray  # (N,)
    x: FloatArray  # (N, n)
    P: FloatArray  # (N, n, n)
    weight: FloatArray  # (N, 4)
    anchor: FloatArray  # (N, 3)
    anchor_P: FloatArray  # (N, 3, 3)
    life: FloatArray  # (N, 4)
    heard: IntArray  # (N,)
    told: FloatArray  # (N, k, k + 1)


@njit(cache=True)
def longer(a, size):  # type: ignore[no-untyped-def]
    """Return an array with room for `size` rows that begins with those of `a`."""
    out = np.zeros((size,) + a.shape[1:], a.dtype)
    out[: len(a)] = a
    return out


@njit(cache=True)
def with_room(tr: Tracks, size: int) -> Tracks:
    """Return the tracks in arrays for `size` of them, or as they are if these are no longer."""
    if size <= len(tr.birth):
        return tr
    return Tracks(
        live=tr.live,
        time=tr.time,
        birth=longer(tr.birth, size),
        x=longer(tr.x, size),
        P=longer(tr.P, size),
        weight=longer(tr.weight, size),
        anchor=longer(tr.anchor, size),
        anchor_P=longer(tr.anchor_P, size),
        life=longer(tr.life, size),
        last_look=tr.last_look,
        clutter=tr.clutter,
        heard=longer(tr.heard, size),
        told=longer(tr.told, size),
        bank=tr.bank,
        undetected=tr.undetected,
        seen_range=tr.seen_range,
    )


@njit(cache=True)
def keep(copies: Copies, tr: Tracks, t: float, number: int) -> Copies:
    """Add a copy of the tracks as they are before the look `number` of time `t`."""
    c = copies.used[0]
    n = tr.live[0]
    a = copies.first[c]
    if c == len(copies.t) or a + n > len(copies.birth):
        copies = _more_room(copies, 2 * (c + 1), 2 * (a + n))
    b = a + n
    copies.used[0] = c + 1
    copies.t[c] = t
    copies.number[c] = number
    copies.first[c + 1] = b
    copies.live[c] = tr.live
    copies.time[c] = tr.time
    copies.last_look[c] = tr.last_look
    copies.clutter[c] = tr.clutter
    copies.bank[c] = tr.bank
    copies.undetected[c] = tr.undetected
    copies.seen_range[c] = tr.seen_range
    copies.birth[a:b] = tr.birth[:n]
    copies.x[a:b] = tr.x[:n]
    copies.P[a:b] = tr.P[:n]
    copies.weight[a:b] = tr.weight[:n]
    copies.anchor[a:b] = tr.anchor[:n]
    copies.anchor_P[a:b] = tr.anchor_P[:n]
    copies.life[a:b] = tr.life[:n]
    copies.heard[a:b] = tr.heard[:n]
    copies.told[a:b] = tr.told[:n]
    return copies


@njit(cache=True)
def restore(copies: Copies, c: int, tr: Tracks, room: int) -> Tracks:
    """Return the tracks as copy c has them, in arrays with room for so many more; `tr` is used up."""
    a, b = copies.first[c], copies.first[c + 1]
    n = b - a
    tr = with_room(tr, n + room)
    tr.live[:] = copies.live[c]
    tr.time[:] = copies.time[c]
    tr.last_look[:] = copies.last_look[c]
    tr.clutter[:] = copies.clutter[c]
    tr.bank[:] = copies.bank[c]
    tr.undetected[:] = copies.undetected[c]
    tr.seen_range[:] = copies.seen_range[c]
    tr.birth[:n] = copies.birth[a:b]
    tr.x[:n] = copies.x[a:b]
    tr.P[:n] = copies.P[a:b]
    tr.weight[:n] = copies.weight[a:b]
    tr.anchor[:n] = copies.anchor[a:b]
    tr.anchor_P[:n] = copies.anchor_P[a:b]
    tr.life[:n] = copies.life[a:b]
    tr.heard[:n] = copies.heard[a:b]
    tr.told[:n] = copies.told[a:b]
    return tr


@njit(cache=True)
def drop(copies: Copies, oldest: int) -> None:
    """Forget the first `oldest` copies."""
    c = copies.used[0]
    a, b = copies.first[oldest], copies.first[c]
    m = c - oldest
    copies.used[0] = m
    for i in range(m):  # upwards: each goes to a lower place
        copies.t[i] = copies.t[oldest + i]
        copies.number[i] = copies.number[oldest + i]
        copies.first[i + 1] = copies.first[oldest + i + 1] - a
        copies.live[i] = copies.live[oldest + i]
        copies.time[i] = copies.time[oldest + i]
        copies.last_look[i] = copies.last_look[oldest + i]
        copies.clutter[i] = copies.clutter[oldest + i]
        copies.bank[i] = copies.bank[oldest + i]
        copies.undetected[i] = copies.undetected[oldest + i]
        copies.seen_range[i] = copies.seen_range[oldest + i]
    for i in range(b - a):
        copies.birth[i] = copies.birth[a + i]
        copies.x[i] = copies.x[a + i]
        copies.P[i] = copies.P[a + i]
        copies.weight[i] = copies.weight[a + i]
        copies.anchor[i] = copies.anchor[a + i]
        copies.anchor_P[i] = copies.anchor_P[a + i]
        copies.life[i] = copies.life[a + i]
        copies.heard[i] = copies.heard[a + i]
        copies.told[i] = copies.told[a + i]


@njit(cache=True)
def _more_room(copies: Copies, count: int, tracks: int) -> Copies:
    return Copies(
        used=copies.used,
        t=longer(copies.t, max(count, len(copies.t))),
        number=longer(copies.number, max(count, len(copies.t))),
        first=longer(copies.first, max(count, len(copies.t)) + 1),
        live=longer(copies.live, max(count, len(copies.t))),
        time=longer(copies.time, max(count, len(copies.t))),
        last_look=longer(copies.last_look, max(count, len(copies.t))),
        clutter=longer(copies.clutter, max(count, len(copies.t))),
        bank=longer(copies.bank, max(count, len(copies.t))),
        undetected=longer(copies.undetected, max(count, len(copies.t))),
        seen_range=longer(copies.seen_range, max(count, len(copies.t))),
        birth=longer(copies.birth, max(tracks, len(copies.birth))),
        x=longer(copies.x, max(tracks, len(copies.birth))),
        P=longer(copies.P, max(tracks, len(copies.birth))),
        weight=longer(copies.weight, max(tracks, len(copies.birth))),
        anchor=longer(copies.anchor, max(tracks, len(copies.birth))),
        anchor_P=longer(copies.anchor_P, max(tracks, len(copies.birth))),
        life=longer(copies.life, max(tracks, len(copies.birth))),
        heard=longer(copies.heard, max(tracks, len(copies.birth))),
        told=longer(copies.told, max(tracks, len(copies.birth))),
    )


def no_copies(tr: Tracks) -> Copies:
    """Return none, of tracks like `tr`."""
    whole = {name: np.zeros((0, *getattr(tr, name).shape), getattr(tr, name).dtype) for name in WHOLE}
    each = {name: getattr(tr, name)[:0].copy() for name in EACH}
    return Copies(np.zeros(1, np.int64), np.zeros(0), np.zeros(0, np.int64), np.zeros(1, np.int64), **whole, **each)


def copy_at(copies: Copies, c: int) -> Tracks:
    """Return copy c as tracks; the arrays are views."""
    a, b = int(copies.first[c]), int(copies.first[c + 1])
    parts = {name: getattr(copies, name)[c] for name in WHOLE} | {name: getattr(copies, name)[a:b] for name in EACH}
    return Tracks(**parts)
