"""Measurements of a sensor to reports of a guide source: one way, for recorded looks and for live lines."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from boresight.frames.local import ecef_from_enu, ecef_from_enu_rotation
from boresight.frames.pose import PoseTrack, sensor_pose
from boresight.kernels.guide import DIRECTION
from boresight.pointing.guide import GuideSource
from boresight.types import Axes, Component, FloatArray, Sensor, Site

POSITION = slice(Component.EAST, Component.UP + 1)


class Report(NamedTuple):
    """One report as `Pointer.take` wants it."""

    source: int
    t: float  # s
    t_recv: float  # s, arrival
    z: FloatArray  # (3,) azimuth, elevation (rad), range (m), NaN where not measured; or ECEF m; (6,) with velocity
    origin: FloatArray  # (3,) ECEF m
    axes: FloatArray  # (3, 3) or (6, 6)


def stands(sensor: Sensor, track: PoseTrack | None, t: FloatArray, site: Site) -> tuple[FloatArray, FloatArray] | None:
    """Return places (n, 3) (ECEF m) and axes (n, 3, 3) (ECEF from the sensor's) at `t` (n,) (s).

    None where the platform's navigation does not cover these times.
    """
    rides = sensor.platform is not None and sensor.axes != Axes.SITE_ENU
    if rides:
        turned = sensor.axes != Axes.PLATFORM_ENU or any(sensor.mount.lever_arm)
        if track is None or not track.usable(t, attitude=turned).all():
            return None
    origin, _, axes = sensor_pose(sensor, track if rides else None, t)
    where = np.stack(ecef_from_enu(origin[:, 0], origin[:, 1], origin[:, 2], site), axis=-1)
    return where, ecef_from_enu_rotation(site) @ axes


def report_of(
    source: int,
    guide: GuideSource,
    t: float,
    t_recv: float,
    z: FloatArray,
    covariance: FloatArray | None,
    origin: FloatArray,
    turn: FloatArray,
    sigma_up: float,
) -> Report | None:
    """Return the report of one detection `z` (7,) of a sensor at `origin` with axes `turn`; None if it holds none.

    What was not measured stays NaN: it is never taken for a number. `covariance` (7, 7) is the detection's own, None
    where the source's sigma stands for it; a position without height has `sigma_up` (m) there.
    """
    if guide.kind == DIRECTION:
        seen = z[[Component.AZIMUTH, Component.ELEVATION, Component.RANGE]]
        return None if np.isnan(seen).all() else Report(source, t, t_recv, seen, origin, turn)
    if np.isnan(z[Component.EAST]) or np.isnan(z[Component.NORTH]):
        return None
    if guide.correlation is not None and covariance is None:
        return None
    flat = math.isnan(z[Component.UP])
    at = origin + turn @ np.nan_to_num(z[POSITION], nan=0.0)
    if covariance is None and not flat:
        return Report(source, t, t_recv, at, origin, turn)
    C = np.diag(np.full(3, guide.sigma_position**2)) if covariance is None else covariance[POSITION, POSITION].copy()
    if flat:
        C[2, :] = C[:, 2] = 0.0
        C[2, 2] = max(sigma_up, guide.sigma_position) ** 2
    try:
        return Report(source, t, t_recv, at, origin, guide.axes_of(turn @ C @ turn.T))
    except np.linalg.LinAlgError:
        return None


def reports_of_look(
    source: int,
    guide: GuideSource,
    sensor: Sensor,
    track: PoseTrack | None,
    site: Site,
    t: FloatArray,
    t_recv: float,
    z: FloatArray,
    covariances: Mapping[int, FloatArray],
    sigma_up: float,
    own: FloatArray | None = None,
) -> tuple[Report, ...] | None:
    """Return the reports of one look, None where its platform's navigation does not cover it.

    Args:
        t, z: (n,) stamps (s), (n, 7) detections; the sensor's declared latency is taken off here.
        covariances: (7, 7) by detection, of those that bring their own.
        own: (3, 3) turn of the measured angles within the sensor's axes (an array's face).
    """
    at = t - sensor.latency
    place = stands(sensor, track, at, site)
    if place is None:
        return None
    where, axes = place
    if own is not None:
        axes = axes @ own
    found = (
        report_of(source, guide, float(at[i]), t_recv, z[i], covariances.get(i), where[i], axes[i], sigma_up)
        for i in range(len(at))
    )
    return tuple(report for report in found if report is not None)
