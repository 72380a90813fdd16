"""Which tracks are shown, which end, and which two have become one."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from boresight.kernels.options import LEAF, PART
from boresight.kernels.tracker import (
    HIDDEN,
    STATIC,
    VISIBLE,
    Extras,
    IntArray,
    Models,
    Settings,
    Tracks,
)
from boresight.kernels.tracker_begin import save_lesson
from boresight.kernels.tracker_copies import put1, put2, put3, put_models
from boresight.kernels.tracker_messages import are_two, take_over


@njit(**PART)
def show(tr: Tracks, s: Settings, extras: Extras) -> None:
    """Show the tracks that are probably moving targets within the report range, and no longer those that left it."""
    for i in range(tr.live[0]):
        target = tr.weight[i, VISIBLE] + tr.weight[i, HIDDEN]
        if tr.life[i, 2] == 0.0 and not target > s.show_above:
            continue
        if tr.life[i, 2] > 0.0:
            if not reported(tr, i, s, 1.1):
                if extras is not None:
                    save_lesson(tr, i, s)
                tr.life[i, 2] = 0.0
        elif reported(tr, i, s, 1.0) and (tr.heard[i] == 0 or stands_apart(tr, i, s)):
            tr.life[i, 2] = 1.0


@njit(**LEAF)
def reported(tr: Tracks, i: int, s: Settings, stretch: float) -> bool:
    """Whether a track lies within `stretch` times the report range of any sensor, where that last stood."""
    for j in range(len(s.report_range)):
        reach = stretch * s.report_range[j]
        if reach == 0.0:  # it answers for none, or has no range
            continue
        if reach == math.inf:
            return True
        gap = 0.0
        for a in range(s.d):
            gap += (tr.x[i, a] - tr.last_look[j, 1 + a]) ** 2
        if gap < reach**2:
            return True
    return False


@njit(**LEAF)
def stands_apart(tr: Tracks, i: int, s: Settings) -> bool:
    """Whether no shown track is so near that `i` may be another part of the same object."""
    for j in range(tr.live[0] if s.apart > 0.0 else 0):
        if tr.life[j, 2] > 0.0 and j != i:
            gap = 0.0
            for a in range(s.d):
                gap += (tr.x[i, a] - tr.x[j, a]) ** 2
            if gap < s.apart**2:
                return False
    return True


@njit(**PART)
def end_and_merge(
    tr: Tracks, s: Settings, merging: bool, start: IntArray, extras: Extras, models: Models | None
) -> None:
    """Drop tracks that are probably nothing, and the weaker of two that have become one.

    `start` is the candidate list of this look: a track whose gate holds many detections needs the more weight to live,
    since the next one in it will be its own the less probably.
    """
    n_tracks = tr.live[0]
    keep = np.ones(n_tracks, np.bool_)
    for i in range(n_tracks):
        w = tr.weight[i]
        target = w[VISIBLE] + w[HIDDEN]
        crowd = start[i + 1] - start[i] if i + 1 < len(start) else 1
        keep[i] = target + w[STATIC] >= s.delete_below * max(1, crowd)
        if not keep[i] or target < s.hide_below:
            if tr.life[i, 2] > 0.0 and extras is not None:
                save_lesson(tr, i, s)
            tr.life[i, 2] = 0.0
    if merging:
        merge(tr, s, keep, extras)
    at = 0
    for i in range(n_tracks):
        if keep[i]:
            if at != i:
                move(tr, i, at, models)
            at += 1
    tr.live[0] = at


@njit(**LEAF)
def move(tr: Tracks, i: int, to: int, models: Models | None) -> None:
    """Put track i in the place of another."""
    put1(tr.birth, to, tr.birth, i, 1)
    put1(tr.heard, to, tr.heard, i, 1)
    put1(tr.beside, to, tr.beside, i, 1)
    put2(tr.x, to, tr.x, i, 1)
    put2(tr.weight, to, tr.weight, i, 1)
    put2(tr.anchor, to, tr.anchor, i, 1)
    put2(tr.life, to, tr.life, i, 1)
    put3(tr.P, to, tr.P, i, 1)
    put3(tr.anchor_P, to, tr.anchor_P, i, 1)
    put3(tr.told, to, tr.told, i, 1)
    put3(tr.witness, to, tr.witness, i, 1)
    put3(tr.spoken, to, tr.spoken, i, 1)
    if models is not None:
        put_models(tr, to, tr, i, 1)


@njit(**PART)
def merge(tr: Tracks, s: Settings, keep: NDArray[np.bool_], extras: Extras) -> None:
    """Take the weaker of two tracks that have become one out of `keep`."""
    order = np.argsort(tr.x[: tr.live[0], 0])  # neighbours lie next to each other in the east
    for a in range(len(order)):
        i = order[a]
        for b in range(a + 1, len(order)):
            j = order[b]
            if tr.x[j, 0] - tr.x[i, 0] > s.merge_distance or not keep[i]:
                break
            if keep[j] and are_one(tr, i, j, s):
                weaker = j if rank(tr, i) >= rank(tr, j) else i
                keep[weaker] = False
                take_over(tr, i + j - weaker, weaker)
                if extras is not None:
                    save_lesson(tr, weaker, s)


@njit(**LEAF)
def are_one(tr: Tracks, i: int, j: int, s: Settings) -> bool:
    """Whether two tracks, each hit more than once, are at one place and move alike."""
    if tr.life[i, 3] < 2.0 or tr.life[j, 3] < 2.0:
        return False
    if tr.heard[i] == 0 or tr.heard[j] == 0:  # begun because bearings tell it from its neighbour
        return False
    if are_two(tr, i, j):
        return False
    gap = 0.0
    speed = 0.0
    spread = 0.0
    for a in range(s.d):
        v = s.d + a
        gap += (tr.x[i, a] - tr.x[j, a]) ** 2
        speed += (tr.x[i, v] - tr.x[j, v]) ** 2
        spread += tr.P[i, v, v] + tr.P[j, v, v]
    return bool(gap <= s.merge_distance**2 and speed <= 4.0 * spread)


@njit(**LEAF)
def rank(tr: Tracks, i: int) -> float:
    """Which of two tracks that are one should stay: a shown one, then the more probable, then the older."""
    return float(tr.life[i, 2] + tr.weight[i, VISIBLE] + tr.weight[i, HIDDEN] - 1e-9 * tr.birth[i])
