"""A recording through the pointing chain: what `boresight point --replay` does."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from boresight.config.site import Station
from boresight.errors import UserError, did_you_mean
from boresight.frames.local import ecef_from_enu, ecef_from_enu_rotation
from boresight.frames.pose import PoseTrack, pose_track, sensor_pose
from boresight.io.scans import iter_scans
from boresight.kernels.guide import DIRECTION
from boresight.pointing.guide import NONE
from boresight.pointing.pointer import Pointer, PointerState, Pointing
from boresight.service.elements import Elements
from boresight.service.navigation import place_at
from boresight.service.tracks import read_track
from boresight.types import Component, FloatArray, Recording, Scan

POSITION = slice(Component.EAST, Component.UP + 1)
APART = 3600.0  # s that a track may begin before, or end after, the recording

Report = tuple[float, FloatArray, FloatArray, FloatArray]  # t, z, origin, axes as `Pointer.take` wants them
Event = tuple[float, int, Scan | Report]  # s of arrival, source, what arrived


def replay(
    station: Station, folder: Path, pointer: Pointer, recording: Recording
) -> Iterator[tuple[Pointing, PointerState]]:
    """Yield a command at every tick, from what had arrived by then; live and replay are one chain.

    `platform` of the site file carries the antenna: its pose is foretold to the aim time from the navigation data known
    at the tick, and the face is turned with it. Tracks of other trackers (`tracks`, beside the site file in `folder`)
    come in between. Raises UserError for a platform that the recording does not have, or one without attitude, and
    for tracks of another time.

    Of a look with several detections the one nearest to the prediction is taken (before there is one: the first).
    """
    rate, coast = station.file.beam.rate_hz, station.file.attitude_coast_s
    tracks = {p.id: pose_track(p, recording.site) for p in recording.platforms}
    carrier = _carrier(tracks, station.file.platform)
    elements = Elements(pointer, station.elements, {s.id: s.max_age_days for s in station.file.source})
    chooser = _Chooser(station, pointer, recording, tracks)
    state = pointer.init()
    first, k = math.nan, 0

    def ticked(state: PointerState, t: float) -> tuple[PointerState, Pointing | None]:
        place = None if carrier is None else place_at(pointer, carrier.until(t), t, coast)
        return pointer.tick(state, t, place)

    tick = 0.0
    for arrival, source, what in _events(station, folder, pointer, recording):
        if math.isnan(first):
            first = tick = arrival
        while tick < arrival:
            elements.report(state, tick)
            state, out = ticked(state, tick)
            if out is not None:
                yield out, state
            k += 1
            tick = first + k / rate
        report = chooser.report(state, what) if isinstance(what, Scan) else what
        if report is not None:
            pointer.take(state, source, *report)
    state, out = ticked(state, tick)
    if out is not None:
        yield out, state


def _events(station: Station, folder: Path, pointer: Pointer, recording: Recording) -> Iterator[Event]:
    """Yield the recording's looks and the other trackers' tracks in order of arrival."""
    index = {s.id: i for i, s in enumerate(pointer.guide.sources)}
    streams: list[Iterator[Event]] = [((s.t_recv, s.sensor, s) for s in iter_scans(recording))]
    d = recording.detections
    for table in station.file.source:
        if table.tracks is None:
            continue
        source = index[table.id]
        rows = read_track(folder / table.tracks, table, pointer.guide.sources[source])
        t = rows.t.tolist()
        if len(d) and (t[-1] < float(d.t_recv[0]) - APART or t[0] > float(d.t_recv[-1]) + APART):
            raise UserError(
                f"source '{table.id}': its tracks ({t[0]:.6g} … {t[-1]:.6g} s) are of another time than the recording "
                f"({d.t_recv[0]:.6g} … {d.t_recv[-1]:.6g} s)"
            )
        streams.append(_rows(source, t, rows.z, rows.axes))
    return heapq.merge(*streams, key=lambda event: event[0])


def _rows(source: int, t: list[float], z: FloatArray, axes: FloatArray) -> Iterator[Event]:
    return ((at, source, (at, z[i], NONE, axes[i])) for i, at in enumerate(t))


def _carrier(tracks: dict[str, PoseTrack], platform: str | None) -> PoseTrack | None:
    if platform is None:
        return None
    if platform not in tracks:
        raise UserError(f"the recording has no platform '{platform}'{did_you_mean(platform, tracks)}")
    if not tracks[platform].has_attitude:
        raise UserError(f"platform '{platform}' has no attitude: it cannot carry the antenna")
    return tracks[platform]


class _Chooser:
    """Which detection of a look is the target, as a report."""

    def __init__(self, station: Station, pointer: Pointer, recording: Recording, tracks: dict[str, PoseTrack]) -> None:
        self.pointer, self.recording, self.tracks = pointer, recording, tracks
        self.up = {s.id: s.sigma_up_m for s in station.file.source}
        self.R = ecef_from_enu_rotation(recording.site)

    def report(self, state: PointerState, scan: Scan) -> Report | None:
        """Return the report nearest to the prediction, None if there is none."""
        sensor = self.recording.sensors[scan.sensor]
        track = self.tracks.get(sensor.platform) if sensor.platform is not None else None
        t = scan.t - sensor.latency
        if not len(t) or (track is not None and not track.usable(t, attitude=track.has_attitude).all()):
            return None
        origin, _, axes = sensor_pose(sensor, track, t)
        where = np.stack(ecef_from_enu(origin[:, 0], origin[:, 1], origin[:, 2], self.recording.site), axis=-1)
        best, least = None, math.inf
        for i in range(len(t)):
            report = self._report(scan, i, float(t[i]), where[i], self.R @ axes[i])
            if report is None:
                continue
            far = self.pointer.guide.surprise(state.guide, scan.sensor, *report)
            if best is None or far < least:
                best, least = report, far
        return best

    def _report(self, scan: Scan, i: int, t: float, origin: FloatArray, turn: FloatArray) -> Report | None:
        z, source = scan.z[i], self.pointer.guide.sources[scan.sensor]
        if source.kind == DIRECTION:
            seen = z[[Component.AZIMUTH, Component.ELEVATION, Component.RANGE]]
            return None if np.isnan(seen).all() else (t, seen, origin, turn)
        if math.isnan(z[Component.EAST]):
            return None
        at = origin + turn @ np.nan_to_num(z[POSITION], nan=0.0)
        if source.correlation is None and int(scan.row[i]) not in self.recording.detections.covariance:
            return t, at, origin, turn
        C = scan.covariance[i][POSITION, POSITION].copy()
        if math.isnan(z[Component.UP]):
            C[2, :] = C[:, 2] = 0.0
            C[2, 2] = self.up.get(source.id, source.sigma_position) ** 2
        try:
            return t, at, origin, source.axes_of(turn @ C @ turn.T)
        except np.linalg.LinAlgError:
            return None
