"""Cut-offs from the noise, errors of every row, and words where truth and tracks do not meet."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.metrics.clock import clock_of
from boresight.metrics.score import default_cut_off, score
from boresight.types import Detections, Recording, Sensor, SensorKind, Site, TrackRows, Truth

RNG = np.random.default_rng(11)


def recording(sigma: float, truth_sigma: float | None = None, n: int = 200, start: float = 0.0) -> Recording:
    """One aircraft on a line, seen each second by a position sensor that declares `sigma` per axis (m)."""
    t = start + np.arange(float(n))
    position = np.stack([-20000.0 + 130.0 * (t - start), 8000.0 - 66.0 * (t - start), np.full(n, 5000.0)], axis=1)
    velocity = np.tile([130.0, -66.0, 0.0], (n, 1))
    z, s = np.full((n, 7), np.nan), np.full((n, 7), np.nan)
    z[:, 4:], s[:, 4:] = position, sigma
    sensor = Sensor("adsb", SensorKind.POSITION, sigma=s[0])
    d = Detections(t, t, np.zeros(n, np.int64), np.arange(n), z, s, {})
    known = None if truth_sigma is None else np.full(n, truth_sigma)
    truth = Truth("plane", t, position, velocity, known)
    return Recording("r", 3, Site(0.8, 0.1, 0.0), (sensor,), d, truth=(truth,), duplicates=np.zeros(n, dtype=bool))


def tracks(of: Recording, error: float, claimed: float, name: int = 1, shift: float = 0.0) -> TrackRows:
    """A track with independent errors of `error` m per axis that claims `claimed` m."""
    truth = of.truth[0]
    n = len(truth.t)
    position = truth.position + RNG.normal(0.0, error, (n, 3)) + shift
    covariance = np.tile(np.eye(3) * claimed**2, (n, 1, 1))
    ids, status = np.full(n, name), np.ones(n, np.uint8)
    return TrackRows(truth.t, truth.t, ids, status, position, truth.velocity, covariance)


def joined(*parts: TrackRows) -> TrackRows:
    return TrackRows(
        **{f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in dataclasses.fields(TrackRows)}
    )


@pytest.mark.parametrize(
    ("sigma", "truth_sigma", "cut_off"),
    [
        (2.0, None, 20.0),
        (4.0, None, 20.0),
        (4.1, None, 50.0),
        (25.0, None, 200.0),
        (100.0, None, 500.0),
        (2.0, 30.0, 200.0),
    ],
)
def test_the_cut_off_follows_from_the_noise(sigma: float, truth_sigma: float | None, cut_off: float) -> None:
    assert default_cut_off(recording(sigma, truth_sigma)) == pytest.approx(cut_off)


def test_a_radars_cut_off_is_that_of_its_range() -> None:
    r = recording(10.0)
    z, s = np.full((200, 7), np.nan), np.full((200, 7), np.nan)
    z[:, :2], s[:, :2] = (50000.0, 0.3), (20.0, math.radians(0.1))
    d = dataclasses.replace(r.detections, z=z, sigma=s)
    # across 87 m, along 20 m: 63 m per axis, five times that 316 m
    assert default_cut_off(dataclasses.replace(r, detections=d)) == pytest.approx(500.0)


def test_nees_counts_every_row_whatever_the_cut_off() -> None:
    """200 errors of 50 m per axis where 12.5 m is claimed: 3 * 16 = 48, +- 4 by chance (3 sigma), not cut at 20 m."""
    r = recording(12.5)
    rows = tracks(r, 50.0, 12.5)
    for cut_off in (None, 20.0, 60.0, 1000.0):
        ours = score(r, rows, cut_off=cut_off).rows[0]
        assert ours["nees_mean"] == pytest.approx(48.0, abs=9.0)
        assert ours["nees_rows"] == 200


def test_parallel_tracks_of_one_target_all_count_and_false_ones_do_not() -> None:
    r = recording(12.5)
    rows = joined(tracks(r, 12.5, 12.5, 1), tracks(r, 50.0, 12.5, 2), tracks(r, 10.0, 10.0, 3, shift=9000.0))
    ours = score(r, rows).rows[0]
    assert ours["nees_rows"] == 400
    assert ours["nees_mean"] == pytest.approx(0.5 * (3.0 + 48.0), abs=5.0)


def test_the_references_own_error_is_added() -> None:
    exact, rough = recording(50.0), recording(50.0, 100.0)
    rows = tracks(exact, 100.0, 1.0)
    assert score(exact, rows).rows[0]["nees_mean"] > 1e4
    assert score(rough, rows).rows[0]["nees_mean"] == pytest.approx(3.0, abs=0.5)


def test_the_empty_tracker_has_the_same_terms() -> None:
    r = recording(100.0)
    ours, empty = score(r, tracks(r, 60.0, 60.0)).rows[:2]
    assert set(ours) == set(empty)
    assert (ours["cut_off_m"], empty["cut_off_m"]) == (500.0, 500.0)
    assert (ours["gospa_order"], ours["gospa_alpha"]) == (2, 2)
    assert empty["gospa_rms_m"] == pytest.approx(500.0 / math.sqrt(2.0))
    assert ours["gospa_rms_m"] < 0.5 * empty["gospa_rms_m"]
    for bad in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(UserError, match="cut-off"):
            score(r, tracks(r, 1.0, 1.0), cut_off=bad)


def test_truth_and_tracks_that_do_not_meet_are_told() -> None:
    r = recording(10.0)
    late = dataclasses.replace(r, truth=(dataclasses.replace(r.truth[0], t=r.truth[0].t + 1e5),))
    assert "do not overlap in time" in score(late, tracks(r, 1.0, 1.0)).notes[0]
    assert "no track comes nearer" in score(r, tracks(r, 1.0, 1.0, shift=5e4)).notes[0]
    partly = dataclasses.replace(r, truth=(dataclasses.replace(r.truth[0], t=r.truth[0].t + 150.0),))
    assert any("only 25%" in n for n in score(partly, tracks(r, 1.0, 1.0)).notes)
    assert score(r, tracks(r, 1.0, 1.0)).notes == ()


def test_the_clock_grows_with_the_reports_and_not_with_their_span() -> None:
    t = np.r_[np.arange(0.0, 100.0), 1e12 + np.arange(0.0, 50.0)]
    clock = clock_of(t)
    assert len(clock) == 199 + 99
    assert clock[0] == 0.0
    np.testing.assert_allclose(np.diff(clock)[:198], 0.5)
    short = np.array([0.0, 599.0, 1000.0])  # silences below ten minutes are scored
    assert len(clock_of(short)) == 2001
