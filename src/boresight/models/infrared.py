"""Infrared and optical sensors: directions without range."""

from __future__ import annotations

from dataclasses import dataclass

from boresight.models.base import AT_ORIGIN, KernelSensor, SensorPose, describe
from boresight.types.enums import Component
from boresight.types.sensor import FloatArray


@dataclass(frozen=True, eq=False)
class Infrared(KernelSensor):
    """A sensor that measures azimuth, elevation or both (rad), as infrared and optical cameras do.

    Give `sigma_azimuth` alone for a bearing-only sensor. With `tangent`, azimuth noise is the cross-elevation angle,
    which is what a camera's pixels have, and stays right near the zenith. The rest as in `Radar`. Raises UserError.
    """

    sigma_azimuth: float | None = None
    sigma_elevation: float | None = None
    pose: SensorPose = AT_ORIGIN
    dimensions: int = 3
    covariance: FloatArray | None = None
    tangent: bool = False

    def __post_init__(self) -> None:
        sigmas: dict[Component, float | None] = {
            Component.AZIMUTH: self.sigma_azimuth,
            Component.ELEVATION: self.sigma_elevation,
        }
        describe(self, sigmas, self.covariance, self.dimensions, self.tangent)
