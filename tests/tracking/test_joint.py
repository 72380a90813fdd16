"""Shared detections (JPDA) and merged measurements in the tracker."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from boresight.association import jpda
from boresight.engine.track import run
from boresight.io.scans import iter_scans
from boresight.kernels.tracker import Look
from boresight.kernels.tracker_joint import mix, shares, take_shares
from boresight.kernels.tracker_place import places_of
from boresight.kernels.tracker_weigh import follow_blob
from boresight.kernels.tracker_workroom import workroom
from boresight.metrics.score import score
from boresight.tracking.config import SensorErrors, TrackerConfig
from boresight.tracking.core import Plan, make_plan
from boresight.tracking.run import track_rows, tracker_for
from boresight.tracking.window import empty_window
from boresight.types import (
    Axes,
    Coverage,
    Detections,
    PlatformTrack,
    Recording,
    Sensor,
    SensorKind,
    Site,
    Truth,
)
from tests.tracking.conftest import make_recording, whole

NAN = float("nan")
EYE = np.eye(3)

TAKE_SHARES = whole(take_shares)
PLACES_OF = whole(places_of)


def point_sensor() -> Sensor:
    sigma = np.full(7, NAN)
    sigma[[4, 5]] = 2.0
    return Sensor("radar", SensorKind.RADAR, axes=Axes.PLATFORM_ENU, sigma=sigma, p_detection=0.8)


def look_at(points: np.ndarray) -> Look:
    m = len(points)
    z, R = np.full((m, 7), NAN), np.full((m, 7, 7), NAN)
    z[:, 4:6] = points
    R[:, 4, 4] = R[:, 5, 5] = 4.0
    R[:, 4, 5] = R[:, 5, 4] = 0.0
    zero = np.zeros((m + 1, 3))
    return Look(0.0, np.zeros(m), z, R, np.arange(m), np.full(m, -1), zero, zero, np.tile(EYE, (m + 1, 1, 1)))


def plan_of(**errors: float) -> Plan:
    return make_plan(TrackerConfig(q=0.1, doubt=1e-6, sensors={"radar": SensorErrors(**errors)}), (point_sensor(),), 2)


def test_evidence_is_the_librarys_existence() -> None:
    rng = np.random.default_rng(3)
    plan = plan_of()
    n, m, p_d, gate, density = 6, 7, 0.8, 200.0, 1e-2  # so wide a gate holds everything: p_G = 1
    existence = rng.uniform(0.05, 0.95, n)
    x, z = rng.normal(0.0, 3.0, (n, 2)), rng.normal(0.0, 3.0, (m, 2))
    S = np.tile(4.0 * np.eye(2), (n, 1, 1))
    tr = empty_window(plan).tracks
    tr.live[0] = n
    tr.weight[:n] = np.column_stack([existence, 0.0 * existence, 0.0 * existence, 1.0 - existence])
    d2 = ((x[:, None] - z[None]) ** 2).sum(axis=2) / 4.0
    loglik = (-0.5 * d2 - math.log(2.0 * math.pi * 4.0) - math.log(density)).ravel()
    start, column = np.arange(n + 1) * m, np.tile(np.arange(m), n)
    found = shares(tr, plan.settings, plan.sensors[0], start, column, loglik, np.full(n, p_d), m)
    ratio = 1.0 - p_d + found.reshape(n, m).sum(axis=1)
    after = existence * ratio / (existence * ratio + 1.0 - existence)
    library = jpda.associate(
        x, S, z, gate=gate, p_detection=p_d, clutter_density=density, existence=existence, most_states=1e9
    )
    np.testing.assert_allclose(after, library.existence, rtol=1e-9)


def test_a_lone_track_takes_the_detection_as_it_is() -> None:
    plan = plan_of()
    tr = empty_window(plan).tracks
    tr.live[0] = 1
    tr.weight[0] = 0.5, 0.0, 0.0, 0.5
    loglik = np.array([0.3, -1.0])
    found = shares(tr, plan.settings, plan.sensors[0], np.array([0, 2]), np.array([0, 1]), loglik, np.array([0.8]), 2)
    np.testing.assert_allclose(found, 0.8 * np.exp(loglik), rtol=1e-12)


def test_the_mixture_is_that_of_probabilistic_data_association() -> None:
    """Bar-Shalom and Li 1995 (3.4.2-3 to 3.4.2-11) for two detections, written with matrices."""
    plan = plan_of()
    points = np.array([[1.0, 2.0], [-3.0, 0.5]])
    look, share, visible = look_at(points), np.array([0.7, 0.4]), 0.2 + 1.1
    tr = empty_window(plan).tracks
    tr.live[0] = 1
    x = np.array([0.5, 0.0, 1.0, -1.0])
    A = np.array([[3.0, 0.5, 1.0, 0.0], [0.5, 4.0, 0.0, 1.0], [1.0, 0.0, 2.0, 0.2], [0.0, 1.0, 0.2, 2.0]])
    tr.x[0], tr.P[0] = x, A
    tr.weight[0] = 0.6, 0.1, 0.2, 0.1
    mix(
        tr,
        0,
        plan.settings,
        plan.sensors[0],
        look,
        workroom(4),
        np.array([0, 2]),
        np.array([0, 1]),
        share,
        visible,
        None,
    )
    H = np.eye(2, 4)
    S = H @ A @ H.T + 4.0 * np.eye(2)
    K = A @ H.T @ np.linalg.inv(S)
    beta = 0.6 * share / (0.6 * visible + 0.1)  # the target, visible or hidden, caused it
    y = points - x[:2]
    together = beta @ y
    spread = sum(b * np.outer(v, v) for b, v in zip(beta, y, strict=True)) - np.outer(together, together)
    P = A - beta.sum() * K @ S @ K.T + K @ spread @ K.T
    np.testing.assert_allclose(tr.x[0], x + K @ together, rtol=1e-9)
    np.testing.assert_allclose(tr.P[0], P, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("own", [1, -1])
def test_shares_weigh_the_hypotheses_and_only_the_own_detection_counts(own: int) -> None:
    plan = plan_of()
    sensor = plan.sensors[0]
    points, share, p_d = np.array([[1.0, 2.0], [-3.0, 0.5]]), np.array([0.7, 0.4]), 0.8
    tr = empty_window(plan).tracks
    tr.live[0] = 1
    tr.x[0], tr.P[0] = (0.5, 0.0, 1.0, -1.0), np.diag([3.0, 4.0, 2.0, 2.0])
    tr.weight[0] = before = np.array([0.4, 0.1, 0.3, 0.2])
    anchor, A = np.array([0.2, 0.4]), np.diag([9.0, 6.0])
    tr.anchor[0, :2], tr.anchor_P[0, :2, :2] = anchor, A
    tr.life[0, 3] = 2.0
    look, room = look_at(points)._replace(dt=np.array([0.0, 0.25])), workroom(4)
    at = PLACES_OF(look, plan.settings, sensor, np.ones(2, np.bool_))
    at_own_time = [(tr.x[0, :2] + dt * tr.x[0, 2:], tr.P[0, :2, :2] + dt**2 * tr.P[0, 2:, 2:]) for dt in look.dt]
    moving = [multivariate_normal.pdf(z, x, P + 4.0 * np.eye(2)) for z, (x, P) in zip(points, at_own_time, strict=True)]
    static = [multivariate_normal.pdf(z, anchor, A + 4.0 * np.eye(2)) for z in points]
    start, column = np.array([0, 2]), np.array([0, 1])
    TAKE_SHARES(tr, 0, plan.settings, sensor, look, at, room, start, column, share, own, p_d, 1.0, None)
    visible = 1.0 - p_d + share.sum()
    still = 1.0 - p_d + share @ np.divide(static, moving)
    after = before * [visible, 1.0, still, 1.0]
    np.testing.assert_allclose(tr.weight[0], after / after.sum(), rtol=1e-9)
    K = A @ np.linalg.inv(A + 4.0 * np.eye(2))
    if own >= 0:
        anchor, A = anchor + K @ (points[own] - anchor), A - K @ A
    np.testing.assert_allclose(tr.anchor[0, :2], anchor, rtol=1e-9)
    np.testing.assert_allclose(tr.anchor_P[0, :2, :2], A, rtol=1e-9, atol=1e-12)
    assert tr.life[0].tolist() == ([0.0, 0.25, 0.0, 3.0] if own >= 0 else [0.0, 0.0, 0.0, 2.0])
    assert tr.heard[0] == (1 if own >= 0 else 0)


@pytest.mark.parametrize("word", ["jpda", "nearest"])
def test_finds_both_boats_either_way(harbour: Recording, word: str) -> None:
    config = TrackerConfig(q=0.01, association=word)
    _, rows, _ = run(tracker_for(harbour, config), iter_scans(harbour))
    result = score(harbour, track_rows(rows)).rows[0]
    assert result["tracked_fraction"] > 0.85
    assert result["false_track_s"] <= 5.0
    assert result["position_rmse_m"] < 4.0


def test_shared_detections_keep_the_covariance_honest() -> None:
    nees = []
    for seed in range(8):
        recording = make_recording(seed, duration=40.0, clutter=6.0)
        config = TrackerConfig(q=0.01, association="jpda")
        _, rows, _ = run(tracker_for(recording, config, ["radar"]), iter_scans(recording, ["radar"]))
        nees += [np.mean(t.nees) for t in score(recording, track_rows(rows), None, ["radar"]).targets if t.nees]
    # 16 target runs of about 5 independent values with mean 2: sigma of the mean 2 / sqrt(80) = 0.22; four of these
    assert abs(np.mean(nees) - 2.0) < 0.9


def test_a_blob_places_no_better_than_its_size() -> None:
    plan = plan_of(resolution=20.0)
    tr = empty_window(plan).tracks
    tr.live[0], tr.heard[0] = 1, 1
    tr.x[0] = 100.0, 30.0, 0.0, 0.0
    tr.P[0] = np.diag([900.0, 25.0, 1.0, 1.0])
    fix = np.array([100.0 + 8.0, 0.0, 0.0])  # seen from the origin: east is the line of sight
    for _ in range(3):  # as often as it likes
        follow_blob(tr, 0, plan.settings, plan.sensors[0], look_at(fix[None, :2]), fix, 0, None)
    # along: variance 900 to (20 / 2)² = 100, the mean by the gain 1 - 100 / 900; across is known better already
    assert tr.P[0, 0, 0] == pytest.approx(100.0)
    assert tr.x[0, 0] == pytest.approx(100.0 + 8.0 * (1.0 - 100.0 / 900.0))
    assert tr.P[0, 1, 1] == 25.0
    assert tr.x[0, 1] == 30.0


def convoy(boats: int, seed: int = 4, duration: float = 40.0) -> Recording:
    """Boats 24 m abreast at 150 m; the radar answers for the first one alone, the camera sees each."""
    rng = np.random.default_rng(seed)
    radar_sigma, eye_sigma = np.full(7, NAN), np.full(7, NAN)
    radar_sigma[[0, 1]], eye_sigma[1] = (3.0, 0.01), 0.008
    radar = Sensor("radar", SensorKind.RADAR, "pier", Axes.PLATFORM_ENU, sigma=radar_sigma, p_detection=0.9,
                   clutter_per_scan=1.0, coverage=Coverage(range=(0.0, 500.0)))  # fmt: skip
    eye = Sensor("eye", SensorKind.OPTICAL, "pier", Axes.PLATFORM_ENU, sigma=eye_sigma, p_detection=0.6,
                 clutter_per_scan=1.0)  # fmt: skip
    start, v = np.array([[-12.0, 150.0], [12.0, 150.0]])[:boats], np.array([0.6, -2.0])
    rows: list[tuple[float, int, int, float, float]] = []
    looks = sorted([(t, 0) for t in np.arange(0.0, duration, 1.5)] + [(t, 1) for t in np.arange(0.05, duration, 0.2)])
    for number, (t, sensor) in enumerate(looks):
        before = len(rows)
        for k, p in enumerate(start + v * t):
            r, az = float(np.hypot(*p)), float(np.arctan2(p[0], p[1]))
            if rng.random() < (0.9 if sensor == 0 else 0.6) and (sensor == 1 or k == 0):
                noise = rng.normal(size=2)
                rows.append((t, sensor, number, r + 3.0 * noise[0] if sensor == 0 else NAN,
                             az + (0.01 if sensor == 0 else 0.008) * noise[1]))  # fmt: skip
        for _ in range(rng.poisson(1.0)):
            rows.append((t, sensor, number, float(rng.uniform(0.0, 500.0)) if sensor == 0 else NAN,
                         float(rng.uniform(-np.pi, np.pi))))  # fmt: skip
        if len(rows) == before:
            rows.append((t, sensor, number, NAN, NAN))
    stamp, index, scan, r, az = (np.array(column) for column in zip(*rows, strict=True))
    z = np.full((len(rows), 7), NAN)
    z[:, 0], z[:, 1] = r, az
    sigma = np.where(np.isfinite(z), np.stack([radar.sigma, eye.sigma])[index], NAN)
    times = np.arange(-2.0, duration + 1.0, 0.1)
    still, none = np.zeros((len(times), 3)), np.full(len(times), NAN)
    pier = PlatformTrack("pier", times, still, still, np.full((len(times), 3), NAN), none, none)
    truth = tuple(
        Truth(f"boat-{k}", times, np.column_stack([p + np.outer(times, v), 0.0 * times]),
              np.tile([*v, 0.0], (len(times), 1)))
        for k, p in enumerate(start)
    )  # fmt: skip
    detections = Detections(stamp, stamp, index, scan, z, sigma, {})
    empty = np.zeros(len(rows), dtype=bool)
    return Recording("convoy", 2, Site(1.1, 0.18, 0.0), (radar, eye), detections, (pier,), truth, (), empty)


CONVOY = TrackerConfig(
    q=0.05, speed_sigma=4.0, merge_distance=12.0, clutter_memory=150.0,
    sensors={"radar": SensorErrors(resolution=25.0), "eye": SensorErrors(decorrelation=1.0, moves_tracks=False)},
)  # fmt: skip


@pytest.mark.parametrize("seed", [0, 1])
def test_two_bearings_tell_two_boats_in_one_blob(seed: int) -> None:
    recording = convoy(2, seed)
    held = []
    for share in (0.0, 0.1):
        config = dataclasses.replace(CONVOY, blob_share=share)
        _, rows, _ = run(tracker_for(recording, config), iter_scans(recording))
        result = score(recording, track_rows(rows))
        assert result.rows[0]["false_track_s"] <= 3.0
        held.append([t.held / t.present for t in result.targets])
    assert result.rows[0]["position_rmse_m"] < 10.0  # of a blob 25 m wide, and bearings of half a degree
    assert held[0][1] == 0.0  # the blob alone shows one boat
    assert held[1][1] > 0.4  # the other takes some ten seconds of bearings
    assert held[1][0] > 0.7


def test_one_boat_stays_one() -> None:
    for seed in range(3):
        recording = convoy(1, seed)
        _, rows, _ = run(tracker_for(recording, dataclasses.replace(CONVOY, blob_share=0.1)), iter_scans(recording))
        result = score(recording, track_rows(rows)).rows[0]
        assert result["false_track_s"] <= 3.0
        assert result["tracked_fraction"] > 0.7  # 40 s, of which the first looks go into confirming it
