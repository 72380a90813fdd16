"""What is declared of a sensor: geometry, noise, timing, detection. SI and radians."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from boresight.types.enums import N_COMPONENTS, Axes, Component, Reporting, SensorKind

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Site:
    """Origin of the world's east/north/up axes on the WGS84 ellipsoid (rad, rad, m)."""

    latitude: float
    longitude: float
    height: float


@dataclass(frozen=True, slots=True)
class Mount:
    """How a sensor sits on its platform: yaw, pitch, roll (rad) turn body into mount axes; lever arm in FRD metres."""

    yaw: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Station:
    """Where a fixed sensor stands: site east, north, up (m), and the rotation (3, 3) from its level axes."""

    position: tuple[float, float, float]
    enu_from_local: tuple[tuple[float, float, float], ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True, slots=True)
class Coverage:
    """Where a sensor can see, in its own axes: range (m), azimuth and elevation (rad), each (low, high).

    Azimuth runs clockwise from `azimuth[0]` to `azimuth[1]`; an interval of 2π or more is all round, and
    low > high passes through south.
    """

    range: tuple[float, float] = (0.0, math.inf)
    azimuth: tuple[float, float] = (-math.pi, math.pi)
    elevation: tuple[float, float] = (-math.pi / 2, math.pi / 2)


def _no_sigma() -> FloatArray:
    return np.full(N_COMPONENTS, np.nan)


@dataclass(frozen=True, slots=True, eq=False)
class Sensor:
    """One sensor of a recording.

    `sigma` (7,) holds the standard deviation of every `Component` that the sensor may measure (m, rad, m/s), NaN
    where it never measures one. `latency` (s): validity = stamp - latency. `period` (s) is None where unknown.
    `p_detection` holds within coverage; `clutter_per_scan` is the mean number of false detections of a look.
    Where `reporting` is SINGLE a look is a message of one target: `period` (s) is then the mean time between two
    messages of one target, and `p_detection` the probability that a target reports at all when it is due.
    `p_wrong_id` is the probability that a `source_id` is not the target's own (None: 0.02 where reporting is SINGLE,
    else `source_id` is not used). `height` is the prior of the targets' height above the ellipsoid (mean and standard
    deviation, m), for a sensor that does not measure it (None: what the elevation coverage allows). `station` is where
    a sensor without a platform stands (None: at the site's origin); its axes are then those of the local level there.
    """

    id: str
    kind: SensorKind
    platform: str | None = None
    axes: Axes = Axes.SITE_ENU
    mount: Mount = Mount()
    sigma: FloatArray = field(default_factory=_no_sigma)
    latency: float = 0.0
    period: float | None = None
    p_detection: float = 0.9
    clutter_per_scan: float = 1.0
    coverage: Coverage = Coverage()
    reporting: Reporting = Reporting.SCAN
    p_wrong_id: float | None = None
    height: tuple[float, float] | None = None
    station: Station | None = None

    @property
    def ranging(self) -> bool:
        """Whether it measures where things are, and not only in which direction: by its sigmas, not by its kind.

        A sensor that declares no sigma at all (its rows bring theirs) goes by its kind.
        """
        if np.isnan(self.sigma).all():
            return self.kind not in (SensorKind.INFRARED, SensorKind.OPTICAL)
        return bool(np.isfinite(self.sigma[[Component.RANGE, Component.EAST]]).any())

    @property
    def begins(self) -> bool:
        """Whether one detection of it can begin a track: range and azimuth, or east and north."""
        if np.isnan(self.sigma).all():
            return self.ranging
        polar = self.sigma[[Component.RANGE, Component.AZIMUTH]]
        return bool(np.isfinite(polar).all() or np.isfinite(self.sigma[[Component.EAST, Component.NORTH]]).all())
