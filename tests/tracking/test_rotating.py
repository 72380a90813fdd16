"""A slowly turning radar beside fast sensors: its looks arrive long after their middle, and are used."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from boresight.config.scenario import read_scenario
from boresight.engine.track import run
from boresight.io.scans import iter_scans
from boresight.sim.scenario import simulate
from boresight.tracking.config import TrackerConfig
from boresight.tracking.run import decision_rows, tracker_for
from boresight.types import FATES, Fate

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
