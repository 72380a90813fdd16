"""One rule of the tracker at a time, on a handful of tracks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from boresight.kernels.tracker import INITIATED, NOTHING, UNASSOCIATED, Look, Models, Tracks
from boresight.kernels.tracker_copies import EACH, WHOLE, copies_with_room, each_of, keep, no_copies, restore
from boresight.kernels.tracker_end import move
from boresight.kernels.tracker_split import begin_beside, keep_beside
from boresight.kernels.tracker_workroom import workroom
from boresight.tracking.config import SensorErrors, TrackerConfig
from boresight.tracking.core import Plan, copy_tracks, make_plan
from boresight.tracking.tracker import Tracker
from boresight.tracking.window import empty_window
from boresight.types import Coverage, Scan, Sensor, SensorKind
from tests.tracking.conftest import whole

NAN = float("nan")

KEEP = whole(keep)
RESTORE = whole(restore)
MOVE = whole(move)
BEGIN_BESIDE = whole(begin_beside)
KEEP_BESIDE = whole(keep_beside)
MODELS = pytest.mark.parametrize("models", [None, Models(q=4.0, every=60.0, lasts=10.0)], ids=["one", "two"])


def sensor(name: str, kind: SensorKind = SensorKind.RADAR, **extra: Any) -> Sensor:
    """A sensor of positions (radar) or bearings, north-aligned at the origin."""
    sigma = np.full(7, NAN)
    if kind == SensorKind.RADAR:
        sigma[4:6] = 5.0
    else:
        sigma[1] = 0.01
    return Sensor(name, kind, sigma=sigma, **extra)


def points(t: float, places: list[list[float]], index: int = 0, first: int = 0, sigma: float = 5.0) -> Scan:
    """One look that reports positions (m)."""
    n = len(places)
    z, R = np.full((n, 7), NAN), np.full((n, 7, 7), NAN)
    if n:
        z[:, 4:6] = places
    R[:, 4:6, 4:6] = sigma**2 * np.eye(2)
    return Scan(index, t, t, np.full(n, t), z, R, np.arange(first, first + n))


def bearings(azimuth: list[float]) -> Look:
    """One look of bearings (rad) for the kernel."""
    m = len(azimuth)
    z, R = np.full((m, 7), NAN), np.full((m, 7, 7), NAN)
    z[:, 1], R[:, 1, 1] = azimuth, 1e-4
    zero = np.zeros((m + 1, 3))
    return Look(0.0, np.zeros(m), z, R, np.arange(m), np.full(m, -1), zero, zero, np.tile(np.eye(3), (m + 1, 1, 1)))


def filled(seed: int, n: int, models: Models | None) -> Tracks:
    """Tracks in which every number of every field is different; n of them live, with room for one more."""
    errors = {"a": SensorErrors(bias_position=1.0, offset_time=0.1, sees_targets=0.5)}
    config = TrackerConfig(q_manoeuvre=None if models is None else models.q, sensors=errors)
    plan = make_plan(config, (sensor("a"), sensor("b")), 2)
    rng = np.random.default_rng(seed)
    tracks = empty_window(plan).tracks
    for array in (a for a in tracks if a is not None):
        array[...] = rng.integers(1, 1_000_000_000, array.shape)
    tracks.live[0] = n
    return tracks


@MODELS
def test_a_copy_holds_all_there_is_of_the_tracks(models: Models | None) -> None:
    tracks, other = filled(1, 3, models), filled(2, 5, models)
    expected = copy_tracks(tracks)
    copies = copies_with_room(no_copies(tracks), 2, 10)
    KEEP(copies, tracks, 7.0, 4, models)
    RESTORE(copies, 0, other, models)
    for name in WHOLE:
        np.testing.assert_array_equal(getattr(other, name), getattr(expected, name), err_msg=name)
    for name in each_of(tracks):
        np.testing.assert_array_equal(getattr(other, name)[:3], getattr(expected, name)[:3], err_msg=name)
    assert set(WHOLE) | set(EACH) == set(Tracks._fields)


@MODELS
def test_a_track_moves_with_all_that_it_is(models: Models | None) -> None:
    tracks = filled(3, 4, models)
    expected = copy_tracks(tracks)
    MOVE(tracks, 3, 1, models)
    for name in each_of(tracks):
        np.testing.assert_array_equal(getattr(tracks, name)[1], getattr(expected, name)[3], err_msg=name)


def test_a_track_begun_where_nobody_can_see_it_again_does_not_wait() -> None:
    """2,030 m is in the margin of the coverage for a report, not for a target."""
    radar = sensor("r", coverage=Coverage(range=(0.0, 2000.0)), p_detection=0.9)
    tracker = Tracker(TrackerConfig(survival_time=1e6, hide_time=1e9), (radar,), 2)
    state, _ = tracker.step(tracker.init(), points(0.0, [[2030.0, 0.0]]))
    assert state.window.tracks.live[0] == 1
    for k in range(1, 9):  # a miss leaves a tenth: four of them are the threshold of 1e-4
        state, _ = tracker.step(state, points(2.0 * k, []))
    assert state.window.tracks.live[0] == 0


def beside(stale: float = 0.0, azimuth: float = 0.12, models: Models | None = None) -> tuple[Plan, Tracks, list[int]]:
    """Two bearings at a shown track 150 m north, whose row 1 was another track's before; returns the fates too."""
    radar, eye = sensor("r"), sensor("e", SensorKind.OPTICAL)
    errors = {"r": SensorErrors(resolution=25.0, offset_time=0.5, offset_azimuth=0.02, sees_targets=0.5)}
    q = None if models is None else models.q
    config = TrackerConfig(q_manoeuvre=q, blob_share=0.1, merge_distance=12.0, sensors=errors)
    plan = make_plan(config, (radar, eye), 2)
    tracks = empty_window(plan).tracks
    n = plan.n_states
    tracks.live[0] = 1
    tracks.x[0], tracks.P[0] = 0.0, 25.0 * np.eye(n)
    tracks.x[0, 1], tracks.heard[0], tracks.birth[0] = 150.0, 1, 77
    tracks.life[0, 2], tracks.weight[0] = 1.0, (1.0, 0.0, 0.0, 0.0)
    tracks.told[0, :, :2] = np.eye(2) / 25.0
    if models is not None:
        tracks.mode[0], tracks.mode_x[0], tracks.mode_P[0] = (0.7, 0.3), tracks.x[0], tracks.P[0]
    for name in each_of(tracks):
        getattr(tracks, name)[1] = stale
    fate, owner = np.full(2, UNASSOCIATED), np.full(2, -1)
    look, usable = bearings([0.0, azimuth]), np.ones(2, np.bool_)
    BEGIN_BESIDE(tracks, plan.settings, plan.sensors[1], look, fate, owner, usable, workroom(n), models)
    return plan, tracks, fate.tolist()


