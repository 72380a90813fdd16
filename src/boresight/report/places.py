"""Where detections lie in the site's axes: points where there is a range, rays where there is only a bearing."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.errors import UserError
from boresight.frames.pose import pose_track, sensor_pose
from boresight.types import Component, FloatArray, Recording


class Places(NamedTuple):
    """Detections of one sensor in site ENU; `origin` is the sensor's position."""

    row: NDArray[np.int64]  # (n,)
    t: FloatArray  # (n,) s, latency taken off
    point: FloatArray  # (n, 3) m, NaN where there is no range
    origin: FloatArray  # (n, 3) m
    azimuth: FloatArray  # (n,) rad from north, of the line of sight


def places_of(recording: Recording, sensor: int) -> Places:
    """Return where the detections of one sensor lie; rows without a pose or a direction are left out."""
    d, declared = recording.detections, recording.sensors[sensor]
    z = np.nan_to_num(d.z)
    seen = ~np.isnan(d.z[:, [Component.AZIMUTH, Component.EAST]]).all(axis=1)
    row = np.flatnonzero((d.sensor == sensor) & seen & recording.usable)
    t = d.t[row] - declared.latency
    platform = next((p for p in recording.platforms if p.id == declared.platform), None)
    try:
        track = None
        if platform is not None:
            track = pose_track(platform, recording.site, max_extrapolation=10.0, max_gap=60.0)
        if track is not None:
            ok = track.usable(t, attitude=track.has_attitude)
            row, t = row[ok], t[ok]
        origin, _, enu_from_sensor = sensor_pose(declared, track, t)
    except UserError:  # no navigation that would do: nothing can be placed
        none = np.zeros((0, 3))
        return Places(np.zeros(0, dtype=np.int64), np.zeros(0), none, none, np.zeros(0))
    z = z[row]
    cartesian = ~np.isnan(d.z[row, Component.EAST])
    ranged = ~np.isnan(d.z[row, Component.RANGE])
    r = np.where(ranged, z[:, Component.RANGE], 1.0)
    azimuth, elevation = z[:, Component.AZIMUTH], z[:, Component.ELEVATION]
    flat = r * np.cos(elevation)
    polar = np.stack([flat * np.sin(azimuth), flat * np.cos(azimuth), r * np.sin(elevation)], axis=1)
    local = np.where(cartesian[:, None], z[:, Component.EAST :], polar)
    line = np.einsum("kij,kj->ki", enu_from_sensor, local)
    point = np.where((cartesian | ranged)[:, None], origin + line, np.nan)
    return Places(row, t, point, origin, np.arctan2(line[:, 0], line[:, 1]))
