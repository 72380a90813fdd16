"""Who moves: targets (by a motion model or through waypoints) and platforms with their attitude."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from boresight.errors import UserError
from boresight.kernels import simulate as kernel
from boresight.models.motion import KernelMotion
from boresight.sim.paths import Straight, Trajectory, Waypoints
from boresight.types import FloatArray, PlatformTrack


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """A path drawn from a motion model: `x0` is its state at birth (position, velocity, the rest)."""

    motion: KernelMotion
    x0: FloatArray

    def at(self, t: FloatArray, rng: np.random.Generator) -> Trajectory:
        """Return one draw at times `t` (s), the first of which is the birth."""
        n, d = self.motion.state_dimension, self.motion.dimensions
        out = np.empty((len(t), n))
        kernel.walk(self.motion.kernel, self.motion.parameters, self.x0, t, rng.standard_normal((len(t), n)), out)
        position, velocity = np.zeros((len(t), 3)), np.zeros((len(t), 3))
        position[:, :d], velocity[:, :d] = out[:, :d], out[:, d : 2 * d]
        return Trajectory(t, position, velocity)


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """A target with its lifetime (s). Raises UserError when it dies before it is born."""

    id: str
    path: Drawn | Waypoints
    birth: float = 0.0
    death: float = math.inf

    def __post_init__(self) -> None:
        if not self.birth < self.death:
            raise UserError(f"target '{self.id}': death ({self.death} s) must come after birth ({self.birth} s)")

    def trajectory(self, end: float, step: float, rng: np.random.Generator) -> Trajectory:
        """Return the path from birth to death or `end` on a clock of about `step` (s)."""
        t = fine_clock(self.birth, min(self.death, end), step)
        return self.path.at(t, rng) if isinstance(self.path, Drawn) else self.path.at(t)


def fine_clock(start: float, end: float, step: float) -> FloatArray:
    """Return times from start to end, both in, spaced evenly by at most `step`."""
    return np.linspace(start, end, max(math.ceil((end - start) / step - 1e-9), 1) + 1)


@dataclass(frozen=True, slots=True)
class Attitude:
    """How a platform is turned (rad): `yaw` None follows its course; each angle sways by amplitude and period (s)."""

    yaw: float | None = None
    pitch: float = 0.0
    roll: float = 0.0
    sway: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of yaw, pitch, roll
    sway_period: tuple[float, float, float] = (10.0, 10.0, 10.0)  # s

    def at(self, path: Trajectory) -> FloatArray:
        """Return yaw, pitch, roll (k, 3) along a path."""
        yaw = np.full(len(path.t), self.yaw)
        if self.yaw is None:
            yaw = np.unwrap(np.arctan2(path.velocity[:, 0], path.velocity[:, 1]))
        steady = np.stack([yaw, np.full_like(yaw, self.pitch), np.full_like(yaw, self.roll)], axis=1)
        phase = 2.0 * math.pi * path.t[:, None] / np.array(self.sway_period)
        out: FloatArray = steady + np.array(self.sway) * np.sin(phase)
        return out


@dataclass(frozen=True, slots=True)
class Navigation:
    """What is recorded of a platform: rate (Hz) and white errors (m per axis, rad per angle); 0 is exact."""

    rate: float = 10.0
    sigma_position: float = 0.0
    sigma_attitude: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Platform:
    """A platform that carries sensors."""

    id: str
    path: Waypoints | Straight
    attitude: Attitude = field(default_factory=Attitude)
    navigation: Navigation = field(default_factory=Navigation)

    def true_track(self, start: float, end: float, step: float) -> PlatformTrack:
        """Return the true path and attitude on a fine clock."""
        return _track(self.id, self.path.at(fine_clock(start, end, step)), self.attitude)

    def recorded_track(self, start: float, end: float, rng: np.random.Generator) -> PlatformTrack:
        """Return the navigation data: stamped samples with their errors."""
        path = self.path.at(
            start + np.arange(math.floor((end - start) * self.navigation.rate) + 1) / self.navigation.rate
        )
        exact = _track(self.id, path, self.attitude)
        n, nav = len(path.t), self.navigation
        return PlatformTrack(
            self.id,
            path.t,
            exact.position + nav.sigma_position * rng.standard_normal((n, 3)),
            exact.velocity,
            exact.ypr + nav.sigma_attitude * rng.standard_normal((n, 3)),
            np.full(n, nav.sigma_position or np.nan),
            np.full(n, nav.sigma_attitude or np.nan),
        )


def _track(name: str, path: Trajectory, attitude: Attitude) -> PlatformTrack:
    unknown = np.full(len(path.t), np.nan)
    return PlatformTrack(name, path.t, path.position, path.velocity, attitude.at(path), unknown, unknown)