def test_a_second_track_stands_where_the_difference_of_the_bearings_says() -> None:
    plan, tracks, fates = beside()
    assert tracks.live[0] == 2
    assert fates == [UNASSOCIATED, INITIATED]
    along, across = np.array([np.sin(0.12), np.cos(0.12)]), np.array([np.cos(0.12), -np.sin(0.12)])
    np.testing.assert_allclose(tracks.x[1, :2], 150.0 * along, rtol=1e-12)
    own = tracks.P[1, :2, :2] - tracks.P[0, :2, :2]
    assert along @ own @ along == pytest.approx(12.5**2)  # half the blob
    assert across @ own @ across == pytest.approx(5.0**2 + (150.0 * np.sqrt(2e-4)) ** 2)  # two bearings of 0.01 rad
    np.testing.assert_allclose(tracks.weight[1], [0.1, 0.0, 0.0, 0.9])
    assert (tracks.beside[1], tracks.heard[1], plan.settings.blob) == (77, 0, 25.0)


@pytest.mark.parametrize("azimuth", [0.05, 0.3])
def test_a_bearing_too_near_or_beyond_the_blob_begins_nothing(azimuth: float) -> None:
    """7.5 m: one target (merge distance 12 m); 45 m: in no blob of 25 m."""
    _, tracks, fates = beside(azimuth=azimuth)
    assert tracks.live[0] == 1
    assert fates == [UNASSOCIATED, UNASSOCIATED]


@MODELS
def test_nothing_is_left_of_the_track_that_had_the_row_before(models: Models | None) -> None:
    (_, fresh, _), (_, used, _) = beside(models=models), beside(stale=3.0, models=models)
    for name in each_of(fresh):
        np.testing.assert_array_equal(getattr(used, name)[1], getattr(fresh, name)[1], err_msg=name)


@pytest.mark.parametrize(("shown", "away", "stays"), [(1.0, 18.0, True), (0.0, 18.0, False), (1.0, 40.0, False)])
def test_a_second_track_ends_with_the_first_or_when_they_part(shown: float, away: float, stays: bool) -> None:
    """Here the first track's blob is 25 m wide, and half as much again the farthest."""
    plan, tracks, _ = beside()
    tracks.life[0, 2] = shown
    tracks.anchor[1, :2] = away, 0.0
    free, usable = np.full(2, -1), np.ones(2, np.bool_)
    tracks.x[0, :2] += 3.0
    KEEP_BESIDE(
        tracks, plan.settings, plan.sensors[1], bearings([0.0, 0.12]), free, usable, workroom(plan.n_states), None
    )
    assert (tracks.weight[1, NOTHING] < 1.0) == stays
    if stays:
        np.testing.assert_allclose(tracks.x[1, :2], tracks.x[0, :2] + [away, 0.0])  # along with the first
