"""Copies of all tracks at times past, one behind the other in long arrays: what the tracker goes back to."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from boresight.kernels.options import BARE, LEAF
from boresight.kernels.tracker import IntArray, Models, PerModel, Tracks
from boresight.types.sensor import FloatArray

WHOLE = ("live", "time", "last_look", "clutter", "bank", "undetected", "seen_range", "pace")
EACH = (
    "birth",
    "x",
    "P",
    "weight",
    "anchor",
    "anchor_P",
    "life",
    "heard",
    "beside",
    "told",
    "witness",
    "spoken",
    "mode",
    "mode_x",
    "mode_P",
)


class Copies(NamedTuple):
    """C copies at most, of N tracks in all; those of copy c are `first[c]` to `first[c + 1]`."""

    used: IntArray  # (1,) copies held
    t: FloatArray  # (C,) s, and
    number: IntArray  # (C,) of the look before which the copy was taken
    first: IntArray  # (C + 1,)
    # of each copy
    live: IntArray  # (C, 2)
    time: FloatArray  # (C, 1)
    last_look: FloatArray  # (C, S, 4)
    clutter: FloatArray  # (C, S, bins)
    bank: FloatArray  # (C, k, k + 1)
    undetected: FloatArray  # (C, 1)
    seen_range: FloatArray  # (C, S)
    pace: FloatArray  # (C, S, 4)
    # of each track in each copy
    birth: IntArray  # (N,)
    x: FloatArray  # (N, n)
    P: FloatArray  # (N, n, n)
    weight: FloatArray  # (N, 4)
    anchor: FloatArray  # (N, 3)
    anchor_P: FloatArray  # (N, 3, 3)
    life: FloatArray  # (N, 4)
    heard: IntArray  # (N,)
    beside: IntArray  # (N,)
    told: FloatArray  # (N, k, k + 1)
    witness: FloatArray  # (N, w, 2)
    spoken: FloatArray  # (N, u, 4)
    mode: PerModel = None  # (N, 2)
    mode_x: PerModel = None  # (N, 2, n)
    mode_P: PerModel = None  # (N, 2, n, n)


@njit(**LEAF)
def put1(target: Any, to: int, source: Any, at: int, n: int) -> None:
    """Copy n elements; these loops compile in a tenth of the time that assigning slices takes."""
    for i in range(n):
        target[to + i] = source[at + i]


@njit(**LEAF)
def put2(target: Any, to: int, source: Any, at: int, n: int) -> None:
    """Copy n rows of two-dimensional arrays."""
    for i in range(n):
        for a in range(source.shape[1]):
            target[to + i, a] = source[at + i, a]


@njit(**LEAF)
def put3(target: Any, to: int, source: Any, at: int, n: int) -> None:
    """Copy n rows of three-dimensional arrays."""
    for i in range(n):
        for a in range(source.shape[1]):
            for b in range(source.shape[2]):
                target[to + i, a, b] = source[at + i, a, b]


@njit(**LEAF)
def put_models(target: Any, to: int, source: Any, at: int, n: int) -> None:
    """Copy what n tracks hold by model."""
    put2(target.mode, to, source.mode, at, n)
    put3(target.mode_x, to, source.mode_x, at, n)
    for i in range(n):
        put3(target.mode_P[to + i], 0, source.mode_P[at + i], 0, source.mode_P.shape[1])


@njit(**BARE)
def keep(copies: Copies, tr: Tracks, t: float, number: int, models: Models | None) -> None:
    """Add a copy of the tracks as they are before the look `number` of time `t`; there must be room."""
    c = copies.used[0]
    n = tr.live[0]
    a = copies.first[c]
    copies.used[0] = c + 1
    copies.t[c] = t
    copies.number[c] = number
    copies.first[c + 1] = a + n
    put1(copies.live[c], 0, tr.live, 0, len(tr.live))
    put1(copies.time[c], 0, tr.time, 0, len(tr.time))
    put2(copies.last_look[c], 0, tr.last_look, 0, len(tr.last_look))
    put2(copies.clutter[c], 0, tr.clutter, 0, len(tr.clutter))
    put2(copies.bank[c], 0, tr.bank, 0, len(tr.bank))
    put1(copies.undetected[c], 0, tr.undetected, 0, len(tr.undetected))
    put1(copies.seen_range[c], 0, tr.seen_range, 0, len(tr.seen_range))
    put2(copies.pace[c], 0, tr.pace, 0, len(tr.pace))
    put1(copies.birth, a, tr.birth, 0, n)
    put2(copies.x, a, tr.x, 0, n)
    put3(copies.P, a, tr.P, 0, n)
    put2(copies.weight, a, tr.weight, 0, n)
    put2(copies.anchor, a, tr.anchor, 0, n)
    put3(copies.anchor_P, a, tr.anchor_P, 0, n)
    put2(copies.life, a, tr.life, 0, n)
    put1(copies.heard, a, tr.heard, 0, n)
    put1(copies.beside, a, tr.beside, 0, n)
    put3(copies.told, a, tr.told, 0, n)
    put3(copies.witness, a, tr.witness, 0, n)
    put3(copies.spoken, a, tr.spoken, 0, n)
    if models is not None:
        put_models(copies, a, tr, 0, n)


@njit(**BARE)
def restore(copies: Copies, c: int, tr: Tracks, models: Models | None) -> None:
    """Make the tracks what copy c says; there must be room."""
    a = copies.first[c]
    n = copies.first[c + 1] - a
    put1(tr.live, 0, copies.live[c], 0, len(tr.live))
    put1(tr.time, 0, copies.time[c], 0, len(tr.time))
    put2(tr.last_look, 0, copies.last_look[c], 0, len(tr.last_look))
    put2(tr.clutter, 0, copies.clutter[c], 0, len(tr.clutter))
    put2(tr.bank, 0, copies.bank[c], 0, len(tr.bank))
    put1(tr.undetected, 0, copies.undetected[c], 0, len(tr.undetected))
    put1(tr.seen_range, 0, copies.seen_range[c], 0, len(tr.seen_range))
    put2(tr.pace, 0, copies.pace[c], 0, len(tr.pace))
    put1(tr.birth, 0, copies.birth, a, n)
    put2(tr.x, 0, copies.x, a, n)
    put3(tr.P, 0, copies.P, a, n)
    put2(tr.weight, 0, copies.weight, a, n)
    put2(tr.anchor, 0, copies.anchor, a, n)
    put3(tr.anchor_P, 0, copies.anchor_P, a, n)
    put2(tr.life, 0, copies.life, a, n)
    put1(tr.heard, 0, copies.heard, a, n)
    put1(tr.beside, 0, copies.beside, a, n)
    put3(tr.told, 0, copies.told, a, n)
    put3(tr.witness, 0, copies.witness, a, n)
    put3(tr.spoken, 0, copies.spoken, a, n)
    if models is not None:
        put_models(tr, 0, copies, a, n)


def each_of(item: Tracks | Copies) -> tuple[str, ...]:
    """Return the names of those arrays with a row for each track that there are."""
    return tuple(name for name in EACH if getattr(item, name) is not None)


def no_copies(tr: Tracks) -> Copies:
    """Return none, of tracks like `tr`."""
    whole = {name: np.zeros((0, *getattr(tr, name).shape), getattr(tr, name).dtype) for name in WHOLE}
    each = {name: getattr(tr, name)[:0].copy() for name in each_of(tr)}
    return Copies(np.zeros(1, np.int64), np.zeros(0), np.zeros(0, np.int64), np.zeros(1, np.int64), **whole, **each)


def copies_with_room(copies: Copies, count: int, tracks: int) -> Copies:
    """Return the copies in arrays for at least `count` of them and so many tracks in all."""
    used = int(copies.used[0])
    few, many = (used, count), (int(copies.first[used]), tracks)
    size = (
        dict.fromkeys(("t", "number", *WHOLE), few)
        | {"first": (used + 1, count + 1)}
        | dict.fromkeys(each_of(copies), many)
    )
    return Copies(used=copies.used, **{name: longer(getattr(copies, name), *n) for name, n in size.items()})


def tracks_with_room(tr: Tracks, size: int) -> Tracks:
    """Return the tracks in arrays for at least `size` of them."""
    return tr._replace(**{name: longer(getattr(tr, name), int(tr.live[0]), size) for name in each_of(tr)})


def longer(array: NDArray[Any], used: int, size: int) -> NDArray[Any]:
    """Return an array for at least `size` rows, the first `used` as they are."""
    if size <= len(array):
        return array
    out = np.zeros((size, *array.shape[1:]), array.dtype)
    out[:used] = array[:used]
    return out


def drop_oldest(copies: Copies, c: int) -> None:
    """Forget the first c copies, in place."""
    used = int(copies.used[0])
    a, b = int(copies.first[c]), int(copies.first[used])
    for name in ("t", "number", *WHOLE):
        array = getattr(copies, name)
        array[: used - c] = array[c:used].copy()
    for name in each_of(copies):
        array = getattr(copies, name)
        array[: b - a] = array[a:b].copy()
    copies.first[: used - c + 1] = copies.first[c : used + 1] - a
    copies.used[0] = used - c


def copy_at(copies: Copies, c: int) -> Tracks:
    """Return copy c as tracks; the arrays are views."""
    a, b = int(copies.first[c]), int(copies.first[c + 1])
    each = {name: getattr(copies, name)[a:b] for name in each_of(copies)}
    return Tracks(**each, **{name: getattr(copies, name)[c] for name in WHOLE})
