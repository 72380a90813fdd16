"""Where reports lie in the world: directions and positions, and back into the sensor's axes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.frames.pose import PoseTrack, sensor_pose
from boresight.kernels.measurement import wrap
from boresight.types import N_COMPONENTS, Axes, Component, FloatArray, Scan, Sensor

AZ, EL = Component.AZIMUTH, Component.ELEVATION
LEVEL = (Axes.SITE_ENU, Axes.PLATFORM_ENU)
STEP = 1e-6  # rad, of differences


class Place(NamedTuple):
    """Pose of a sensor at the times of interest, world ENU."""

    position: FloatArray  # (n, 3) m
    axes: FloatArray  # (n, 3, 3) enu_from_sensor


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """The sensors and platforms of a recording, for stages."""

    sensors: tuple[Sensor, ...]
    poses: Mapping[str, PoseTrack] = field(default_factory=dict)

    def valid(self, scan: Scan) -> FloatArray:
        """Return the times of validity (n,) of a look's detections: the declared latency off."""
        return scan.t - self.sensors[scan.sensor].latency

    def look_time(self, scan: Scan) -> float:
        """Return the time of validity of a look."""
        return scan.t_look - self.sensors[scan.sensor].latency

    def place(self, sensor: int, t: FloatArray, known: float) -> Place | None:
        """Return the pose at `t` (n,) of navigation that had arrived by `known` (s); None where there is none."""
        one = self.sensors[sensor]
        track = self.poses.get(one.platform) if one.platform is not None else None
        if track is not None:
            track = track.until(known)
            if not track.covers(t):
                return None
        position, _, axes = sensor_pose(one, track, t)
        return Place(position, axes)


def bearing_only(sensor: Sensor) -> bool:
    """Whether a sensor reports directions and nothing else."""
    rest = [c for c in range(N_COMPONENTS) if c not in (AZ, EL)]
    return math.isfinite(sensor.sigma[AZ]) and not np.isfinite(sensor.sigma[rest]).any()


def local(z: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return positions (n, 3) in sensor axes of reports z (n, 7), and which are directions of length 1.

    Elevation or height that is not measured counts as zero.
    """
    boxed = np.isfinite(z[:, Component.EAST])
    r = z[:, Component.RANGE]
    direction = ~boxed & ~np.isfinite(r)
    az, el = np.nan_to_num(z[:, AZ]), np.nan_to_num(z[:, EL])
    u = np.stack([np.cos(el) * np.sin(az), np.cos(el) * np.cos(az), np.sin(el)], axis=1)
    box = np.nan_to_num(z[:, Component.EAST : Component.UP + 1])
    return np.where(boxed[:, None], box, u * np.where(direction, 1.0, np.nan_to_num(r))[:, None]), direction


def spread(z: FloatArray, R: FloatArray, xyz: FloatArray) -> FloatArray:
    """Return the largest standard deviation (n,) of positions (m) or directions (rad) `xyz` (n, 3) of reports."""
    variance = np.nan_to_num(np.einsum("kii->ki", R))
    far = np.linalg.norm(xyz, axis=1)
    angle = np.maximum(variance[:, AZ] * np.cos(np.nan_to_num(z[:, EL])) ** 2, variance[:, EL])
    box = variance[:, Component.EAST : Component.UP + 1].max(axis=1)
    out: FloatArray = np.sqrt(np.maximum(np.maximum(box, variance[:, Component.RANGE]), angle * far**2))
    return out


def turn(sensor: Sensor, az: float, el: float, enu_from_sensor: FloatArray, back: bool = False) -> FloatArray:
    """Return (az, el) (2,) of a direction in sensor axes in world axes, or `back`.

    North-aligned axes are taken for the world's: what they differ by over a recording is below a hundredth of a degree.
    """
    if sensor.axes in LEVEL:
        return np.array([az, el])
    u = np.array([math.cos(el) * math.sin(az), math.cos(el) * math.cos(az), math.sin(el)])
    v = (enu_from_sensor.T if back else enu_from_sensor) @ u
    return np.array([math.atan2(v[0], v[1]), math.atan2(v[2], math.hypot(v[0], v[1]))])


def turn_jacobian(sensor: Sensor, az: float, el: float, axes: FloatArray, back: bool = False) -> FloatArray:
    """Return the Jacobian (2, 2) of `turn`, by central differences."""
    if sensor.axes in LEVEL:
        return np.eye(2)
    out = np.empty((2, 2))
    for j, (da, de) in enumerate(((STEP, 0.0), (0.0, STEP))):
        d = turn(sensor, az + da, el + de, axes, back) - turn(sensor, az - da, el - de, axes, back)
        out[:, j] = wrap(d[0]) / (2 * STEP), d[1] / (2 * STEP)
    return out
