"""What is said of a report, and what it does to belief in a track, against the formulas written with matrices."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.stats import chi2, multivariate_normal

from boresight.engine.track import run
from boresight.io.scans import iter_scans
from boresight.kernels.tracker import AZIMUTH_BINS, HIDDEN, NOTHING, VISIBLE
from boresight.kernels.tracker_state import innovation
from boresight.kernels.tracker_workroom import workroom
from boresight.tracking.config import TrackerConfig
from boresight.tracking.run import decision_rows, tracker_for
from boresight.tracking.tracker import Tracker, TrackerState
from boresight.types import FATES, NO_TRACK, Coverage, Fate, FloatArray, Recording, Scan, SensorKind
from tests.tracking.conftest import whole
from tests.tracking.test_rules import points, sensor

INNOVATION = whole(innovation)
RANGE = 2000.0
TRACKER = Tracker(
    TrackerConfig(q=0.1, static_share=0.0, stop_floor=0.0, gate_probability=0.99, lonely_bearings=False),
    (
        sensor("radar", coverage=Coverage(range=(0.0, RANGE)), p_detection=0.8, clutter_per_scan=2.0),
        sensor("eye", SensorKind.OPTICAL, p_detection=0.7),
    ),
    2,
)


def tracked() -> tuple[TrackerState, FloatArray, FloatArray]:
    """One track of three reports: the state, its mean (4,) and covariance (4, 4) at 2 s."""
    state = TRACKER.init()
    for k, place in enumerate(([300.0, 400.0], [303.0, 404.0], [309.0, 406.0])):
        state, _ = TRACKER.step(state, points(1.0 * k, [place], first=k))
    tr = state.window.tracks
    assert tr.live[0] == 1
    return state, tr.x[0].copy(), tr.P[0].copy()


def told(state: TrackerState) -> dict[int, tuple[Fate, int, float]]:
    """Return fate, track and NIS of every report by its row."""
    _, out = TRACKER.finish(state)
    return {
        int(row): (FATES[fate], int(birth), float(nis))
        for d in out.decisions
        for row, fate, birth, nis in zip(*d, strict=True)
    }


@pytest.mark.parametrize("direction", [0.0, 1.0, 2.0, 4.0])
def test_the_gate_of_positions_is_the_chi_square_quantile(direction: float) -> None:
    state, x, P = tracked()
    S = P[:2, :2] + 25.0 * np.eye(2)
    way = np.linalg.cholesky(S) @ [np.cos(direction), np.sin(direction)]
    gate = chi2.ppf(0.99, 2)
    inside, outside = (x[:2] + np.sqrt(share * gate) * way for share in (0.98, 1.02))
    state, _ = TRACKER.step(state, points(2.0, [list(inside)], first=3))
    assert told(state)[3] == (Fate.UPDATED, 0, pytest.approx(0.98 * gate))
    state, x, P = tracked()
    state, _ = TRACKER.step(state, points(2.0, [list(outside)], first=3))
    assert told(state)[3][:2] == (Fate.INITIATED, 3)


def test_bearings_are_told_with_the_track_they_were_held_against() -> None:
    state, x, P = tracked()
    e, n = x[:2]
    H = np.array([n, -e, 0.0, 0.0]) / (e * e + n * n)
    sigma = np.sqrt(H @ P @ H + 1e-4)
    gate = chi2.ppf(0.99, 1)
    z, R = np.full((2, 7), np.nan), np.full((2, 7, 7), np.nan)
    z[:, 1] = np.arctan2(e, n) + sigma * np.sqrt(gate * np.array([0.98, 1.02])) * [1.0, -1.0]
    R[:, 1, 1] = 1e-4
    state, _ = TRACKER.step(state, Scan(1, 2.0, 2.0, np.full(2, 2.0), z, R, np.arange(3, 5)))
    found = told(state)
    assert found[3] == (Fate.UPDATED, 0, pytest.approx(0.98 * gate))
    assert found[4] == (Fate.GATED, 0, pytest.approx(1.02 * gate))


def test_a_detection_is_held_against_the_track_at_its_own_time() -> None:
    """A radar that turns sees it a quarter of a second after the middle of its look."""
    state, x, P = tracked()
    H = np.eye(2, 4) + 0.25 * np.eye(2, 4, k=2)
    y, S = np.array([8.0, -6.0]), H @ P @ H.T + 25.0 * np.eye(2)
    look = points(2.0, [list(H @ x + y)], first=3)
    state, _ = TRACKER.step(state, dataclasses.replace(look, t=look.t + 0.25))
    assert told(state)[3] == (Fate.UPDATED, 0, pytest.approx(y @ np.linalg.solve(S, y)))
    np.testing.assert_allclose(state.window.tracks.x[0], x + P @ H.T @ np.linalg.solve(S, y), rtol=1e-9)


def test_a_time_offset_times_a_velocity_both_uncertain() -> None:
    """Moments of the product of two Gaussians, by drawing them: z = p - lag v + noise."""
    rng = np.random.default_rng(7)
    mean = np.array([10.0, -20.0, 3.0, -4.0, 0.5])
    A = rng.normal(size=(5, 5)) * [1.0, 1.0, 1.0, 1.0, 0.4]
    P = A.T @ A
    p, v, lag = np.split(rng.multivariate_normal(mean, P, 400_000), [2, 4], axis=1)
    drawn = p - lag * v
    z, R, room = np.full(7, np.nan), np.full((7, 7), np.nan), workroom(5)
    z[4:6], R[4:6, 4:6] = (1.0, 2.0), 0.25 * np.eye(2)
    room.mask[:2], room.z[4:6] = (4, 5), mean[:2] - mean[4] * mean[2:4]
    room.H[4:6] = np.column_stack([np.eye(2), -mean[4] * np.eye(2), -mean[2:4]])
    INNOVATION(P, z, R, 2, room, 2, 4)
    L = np.tril(room.S[:2, :2])
    np.testing.assert_allclose(L @ room.y[:2], z[4:6] - drawn.mean(axis=0), atol=4.0 * drawn.std() / 400_000**0.5)
    np.testing.assert_allclose(L @ L.T, np.cov(drawn.T) + 0.25 * np.eye(2), rtol=0.02, atol=0.05)


@pytest.mark.parametrize("near", [[[4.0, 3.0]], [[4.0, 3.0], [-6.0, 8.0]], []])
def test_every_detection_in_the_gate_speaks_for_the_track(near: list[list[float]]) -> None:
    """Musicki, Evans and Stankovic 1994: 1 - p_D + p_D Σ N(z; Hx, S) / λ, over 1 for what is nothing or hidden."""
    state, x, P = tracked()
    tr = state.window.tracks
    density = tr.clutter[0, AZIMUTH_BINS] / (np.pi * RANGE**2)
    places = [list(x[:2] + offset) for offset in near]
    before = tr.weight[0].copy()
    S = P[:2, :2] + 25.0 * np.eye(2)
    ratio = 0.2 + 0.8 * sum(multivariate_normal.pdf(z, x[:2], S) for z in places) / density
    state, _ = TRACKER.step(state, points(2.0, places, first=3))
    after = state.window.tracks.weight[0]
    expected = before * np.where(np.arange(4) == VISIBLE, ratio, 1.0)
    np.testing.assert_allclose(after, expected / expected.sum(), rtol=1e-6)
    assert after[HIDDEN] > 0.0
    assert after[NOTHING] > 0.0


def test_every_row_says_why(harbour: Recording) -> None:
    """Empty looks saw nothing; a track that was never shown has no number, and its reports say so."""
    used = tracker_for(harbour, TrackerConfig())
    state, _, decisions = run(used, iter_scans(harbour))
    found = decision_rows(harbour, used, decisions, state.names)
    empty = np.isnan(harbour.detections.z).all(axis=1)
    assert empty.any()
    np.testing.assert_array_equal(found.fate == FATES.index(Fate.NO_DETECTION), empty)
    taken = np.isin(found.fate, [FATES.index(Fate.UPDATED), FATES.index(Fate.INITIATED)])
    unnamed = taken & (found.track_id == NO_TRACK)
    assert unnamed.any()
    assert set(found.reason[unnamed]) == {"the track was never confirmed"}
    assert set(found.reason[taken & ~unnamed]) == {None}
