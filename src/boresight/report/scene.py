"""What can be seen at one time: tracks with trails, truth, the newest detections, platforms. For replays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from boresight.report.places import Places, places_of
from boresight.types import STATUSES, FloatArray, Recording, Results, TrackStatus

HOLD = 2.0  # s for which a track without a new row, or a detection, is still shown


class Path(NamedTuple):
    """One path on the plan: the rows up to now that are not older than the trail."""

    name: str
    key: int
    xy: FloatArray  # (k, 2) m, oldest first
    coasting: bool = False


class Frame(NamedTuple):
    """Everything on the plan at time `t` (s)."""

    t: float
    tracks: list[Path]
    truth: list[Path]
    platforms: list[Path]
    points: list[FloatArray]  # per sensor (k, 2) m: detections with a range
    rays: list[tuple[FloatArray, FloatArray]]  # per sensor origins (k, 2) m and azimuths (k,) rad: bearings


@dataclass(frozen=True, slots=True, eq=False)
class _Line:
    name: str
    key: int
    t: FloatArray
    xy: FloatArray
    coasting: FloatArray


class Scene:
    """A result, and its recording where given, ready to be asked for frames."""

    def __init__(self, results: Results, recording: Recording | None, trail: float | None = None) -> None:
        rows = results.tracks
        stamps = recording.detections.t[recording.usable] if recording is not None else rows.t
        self.start, self.end = (float(stamps.min()), float(stamps.max())) if len(stamps) else (0.0, 0.0)
        self.trail = max(10.0, (self.end - self.start) / 8.0) if trail is None else trail
        self.sensors = [s.id for s in recording.sensors] if recording is not None else []
        coasting = (rows.status == STATUSES.index(TrackStatus.COASTING)).astype(np.float64)
        order = np.lexsort((rows.t, rows.track_id))
        ids, starts = np.unique(rows.track_id[order], return_index=True)
        parts = np.split(order, starts[1:]) if len(ids) else []
        self._tracks = [
            _Line(str(i), i, rows.t[k], rows.position[k, :2], coasting[k])
            for i, k in zip(ids.tolist(), parts, strict=True)
        ]
        self._truth = [_line(p.target, i, p.t, p.position) for i, p in enumerate(recording.truth)] if recording else []
        self._platforms = (
            [_line(p.id, i, p.t, p.position) for i, p in enumerate(recording.platforms)] if recording else []
        )
        self._places: list[Places] = [places_of(recording, i) for i in range(len(self.sensors))] if recording else []

    def bounds(self) -> tuple[float, float, float, float]:
        """Return west, east, south, north (m) of everything that moves, with a margin."""
        lines = [p.xy for p in (*self._tracks, *self._truth, *self._platforms) if len(p.xy)]
        if not self._tracks and not self._truth:
            lines += [p.point[np.isfinite(p.point[:, 0]), :2] for p in self._places]
        lines = [xy for xy in lines if len(xy)]
        if not lines:
            return -100.0, 100.0, -100.0, 100.0
        low = np.min([xy.min(axis=0) for xy in lines], axis=0)
        high = np.max([xy.max(axis=0) for xy in lines], axis=0)
        margin = 0.06 * max(float((high - low).max()), 20.0)
        return (
            float(low[0] - margin),
            float(high[0] + margin),
            float(low[1] - margin),
            float(high[1] + margin),
        )

    def at(self, t: float) -> Frame:
        """Return the frame at time `t` (s)."""
        points, rays = [], []
        for p in self._places:
            new = (p.t <= t) & (p.t > t - HOLD)
            ranged = np.isfinite(p.point[:, 0])
            points.append(p.point[new & ranged, :2])
            now = new & ~ranged & (p.t > t - 0.25 * HOLD)
            rays.append((p.origin[now, :2], p.azimuth[now]))
        tracks = [q for line in self._tracks if (q := self._cut(line, t, HOLD)) is not None]
        truth = [q for line in self._truth if (q := self._cut(line, t, HOLD)) is not None]
        platforms = [q for line in self._platforms if (q := self._cut(line, t, np.inf)) is not None]
        return Frame(t, tracks, truth, platforms, points, rays)

    def _cut(self, line: _Line, t: float, hold: float) -> Path | None:
        end = int(np.searchsorted(line.t, t, side="right"))
        if end == 0 or t - line.t[end - 1] > hold:
            return None
        begin = int(np.searchsorted(line.t, t - self.trail))
        begin = min(begin, end - 1)
        return Path(line.name, line.key, line.xy[begin:end], bool(line.coasting[end - 1]))


def _line(name: str, key: int, t: FloatArray, position: FloatArray) -> _Line:
    return _Line(name, key, t, position[:, :2], np.zeros(len(t)))
