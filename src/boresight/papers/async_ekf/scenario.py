"""Scenarios S0 (truth drawn from the filter's own model) and S2 (the paper's sinusoidal path).

The paper's x axis is our north and its y our east, so that its azimuth atan2(y, x) is ours. Radar 10 Hz, 1 m and 0.2°;
infrared 20 Hz, 0.1°, 25 ms out of phase. Both sit at the origin.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.filters.stream import Reports
from boresight.models import Infrared, NearlyConstantVelocity, Radar
from boresight.papers.montecarlo import draw_paths, polar
from boresight.types.sensor import FloatArray
from boresight.types.state import GaussianState

START = np.array([120.0, 400.0, 40.0, 0.0, 20.0, 0.0])
PRIOR = np.diag([25.0, 25.0, 25.0, 9.0, 9.0, 9.0])
RADAR = Radar(1.0, radians(0.2), radians(0.2))
IR = Infrared(radians(0.1), radians(0.1))
IR_PHASE = 0.025  # s
Q = 0.4  # m²/s³, of the tuned constant-velocity filter
Q_ACCELERATION = 0.01  # m²/s⁵


@dataclass(frozen=True)
class Scenario:
    """How long it lasts and from when it is scored (s), and whether the truth is drawn or the paper's path."""

    name: str
    duration: float
    scored_from: float
    drawn: bool


SCENARIOS = {"S0": Scenario("S0", 40.0, 10.0, True), "S2": Scenario("S2", 60.0, 10.0, False)}


class Data(NamedTuple):
    """Truth and reports of all runs; the filters begin at a draw from the prior about the true start."""

    t: FloatArray  # (k,)
    is_radar: NDArray[np.bool_]  # (k,)
    truth: FloatArray  # (runs, k, 6)
    start: FloatArray  # (runs, 6)
    prior: FloatArray  # (runs, 6) means that the filters begin with
    z: FloatArray  # (runs, k, 7)
    context: FloatArray  # (k, c)
    at: NDArray[np.int64]  # (e,) scored: the radar's reports from `scored_from` on

    def reports(self, run: int, only: NDArray[np.bool_] | None = None) -> Reports:
        """Return the reports of one run, or those that `only` (k,) selects."""
        at = np.ones(len(self.t), bool) if only is None else only
        return Reports(self.t[at], self.z[run][at], self.context[at], Radar.kernel)

    def state(self, run: int) -> GaussianState:
        """Return the prior of one run."""
        return GaussianState(0.0, self.prior[run], PRIOR.copy())


def sinusoid(t: FloatArray) -> FloatArray:
    """Return the paper's path (k, 6): 20 m/s along its x axis, y = 100 (1 - cos 0.1 t)."""
    out = np.tile(START, (len(t), 1))
    out[:, 0] += 100.0 * (1.0 - np.cos(0.1 * t))
    out[:, 1] += 20.0 * t
    out[:, 3] = 10.0 * np.sin(0.1 * t)
    return out


def simulate(scenario: Scenario, runs: int, rng: np.random.Generator) -> Data:
    """Draw truth and every report."""
    radar_times = np.arange(1, round(10 * scenario.duration) + 1) / 10.0
    ir_times = np.arange(round(20 * scenario.duration)) / 20.0 + IR_PHASE
    t = np.r_[radar_times, ir_times]
    order = np.argsort(t, kind="stable")
    t, is_radar = t[order], (np.arange(len(t)) < len(radar_times))[order]
    if scenario.drawn:
        start, truth = draw_paths(NearlyConstantVelocity(Q), START, 1e-18 * np.eye(6), t, runs, rng)
    else:
        start, truth = np.tile(START, (runs, 1)), np.tile(sinusoid(t), (runs, 1, 1))
    seen = polar(truth)
    noise = rng.normal(size=seen.shape)
    z = np.full((runs, len(t), 7), np.nan)
    z[:, is_radar, :3] = seen[:, is_radar] + noise[:, is_radar] * [RADAR.sigma_range, radians(0.2), radians(0.2)]
    z[:, ~is_radar, 1:3] = seen[:, ~is_radar, 1:] + noise[:, ~is_radar, 1:] * radians(0.1)
    context = np.array([RADAR.context if r else IR.context for r in is_radar])
    prior = start + rng.normal(size=(runs, 6)) * np.sqrt(np.diag(PRIOR))
    at = np.flatnonzero(is_radar & (t > scenario.scored_from - 1e-9))
    return Data(t, is_radar, truth, start, prior, z, context, at)
