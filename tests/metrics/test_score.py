"""The score of tracks made by hand, where every figure is known."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.metrics.score import score
from boresight.types import Ignore, Recording, TrackRows
from tests.tracking.conftest import make_recording


def rows_of(t: np.ndarray, track_id: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> TrackRows:
    n = len(t)
    up = np.full((n, 1), np.nan)
    covariance = np.full((n, 3, 3), np.nan)
    covariance[:, :2, :2] = np.eye(2) * 4.0
    status = np.ones(n, np.uint8)
    return TrackRows(t, t, track_id, status, np.hstack([position, up]), np.hstack([velocity, up]), covariance)


@pytest.fixture(scope="module")
def one_boat() -> Recording:
    recording = make_recording(duration=20.0)
    return dataclasses.replace(recording, truth=recording.truth[:1])


def follow(recording: Recording, t: np.ndarray, offset: tuple[float, float] = (0.0, 0.0), name: int = 1) -> TrackRows:
    truth = recording.truth[0]
    position = np.stack([np.interp(t, truth.t, truth.position[:, k]) for k in (0, 1)], axis=1)
    velocity = np.stack([np.interp(t, truth.t, truth.velocity[:, k]) for k in (0, 1)], axis=1)
    return rows_of(t, np.full(len(t), name), position + offset, velocity)


def join(*parts: TrackRows) -> TrackRows:
    return TrackRows(
        **{f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in dataclasses.fields(TrackRows)}
    )


def test_a_perfect_track(one_boat: Recording) -> None:
    ours, empty = score(one_boat, follow(one_boat, np.arange(0.0, 20.0, 0.4))).rows[:2]
    assert ours["gospa_rms_m"] == pytest.approx(0.0, abs=1e-9)  # rows are moved by their velocity
    assert ours["tracked_fraction"] == 1.0
    assert empty["gospa_rms_m"] == pytest.approx(20.0 / np.sqrt(2.0))
    assert empty["tracked_fraction"] == 0.0


def test_offset_gap_switch_and_false_track(one_boat: Recording) -> None:
    tracks = join(
        follow(one_boat, np.arange(0.0, 8.0, 0.5), (3.0, 4.0), name=1),
        follow(one_boat, np.arange(12.0, 20.0, 0.5), (3.0, 4.0), name=2),
        follow(one_boat, np.arange(0.0, 5.0, 0.5), (500.0, 0.0), name=3),
    )
    ours = score(one_boat, tracks).rows[0]
    assert ours["position_rmse_m"] == pytest.approx(5.0)
    assert ours["identity_switches"] == 1
    assert ours["breaks"] == 1
    assert ours["false_track_s"] == pytest.approx(0.5 * 14)  # 0 to 4.5 s and carried for 2 s
    assert ours["nees_mean"] == pytest.approx(25.0 / 4.0)
    assert ours["nees_in_band_95"] == 1.0
    present = score(one_boat, tracks).targets[0]
    assert present.present - present.held == 4  # 10 s to 11.5 s: the first track's last row (7.5 s) has grown too old


def test_ignored_objects_excuse_only_unmatched_tracks(one_boat: Recording) -> None:
    t = np.arange(0.0, 20.0, 0.5)
    good, other = follow(one_boat, t), follow(one_boat, t, (300.0, 0.0), name=2)
    ignored = tuple(
        Ignore(f"boat-{i}", t, part.position[:, :2], np.full(len(t), 40.0)) for i, part in enumerate((good, other))
    )
    ours = score(dataclasses.replace(one_boat, ignore=ignored), join(good, other)).rows[0]
    assert ours["false_track_s"] == 0.0
    assert ours["tracked_fraction"] == 1.0
    assert score(one_boat, join(good, other)).rows[0]["false_track_s"] == pytest.approx(20.0)


def test_without_truth_there_is_no_score(one_boat: Recording) -> None:
    with pytest.raises(UserError, match="no truth"):
        score(dataclasses.replace(one_boat, truth=()), follow(one_boat, np.arange(3.0)))
