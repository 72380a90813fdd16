"""The scenarios: a target closing at 410 m/s from 5 km, 3 km below; radar at 10 Hz, infrared n times as fast.

The paper prints no noise; the sets A, P, B, C, M are ours. World ENU; the own ship flies north at 200 m/s from the
origin, so the relative state starts at (0, 4000, -3000) m and (0, -410, 0) m/s, drawn from the prior.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.filters.stream import Reports
from boresight.models import Infrared, NearlyConstantVelocity, Radar, SensorPose
from boresight.papers.montecarlo import draw_paths, polar
from boresight.types.sensor import FloatArray
from boresight.types.state import GaussianState

IndexArray = NDArray[np.int64]
MaskArray = NDArray[np.bool_]

RADAR_RATE = 10  # Hz
DURATION = 7.0  # s
SCORED = (3.0, 6.0)  # s
RELATIVE = np.array([0.0, 4000.0, -3000.0, 0.0, -410.0, 0.0])
OWN = np.array([0.0, 0.0, 0.0, 0.0, 200.0, 0.0])


@dataclass(frozen=True)
class Setup:
    """One set: noise in rad and m, infrared rate in Hz, process noise in m²/s³, prior velocity sigma in m/s."""

    radar_angle: float
    radar_range: float
    infrared: float
    infrared_rate: int
    q: float
    prior_velocity: float = 50.0

    @property
    def motion(self) -> NearlyConstantVelocity:
        """The target's motion."""
        return NearlyConstantVelocity(self.q)

    @property
    def radar(self) -> Radar:
        """The radar, not yet placed."""
        return Radar(self.radar_range, self.radar_angle, self.radar_angle)

    @property
    def ir(self) -> Infrared:
        """The infrared sensor, not yet placed."""
        return Infrared(self.infrared, self.infrared)

    @property
    def samples(self) -> int:
        """Infrared samples per radar period."""
        return self.infrared_rate // RADAR_RATE

    @property
    def prior(self) -> GaussianState:
        """The prior at time 0: range sigma along the line of sight, angle sigma times range across."""
        u = RELATIVE[:3] / np.linalg.norm(RELATIVE[:3])
        across = (self.radar_angle * np.linalg.norm(RELATIVE[:3])) ** 2
        P = np.zeros((6, 6))
        P[:3, :3] = across * np.eye(3) + (self.radar_range**2 - across) * np.outer(u, u)
        P[3:, 3:] = self.prior_velocity**2 * np.eye(3)
        return GaussianState(0.0, RELATIVE + OWN, P)


SETS = {
    "A": Setup(5e-3, 20.0, 0.5e-3, 50, 1.0),
    "P": Setup(10e-3, 50.0, 0.6e-3, 50, 1.0),
    "B": Setup(10e-3, 50.0, 1.0e-3, 50, 1.0),
    "C": Setup(3e-3, 10.0, 0.5e-3, 100, 1.0),
    "M": Setup(5e-3, 20.0, 0.5e-3, 50, 100.0),
}


def own_ship(t: FloatArray) -> FloatArray:
    """Return position and velocity (k, 6) of the own ship in straight flight."""
    t = np.asarray(t, dtype=float)
    out = np.tile(OWN, (*t.shape, 1))
    out[..., :3] += t[..., None] * OWN[3:]
    return out


def pose(own: FloatArray) -> SensorPose:
    """Return the pose of a north-aligned sensor on the own ship."""
    return SensorPose(own[:3], own[3:], np.eye(3))


class Data(NamedTuple):
    """Truth and reports of all runs."""

    start: FloatArray  # (runs, 6) true state at time 0
    t: FloatArray  # (k,) report times; at a common time infrared first
    is_radar: MaskArray  # (k,)
    truth: FloatArray  # (runs, k, 6) world ENU
    own: FloatArray  # (k, 6)
    z: FloatArray  # (runs, k, 7)
    context: FloatArray  # (k, c)
    window: tuple[float, float] = SCORED  # s

    def scored(self) -> IndexArray:
        """Return the indices of the reports at whose time figures are taken: the radar's, within the window."""
        inside = (self.t > self.window[0] - 1e-9) & (self.t < self.window[1] + 1e-9)
        return np.flatnonzero(inside & self.is_radar)

    def reports(self, run: int, only: MaskArray | None = None) -> Reports:
        """Return the reports of one run, or those that `only` (k,) selects."""
        at = np.ones(len(self.t), bool) if only is None else only
        return Reports(self.t[at], self.z[run][at], self.context[at], Radar.kernel)


def simulate(setup: Setup, runs: int, rng: np.random.Generator) -> Data:
    """Draw truth from the prior and the motion model, and every report."""
    step = np.arange(1, round(DURATION * setup.infrared_rate) + 1)
    ticks = [(k, radar) for k in step for radar in (False, True) if not radar or k % setup.samples == 0]
    t = np.array([k / setup.infrared_rate for k, _ in ticks])
    is_radar = np.array([radar for _, radar in ticks])
    start, truth = draw_paths(setup.motion, setup.prior.x, setup.prior.P, t, runs, rng)
    own = own_ship(t)
    sigma = np.array([setup.radar_range, setup.radar_angle, setup.radar_angle])
    seen = polar(truth - own)
    noise = rng.normal(size=seen.shape)
    z = np.full((*seen.shape[:2], 7), np.nan)
    z[:, is_radar, :3] = seen[:, is_radar] + sigma * noise[:, is_radar]
    z[:, ~is_radar, 1:3] = seen[:, ~is_radar, 1:] + setup.infrared * noise[:, ~is_radar, 1:]
    context = np.array([(setup.radar if r else setup.ir).at(pose(o)).context for r, o in zip(is_radar, own)])
    return Data(start, t, is_radar, truth, own, z, context)
