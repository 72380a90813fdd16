"""How targets move and what sensors see of them."""

from boresight.models.base import KernelSensor, SensorPose
from boresight.models.infrared import Infrared
from boresight.models.motion import KernelMotion, NearlyConstantAcceleration, NearlyConstantVelocity
from boresight.models.position import Position
from boresight.models.protocols import MeasurementModel, MotionModel
from boresight.models.radar import Radar

__all__ = [
    "Infrared",
    "KernelMotion",
    "KernelSensor",
    "MeasurementModel",
    "MotionModel",
    "NearlyConstantAcceleration",
    "NearlyConstantVelocity",
    "Position",
    "Radar",
    "SensorPose",
]
