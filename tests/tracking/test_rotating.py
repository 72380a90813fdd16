"""A slowly turning radar beside fast sensors: its looks arrive long after their middle, and are used."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from boresight.config.scenario import read_scenario
from boresight.engine.track import run
from boresight.io.scans import iter_scans
from boresight.kernels.tracker import STATIC
from boresight.sim.scenario import simulate
from boresight.tracking.config import TrackerConfig
from boresight.tracking.run import decision_rows, tracker_for
from boresight.tracking.tracker import Tracker
from boresight.types import FATES, Fate, Scan, Sensor, SensorKind

EXAMPLE = Path(__file__).parents[2] / "examples" / "aircraft.toml"


def test_looks_of_a_slow_turn_are_not_late() -> None:
    scenario, seed = read_scenario(EXAMPLE)
    recording = simulate(scenario, np.random.default_rng(seed))
    tracker = tracker_for(recording, TrackerConfig())
    state, _, decisions = run(tracker, list(iter_scans(recording)))
    fate = decision_rows(recording, tracker, decisions, state.names).fate
    assert not (fate == FATES.index(Fate.LATE)).any()
    radar = recording.detections.sensor == 0
    used = np.isin(fate, [FATES.index(Fate.UPDATED), FATES.index(Fate.INITIATED)])
    assert used[radar].mean() > 0.9


def test_a_fast_target_seen_at_its_own_time_is_not_taken_for_one_that_stands() -> None:
    """A radar that turns in four seconds sees it up to two seconds before or after the look's own time: 400 m."""
    sigma = np.full(7, np.nan)
    sigma[4:6] = 10.0
    used = Tracker(TrackerConfig(q=1.0, speed_sigma=150.0), (Sensor("radar", SensorKind.RADAR, sigma=sigma),), 2)
    rng, state = np.random.default_rng(3), used.init()
    for k in range(20):
        t = 4.0 * k + 2.0 * np.sin(k)  # of the detection; the look is of the middle of the turn
        z, R = np.full((1, 7), np.nan), np.full((1, 7, 7), np.nan)
        z[0, 4:6] = np.array([200.0 * t, 5000.0]) + rng.normal(0.0, 10.0, 2)
        R[0, 4:6, 4:6] = 100.0 * np.eye(2)
        look = 4.0 * k + 2.0
        state, _ = used.step(state, Scan(0, 4.0 * k, look, np.array([t]), z, R, np.array([k])))
        tr = state.window.tracks
        if k >= 3:
            assert tr.live[0] == 1
            assert tr.weight[0, STATIC] < 0.05
