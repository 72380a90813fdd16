"""The real recordings: one parameter set, no truth before scoring; floors that a change must not fall through."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from benchmarks.scoreboard import DATA, SCENARIOS, configuration, recordings

from boresight.engine.track import run
from boresight.io.scans import iter_scans
from boresight.metrics.score import Score, score
from boresight.tracking.run import track_rows, tracker_for
from boresight.types import Recording

pytestmark = pytest.mark.skipif(
    not Path(DATA).is_dir(), reason="the Autoferry recordings are not beside the repository"
)


@pytest.fixture(scope="module")
def data() -> dict[int, Recording]:
    return recordings(DATA)


def scores_of(data: dict[int, Recording], sensors: list[str]) -> list[Score]:
    config = configuration(data[SCENARIOS[0]])
    out = []
    for recording in data.values():
        tracker = tracker_for(recording, config, sensors)
        _, rows, _ = run(tracker, iter_scans(recording, sensors))
        out.append(score(recording, track_rows(rows), None, sensors))
    return out


@pytest.mark.parametrize(
    ("sensors", "gospa", "tracked", "false_s"),
    [
        (["radar"], 12.0, 0.81, 90),
        (["radar", "ir"], 12.0, 0.80, 80),
        (["radar", "lidar", "ir", "eo"], 11.3, 0.83, 90),
    ],
    ids=str,
)
def test_pooled_scores(
    data: dict[int, Recording], sensors: list[str], gospa: float, tracked: float, false_s: float
) -> None:
    scores = scores_of(data, sensors)
    assert np.sqrt(np.concatenate([s.gospa[:, 0] ** 2 for s in scores]).mean()) <= gospa
    targets = [t for s in scores for t in s.targets]
    assert sum(t.held for t in targets) / sum(t.present for t in targets) >= tracked
    assert sum(s.rows[0]["false_track_s"] for s in scores) <= false_s
    nees = np.concatenate([t.nees for t in targets])
    assert 0.7 <= np.median(nees) <= 2.0  # chi-square with 2 degrees of freedom has median 1.39
    for s in scores:  # two targets, nobody reported: 20 m at every time
        assert s.rows[1]["gospa_rms_m"] == pytest.approx(20.0, abs=1e-12)


def test_bearings_alone_begin_no_tracks(data: dict[int, Recording]) -> None:
    assert all(s.rows[0]["tracked_fraction"] == 0.0 for s in scores_of(data, ["ir"]))
