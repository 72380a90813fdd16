"""The tracker called with what it cannot take: one line of error, and the state as it was."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.io.scans import iter_scans
from boresight.tracking.config import SensorErrors, TrackerConfig
from boresight.tracking.run import tracker_for
from boresight.tracking.saved import arrays_of_state
from boresight.tracking.tracker import Tracker
from boresight.types import Recording, Scan


def _one_line(call: Callable[[], Any]) -> None:
    with pytest.raises(UserError) as told:
        call()
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("dimensions", [1, 4, 0, -2, 2.0, "3", None, True])
def test_dimensions(harbour: Recording, dimensions: Any) -> None:
    _one_line(lambda: Tracker(TrackerConfig(), harbour.sensors, dimensions))


def test_sensors(harbour: Recording) -> None:
    radar = harbour.sensors[0]
    for change in (
        {"sigma": radar.sigma[:3]},
        {"sigma": radar.sigma.tolist()},
        {"sigma": -radar.sigma},
        {"sigma": 0.0 * radar.sigma},
        {"latency": np.nan},
        {"period": -1.0},
        {"p_detection": 1.5},
        {"p_detection": np.nan},
        {"clutter_per_scan": -1.0},
    ):
        bad = dataclasses.replace(radar, **change)  # type: ignore[arg-type]
        _one_line(lambda bad=bad: Tracker(TrackerConfig(), (bad,), 2))  # type: ignore[misc]
    listed: Any = list(harbour.sensors)
    _one_line(lambda: Tracker(TrackerConfig(), listed, 2))
    _one_line(lambda: Tracker(TrackerConfig(), (radar, radar), 2))
    for use in ((0, 0), (2,), (-1,), (0.5,)):
        wrong: Any = use
        _one_line(lambda wrong=wrong: Tracker(TrackerConfig(), harbour.sensors, 2, use=wrong))  # type: ignore[misc]
    _one_line(lambda: Tracker(TrackerConfig(), harbour.sensors, 2, site_height=np.nan))


def _wrong(scan: Scan) -> list[dict[str, Any]]:
    n = len(scan.t)
    askew = np.tile(np.eye(7), (n, 1, 1))
    askew[:, 0, 1] = 0.5
    much = np.tile(np.eye(7), (n, 1, 1))
    much[:, 0, 1] = much[:, 1, 0] = 2.0
    infinite, behind = scan.z.copy(), scan.z.copy()
    infinite[0, 1], behind[0, 0] = np.inf, -50.0
    return [
        {"sensor": 2},
        {"sensor": -1},
        {"sensor": "radar"},
        {"t_look": np.nan},
        {"t_look": 1e300},
        {"t_recv": np.inf},
        {"t_recv": -100.0},
        {"t_recv": None},
        {"t": scan.t.tolist()},
        {"t": scan.t[:-1]},
        {"t": scan.t * np.nan},
        {"z": scan.z[:, :6]},
        {"z": scan.z[:-1]},
        {"z": scan.z.tolist()},
        {"z": scan.z.astype(str)},
        {"z": infinite},
        {"z": behind},
        {"row": scan.row.astype(float)},
        {"row": scan.row[:-1]},
        {"address": np.zeros(n + 1, np.int64)},
        {"covariance": -scan.covariance},
        {"covariance": 0.0 * scan.covariance},
        {"covariance": np.full((n, 7, 7), np.nan)},
        {"covariance": np.full((n, 7, 7), np.inf)},
        {"covariance": scan.covariance[:, :6, :6]},
        {"covariance": askew},
        {"covariance": much},
    ]


def test_looks(harbour: Recording) -> None:
    tracker = tracker_for(harbour, TrackerConfig())
    scans = list(iter_scans(harbour))
    k = next(i for i, s in enumerate(scans) if i > 50 and s.sensor == 0 and len(s.t) > 1)
    state, _ = tracker.steps(tracker.init(), scans[:k])
    before = arrays_of_state(state)
    for change in _wrong(scans[k]):
        bad = dataclasses.replace(scans[k], **change)
        _one_line(lambda bad=bad: tracker.step(state, bad))  # type: ignore[misc]
        _one_line(lambda bad=bad: tracker.steps(state, [*scans[k : k + 1], bad]))  # type: ignore[misc]
    other: Any = None
    _one_line(lambda: tracker.step(other, scans[k]))
    _one_line(lambda: tracker.step(state, other))
    _one_line(lambda: tracker.tick(state, np.nan))
    wandering = tracker_for(harbour, TrackerConfig(sensors={"radar": SensorErrors(bias_azimuth=0.01)}))
    _one_line(lambda: wandering.step(state, scans[k]))
    for name, array in arrays_of_state(state).items():
        np.testing.assert_array_equal(array, before[name])
    tracker.step(state, scans[k])
