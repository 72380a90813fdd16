"""How targets move and what sensors see of them."""

from boresight.models.base import KernelSensor, SensorPose
from boresight.models.infrared import Infrared
from boresight.models.motion import (
    CoordinatedTurn,
    KernelMotion,
    KnownTurn,
    NearlyConstantAcceleration,
    NearlyConstantJerk,
    NearlyConstantVelocity,
    Singer,
)
from boresight.models.position import Position
from boresight.models.protocols import MeasurementModel, MotionModel
from boresight.models.radar import Radar

__all__ = [
    "CoordinatedTurn",
    "Infrared",
    "KernelMotion",
    "KernelSensor",
    "KnownTurn",
    "MeasurementModel",
    "MotionModel",
    "NearlyConstantAcceleration",
    "NearlyConstantJerk",
    "NearlyConstantVelocity",
    "Position",
    "Radar",
    "SensorPose",
    "Singer",
]
