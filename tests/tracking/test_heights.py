"""Height that nobody measures: a range and an azimuth leave a target on an arc."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from boresight.frames.pose import pose_track
from boresight.tracking.config import TrackerConfig
from boresight.tracking.heights import height_not_observed, told_of_heights
from boresight.tracking.tracker import Tracker, TrackerState
from boresight.types import (
    Axes,
    Coverage,
    Detections,
    FloatArray,
    PlatformTrack,
    Recording,
    Scan,
    Sensor,
    SensorKind,
    Site,
    no_tracks,
)

AZIMUTH, ELEVATION, UP = 1, 2, 6


def radar(sigma_range: float = 50.0, sigma_azimuth: float = np.radians(0.1), **extra: object) -> Sensor:
    sigma = np.full(7, np.nan)
    sigma[:2] = sigma_range, sigma_azimuth
    values: dict[str, object] = {"period": 4.0, "coverage": Coverage(range=(0.0, 200e3)), "clutter_per_scan": 0.2}
    return Sensor("radar", SensorKind.RADAR, sigma=sigma, **{**values, **extra})  # type: ignore[arg-type]


def with_elevation(sigma: float = np.radians(0.1)) -> Sensor:
    out = replace(radar(), id="tall")
    out.sigma[ELEVATION] = sigma
    return out


class Seen(NamedTuple):
    error: FloatArray  # (n, 3) m, of the track shown
    covariance: FloatArray  # (n, 3, 3)
    parts: FloatArray  # (n,) heights in use
    state: TrackerState

    def nees(self, d: int = 3) -> FloatArray:
        off, P = self.error[:, :d], self.covariance[:, :d, :d]
        return np.einsum("na,nab,nb->n", off, np.linalg.inv(P), off)


def watch(
    sensors: tuple[Sensor, ...],
    start: list[float],
    velocity: list[float],
    seed: int,
    looks: int = 50,
    turn: list[int] | None = None,
    site_height: float = 0.0,
    height: bool = False,
    east: float = 0.0,
    after: int = 3,
) -> Seen:
    """One target, seen every 4 s by one sensor after the other, or by those that `turn` names look by look.

    The second sensor stands `east` (m) of the site; with `height` each report has the target's.
    """
    t = np.arange(-10.0, 4.0 * looks + 10.0)
    still = np.zeros((len(t), 3))
    far = PlatformTrack("far", t, still + [east, 0.0, 0.0], still, still, np.zeros(len(t)), np.zeros(len(t)))
    placed = [s if i == 0 else replace(s, platform="far", axes=Axes.PLATFORM_ENU) for i, s in enumerate(sensors)]
    used = Tracker(TrackerConfig(q=0.1), tuple(placed), 3, {"far": pose_track(far)}, site_height=site_height)
    rng, state = np.random.default_rng(seed), used.init()
    error, covariance, parts = [], [], []
    for k in range(looks):
        t = 4.0 * k
        i = turn[k] if turn is not None else k % len(sensors)
        place = np.array(start) + t * np.array(velocity)
        off = place - [east * i, 0.0, 0.0]
        r = float(np.linalg.norm(off))
        full = np.array([r, np.arctan2(off[0], off[1]), np.arcsin(off[2] / r), 0.0, *off])
        sigma = sensors[i].sigma.copy()
        if height:
            sigma[UP] = 30.0
        z = np.where(np.isfinite(sigma), full + rng.standard_normal(7) * np.nan_to_num(sigma), np.nan)
        R = np.diag(sigma**2)
        R[np.isnan(sigma)] = np.nan
        R[:, np.isnan(sigma)] = np.nan
        state, _ = used.step(state, Scan(i, t, t, np.array([t]), z[None], R[None], np.array([k])))
        tr = state.window.tracks
        if k >= after:
            assert tr.live[0] == 1
            assert tr.life[0, 2] > 0.0
            error.append(tr.x[0, :3] - place)
            covariance.append(tr.P[0, :3, :3].copy())
            parts.append(0 if tr.mode is None else np.count_nonzero(tr.mode[0]))
    return Seen(np.array(error), np.array(covariance), np.array(parts, float), state)


@pytest.mark.parametrize(
    ("height", "ground"), [(3e3, 30e3), (10e3, 100e3), (10e3, 30e3), (10e3, 15e3), (1.5e3, 9e3), (7e3, 60e3)]
)
def test_one_radar_is_honest_in_the_plane_and_in_height(height: float, ground: float) -> None:
    """Twelve runs in as many directions; one Gaussian at the middle of the coverage had a NEES up to 5,383.

    A run's height is one draw of the prior, so that its NEES is right within a factor of some four.
    """
    medians, plane = [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        a, c = rng.uniform(0.0, 2.0 * np.pi, 2)
        velocity = 200.0 * np.array([np.sin(c), np.cos(c), 0.0])
        start = np.array([ground * np.sin(a), ground * np.cos(a), height]) - 100.0 * velocity
        seen = watch((radar(),), start.tolist(), velocity.tolist(), seed)
        medians.append(float(np.median(seen.nees())))
        plane.append(float(np.median(seen.nees(2))))
        assert np.linalg.eigvalsh(seen.covariance).min() > 0.0
    assert 0.4 < np.median(medians) < 4.5
    assert max(medians) < 15.0
    assert 0.25 < np.median(plane) < 3.0


def test_a_height_makes_the_heights_one_and_they_spread_again_without_it() -> None:
    """Ten looks without elevation, ten with, then none for 120 s: known, then as wide as the climb may have been."""
    both = radar(), with_elevation()
    seen = watch(both, [20e3, 5e3, 6e3], [-120.0, 60.0, 0.0], 3, turn=[0] * 10 + [1] * 10 + [0] * 30)
    sigma = np.sqrt(seen.covariance[:, 2, 2])
    assert (sigma[:6] > 1500.0).all()
    assert (seen.parts[:6] > 1).all()
    assert sigma[16] < 60.0
    assert seen.parts[16] == 1
    assert sigma[-1] > 2.0 * sigma[16]
    assert np.median(seen.nees()[8:]) < 6.0


def test_a_second_radar_elsewhere_finds_the_height() -> None:
    """Slant ranges from two places 30 km apart meet at one height, as a filter that began there would have it."""
    medians, sigma = [], []
    for seed in range(8):
        sensors = radar(), replace(radar(), id="east")
        seen = watch(sensors, [9e3, 12e3, 8e3], [-30.0, -40.0, 0.0], seed, looks=60, east=30e3)
        medians.append(float(np.median(seen.nees())))
        sigma.append(float(np.sqrt(seen.covariance[-1, 2, 2])))
    assert 1.0 < np.median(medians) < 4.5
    assert max(sigma) < 300.0


def test_a_declared_height_is_the_prior_and_stays_it() -> None:
    """Boats on the water, 6 km from a radar on a mast: a height of 0 ± 3 m above the ellipsoid, the site at 40 m."""
    sea = radar(10.0, np.radians(0.3), height=(0.0, 3.0))
    seen = watch((sea,), [-3e3, 5e3, -40.0], [9.0, 6.0, 0.0], 5, looks=100, site_height=40.0, after=30)
    sigma = np.sqrt(seen.covariance[:, 2, 2])
    assert (sigma < 12.0).all()
    assert (np.abs(seen.error[:, 2]) < 12.0).all()
    assert np.median(seen.nees(2)) < 3.5
    assert (seen.parts == 1).all()


def test_a_height_beside_range_and_azimuth_counts() -> None:
    """As transponders give it: no arc is left."""
    seen = watch((radar(),), [20e3, 5e3, 6e3], [-120.0, 60.0, 0.0], 4, height=True)
    assert (np.sqrt(seen.covariance[:, 2, 2]) < 40.0).all()
    assert 0.8 < np.median(seen.nees()) < 4.5


def test_with_two_models_of_motion_each_height_has_both() -> None:
    sensors = (radar(),)
    used = Tracker(TrackerConfig(q=0.1, q_manoeuvre=50.0), sensors, 3)
    assert used.plan.models is not None
    assert (used.plan.models.motions, used.plan.models.heights) == (2, 10)
    rng, state = np.random.default_rng(1), used.init()
    for k in range(20):
        t = 4.0 * k
        place = np.array([15e3 - 100.0 * t, 8e3, 5e3])
        z, R = np.full((1, 7), np.nan), np.full((1, 7, 7), np.nan)
        z[0, 0] = np.linalg.norm(place) + 50.0 * rng.standard_normal()
        z[0, 1] = np.arctan2(place[0], place[1]) + np.radians(0.1) * rng.standard_normal()
        R[0, 0, 0], R[0, 1, 1], R[0, 0, 1], R[0, 1, 0] = 2500.0, np.radians(0.1) ** 2, 0.0, 0.0
        state, _ = used.step(state, Scan(0, t, t, np.array([t]), z, R, np.array([k])))
        tr = state.window.tracks
        w, x, P = tr.mode[0], tr.mode_x[0], tr.mode_P[0]
        active = w > 0.0
        assert w.sum() == pytest.approx(1.0)
        assert ((w[0::2] > 0.0) == (w[1::2] > 0.0)).all()
        mean = w[active] @ x[active]
        np.testing.assert_allclose(tr.x[0], mean, rtol=1e-9, atol=1e-6)
        gap = x[active] - mean
        total = np.einsum("j,jab->ab", w[active], P[active]) + np.einsum("j,ja,jb->ab", w[active], gap, gap)
        np.testing.assert_allclose(tr.P[0], total, rtol=1e-7, atol=1e-4)
    off = tr.x[0, :3] - place
    assert off @ np.linalg.solve(tr.P[0, :3, :3], off) < 15.0


def test_in_two_dimensions_and_with_elevation_there_is_one_height() -> None:
    assert Tracker(TrackerConfig(), (radar(),), 2).plan.models is None
    assert Tracker(TrackerConfig(), (with_elevation(),), 3).plan.models is None


def test_rows_whose_height_nobody_told_are_said() -> None:
    """Two rows of 3 km and 50 m; with 0 ± 3 m declared, 50 m is no better than that, and 0.5 m is."""
    n = 3
    covariance = np.tile(np.eye(3), (n, 1, 1))
    covariance[:, 2, 2] = [3000.0**2, 50.0**2, 0.5**2]
    rows = replace(
        no_tracks(), t=np.zeros(n), t_known=np.zeros(n), track_id=np.ones(n, np.int64), covariance=covariance
    )
    none, whole, wide = np.zeros(0), np.zeros(0, np.int64), np.zeros((0, 7))
    empty = Detections(none, none, whole, whole, wide, wide, {})
    recording = Recording("r", 3, Site(0.8, 0.1, 0.0), (radar(),), empty, (), (), (), np.zeros(0, np.bool_))
    assert height_not_observed(recording, rows).tolist() == [True, False, False]
    lines = told_of_heights(recording, rows)
    assert lines[0].startswith("radar: height not observed")
    assert lines[1].startswith("height not observed in 33 % of the rows")
    sea = replace(recording, sensors=(radar(height=(0.0, 3.0)),))
    assert height_not_observed(sea, rows).tolist() == [True, True, False]
    assert "0 ± 3 m above the ellipsoid" in told_of_heights(sea, rows)[0]
    for silent in (replace(recording, dimensions=2), replace(recording, sensors=(with_elevation(),))):
        assert told_of_heights(silent, rows) == []
        assert not height_not_observed(silent, rows).any()
