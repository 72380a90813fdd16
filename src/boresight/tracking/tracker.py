"""The multi-target tracker: looks in, rows of tracks and the fate of every report out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.frames.pose import PoseTrack, add_navigation_noise, sensor_pose
from boresight.kernels.tracker import GATED, INITIATED, OUTSIDE, UNASSOCIATED, UPDATED, Look
from boresight.tracking.config import TrackerConfig
from boresight.tracking.core import Plan, make_plan
from boresight.tracking.lagged import smoothed_rows
from boresight.tracking.output import Clock, Rows, due_at_arrival, due_before, note_arrival, period_of, rows_at
from boresight.tracking.window import Entry, Window, empty_window, expire, insert
from boresight.types import Fate, FloatArray, Scan, Sensor

MAX_ROW_GAP = 0.5  # s between two rows of one track id
FATE_OF_CODE = {
    UNASSOCIATED: Fate.UNASSOCIATED,
    UPDATED: Fate.UPDATED,
    INITIATED: Fate.INITIATED,
    OUTSIDE: Fate.OUT_OF_COVERAGE,
    GATED: Fate.GATED,
}
REASON = {
    Fate.UNASSOCIATED: "no track took it, and it begins none",
    Fate.GATED: "outside the gate of the nearest track, and it begins none",
    Fate.OUT_OF_COVERAGE: "outside the coverage that the sensor declares",
    Fate.LATE: "older than the window",
    Fate.NO_DETECTION: "the look saw nothing",
    Fate.SCREENED: "no navigation data for its platform at its time",
}


class Decision(NamedTuple):
    """What became of one row of the detections; `birth` names the track by the row that began it (-1: none)."""

    row: int
    fate: Fate
    birth: int
    nis: float


@dataclass(slots=True, eq=False)
class TrackerState:
    """Everything that the next step needs. `step` consumes it; `tracking.saved` copies, saves and restores it."""

    window: Window
    clock: Clock
    pending: bool = False  # looks have come at clock.arrival for which rows are still due
    numbered: int = 0  # track ids given out
    names: dict[int, int] = field(default_factory=dict)  # birth row -> track id, the newest
    last_row: dict[int, float] = field(default_factory=dict)  # birth row -> time of its newest row (s)
    smoothed: float = -np.inf  # s, time of the newest smoothed rows


class Output(NamedTuple):
    """What one step gives: rows of tracks (in order), decisions that are final, and smoothed rows of the past."""

    rows: list[Rows]
    decisions: list[Decision]
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
    """

    config: TrackerConfig
    sensors: tuple[Sensor, ...]
    dimensions: int
    poses: Mapping[str, PoseTrack] = field(default_factory=dict)
    use: tuple[int, ...] | None = None
    plan: Plan = field(init=False)
    length: float = field(init=False)  # s, of the window for late looks

    def __post_init__(self) -> None:
        used = self.used
        plan = make_plan(self.config, self.sensors, self.dimensions, used)
        object.__setattr__(self, "plan", plan)
        latencies = [self.sensors[i].latency for i in used] or [0.0]
        length = self.config.window
        if length is None:
            # a look that sweeps one period arrives half of it after its middle
            sweep = 0.5 * max((self.sensors[i].period or 0.0 for i in used), default=0.0)
            length = max(latencies) - min(latencies) + sweep + 1.0
        object.__setattr__(self, "length", length)

    @property
    def used(self) -> tuple[int, ...]:
        """Indices of the sensors in use."""
        return tuple(range(len(self.sensors))) if self.use is None else self.use

    def init(self) -> TrackerState:
        """Return the state before the first look."""
        return TrackerState(empty_window(self.plan), Clock())

    def step(self, state: TrackerState, scan: Scan) -> tuple[TrackerState, Output]:
        """Take one look in order of arrival; consumes `state`.

        Rows that the looks up to the previous arrival call for come out first: looks that arrive together are all
        taken before rows are made.
        """
        out = Output([], [], [])
        if state.pending and scan.t_recv > state.clock.arrival:
            self._rows(state, out)
            for t in due_before(state.clock, scan.t_recv):
                self._emit(state, out, t, t)
        out.decisions.extend(Decision(row, Fate.NO_DETECTION, -1, np.nan) for row in scan.empty_rows)
        look = self._look(scan)
        note_arrival(state.clock, scan.sensor, scan.t_recv)
        state.pending = True
        if look is None:
            out.decisions.extend(Decision(int(row), Fate.SCREENED, -1, np.nan) for row in scan.row)
            return state, out
        if not insert(state.window, self.plan, scan.sensor, look, self.length):
            out.decisions.extend(Decision(int(row), Fate.LATE, -1, np.nan) for row in scan.row)
        lag = self.config.smoothing_lag
        if lag is not None:
            self._smooth(state, out, state.clock.arrival - lag)
        final = expire(state.window, self.length if lag is None else max(self.length, lag))
        out.decisions.extend(decision for entry in final for decision in _decisions(entry))
        return state, out

    def finish(self, state: TrackerState) -> tuple[TrackerState, Output]:
        """Give the rows that the last arrival calls for, the decisions and the smoothed rows still in the window."""
        out = Output([], [], [])
        if state.pending:
            self._rows(state, out)
        if self.config.smoothing_lag is not None:
            self._smooth(state, out, np.inf)
        out.decisions.extend(decision for entry in state.window.entries for decision in _decisions(entry))
        return state, out

    def _smooth(self, state: TrackerState, out: Output, until: float) -> None:
        known = state.clock.arrival
        for rows in smoothed_rows(state.window, self.plan, state.smoothed, until, known, self.config.coast_after):
            state.smoothed = float(rows.t[0])
            named = np.array([birth in state.names for birth in rows.birth.tolist()])
            if named.any():
                out.smoothed.append(rows.select(named, state.names))

    def _rows(self, state: TrackerState, out: Output) -> None:
        periods = {i: period_of(state.clock, i, self.sensors[i].period) for i in self.used}
        for t in due_at_arrival(state.clock, periods):
            self._emit(state, out, t, state.clock.arrival)
        state.pending = False

    def _emit(self, state: TrackerState, out: Output, t: float, t_known: float) -> None:
        rows = rows_at(state.window.tracks, self.plan, t, t_known, self.config.coast_after)
        if rows is not None:
            out.rows.append(replace(rows, track_id=_number(state, rows.birth.tolist(), t)))

    def _look(self, scan: Scan) -> Look | None:
        """Take the declared latency off and place the sensor; None where there is no pose for it."""
        sensor = self.sensors[scan.sensor]
        times = np.append(scan.t, scan.t_look) - sensor.latency
        track = self.poses.get(sensor.platform) if sensor.platform is not None else None
        if track is not None:
            track = track.until(scan.t_recv)
            if not track.covers(times):
                return None
        position, velocity, axes = _poses(sensor, track, times)
        R = np.ascontiguousarray(scan.covariance)
        if track is not None:
            R = add_navigation_noise(sensor, track, times[:-1], scan.z, R)
        t_look = float(times[-1])
        return Look(
            t=t_look,
            dt=times[:-1] - t_look,
            z=np.ascontiguousarray(scan.z),
            R=R,
            row=np.ascontiguousarray(scan.row, dtype=np.int64),
            sensor_position=position,
            sensor_velocity=velocity,
            enu_from_sensor=axes,
        )


