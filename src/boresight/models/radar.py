"""Radar: any subset of range, azimuth, elevation, range rate."""

from __future__ import annotations

from dataclasses import dataclass

from boresight.models.base import AT_ORIGIN, KernelSensor, SensorPose, describe
from boresight.types.enums import Component
from boresight.types.sensor import FloatArray


@dataclass(frozen=True, eq=False)
class Radar(KernelSensor):
    """A radar that measures whichever of range, azimuth, elevation and range rate have a sigma (m, rad, rad, m/s).

    Measurements are (m,) arrays in that order, in the sensor's axes: azimuth from north clockwise, elevation up
    positive, range rate relative to the sensor's own motion. `covariance` (m, m) replaces the sigmas where the noise
    is correlated. With `tangent`, azimuth noise is the cross-elevation angle (see kernels.observation.observe).
    `dimensions` is that of the state's space; in 2-D targets lie in the plane up = 0. Raises UserError.
    """

    sigma_range: float | None = None
    sigma_azimuth: float | None = None
    sigma_elevation: float | None = None
    sigma_range_rate: float | None = None
    pose: SensorPose = AT_ORIGIN
    dimensions: int = 3
    covariance: FloatArray | None = None
    tangent: bool = False

    def __post_init__(self) -> None:
        sigmas: dict[Component, float | None] = {
            Component.RANGE: self.sigma_range,
            Component.AZIMUTH: self.sigma_azimuth,
            Component.ELEVATION: self.sigma_elevation,
            Component.RANGE_RATE: self.sigma_range_rate,
        }
        describe(self, sigmas, self.covariance, self.dimensions, self.tangent)
