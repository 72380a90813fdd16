"""Rows of three simulated recordings, and the layout of the saved state, as they were: moves must not move them.

The sums below change when the tracker is meant to change. `python -m tests.tracking.test_frozen` writes them anew.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from boresight.config.scenario import read_scenario
from boresight.engine.track import run
from boresight.io.scans import iter_scans
from boresight.sim.scenario import simulate
from boresight.tracking.config import TrackerConfig
from boresight.tracking.run import decision_rows, track_rows, tracker_for
from boresight.tracking.saved import arrays_of_state
from boresight.types import FATES, Recording
from tests.tracking.conftest import make_recording

KEPT = Path(__file__).with_name("frozen.json")
EXAMPLES = Path(__file__).parents[2] / "examples"
NAMES = ("harbour", "aircraft", "crowded")


def recording(name: str) -> Recording:
    if name == "harbour":
        return make_recording()
    scenario, seed = read_scenario(EXAMPLES / f"{name}.toml")
    return simulate(scenario, np.random.default_rng(seed))


def digest(name: str) -> dict[str, Any]:
    """Counts, and for each column a sum with weights that no two rows share."""
    made = recording(name)
    tracker = tracker_for(made, TrackerConfig())
    state, rows, decisions = run(tracker, iter_scans(made))
    table = track_rows(rows)
    fates = decision_rows(made, tracker, decisions, state.names)
    weights = np.sin(1.0 + np.arange(len(table)))
    columns = {"t": table.t - made.detections.t.min(), "t_known": table.t_known - made.detections.t.min()}
    columns |= {f"position{i}": table.position[:, i] for i in range(made.dimensions)}
    columns |= {f"velocity{i}": table.velocity[:, i] for i in range(made.dimensions)}
    columns |= {f"covariance{i}": table.covariance[:, i, i] for i in range(made.dimensions)}
    counted = {str(FATES[k]): int((fates.fate == k).sum()) for k in np.unique(fates.fate)}
    saved = arrays_of_state(state)
    return {
        "rows": len(table),
        "tracks": state.names.given,
        "statuses": np.bincount(table.status, minlength=3).tolist(),
        "ids": int((table.track_id * (1 + np.arange(len(table)) % 97)).sum()),
        "fates": counted,
        "sums": {key: [float(weights @ values), float(np.abs(values).sum())] for key, values in columns.items()},
        "format": int(saved["format"][0]),
        "state": {key: [str(a.dtype), a.ndim] for key, a in sorted(saved.items())},
    }


@pytest.mark.parametrize("name", NAMES)
def test_rows_and_saved_states_are_as_they_were(name: str) -> None:
    kept, now = json.loads(KEPT.read_text(encoding="utf-8"))[name], digest(name)
    sums, found = kept.pop("sums"), now.pop("sums")
    assert now == kept
    assert found.keys() == sums.keys()
    for key, (weighted, size) in sums.items():
        assert abs(found[key][0] - weighted) <= 1e-9 * size, key


if __name__ == "__main__":
    KEPT.write_text(json.dumps({name: digest(name) for name in NAMES}, indent=1) + "\n", encoding="utf-8")
