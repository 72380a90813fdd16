"""Looks taken many at a time, and the numbers that tracks go by."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from boresight.engine.track import run
from boresight.io.scans import iter_scans
from boresight.tracking.config import TrackerConfig
from boresight.tracking.names import MAX_ROW_GAP, Names
from boresight.tracking.output import Rows
from boresight.tracking.run import NAVIGATION_AHEAD, decision_rows, track_rows, tracker_for
from boresight.tracking.tracker import Output, Tracker, TrackerState
from boresight.types import FATES, Coverage, DecisionRows, Fate, Recording, Scan, Sensor, SensorKind
from tests.tracking.test_tracker import CONFIG, same


@pytest.mark.parametrize("lag", [None, 3.0])
def test_many_looks_at_a_time_give_what_one_by_one_gives(harbour: Recording, lag: float | None) -> None:
    # late looks, looks older than the window, and looks for which there is no pose
    cut = dataclasses.replace(harbour.platforms[0], t=harbour.platforms[0].t.clip(max=40.0))
    keep = np.concatenate([[True], np.diff(cut.t) > 0.0])
    columns = {f.name: v for f in dataclasses.fields(cut) if isinstance(v := getattr(cut, f.name), np.ndarray)}
    short = dataclasses.replace(cut, **{n: v[keep] for n, v in columns.items()})
    recording = dataclasses.replace(harbour, platforms=(short,))
    tracker = tracker_for(recording, dataclasses.replace(CONFIG, window=1.2, smoothing_lag=lag))
    scans = list(iter_scans(recording))
    many, past = tracker.init(), []
    for first in range(0, len(scans), 37):
        many, out = tracker.steps(many, scans[first : first + 37])
        past += out.smoothed
    all_at_once = run(tracker, scans)
    smoothed: list[Rows] = []

    def watch(_: TrackerState, out: Output) -> None:
        smoothed.extend(out.smoothed)

    one_by_one = run(tracker, scans, watch=watch)
    same(track_rows(all_at_once[1]), track_rows(one_by_one[1]))
    a, b = (decision_rows(recording, tracker, r[2], r[0].names) for r in (all_at_once, one_by_one))
    for name in (f.name for f in dataclasses.fields(DecisionRows) if f.name != "extra"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    assert len({*a.fate.tolist()}) >= 5
    d, screened = recording.detections, a.fate == FATES.index(Fate.SCREENED)
    beyond = (d.t > 40.0 + NAVIGATION_AHEAD + 1.0) & ~np.isnan(d.z).all(axis=1)  # the radar's stamps are a second late
    assert screened[beyond].all()
    assert not screened[d.t < 40.0].any()
    n = int(many.window.tracks.live[0])
    np.testing.assert_array_equal(many.window.tracks.x[:n], one_by_one[0].window.tracks.x[:n])
    assert (len(smoothed) > 0) == (lag is not None)
    until = past[-1].t[-1] if past else -np.inf
    same(track_rows(past), track_rows([r for r in smoothed if r.t[0] <= until]))


def test_numbers_are_those_of_a_plain_loop() -> None:
    rng = np.random.default_rng(5)
    names, given = Names(), 0
    last: dict[int, float] = {}
    number: dict[int, int] = {}
    t = 0.0
    for _ in range(200):
        birth, times, expected = [], [], []
        for _ in range(rng.integers(0, 4)):
            t += rng.choice([0.1, 0.4, 0.9])
            for b in rng.permutation(12)[: rng.integers(0, 8)].tolist():
                if t - last.get(b, -np.inf) > MAX_ROW_GAP:
                    given += 1
                    number[b] = given
                last[b] = t
                birth.append(b)
                times.append(t)
                expected.append(number[b])
        np.testing.assert_array_equal(names.take(np.array(birth, np.int64), np.array(times)), expected)
    assert names.given == given
    every = np.arange(-1, 13)
    np.testing.assert_array_equal(names.of(every), [number.get(int(b), -1) for b in every])


def test_a_target_that_leaves_every_coverage_is_given_up() -> None:
    sigma = np.full(7, np.nan)
    sigma[4:6] = 5.0
    radar = Sensor("r", SensorKind.RADAR, sigma=sigma, period=2.0, coverage=Coverage(range=(0.0, 2000.0)))
    tracker = Tracker(TrackerConfig(survival_time=30.0), (radar,), 2)
    state, alive = tracker.init(), []
    R = np.full((1, 7, 7), np.nan)
    R[0, 4:6, 4:6] = 25.0 * np.eye(2)
    rng = np.random.default_rng(2)
    for k in range(150):
        t, east = 2.0 * k, 1000.0 + 10.0 * 2.0 * k  # out of the coverage after 100 s
        z = np.full((1, 7), np.nan)
        z[0, 4:6] = np.array([east, 0.0]) + rng.normal(0.0, 5.0, 2)
        n = int(east < 2000.0)
        state, _ = tracker.step(state, Scan(0, t, t, np.full(n, t), z[:n], R[:n], np.arange(k, k + n)))
        alive.append(int(state.window.tracks.live[0]))
    assert alive[49] == 1
    assert alive[60] == 1  # it may come back
    assert alive[-1] == 0


def test_positions_beyond_the_coverage_are_counted_and_begin_nothing() -> None:
    sigma = np.full(7, np.nan)
    sigma[4:6] = 5.0
    radar = Sensor("r", SensorKind.RADAR, sigma=sigma, coverage=Coverage(range=(0.0, 2000.0)))
    tracker = Tracker(TrackerConfig(), (radar,), 2)
    z, R = np.full((2, 7), np.nan), np.full((2, 7, 7), np.nan)
    z[:, 4:6], R[:, 4:6, 4:6] = [[500.0, 0.0], [1500.0, 1500.0]], 25.0 * np.eye(2)
    state, _ = tracker.step(tracker.init(), Scan(0, 0.0, 0.0, np.zeros(2), z, R, np.arange(2)))
    _, out = tracker.finish(state)
    assert [FATES[c] for d in out.decisions for c in d.fate.tolist()] == [Fate.INITIATED, Fate.OUT_OF_COVERAGE]
