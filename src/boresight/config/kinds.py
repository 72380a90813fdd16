"""The only table from a `kind` in a file to the class that does it."""

from __future__ import annotations

import math

from boresight.errors import UserError, did_you_mean
from boresight.io.toml import TableModel
from boresight.models.motion import (
    CoordinatedTurn,
    KernelMotion,
    KnownTurn,
    NearlyConstantAcceleration,
    NearlyConstantJerk,
    NearlyConstantVelocity,
    Singer,
)


class MotionTable(TableModel, frozen=True):
    """The parameters of one kind of motion."""

    def build(self, dimensions: int) -> KernelMotion:
        """Return the motion model."""
        raise NotImplementedError

    def rest(self, dimensions: int) -> list[float]:
        """Return the components of the first state after position and velocity (none: zeros)."""
        return []


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


class NearlyConstantJerkTable(MotionTable, frozen=True):
    """White snap."""

    q_m2_s7: float

    def build(self, dimensions: int) -> KernelMotion:
        """Return the motion model."""
        return NearlyConstantJerk(self.q_m2_s7, dimensions)


class SingerTable(MotionTable, frozen=True):
    """Acceleration with a memory."""

    tau_s: float
    sigma_m_s2: float

    def build(self, dimensions: int) -> KernelMotion:
        """Return the motion model."""
        return Singer(self.tau_s, self.sigma_m_s2, dimensions)


class KnownTurnTable(MotionTable, frozen=True):
    """A turn of constant rate, positive to the right (clockwise, as azimuth)."""

    turn_rate_deg_s: float
    q_m2_s3: float = 1e-12

    def build(self, dimensions: int) -> KernelMotion:
        """Return the motion model."""
        return KnownTurn(-math.radians(self.turn_rate_deg_s), self.q_m2_s3, dimensions)


class CoordinatedTurnTable(MotionTable, frozen=True):
    """A turn whose rate wanders: `q_rate_deg2_s3` is the spectral density of its white derivative."""

    turn_rate_deg_s: float = 0.0
    q_m2_s3: float = 1e-12
    q_rate_deg2_s3: float = 1.0

    def build(self, dimensions: int) -> KernelMotion:
        """Return the motion model."""
        return CoordinatedTurn(self.q_m2_s3, math.radians(1.0) ** 2 * self.q_rate_deg2_s3, dimensions)

    def rest(self, dimensions: int) -> list[float]:
        """Return the first turn rate."""
        return [-math.radians(self.turn_rate_deg_s)]


MOTIONS: dict[str, type[MotionTable]] = {
    "nearly_constant_velocity": NearlyConstantVelocityTable,
    "nearly_constant_acceleration": NearlyConstantAccelerationTable,
    "nearly_constant_jerk": NearlyConstantJerkTable,
    "singer": SingerTable,
    "known_turn": KnownTurnTable,
    "coordinated_turn": CoordinatedTurnTable,
}
WAYPOINTS = "waypoints"


def check_kind(kind: object, known: list[str], where: str) -> str:
    """Return `kind` when it is known; raises UserError with the nearest known one."""
    if not isinstance(kind, str) or kind not in known:
        near = did_you_mean(kind, known) if isinstance(kind, str) else ""
        raise UserError(f"{where}: kind = {kind!r} is not known{near}; give one of {', '.join(known)}")
    return kind
