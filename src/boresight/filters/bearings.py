"""Initiation from directions alone: a track is begun where own-ship motion tells range, and none where it does not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from boresight.filters.msc import MscFilter, MscState, to_cartesian
from boresight.models import check
from boresight.models.protocols import MeasurementModel, MotionModel
from boresight.types.sensor import FloatArray
from boresight.types.state import GaussianState

MSC = MscFilter()


@dataclass(frozen=True, slots=True)
class BearingsOnly:
    """What is believed of a target before anything but its direction is known.

    Range is lognormal with mean `range_m` and `sigma_log_range`, velocity zero within `sigma_velocity` (m/s) per axis.
    The MSC filter holds the belief; a Cartesian track comes out once the range is known to a tenth. In straight flight
    past a target that may itself move that never happens. Raises UserError for values that are not positive.
    """

    range_m: float = 3000.0
    sigma_log_range: float = 0.8
    sigma_velocity: float = 50.0

    def __post_init__(self) -> None:
        check.positive("range_m", self.range_m)
        check.positive("sigma_log_range", self.sigma_log_range)
        check.positive("sigma_velocity", self.sigma_velocity)

    def init(self, t: float, azimuth: float, elevation: float, sigma_angle: float, own: FloatArray) -> MscState:
        """Begin with one direction (rad, world axes) seen from `own` (6,), position and velocity of the own ship."""
        return MSC.from_direction(
            t, azimuth, elevation, sigma_angle, self.range_m, self.sigma_log_range, self.sigma_velocity, np.asarray(own)
        )

    def step(
        self, state: MscState, motion: MotionModel, t: float, own: FloatArray, sensor: MeasurementModel, z: FloatArray
    ) -> tuple[MscState, GaussianState | None]:
        """Take one more report at `t`; the second result is the Cartesian track once range is known, else None."""
        state, _ = MSC.update(MSC.predict(state, motion, t, own), sensor, z)
        return state, to_cartesian(state) if state.range_observable else None
