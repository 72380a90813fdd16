"""Targets and tracks on the clock on which they are scored."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from boresight.types import FloatArray, Ignore, TrackRows, Truth

STEP = 0.5  # s
SILENCE = 600.0  # s without any report: nothing in it is scored
MAX_AGE = 2.0  # s: a row older than this says nothing about now


@dataclass(frozen=True, slots=True, eq=False)
class Sampled:
    """One target or track on the clock: (n,) whether it is there, (n, d) position (m), and for tracks covariance."""

    name: str | int
    present: NDArray[np.bool_]
    position: FloatArray
    covariance: FloatArray | None = None
    sigma: FloatArray | None = None  # (n,) m per axis, of a target's position


def clock_of(stamps: FloatArray) -> FloatArray:
    """Return the times (s) from the first to the last of some stamps (n,) in steps of 0.5 s, long silences left out.

    Where no stamp lies for more than `SILENCE` s there are no times, so that their number follows from the reports.
    """
    t = np.unique(stamps)
    ends = np.flatnonzero(np.diff(t) > SILENCE)
    first, last = t[np.r_[0, ends + 1]], t[np.r_[ends, len(t) - 1]]
    begin = np.ceil((first - t[0]) / STEP - 1e-9)
    end = np.floor((last - t[0]) / STEP + 1e-9)
    return np.concatenate([t[0] + STEP * (a + np.arange(b - a + 1.0)) for a, b in zip(begin, end, strict=True)])


def sample_truth(truth: Truth, clock: FloatArray, d: int) -> Sampled:
    """Interpolate a true path linearly; it is there from its first to its last stamp, and half a step beyond."""
    present = (clock >= truth.t[0] - STEP) & (clock <= truth.t[-1] + STEP)
    known = None if truth.sigma is None else np.isfinite(truth.sigma)
    sigma = None
    if truth.sigma is not None and known is not None and known.any():
        sigma = np.interp(clock, truth.t[known], truth.sigma[known])
    return Sampled(truth.target, present, interpolate(clock, truth.t, truth.position[:, :d]), sigma=sigma)


def sample_tracks(rows: TrackRows, clock: FloatArray, d: int) -> list[Sampled]:
    """Give each track its latest row not older than 2 s, moved by its own velocity."""
    order = np.lexsort((rows.t_known, rows.t, rows.track_id))
    ids = rows.track_id[order]
    cuts = np.flatnonzero(np.r_[True, ids[1:] != ids[:-1], True]) if len(ids) else np.zeros(1, np.int64)
    out = []
    for begin, end in itertools.pairwise(cuts.tolist()):
        mine = order[begin:end]
        t = rows.t[mine]
        at = np.searchsorted(t, clock, side="right") - 1
        row = mine[np.maximum(at, 0)]
        age = clock - rows.t[row]
        present = (at >= 0) & (age <= MAX_AGE)
        position = rows.position[row, :d] + age[:, None] * rows.velocity[row, :d]
        out.append(Sampled(int(ids[begin]), present, position, rows.covariance[row, :d, :d]))
    return out


def sample_ignored(ignored: Ignore, clock: FloatArray) -> tuple[NDArray[np.bool_], FloatArray, FloatArray]:
    """Return whether an object without truth is there, its position (n, 2) and the radius (n,) around it (m)."""
    present = (clock >= ignored.t[0]) & (clock <= ignored.t[-1])
    radius = np.interp(clock, ignored.t, ignored.radius)
    return present, interpolate(clock, ignored.t, ignored.position), radius


def interpolate(clock: FloatArray, t: FloatArray, x: FloatArray) -> FloatArray:
    """Return rows of `x` (n, d) at the times `clock`, linearly between their own times `t` (n,)."""
    out: FloatArray = np.stack([np.interp(clock, t, x[:, k]) for k in range(x.shape[1])], axis=1)
    return out
