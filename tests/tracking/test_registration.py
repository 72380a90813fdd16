"""Constant sensor errors learned on line: inside their own bands, silent where nothing shows them, kept in files."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from benchmarks.registration import CONFIG, SPREAD, case, estimate

from boresight.config.tracker import parameters_of
from boresight.engine.track import run
from boresight.io.results import read_results, write_results
from boresight.io.scans import iter_scans
from boresight.kernels.measurement import measure
from boresight.kernels.registration import AZIMUTH, ELEVATION, RANGE, SCALE, TIME, sensitivity
from boresight.metrics.score import score
from boresight.tracking.config import TrackerConfig
from boresight.tracking.registration import NOT, OBSERVABLE, Diary
from boresight.tracking.run import decision_rows, track_rows, tracker_for
from boresight.types import Results


def test_sensitivity_equals_differences() -> None:
    rng = np.random.default_rng(2)
    for _ in range(20):
        p, v, s, u = (rng.normal(size=3) * scale for scale in (200.0, 10.0, 50.0, 5.0))
        R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        z, h6, S = np.empty(7), np.empty((7, 6)), np.empty((7, 5))
        measure(p, v, s, u, R, z, h6)
        sensitivity(z, h6, v - u, S)

        def polar(place: np.ndarray, R: np.ndarray = R, s: np.ndarray = s) -> np.ndarray:
            d = R.T @ (place - s)
            r = np.linalg.norm(d)
            return np.array([r, np.arctan2(d[0], d[1]), np.arcsin(d[2] / r)])

        def cartesian(q: np.ndarray) -> np.ndarray:
            r, az, el = q
            return np.array([r * np.cos(el) * np.sin(az), r * np.cos(el) * np.cos(az), r * np.sin(el)])

        q, h = polar(p), 1e-5
        for parameter, step in (
            (RANGE, [h, 0, 0]), (SCALE, [h * q[0], 0, 0]), (AZIMUTH, [0, h, 0]), (ELEVATION, [0, 0, h]),
        ):  # fmt: skip
            slope = (cartesian(q + np.array(step)) - cartesian(q - np.array(step))) / (2 * h)
            np.testing.assert_allclose(S[4:7, parameter], slope, atol=1e-4)
            np.testing.assert_allclose(S[:3, parameter], np.array(step) / h, atol=1e-9)
        later = polar(p - h * (v - u)) - polar(p + h * (v - u))
        np.testing.assert_allclose(S[:3, TIME], later / (2 * h), atol=1e-5)


def test_estimates_lie_in_their_own_bands() -> None:
    inside = total = 0
    for seed in range(20):
        recording, truth = case(1000 + seed)
        for c in estimate(recording):
            assert c.sensor == "off"
            assert c.verdict == OBSERVABLE
            inside += abs(c.value - truth[c.parameter]) <= 1.96 * c.sigma
            total += 1
    # binomial with 60 trials at 0.95: mean 57, sigma 1.7; four of these
    assert total == 60
    assert inside >= 50


def test_one_sensor_alone_shows_nothing_and_says_so() -> None:
    for seed in range(3):
        recording, _ = case(2000 + seed)
        for c in estimate(recording, ["off"]):
            assert c.verdict == NOT
            assert c.sigma > 0.8 * SPREAD[c.parameter]


def test_tracks_are_better_and_honest() -> None:
    ignorant = dataclasses.replace(CONFIG, sensors={})
    squares: dict[str, list[float]] = {"ignorant": [], "registering": []}
    nees: dict[str, list[float]] = {"ignorant": [], "registering": []}
    for seed in range(6):
        recording, _ = case(3000 + seed)
        for name, config in (("ignorant", ignorant), ("registering", CONFIG)):
            rows = track_rows(run(tracker_for(recording, config), iter_scans(recording))[1])
            for target in score(recording, rows).targets:
                squares[name] += target.squared_error
                nees[name] += target.nees
    assert np.mean(squares["registering"]) < 0.6 * np.mean(squares["ignorant"])
    # 18 target runs with about 6 independent errors each: sigma of the mean 2 / sqrt(108) = 0.19; five, for clutter
    assert np.mean(nees["registering"]) < 2.0 + 0.96
    assert np.mean(nees["ignorant"]) > 4.0


def test_results_hold_the_way_there(tmp_path: object) -> None:
    from pathlib import Path

    folder = Path(str(tmp_path))
    recording, _ = case(7, duration=40.0)
    tracker = tracker_for(recording, CONFIG)
    diary = Diary(tracker)
    state, rows, decisions = run(tracker, iter_scans(recording), watch=lambda state, _: diary.note(state))
    known = diary.rows()
    assert len(known) >= 3 * 38
    fates = decision_rows(recording, tracker, decisions, state.names)
    summary = {"parameters": parameters_of(CONFIG)}
    write_results(Results(track_rows(rows), fates, summary, registration=known), recording, folder)
    again = read_results(folder).registration
    assert again is not None
    for field in dataclasses.fields(known):
        np.testing.assert_array_equal(getattr(again, field.name), getattr(known, field.name))
    for parameter in SPREAD:
        mine = known.sigma[known.parameter == parameter]
        assert mine[0] == pytest.approx(SPREAD[parameter], rel=1e-6)
        assert mine[-1] < 0.6 * mine[0]


def test_nothing_declared_nothing_learned() -> None:
    recording, _ = case(3, duration=20.0)
    tracker = tracker_for(recording, TrackerConfig())
    assert tracker.plan.settings.n_constant == 0
