"""A whole recording in memory (RECORDING format, version 1), already in SI, radians and the site's ENU."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from boresight.types.sensor import FloatArray, Sensor, Site


@dataclass(frozen=True, slots=True, eq=False)
class Detections:
    """All rows of `detections.parquet`, in file order (= order of arrival), as columns.

    Cartesian components are already turned to the east/north/up-like columns of `Component`; `sigma` has the
    sensor's value filled in where the row has none.
    """

    t: FloatArray  # (n,) s, as stamped
    t_recv: FloatArray  # (n,) s
    sensor: NDArray[np.int64]  # (n,) index into Recording.sensors
    scan: NDArray[np.int64]  # (n,)
    z: FloatArray  # (n, 7) NaN where not measured
    sigma: FloatArray  # (n, 7) NaN where not measured
    covariance: dict[int, FloatArray]  # row -> (7, 7), for rows that carry a full covariance
    source_id: list[str | None] | None = None
    attributes: list[str | None] | None = None

    def __len__(self) -> int:
        return len(self.t)


@dataclass(frozen=True, slots=True, eq=False)
class PlatformTrack:
    """Stamped navigation data of one platform; NaN where not given. `ypr` is yaw, pitch, roll (rad), NED to FRD.

    `at_rest`: its one row holds for all times.
    """

    id: str
    t: FloatArray  # (n,) s, ascending
    position: FloatArray  # (n, 3) site ENU m
    velocity: FloatArray  # (n, 3) site ENU m/s
    ypr: FloatArray  # (n, 3) rad
    sigma_position: FloatArray  # (n,) m
    sigma_attitude: FloatArray  # (n,) rad
    t_recv: FloatArray | None = None  # (n,) s, when each arrived; None: with its stamp
    at_rest: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """The true path of one target. Never read by a tracker."""

    target: str
    t: FloatArray  # (n,) s, ascending
    position: FloatArray  # (n, 3) site ENU m
    velocity: FloatArray  # (n, 3) m/s, NaN where not given
    sigma: FloatArray | None = None  # (n,) m per axis: the reference's own error, NaN where not given


@dataclass(frozen=True, slots=True, eq=False)
class Ignore:
    """A real object without truth: unmatched tracks near it are not scored."""

    object: str
    t: FloatArray  # (n,) s
    position: FloatArray  # (n, 2) east, north m
    radius: FloatArray  # (n,) m


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """A recording: what was declared and what was recorded."""

    name: str
    dimensions: int
    site: Site
    sensors: tuple[Sensor, ...]
    detections: Detections
    platforms: tuple[PlatformTrack, ...] = ()
    truth: tuple[Truth, ...] = ()
    ignore: tuple[Ignore, ...] = ()
    duplicates: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=bool))  # (n,) row stood earlier
    refused: Mapping[int, str] = field(default_factory=dict)  # rows of the detections that are not used, and why
    notes: tuple[str, ...] = ()  # what the user is to know of the files: one line each

    @property
    def usable(self) -> NDArray[np.bool_]:
        """(n,) False for rows of the detections that are refused: their stamps or values say nothing."""
        out = np.ones(len(self.detections), dtype=bool)
        out[list(self.refused)] = False
        return out

    @property
    def span(self) -> tuple[float, float]:
        """First and last stamp (s) of the detections that are not refused; of all where every one is."""
        t = self.detections.t[self.usable] if len(self.refused) < len(self.detections) else self.detections.t
        return float(t.min()), float(t.max())

    def sensor_index(self, sensor_id: str) -> int:
        """Return the index of a sensor by id; raises KeyError."""
        for i, sensor in enumerate(self.sensors):
            if sensor.id == sensor_id:
                return i
        raise KeyError(sensor_id)
