"""What the looks teach of false detections."""

from __future__ import annotations

import numpy as np
import pytest

from boresight.kernels.tracker import AZIMUTH_BINS
from boresight.kernels.tracker_clutter import clutter_density, learn_clutter
from boresight.tracking.config import TrackerConfig
from boresight.tracking.core import make_plan
from boresight.tracking.window import empty_window
from boresight.types import Coverage, SensorKind
from tests.tracking.conftest import whole
from tests.tracking.test_rules import bearings, sensor

CLUTTER_DENSITY = whole(clutter_density)
LEARN_CLUTTER = whole(learn_clutter)
MEMORY = 30.0
PLAN = make_plan(
    TrackerConfig(clutter_memory=MEMORY),
    (
        sensor("eye", SensorKind.OPTICAL, clutter_per_scan=1.2),
        sensor("radar", clutter_per_scan=6.0, coverage=Coverage(range=(100.0, 500.0), azimuth=(-0.5, 1.0))),
    ),
    2,
)
NONE = np.zeros(3, np.int64)
FREE = np.full(3, -1)
ALL = np.ones(3, np.bool_)


def place(azimuth: float) -> int:
    return int((azimuth + np.pi) / (2.0 * np.pi) * AZIMUTH_BINS)


def test_false_bearings_are_learned_where_they_come_from() -> None:
    tracks = empty_window(PLAN).tracks
    look = bearings([1.0, 1.01, -2.0])
    for _ in range(50):
        LEARN_CLUTTER(tracks, PLAN.settings, PLAN.sensors[0], look, NONE, FREE, ALL)
    left = (1.0 - 1.0 / MEMORY) ** 50  # of what was declared; the rest is the mean of the looks
    known = tracks.clutter[0]
    assert known[AZIMUTH_BINS] == pytest.approx(3.0 * (1.0 - left) + 1.2 * left)
    expected = np.full(AZIMUTH_BINS, 1.2 / AZIMUTH_BINS * left)
    expected[place(1.0)] += 2.0 * (1.0 - left)
    expected[place(-2.0)] += 1.0 - left
    np.testing.assert_allclose(known[:AZIMUTH_BINS], expected)


def test_what_may_be_a_target_is_no_false_detection() -> None:
    """Nothing of what a shown track could claim; of what one took, the probability that the track is nothing."""
    tracks = empty_window(PLAN).tracks
    tracks.live[0] = 1
    tracks.weight[0] = 0.5, 0.1, 0.1, 0.3
    claims, taken = np.array([1, 1, 0]), np.array([0, -1, -1])
    LEARN_CLUTTER(tracks, PLAN.settings, PLAN.sensors[0], bearings([1.0, 2.0, -2.0]), claims, taken, ALL)
    before = 1.2 / AZIMUTH_BINS * (1.0 - 1.0 / MEMORY)
    learned = MEMORY * (tracks.clutter[0, [place(1.0), place(2.0), place(-2.0)]] - before)
    np.testing.assert_allclose(learned, [0.3, 0.0, 1.0], atol=1e-12)


def test_the_density_is_the_number_over_the_coverage() -> None:
    tracks = empty_window(PLAN).tracks
    z = np.full(7, np.nan)
    for azimuth in (-3.1, 0.0, 3.1):
        z[1] = azimuth
        per_rad = CLUTTER_DENSITY(tracks, PLAN.settings, PLAN.sensors[0], z, np.array([1]), 1)
        assert per_rad == pytest.approx(1.2 / (2.0 * np.pi))
    per_m2 = CLUTTER_DENSITY(tracks, PLAN.settings, PLAN.sensors[1], z, np.array([4, 5]), 2)
    assert per_m2 == pytest.approx(6.0 / (0.5 * (500.0**2 - 100.0**2) * 1.5))


def test_a_coverage_without_end_is_as_wide_as_twice_what_was_seen() -> None:
    """And at least what a target at the prior speed of 8 m/s covers in 100 s."""
    plan = make_plan(TrackerConfig(), (sensor("radar", clutter_per_scan=6.0),), 2)
    tracks, look = empty_window(plan).tracks, bearings([1.0, 2.0, 3.0])
    mask, z = np.array([4, 5]), np.full(7, np.nan)
    first = CLUTTER_DENSITY(tracks, plan.settings, plan.sensors[0], z, mask, 2)
    assert first == pytest.approx(6.0 / (np.pi * 800.0**2))
    look.z[1, 4:6] = 3000.0, -4000.0
    LEARN_CLUTTER(tracks, plan.settings, plan.sensors[0], look, NONE, FREE, ALL)
    then = CLUTTER_DENSITY(tracks, plan.settings, plan.sensors[0], z, mask, 2)
    assert then == pytest.approx(tracks.clutter[0, AZIMUTH_BINS] / (np.pi * 10_000.0**2))
