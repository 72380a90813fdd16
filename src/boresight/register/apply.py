"""Take constant errors out of a recording: into its declaration where that has a field, else out of the reports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from boresight.kernels.registration import AZIMUTH, ELEVATION, RANGE, SCALE, TIME
from boresight.types import Axes, Component, Detections, FloatArray, Mount, Recording, Sensor


def corrected(recording: Recording, errors: Mapping[int, FloatArray]) -> Recording:
    """Return the recording with constant errors (sensor index -> (5,), reported minus true) taken out.

    The time offset goes into the sensor's `latency`, the azimuth offset of one that turns with the platform (and is
    mounted without pitch and roll) into its mount's yaw; ranges and the other angles have no field in the declaration,
    and are corrected in the reports themselves.
    """
    sensors, detections = list(recording.sensors), recording.detections
    for i, e in errors.items():
        sensor = sensors[i]
        turns = sensor.axes in (Axes.BODY, Axes.MOUNT)
        mounted = turns and (sensor.axes == Axes.BODY or (sensor.mount.pitch == 0.0 and sensor.mount.roll == 0.0))
        rest = e.copy()
        if mounted and e[AZIMUTH] != 0.0:
            sensor, rest[AZIMUTH] = _turned(sensor, float(e[AZIMUTH])), 0.0
        sensors[i] = replace(sensor, latency=sensor.latency + float(e[TIME]))
        detections = _reports(detections, i, rest)
    return replace(recording, sensors=tuple(sensors), detections=detections)


def _turned(sensor: Sensor, azimuth: float) -> Sensor:
    old = sensor.mount
    yaw = (old.yaw if sensor.axes == Axes.MOUNT else 0.0) - azimuth
    return replace(sensor, axes=Axes.MOUNT, mount=Mount(yaw, 0.0, 0.0, old.lever_arm))


def _reports(d: Detections, sensor: int, e: FloatArray) -> Detections:
    """Correct ranges and angles of one sensor's rows."""
    rows = np.flatnonzero(d.sensor == sensor)
    z, covariance = d.z.copy(), dict(d.covariance)
    part = z[rows]
    part[:, Component.RANGE] = np.maximum((part[:, Component.RANGE] - e[RANGE]) / (1.0 + e[SCALE]), 0.0)
    part[:, Component.AZIMUTH] = np.angle(np.exp(1j * (part[:, Component.AZIMUTH] - e[AZIMUTH])))
    level = np.pi / 2
    part[:, Component.ELEVATION] = np.clip(part[:, Component.ELEVATION] - e[ELEVATION], -level, level)
    box = part[:, Component.EAST : Component.UP + 1]
    flat = np.hypot(box[:, 0], box[:, 1])
    up = np.nan_to_num(box[:, 2])
    r = np.maximum((np.hypot(flat, up) - e[RANGE]) / (1.0 + e[SCALE]), 0.0)
    az, el = np.arctan2(box[:, 0], box[:, 1]) - e[AZIMUTH], np.arctan2(up, flat) - e[ELEVATION]
    part[:, Component.EAST] = r * np.cos(el) * np.sin(az)
    part[:, Component.NORTH] = r * np.cos(el) * np.cos(az)
    part[:, Component.UP] = np.where(np.isfinite(box[:, 2]), r * np.sin(el), np.nan)
    z[rows] = part
    c, s = np.cos(e[AZIMUTH]), np.sin(e[AZIMUTH])
    turn = np.eye(7)
    turn[4:6, 4:6] = [[c, -s], [s, c]]
    for row in rows.tolist():
        if row in covariance and np.isfinite(z[row, Component.EAST]):
            missing = np.isnan(covariance[row])
            full = turn @ np.nan_to_num(covariance[row]) @ turn.T
            covariance[row] = np.where(missing, np.nan, full)
    return replace(d, z=z, covariance=covariance)
