"""What a tracker is made of for a recording, and what comes out of it as tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from boresight.frames.pose import pose_track
from boresight.kernels.tracker import NOTHING
from boresight.tracking.config import TrackerConfig
from boresight.tracking.names import Names
from boresight.tracking.output import Decisions, Rows
from boresight.tracking.tracker import REASON, Tracker, TrackerState
from boresight.tracking.uncovered import why_uncovered
from boresight.types import (
    FATES,
    NO_TRACK,
    STATUSES,
    DecisionRows,
    Fate,
    FloatArray,
    Recording,
    TrackRows,
    TrackStatus,
    no_tracks,
)

NAVIGATION_GAP = 10.0  # s without navigation data over which a pose is still interpolated
PROBABLE = 0.5  # least probability of being a target or a thing with which a track is believed
NAVIGATION_AHEAD = 5.0  # s beyond the ends over which it is still extrapolated


def tracker_for(recording: Recording, config: TrackerConfig, sensors: Sequence[str] | None = None) -> Tracker:
    """Return a tracker for a recording; `sensors` are the ids to use (all)."""
    poses = {
        p.id: pose_track(p, recording.site, max_extrapolation=NAVIGATION_AHEAD, max_gap=NAVIGATION_GAP)
        for p in recording.platforms
    }
    use = None if sensors is None else tuple(sorted(recording.sensor_index(name) for name in sensors))
    return Tracker(config, recording.sensors, recording.dimensions, poses, use, recording.site.height)


def believed(tracker: Tracker, state: TrackerState) -> tuple[float, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return time (s), position, velocity (k, 3), covariance of each (k, 3, 3) of the probable tracks, world ENU."""
    tr, d = state.window.tracks, tracker.dimensions
    chosen = np.flatnonzero(tr.weight[: int(tr.live[0]), NOTHING] <= 1.0 - PROBABLE)
    k = len(chosen)
    p, v, P, V = np.zeros((k, 3)), np.zeros((k, 3)), np.zeros((k, 3, 3)), np.zeros((k, 3, 3))
    p[:, :d], v[:, :d] = tr.x[chosen, :d], tr.x[chosen, d : 2 * d]
    P[:, :d, :d], V[:, :d, :d] = tr.P[chosen, :d, :d], tr.P[chosen, d : 2 * d, d : 2 * d]
    return float(tr.time[0]), p, v, P, V


def track_rows(rows: Sequence[Rows]) -> TrackRows:
    """Join rows to the columns of tracks.parquet; positions in 2-D have NaN for up."""
    if not rows:
        return no_tracks()
    d = rows[0].position.shape[1]
    n = sum(len(r.t) for r in rows)
    position, velocity, covariance = np.full((n, 3), np.nan), np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
    position[:, :d] = np.concatenate([r.position for r in rows])
    velocity[:, :d] = np.concatenate([r.velocity for r in rows])
    covariance[:, :d, :d] = np.concatenate([r.covariance for r in rows])
    coasting = np.concatenate([r.coasting for r in rows])
    confirmed, coasts = STATUSES.index(TrackStatus.CONFIRMED), STATUSES.index(TrackStatus.COASTING)
    return TrackRows(
        t=np.concatenate([r.t for r in rows]),
        t_known=np.concatenate([r.t_known for r in rows]),
        track_id=np.concatenate([r.track_id for r in rows]),
        status=np.where(coasting, coasts, confirmed).astype(np.uint8),
        position=position,
        velocity=velocity,
        covariance=covariance,
    )


def decision_rows(recording: Recording, tracker: Tracker, decisions: Sequence[Decisions], names: Names) -> DecisionRows:
    """Give every row of the recording its fate, in file order, those that never reached the tracker included."""
    used = np.isin(recording.detections.sensor, tracker.used)
    out = fates_of(used, recording.duplicates & used, decisions, names, recording.refused)
    blind = np.flatnonzero((out.fate == FATES.index(Fate.SCREENED)) & (out.reason == REASON[Fate.SCREENED]))
    for row, why in why_uncovered(recording, tracker.poses, blind):
        out.reason[row] = why
    return out


def fates_of(
    used: NDArray[np.bool_],
    duplicate: NDArray[np.bool_],
    decisions: Sequence[Decisions],
    names: Names,
    refused: Mapping[int, str] | None = None,
) -> DecisionRows:
    """Give every row its fate.

    `used` (n,) says of which sensors are in use, `duplicate` (n,) which repeat a row, `refused` why some rows are not
    used at all.
    """
    n = len(used)
    code = {fate: FATES.index(fate) for fate in FATES}
    fate = np.full(n, code[Fate.NOT_SELECTED], np.uint8)
    reason = np.full(n, "its sensor was left out", dtype=object)
    fate[duplicate] = code[Fate.DUPLICATE]
    reason[duplicate] = "the same row stands earlier"
    for k, why in (refused or {}).items():
        if used[k]:
            fate[k], reason[k] = code[Fate.SCREENED], why
    birth = np.full(n, -1, np.int64)
    nis = np.full(n, np.nan)
    if decisions:
        row, what, begun_by, distance = (np.concatenate(column) for column in zip(*decisions, strict=True))
        reasons = np.array([REASON.get(f) for f in FATES], dtype=object)
        fate[row], reason[row], birth[row], nis[row] = what, reasons[what], begun_by, distance
    ids = names.of(birth)
    never = (birth >= 0) & (ids == NO_TRACK)
    reason[never & np.isin(fate, [code[Fate.UPDATED], code[Fate.INITIATED]])] = "the track was never confirmed"
    return DecisionRows(np.arange(n), fate, ids, nis, reason)
