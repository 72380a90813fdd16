"""Position sensors: Cartesian reports."""

from __future__ import annotations

from dataclasses import dataclass

from boresight.models.base import AT_ORIGIN, KernelSensor, SensorPose, describe
from boresight.types.enums import Component
from boresight.types.sensor import FloatArray


@dataclass(frozen=True, eq=False)
class Position(KernelSensor):
    """A sensor that measures position (m) in its own east/north/up-like axes: lidar clusters, GNSS reports.

    `sigma` holds for every axis; `covariance` (`dimensions`, `dimensions`) replaces it where the noise is correlated.
    In 2-D it measures east and north. Raises UserError.
    """

    sigma: float
    pose: SensorPose = AT_ORIGIN
    dimensions: int = 3
    covariance: FloatArray | None = None

    def __post_init__(self) -> None:
        axes = (Component.EAST, Component.NORTH, Component.UP)[: self.dimensions]
        sigmas: dict[Component, float | None] = dict.fromkeys(axes, self.sigma)
        describe(self, sigmas, self.covariance, self.dimensions)
