"""The multi-target tracker: looks in, rows of tracks and the fate of every report out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.errors import UserError
from boresight.frames.pose import PoseTrack, add_navigation_noise, has_pose, sensor_poses
from boresight.kernels.tracker_looks import NO_LOOK, Looks, moment, places_of_looks
from boresight.kernels.tracker_rows import ARRIVAL, PENDING, RowTable, row_table, rows_at_arrival, times_due
from boresight.tracking.config import TrackerConfig
from boresight.tracking.core import Plan, make_plan
from boresight.tracking.lagged import smoothed_rows
from boresight.tracking.names import Names
from boresight.tracking.output import Decisions, Rows, decisions_of, rows_of, unseen
from boresight.tracking.scan_check import LATEST, check_detections, check_scans, check_setup
from boresight.tracking.window import Window, empty_window, take, what_became
from boresight.types import NO_TRACK, Component, Fate, FloatArray, Reporting, Scan, Sensor, addresses_of

REASON = {
    Fate.UNASSOCIATED: "no track took it, and it begins none",
    Fate.GATED: "outside the gate of the nearest track, and it begins none",
    Fate.OUT_OF_COVERAGE: "outside the coverage that the sensor declares",
    Fate.LATE: "older than the window",
    Fate.NO_DETECTION: "the look saw nothing",
    Fate.SCREENED: "no navigation data for its platform at its time",
}


@dataclass(slots=True, eq=False)
class TrackerState:
    """Everything that the next step needs. `step` consumes it; `tracking.saved` copies, saves and restores it."""

    window: Window
    names: Names = field(default_factory=Names)
    smoothed: float = -np.inf  # s, up to when smoothed rows have been given

    @property
    def arrival(self) -> float:
        """The newest time of arrival (s)."""
        return float(self.window.clock.now[ARRIVAL])


class Output(NamedTuple):
    """What one step gives: rows of tracks (in order), decisions that are final, and smoothed rows of the past."""

    rows: list[Rows]
    decisions: list[Decisions]
    smoothed: list[Rows]


@dataclass(frozen=True, slots=True, eq=False)
class Tracker:
    """A configured tracker for the sensors of one recording or live feed.

    Attributes:
        config: what can be chosen.
        sensors: all sensors, in the order in which scans name them.
        dimensions: 2 (tracks in the plane up = 0) or 3.
        poses: the platforms' pose tracks by id; a look uses only the stamps up to its own time of arrival.
        use: indices of the sensors that are used, None for all (sets the window and the planned biases).
        site_height: of the site above the ellipsoid (m), to which the sensors' prior heights refer.
    """

    config: TrackerConfig
    sensors: tuple[Sensor, ...]
    dimensions: int
    poses: Mapping[str, PoseTrack] = field(default_factory=dict)
    use: tuple[int, ...] | None = None
    site_height: float = 0.0
    plan: Plan = field(init=False)
    length: float = field(init=False)  # s, of the window for late looks
    _period: FloatArray = field(init=False)  # (S,) s, declared; NaN: to be found out; 0: not used

    def __post_init__(self) -> None:
        check_setup(self.config, self.sensors, self.dimensions, self.poses, self.use, self.site_height)
        used = self.used
        plan = make_plan(self.config, self.sensors, self.dimensions, used, self.site_height)
        object.__setattr__(self, "plan", plan)
        latencies = [self.sensors[i].latency for i in used] or [0.0]
        length = self.config.window
        if length is None:
            # a look that sweeps one period arrives half of it after its middle
            sweep = 0.5 * max((_turn(self.sensors[i]) or 0.0 for i in used), default=0.0)
            length = max(latencies) - min(latencies) + sweep + 1.0
        object.__setattr__(self, "length", length)
        period = np.zeros(len(self.sensors))
        for i in used:
            turn = _turn(self.sensors[i])
            period[i] = np.nan if turn is None else turn
        object.__setattr__(self, "_period", period)

    @property
    def used(self) -> tuple[int, ...]:
        """Indices of the sensors in use."""
        return tuple(range(len(self.sensors))) if self.use is None else self.use

    def cannot_begin(self) -> str:
        """Return in words that no sensor in use can begin a track; empty if one can."""
        if any(self.sensors[i].begins for i in self.used):
            return ""
        names = ", ".join(self.sensors[i].id for i in self.used) or "none"
        return (
            f"no sensor in use can begin a track ({names}): one of them has to measure range and azimuth "
            "(sigma_range_m, sigma_azimuth_deg) or a position (sigma_position_m)"
        )

    def init(self) -> TrackerState:
        """Return the state before the first look."""
        return TrackerState(empty_window(self.plan))

    def step(self, state: TrackerState, scan: Scan) -> tuple[TrackerState, Output]:
        """Take one look in order of arrival; consumes `state`.

        Rows that the looks up to the previous arrival call for come out first: looks that arrive together are all
        taken before rows are made.
        """
        return self.steps(state, (scan,))

    def steps(self, state: TrackerState, scans: Sequence[Scan]) -> tuple[TrackerState, Output]:
        """Take several looks in order of arrival at once: what `step` does one by one, and faster.

        Raises UserError, with nothing changed, for looks that cannot be, and a state of another tracker.
        """
        if not len(scans):
            return state, Output([], [], [])
        self._require(state)
        check_scans(scans, len(self.sensors), state.arrival)
        lag = self.config.smoothing_lag
        if lag is not None and len(scans) > 1:  # smoothed rows depend on what was known when
            out = Output([], [], [])
            for scan in scans:
                state, one = self.step(state, scan)
                out.rows.extend(one.rows)
                out.decisions.extend(one.decisions)
                out.smoothed.extend(one.smoothed)
            return state, out
        out = self._take(state, self.looks(scans))
        unseen_rows = [row for scan in scans for row in scan.empty_rows]
        if unseen_rows:
            out.decisions.insert(0, unseen(unseen_rows))
        if lag is not None:
            self._smooth(state, out, state.arrival - lag)
        return state, out

    def tick(self, state: TrackerState, t_recv: float) -> Output:
        """Give the rows due by `t_recv` (s) although no look comes in: a stage before the tracker may hold looks."""
        self._require(state)
        if not abs(t_recv) < LATEST:
            raise UserError(f"tracker: t_recv must be a time in seconds, not {t_recv!r}")
        return self._take(state, moment(t_recv))

    def _require(self, state: TrackerState) -> None:
        """Raise UserError for a state that is not of this tracker."""
        if not isinstance(state, TrackerState):
            raise UserError(f"tracker: the state must be what init or step gave, not {type(state).__name__}")
        tracks, like = state.window.tracks, self.plan.empty
        same = (
            tracks.x.shape[1] == self.plan.n_states
            and tracks.last_look.shape == like.last_look.shape[1:]
            and tracks.told.shape[1:] == like.told.shape[1:]
            and tracks.witness.shape[1:] == like.witness.shape[1:]
            and tracks.spoken.shape[1:] == like.spoken.shape[1:]
            and (tracks.mode is None) == (like.mode is None)
            and (like.mode is None or tracks.mode_x.shape[1:] == like.mode_x.shape[1:])
        )
        if not same:
            raise UserError("tracker: the state is that of a tracker with other sensors or settings")

    def due(self, state: TrackerState, t: float) -> Output:
        """Give the rows due by time `t` (s), nothing having arrived since: what comes later is the same without."""
        return self._take(state, moment(t, NO_LOOK))

    def finish(self, state: TrackerState) -> tuple[TrackerState, Output]:
        """Give the rows that the last arrival calls for, the decisions and the smoothed rows still in the window."""
        window, out = state.window, Output([], [], [])
        if window.clock.now[PENDING]:
            times = times_due(window.tracks, self.plan.settings, window.clock, self._period, np.inf)
            rows = row_table(times * int(window.tracks.live[0]), self.dimensions)
            rows_at_arrival(
                window.tracks, self.plan.settings, window.clock, self._period, self.config.coast_after, rows,
                self.plan.models,
            )  # fmt: skip
            self._write(state, rows, out)
        if self.config.smoothing_lag is not None:
            self._smooth(state, out, np.inf)
        out.decisions.append(decisions_of(what_became(window, window.order)))
        return state, out

    def _take(self, state: TrackerState, looks: Looks) -> Output:
        out = Output([], [], [])
        keep_after = np.inf if self.config.smoothing_lag is None else state.smoothed
        rows, left = take(
            state.window, self.plan, looks, self.length, keep_after, self._period, self.config.coast_after
        )
        self._write(state, rows, out)
        if len(left.row):
            out.decisions.append(decisions_of(left))
        return out

    def _write(self, state: TrackerState, rows: RowTable, out: Output) -> None:
        n = int(rows.used[0])
        if n:
            out.rows.append(rows_of(rows, state.names.take(rows.birth[:n], rows.t[:n])))

    def _smooth(self, state: TrackerState, out: Output, until: float) -> None:
        for rows in smoothed_rows(
            state.window, self.plan, state.smoothed, until, state.arrival, self.config.coast_after
        ):
            number = state.names.of(rows.birth)
            shown = number != NO_TRACK
            if shown.any():
                parts = {name: getattr(rows, name)[shown] for name in Rows.__dataclass_fields__}
                out.smoothed.append(Rows(**parts | {"track_id": number[shown]}))
        state.smoothed = max(state.smoothed, until)

    def looks(self, scans: Sequence[Scan]) -> Looks:
        """Return looks as the kernel takes them: the declared latencies taken off, the sensors placed.

        Raises UserError for detections that cannot be.
        """
        count = np.array([len(scan.t) for scan in scans])
        first = np.concatenate([[0], np.cumsum(count)])
        sensor = np.array([scan.sensor for scan in scans])
        latency = np.array([s.latency for s in self.sensors])[sensor]
        t_look = np.array([scan.t_look for scan in scans]) - latency
        t = np.concatenate([scan.t for scan in scans]) - np.repeat(latency, count)
        looks = Looks(
            t=t_look,
            arrival=np.array([scan.t_recv for scan in scans]),
            sensor=sensor,
            number=np.zeros(len(scans), np.int64),
            first=first,
            dt=t - np.repeat(t_look, count),
            z=np.concatenate([scan.z for scan in scans]),
            R=np.concatenate([scan.covariance for scan in scans]),
            row=np.concatenate([scan.row for scan in scans]).astype(np.int64),
            address=np.concatenate([addresses_of(scan) for scan in scans]),
            position=np.zeros((len(t) + len(scans), 3)),
            velocity=np.zeros((len(t) + len(scans), 3)),
            axes=np.zeros((len(t) + len(scans), 3, 3)),
        )
        sigma_range = np.array([s.sigma[Component.RANGE] for s in self.sensors])[sensor]
        check_detections(np.repeat(sensor, count), t, looks.z, looks.R, np.repeat(sigma_range, count))
        for i in np.unique(sensor):
            self._place(looks, np.flatnonzero(sensor == i), t)
        return looks

    def _place(self, looks: Looks, which: NDArray[np.int64], t: FloatArray) -> None:
        """Fill the poses of the looks `which` of one sensor and the noise of its navigation; `t` of all detections."""
        sensor = self.sensors[looks.sensor[which[0]]]
        track = self.poses.get(sensor.platform) if sensor.platform is not None else None
        if sensor.platform is not None and not has_pose(sensor, track):  # none of its navigation has come
            looks.t[which] = np.nan
            return
        detections, poses, first = places_of_looks(looks, which)
        times = np.empty(len(poses))
        own = first[1:] + np.arange(len(which))  # the look itself stands behind its detections
        is_own = np.zeros(len(poses), np.bool_)
        is_own[own] = True
        times[own], times[~is_own] = looks.t[which], t[detections]
        known = looks.arrival[which]
        good, position, velocity, axes = sensor_poses(sensor, track, times, first + np.arange(len(first)), known)
        looks.position[poses], looks.velocity[poses], looks.axes[poses] = position, velocity, axes
        looks.t[which[~good]] = np.nan
        if track is not None:
            R, until = looks.R[detections], np.repeat(known, np.diff(first))
            looks.R[detections] = add_navigation_noise(sensor, track, t[detections], looks.z[detections], R, until)


def _turn(sensor: Sensor) -> float | None:
    """Return the declared time between two looks of a sensor (s), None where none is: the period of messages is not."""
    return None if sensor.reporting is Reporting.SINGLE else sensor.period