def _poses(sensor: Sensor, track: PoseTrack | None, times: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Look the pose up once where all detections share one time."""
    if len(times) > 2 and (times == times[-1]).all():
        position, velocity, axes = sensor_pose(sensor, track, times[-1:])
        n = len(times)
        return np.repeat(position, n, axis=0), np.repeat(velocity, n, axis=0), np.repeat(axes, n, axis=0)
    return sensor_pose(sensor, track, times)


def _number(state: TrackerState, births: list[int], t: float) -> NDArray[np.int64]:
    """Return the ids of rows at `t`: a live track has a row every half second, one shown again begins anew."""
    last = state.last_row.get
    for birth in [b for b in births if t - last(b, -np.inf) > MAX_ROW_GAP]:
        state.numbered += 1
        state.names[birth] = state.numbered
    state.last_row.update(dict.fromkeys(births, t))
    return np.fromiter(map(state.names.__getitem__, births), np.int64, len(births))


def _decisions(entry: Entry) -> list[Decision]:
    return [
        Decision(row, FATE_OF_CODE[code], owner, nis)
        for row, code, owner, nis in zip(
            entry.look.row.tolist(), entry.fate.tolist(), entry.owner.tolist(), entry.nis.tolist(), strict=True
        )
    ]


def track_ids(birth: NDArray[np.int64], names: Mapping[int, int]) -> NDArray[np.int64]:
    """Return the track ids of births, -1 where the track was never shown."""
    return np.array([names.get(int(b), -1) for b in birth], dtype=np.int64)
