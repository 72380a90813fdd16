"""One run of a study: simulate, track, score, and bound. The same row for the same task, wherever it is run."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from boresight.engine.track import run
from boresight.frames.pose import pose_track
from boresight.io.scans import iter_scans
from boresight.metrics.score import CUT_OFF, score
from boresight.models.motion import NearlyConstantVelocity
from boresight.sim.actors import Drawn
from boresight.sim.scenario import Scenario, simulate
from boresight.study.bound import bound_at
from boresight.study.plan import Task, build
from boresight.tracking.config import TrackerConfig
from boresight.tracking.run import track_rows, tracker_for
from boresight.types import FloatArray, Recording

DEFAULTS = {2: (0.1, 8.0), 3: (1.0, 150.0)}  # q (m²/s³), speed (m/s), where the tracker's configuration says nothing
SCORES = ("gospa_rms_m", "tracked_fraction", "position_rmse_m", "nees_mean", "identity_switches", "breaks")


def one_run(task: Task) -> dict[str, Any]:
    """Return one row of the study's runs: figures of the score, and the sums that cells are made of."""
    scenario, config = build(json.loads(task.scenario), json.loads(task.tracker), task.seed, "study")
    recording = simulate(scenario, np.random.default_rng(task.seed))
    _, rows, _ = run(tracker_for(recording, config), iter_scans(recording))
    scored = score(recording, track_rows(rows), cut_off=CUT_OFF)
    table = next(r for r in scored.rows if r["item"] == "tracks")
    squared = np.array([v for t in scored.targets for v in t.squared_error])
    times = [np.array(t.times) for t in scored.targets]
    bound = np.concatenate([_bounds(scenario, recording, config, i, t) for i, t in enumerate(times)])
    return {
        "cell": task.cell,
        "run": task.run,
        "seed": task.seed,
        **{key: table[key] for key in SCORES},
        "false_track_s": table["false_track_s"],
        "bound_rmse_m": float(np.sqrt(bound.mean())) if len(bound) else None,
        "samples": len(squared),
        "squared_error_m2": float(squared.sum()),
        "bound_m2": float(bound.sum()),
        "nees_sum": float(sum(v for t in scored.targets for v in t.nees)),
    }


def _bounds(scenario: Scenario, recording: Recording, config: TrackerConfig, i: int, clock: FloatArray) -> FloatArray:
    """The bound of target i at the times at which it was held.

    With the target's own motion where that is nearly constant velocity, so that the bound does not depend on how the
    tracker is set; else with the tracker's process noise.
    """
    if not len(clock):
        return np.zeros(0)
    q, speed = DEFAULTS[scenario.dimensions]
    q = q if config.q is None else config.q
    target = next(t for t in scenario.targets if t.id == recording.truth[i].target)
    if isinstance(target.path, Drawn) and isinstance(target.path.motion, NearlyConstantVelocity):
        q = target.path.motion.q
    poses = {p.id: pose_track(p, recording.site) for p in recording.platforms}
    speed = speed if config.speed_sigma is None else config.speed_sigma
    return bound_at(scenario, recording.truth[i], poses, clock, q, speed)
