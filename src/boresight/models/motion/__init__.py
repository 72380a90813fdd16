"""How targets move."""

from boresight.models.motion.base import KernelMotion
from boresight.models.motion.cv import NearlyConstantAcceleration, NearlyConstantVelocity

__all__ = ["KernelMotion", "NearlyConstantAcceleration", "NearlyConstantVelocity"]
