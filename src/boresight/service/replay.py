"""A recording through the pointing chain: what `boresight point --replay` does."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from boresight.config.site import Station
from boresight.engine.guide import Guiding
from boresight.engine.loop import Item
from boresight.engine.portions import in_order, ticked
from boresight.errors import UserError, did_you_mean
from boresight.frames.pose import PoseTrack, pose_track
from boresight.io.scans import iter_scans
from boresight.pointing.guide import NONE
from boresight.pointing.mount import MountState
from boresight.pointing.pointer import Place, Pointer, PointerState, Pointing
from boresight.pointing.reports import Report, reports_of_look
from boresight.service.elements import Elements
from boresight.service.navigation import place_at
from boresight.service.tracks import read_track
from boresight.types import Recording

APART = 3600.0  # s that a track may begin before, or end after, the recording


def replay(
    station: Station, folder: Path, pointer: Pointer, recording: Recording
) -> Iterator[tuple[Pointing, PointerState, MountState]]:
    """Yield a command at every tick, from what had arrived by then, and where the mount has been sent.

    `platform` of the site file carries the antenna: its pose is foretold to the aim time from the navigation data known
    at the tick, and the face is turned with it. Tracks of other trackers (`tracks`, beside the site file in `folder`)
    come in between. Raises UserError for a platform that the recording does not have, or one without attitude, and
    for tracks of another time.

    Of a look with several detections the one nearest to the prediction is taken (before there is one: the first).
    """
    rate, coast = station.file.beam.rate_hz, station.file.attitude_coast_s
    poses = {p.id: pose_track(p, recording.site) for p in recording.platforms}
    carrier = _carrier(poses, station.file.platform)
    elements = Elements(pointer, station.elements, {s.id: s.max_age_days for s in station.file.source})

    def place(t: float) -> Place:
        assert carrier is not None
        return place_at(pointer, carrier.until(t), t, coast)

    guiding = Guiding(pointer, rate, None if carrier is None else place, elements.report)
    items = in_order(_looks(station, pointer, recording, poses), *_tracks(station, folder, pointer, recording))
    state = guiding.init()
    mount = _Sent(station)
    for portion in ticked(items, rate):
        state, out = guiding.step(state, portion)
        for pointing in out.pointings:
            yield pointing, out.state, mount.step(pointing)


def _looks(station: Station, pointer: Pointer, recording: Recording, poses: dict[str, PoseTrack]) -> Iterator[Item]:
    """Yield the reports of every look."""
    up = {s.id: s.sigma_up_m for s in station.file.source}
    own = recording.detections.covariance
    for scan in iter_scans(recording):
        sensor, guide = recording.sensors[scan.sensor], pointer.guide.sources[scan.sensor]
        if not len(scan.t):
            continue
        track = poses.get(sensor.platform) if sensor.platform is not None else None
        given = {
            i: scan.covariance[i] for i, row in enumerate(scan.row) if guide.correlation is not None or int(row) in own
        }
        reports = reports_of_look(
            scan.sensor, guide, sensor, None if track is None else track.until(scan.t_recv), recording.site, scan.t,
            scan.t_recv, scan.z, given, up.get(guide.id, guide.sigma_position),
        )  # fmt: skip
        if reports:
            yield reports


def _tracks(station: Station, folder: Path, pointer: Pointer, recording: Recording) -> Iterator[Iterator[Item]]:
    """Yield the rows of each other tracker's track, as reports in the order in which it gave them."""
    index = {s.id: i for i, s in enumerate(pointer.guide.sources)}
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
        yield iter([Report(source, at, at, rows.z[i], NONE, rows.axes[i]) for i, at in enumerate(t)])


def _carrier(tracks: dict[str, PoseTrack], platform: str | None) -> PoseTrack | None:
    if platform is None:
        return None
    if platform not in tracks:
        raise UserError(f"the recording has no platform '{platform}'{did_you_mean(platform, tracks)}")
    if not tracks[platform].has_attitude:
        raise UserError(f"platform '{platform}' has no attitude: it cannot carry the antenna")
    return tracks[platform]


class _Sent:
    """Where the mount of a station is sent by commands: within its stops and rates, as its rotator is live."""

    def __init__(self, station: Station) -> None:
        self.mount = station.mount
        self.state: MountState | None = None
        self.t = math.nan

    def step(self, p: Pointing) -> MountState:
        """Return the position commanded at a pointing; NaN before there is one."""
        if not np.isfinite([p.mount_azimuth, p.mount_elevation]).all():
            return self.state or MountState(math.nan, math.nan)
        if self.state is None:
            self.state = self.mount.reach(p.mount_azimuth, p.mount_elevation, p.mount_azimuth)
        else:
            self.state = self.mount.step(self.state, p.mount_azimuth, p.mount_elevation, p.t - self.t)
        self.t = p.t
        return self.state
