"""A whole recording through the tracker."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from boresight.frames.pose import pose_track
from boresight.kernels.tracker import NOTHING
from boresight.tracking.config import TrackerConfig
from boresight.tracking.names import Names
from boresight.tracking.output import Decisions, Rows
from boresight.tracking.tracker import REASON, Output, Tracker, TrackerState
from boresight.types import (
    FATES,
    NO_TRACK,
    STATUSES,
    DecisionRows,
    Fate,
    FloatArray,
    Recording,
    Scan,
    TrackRows,
    TrackStatus,
    no_tracks,
)

MOST_LOOKS, MOST_REPORTS = 256, 10_000  # that reach the kernel in one call
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


def run(
    tracker: Tracker,
    scans: Iterable[Scan],
    state: TrackerState | None = None,
    *,
    finish: bool = True,
    progress: Callable[[Scan], None] | None = None,
    watch: Callable[[TrackerState, Output], None] | None = None,
) -> tuple[TrackerState, list[Rows], list[Decisions]]:
    """Take a tracker through scans in order of arrival, from `state` (a fresh one); consumes it.

    `progress` is called with every scan taken, `watch` with the state and what each step gave, also at the end; with
    `watch` scans are taken one by one, else many at a time.
    """
    state = tracker.init() if state is None else state
    rows: list[Rows] = []
    decisions: list[Decisions] = []
    for some in _portions(scans, 1 if watch is not None else MOST_LOOKS):
        state, out = tracker.steps(state, some)
        rows += out.rows
        decisions += out.decisions
        if watch is not None:
            watch(state, out)
        if progress is not None:
            for scan in some:
                progress(scan)
    if finish:
        state, out = tracker.finish(state)
        rows += out.rows
        decisions += out.decisions
        if watch is not None:
            watch(state, out)
    return state, rows, decisions


def _portions(scans: Iterable[Scan], most: int) -> Iterator[list[Scan]]:
    """Yield the scans in groups that are worth one call of the kernel and do not take much memory."""
    some: list[Scan] = []
    reports = 0
    for scan in scans:
        some.append(scan)
        reports += len(scan.t)
        if len(some) >= most or reports >= MOST_REPORTS:
            yield some
            some, reports = [], 0
    if some:
        yield some


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
    n = len(recording.detections)
    code = {fate: FATES.index(fate) for fate in FATES}
    fate = np.full(n, code[Fate.NOT_SELECTED], np.uint8)
    reason = np.full(n, "its sensor was left out", dtype=object)
    used = np.isin(recording.detections.sensor, tracker.used)
    duplicate = recording.duplicates & used
    fate[duplicate] = code[Fate.DUPLICATE]
    reason[duplicate] = "the same row stands earlier"
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
