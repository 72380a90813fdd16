"""From a tracked recording to the reports that registration rests on."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from boresight.errors import UserError
from boresight.frames.azel import enu_from_azel
from boresight.frames.pose import PoseTrack, sensor_pose
from boresight.io.scans import covariances
from boresight.register.residuals import Observed
from boresight.types import NO_TRACK, Component, FloatArray, Recording

LEAST_REPORTS, LEAST_SPAN = 6, 5.0  # of a track, s: less says nothing


def observed_of(
    recording: Recording,
    track_id: NDArray[np.int64],
    poses: Mapping[str, PoseTrack],
    use: Collection[int],
    decorrelation: Mapping[int, float],
) -> Observed:
    """Return the reports of `track_id` (n,) (NO_TRACK: of none), at their declared times of validity.

    Tracks with few reports, or that no ranging sensor saw, are left out, and reports without navigation. Raises
    UserError where nothing is left.
    """
    d = recording.detections
    latency = np.array([s.latency for s in recording.sensors])
    t = d.t - latency[d.sensor]
    good = (track_id != NO_TRACK) & np.isin(d.sensor, sorted(use)) & np.isfinite(d.z).any(axis=1) & recording.usable
    by_sensor = tuple(poses.get(s.platform) if s.platform is not None else None for s in recording.sensors)
    for i, pose in enumerate(by_sensor):
        mine = good & (d.sensor == i)
        if pose is not None and mine.any():
            good[np.flatnonzero(mine)[~pose.usable(t[mine], len(pose.t_attitude) > 0)]] = False
    fix = np.full((len(d), 3), np.nan)
    for i, pose in enumerate(by_sensor):
        rows = np.flatnonzero(good & (d.sensor == i))
        if len(rows):
            place, _, axes = sensor_pose(recording.sensors[i], pose, t[rows])
            fix[rows] = place + np.einsum("kij,kj->ki", axes, _local(d.z[rows]))
    kept: list[NDArray[np.int64]] = []
    number = np.full(len(d), -1)
    tracks = 0
    for name in np.unique(track_id[good]):
        mine = np.flatnonzero(good & (track_id == name))
        ranging = mine[np.isfinite(fix[mine]).all(axis=1)]
        if len(mine) >= LEAST_REPORTS and len(ranging) >= 3 and np.ptp(t[ranging]) >= LEAST_SPAN:
            number[mine] = tracks
            kept.append(mine)
            tracks += 1
    if not kept:
        raise UserError(f"recording '{recording.name}': no track long enough to register sensors by")
    alike = np.ones(len(d))
    for mine in kept:
        for i in np.unique(d.sensor[mine]):
            rows = mine[d.sensor[mine] == i]
            times, half = np.sort(t[rows]), 0.5 * decorrelation.get(int(i), 0.0)
            alike[rows] = np.searchsorted(times, t[rows] + half, "right") - np.searchsorted(times, t[rows] - half)
    at = np.sort(np.concatenate(kept))
    R = covariances(d, at)
    return Observed(number[at], d.sensor[at], t[at], d.z[at], R, fix[at], alike[at], by_sensor, tracks)


def _local(z: FloatArray) -> FloatArray:
    """Positions (n, 3) in sensor axes, NaN for directions; elevation and height that are not measured count as 0."""
    boxed = np.isfinite(z[:, Component.EAST])
    r, az = z[:, Component.RANGE], z[:, Component.AZIMUTH]
    polar = np.isfinite(r) & np.isfinite(az)
    out = np.full((len(z), 3), np.nan)
    out[boxed] = np.nan_to_num(z[boxed][:, Component.EAST : Component.UP + 1])
    if polar.any():
        el = np.nan_to_num(z[polar, Component.ELEVATION])
        out[polar] = np.stack(enu_from_azel(az[polar], el, r[polar]), axis=1)
    return out
