"""The fixed-lag smoother against a batch solution that knows nothing of filters, and what it gains."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from boresight.engine.track import run
from boresight.io.scans import iter_scans
from boresight.metrics.score import score
from boresight.tracking.config import TrackerConfig
from boresight.tracking.output import Rows
from boresight.tracking.run import track_rows, tracker_for
from boresight.tracking.saved import arrays_of_state, state_of_arrays
from boresight.tracking.tracker import Output, TrackerState
from boresight.types import Axes, Coverage, Detections, Recording, Sensor, SensorKind, Site, TrackRows
from tests.tracking.conftest import make_recording

Q, SIGMA, SPEED, LAG, PERIOD = 0.05, 2.0, 6.0, 4.0, 0.7
CONFIG = TrackerConfig(q=Q, speed_sigma=SPEED, smoothing_lag=LAG, rest_time=1e12)


def lone_target() -> Recording:
    """One boat and a sensor that measures east and north: everything is linear, no report is ambiguous."""
    rng = np.random.default_rng(5)
    t = PERIOD * np.arange(60)
    z = np.full((60, 7), np.nan)
    z[:, 4] = 10.0 + 3.0 * t + SIGMA * rng.normal(size=60)
    z[:, 5] = -20.0 + 1.0 * t + SIGMA * rng.normal(size=60)
    sigma = np.where(np.isfinite(z), SIGMA, np.nan)
    lidar = Sensor(
        "lidar", SensorKind.LIDAR, None, Axes.SITE_ENU, sigma=sigma[0], p_detection=0.95, clutter_per_scan=0.01,
        coverage=Coverage(range=(0.0, 500.0)), period=PERIOD,
    )  # fmt: skip
    detections = Detections(t, t, np.zeros(60, int), np.arange(60), z, sigma, {})
    return Recording("lone", 2, Site(1.1, 0.2, 0.0), (lidar,), detections, (), (), (), np.zeros(60, dtype=bool))


def smoothed_of(recording: Recording, config: TrackerConfig) -> list[Rows]:
    rows: list[Rows] = []
    run(tracker_for(recording, config), iter_scans(recording), watch=lambda _, out: rows.extend(out.smoothed))
    return rows


def batch(t: np.ndarray, z: np.ndarray, at: float) -> tuple[np.ndarray, np.ndarray]:
    """Least squares over the states at all times `t` and at `at`, one axis: the mean and covariance there."""
    times = np.unique(np.append(t, at))
    n = len(times)
    A = np.zeros((2 * n, 2 * n))
    b = np.zeros(2 * n)
    A[1, 1] += 1.0 / SPEED**2  # the prior of the tracker: velocity zero, position from the first report
    for k in range(n - 1):
        dt = times[k + 1] - times[k]
        F = np.array([[1.0, dt], [0.0, 1.0]])
        W = np.linalg.inv(Q * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]))
        here, there = slice(2 * k, 2 * k + 2), slice(2 * k + 2, 2 * k + 4)
        A[here, here] += F.T @ W @ F
        A[here, there] -= F.T @ W
        A[there, here] -= W @ F
        A[there, there] += W
    for k, value in zip(np.searchsorted(times, t), z, strict=True):
        A[2 * k, 2 * k] += 1.0 / SIGMA**2
        b[2 * k] += value / SIGMA**2
    P = np.linalg.inv(A)
    k = 2 * int(np.searchsorted(times, at))
    return (P @ b)[k : k + 2], P[k : k + 2, k : k + 2]


def test_equals_the_batch_solution() -> None:
    recording = lone_target()
    d = recording.detections
    rows = smoothed_of(recording, CONFIG)
    assert len(rows) > 40
    for r in rows[:: len(rows) // 12]:
        assert len(r.t) == 1
        known = d.t_recv <= r.t_known[0]
        for axis in (0, 1):
            mean, covariance = batch(d.t[known], d.z[known, 4 + axis], float(r.t[0]))
            assert r.position[0, axis] == pytest.approx(mean[0], abs=1e-5)
            assert r.velocity[0, axis] == pytest.approx(mean[1], abs=1e-5)
            assert r.covariance[0, axis, axis] == pytest.approx(covariance[0, 0], rel=1e-5)


def test_rows_lie_at_least_the_lag_back_and_never_repeat() -> None:
    recording = lone_target()
    rows = track_rows(smoothed_of(recording, CONFIG))
    last = recording.detections.t_recv.max()
    running = rows.t_known < last
    assert (rows.t_known[running] - rows.t[running] >= LAG - 1e-9).all()
    assert (rows.t_known[running] - rows.t[running] <= LAG + 2 * PERIOD).all()
    assert (np.diff(rows.t) > 0).all()
    assert rows.t.max() > last - 2 * PERIOD  # the end of a recording has no later reports to wait for


def test_causal_rows_are_untouched(harbour: Recording) -> None:
    def causal(config: TrackerConfig) -> TrackRows:
        return track_rows(run(tracker_for(harbour, config), iter_scans(harbour))[1])

    plain, lagged = causal(TrackerConfig()), causal(TrackerConfig(smoothing_lag=6.0))
    for field in dataclasses.fields(TrackRows):
        np.testing.assert_array_equal(getattr(plain, field.name), getattr(lagged, field.name))


def test_saved_half_way_it_goes_on_with_the_same_rows(harbour: Recording) -> None:
    config = TrackerConfig(smoothing_lag=5.0)
    scans = list(iter_scans(harbour))
    whole = track_rows(smoothed_of(harbour, config))
    first: list[Rows] = []

    def keep(_: TrackerState, out: Output) -> None:
        first.extend(out.smoothed)

    tracker = tracker_for(harbour, config)
    state, _, _ = run(tracker, scans[:150], finish=False, watch=keep)
    run(tracker, scans[150:], state_of_arrays(arrays_of_state(state), tracker), watch=keep)
    joined = track_rows(first)
    np.testing.assert_array_equal(joined.t, whole.t)
    np.testing.assert_array_equal(joined.position, whole.position)


def test_smoothing_gains_and_stays_honest() -> None:
    squares: dict[float | None, list[float]] = {None: [], 6.0: []}
    nees = []
    for seed in range(8):
        recording = make_recording(seed, duration=40.0)
        for lag, found in squares.items():
            config = TrackerConfig(q=0.01, smoothing_lag=lag)
            rows = (
                smoothed_of(recording, config) if lag else run(tracker_for(recording, config), iter_scans(recording))[1]
            )
            for target in score(recording, track_rows(rows)).targets:
                found += target.squared_error
                if lag and target.nees:
                    nees.append(np.mean(target.nees))
    assert np.mean(squares[6.0]) < 0.8 * np.mean(squares[None])
    # 16 target runs of about 3 independent errors each (smoothed ones last longer): sigma 2 / sqrt(48) = 0.29; four
    assert 2.0 - 1.16 < np.mean(nees) < 2.0 + 1.16


def test_what_no_average_takes_away() -> None:
    """Boats that are reported at a point of theirs, constant, which nobody knows: `extent` makes the rows honest."""
    recording, extent = lone_target(), 2.5
    rng = np.random.default_rng(8)
    t = recording.detections.t
    nees: dict[tuple[str, float], list[float]] = {}
    for _ in range(60):
        offset = extent * rng.normal(size=2)
        z = np.full((len(t), 7), np.nan)
        z[:, 4:6] = np.outer(t, [3.0, 1.0]) + [10.0, -20.0] + offset + SIGMA * rng.normal(size=(len(t), 2))
        one = dataclasses.replace(recording, detections=dataclasses.replace(recording.detections, z=z))
        for told in (0.0, extent):
            past: list[Rows] = []
            config = dataclasses.replace(CONFIG, extent=told)
            _, rows, _ = run(tracker_for(one, config), iter_scans(one), watch=lambda _, out: past.extend(out.smoothed))  # noqa: B023
            for name, row in (("causal", rows[-1]), ("smoothed", past[-12])):
                e = row.position[-1] - np.array([10.0 + 3.0 * row.t[-1], -20.0 + row.t[-1]])
                nees.setdefault((name, told), []).append(float(e @ np.linalg.solve(row.covariance[-1], e)))
    # chi-square of 2 degrees of freedom: mean 2, standard deviation 2/√60 = 0.26 of the mean of 60; three of them
    for name in ("causal", "smoothed"):
        assert np.mean(nees[name, extent]) == pytest.approx(2.0, abs=0.78)
        assert np.mean(nees[name, 0.0]) > 5.0


def test_extent_changes_nothing_but_the_covariances() -> None:
    recording = lone_target()
    point = run(tracker_for(recording, CONFIG), iter_scans(recording))[1]
    wide = run(tracker_for(recording, dataclasses.replace(CONFIG, extent=2.0)), iter_scans(recording))[1]
    assert len(point) == len(wide) > 40
    for a, b in zip(point, wide, strict=True):
        assert np.array_equal(a.position, b.position)
        assert np.array_equal(a.velocity, b.velocity)
        assert b.covariance == pytest.approx(a.covariance + 4.0 * np.eye(2), rel=1e-12)
