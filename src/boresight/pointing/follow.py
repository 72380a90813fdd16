"""One track of the tracker as the guide of a pointer: its state is the prediction, nothing filters it again."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from boresight.errors import UserError
from boresight.frames.local import ecef_from_enu, ecef_from_enu_rotation
from boresight.kernels.guide_run import N_CLOCK
from boresight.pointing.guide import GuideSource, Predicted
from boresight.types import FloatArray, Site


@dataclass(slots=True)
class FollowState:
    """The track that is followed: time (s), position and velocity (6,), covariance (6, 6) in the site's ENU."""

    t: float = math.nan
    x: FloatArray = field(default_factory=lambda: np.zeros(6))
    P: FloatArray = field(default_factory=lambda: np.zeros((6, 6)))
    q: float = 0.0  # m²/s³, noise of its motion
    track: int = -1  # its number, -1: none
    scale: FloatArray = field(default_factory=lambda: np.ones(1))
    clock: FloatArray = field(default_factory=lambda: np.zeros(N_CLOCK))


@dataclass(frozen=True, slots=True)
class TrackGuide:
    """Stands where a `GuideFilter` does, for a pointer that follows a track."""

    site: Site
    sources: tuple[GuideSource, ...] = (GuideSource("track", correlation=0.0),)
    orbit: bool = False

    def init(self) -> FollowState:
        """Return the state before there is a track."""
        return FollowState()

    def step(
        self, state: FollowState, source: int, t: float, z: FloatArray, origin: FloatArray, axes: FloatArray
    ) -> int:
        """Refuse: a track is followed, and no report of its own taken."""
        raise UserError("a pointer that follows a track takes no reports")

    def surprise(
        self, state: FollowState, source: int, t: float, z: FloatArray, origin: FloatArray, axes: FloatArray
    ) -> float:
        """Refuse, as `step`."""
        raise UserError("a pointer that follows a track takes no reports")

    def predict(self, state: FollowState, t: float) -> Predicted | None:
        """Return the track at time `t` (s) in ECEF, on a straight line; None while there is none."""
        if state.track < 0:
            return None
        dt = t - state.t
        F = np.eye(6)
        F[:3, 3:] = dt * np.eye(3)
        x = F @ state.x
        P = F @ state.P @ F.T
        C = P[:3, :3] + state.q * abs(dt) ** 3 / 3.0 * np.eye(3)
        R = ecef_from_enu_rotation(self.site)
        at = np.array(ecef_from_enu(float(x[0]), float(x[1]), float(x[2]), self.site))
        return Predicted(at, R @ x[3:], R @ C @ R.T)

    def restart_now(self, state: FollowState) -> None:
        """Forget the track."""
        state.track = -1
