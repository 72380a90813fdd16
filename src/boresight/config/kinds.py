"""The only table from a `kind` in a file to the class that does it."""

from __future__ import annotations

from boresight.errors import UserError, did_you_mean
from boresight.io.toml import TableModel
from boresight.models.motion import KernelMotion, NearlyConstantAcceleration, NearlyConstantVelocity


class MotionTable(TableModel, frozen=True):
    """The parameters of one kind of motion."""

    def build(self, dimensions: int) -> KernelMotion:
        """Return the motion model."""
        raise NotImplementedError


class NearlyConstantVelocityTable(MotionTable, frozen=True):
    """White acceleration."""

    q_m2_s3: float = 1e-12

    def build(self, dimensions: int) -> KernelMotion:
        """Return the motion model."""
        return NearlyConstantVelocity(self.q_m2_s3, dimensions)


class NearlyConstantAccelerationTable(MotionTable, frozen=True):
    """White jerk."""

    q_m2_s5: float

    def build(self, dimensions: int) -> KernelMotion:
        """Return the motion model."""
        return NearlyConstantAcceleration(self.q_m2_s5, dimensions)


MOTIONS: dict[str, type[MotionTable]] = {
    "nearly_constant_velocity": NearlyConstantVelocityTable,
    "nearly_constant_acceleration": NearlyConstantAccelerationTable,
}
WAYPOINTS = "waypoints"


def check_kind(kind: object, known: list[str], where: str) -> str:
    """Return `kind` when it is known; raises UserError with the nearest known one."""
    if not isinstance(kind, str) or kind not in known:
        near = did_you_mean(kind, known) if isinstance(kind, str) else ""
        raise UserError(f"{where}: kind = {kind!r} is not known{near}; give one of {', '.join(known)}")
    return kind
