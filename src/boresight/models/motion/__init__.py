"""How targets move."""

from boresight.models.motion.base import KernelMotion
from boresight.models.motion.cv import NearlyConstantAcceleration, NearlyConstantJerk, NearlyConstantVelocity
from boresight.models.motion.singer import Singer
from boresight.models.motion.turn import CoordinatedTurn, KnownTurn

__all__ = [
    "CoordinatedTurn",
    "KernelMotion",
    "KnownTurn",
    "NearlyConstantAcceleration",
    "NearlyConstantJerk",
    "NearlyConstantVelocity",
    "Singer",
]
