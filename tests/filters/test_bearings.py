"""Bearings-only initiation: a track where the own ship weaves, none where it flies straight."""

from __future__ import annotations

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.filters.bearings import BearingsOnly
from boresight.models import Infrared, NearlyConstantVelocity, SensorPose
from boresight.types.state import GaussianState


def fly(weaving: bool, rng: np.random.Generator) -> tuple[GaussianState | None, np.ndarray]:
    """Own ship at 100 m/s north, weaving with ±20 m/s² or not; infrared at 10 Hz for 12 s."""
    motion, ir = NearlyConstantVelocity(0.01), Infrared(5e-4, 5e-4)
    r = np.exp(np.log(3000.0) - 0.18 + 0.6 * rng.normal())
    truth = np.r_[r * np.array([0.35, 0.9, 0.25]), rng.normal(size=3) * 50.0]
    own = np.array([0.0, 0, 0, 0, 100.0, 0])
    begin = BearingsOnly(3000.0, 0.6, 50.0)
    z = ir.h(truth) + rng.normal(size=2) * 5e-4
    state = begin.init(0.0, z[0], z[1], 5e-4, own)
    for k in range(1, 121):
        a = 20.0 * (1 if (k - 1) % 60 < 30 else -1) if weaving else 0.0
        own = own + np.r_[0.1 * own[3:] + [0.005 * a, 0, 0], [0.1 * a, 0, 0]]
        truth = motion.transition(truth, 0.1)
        sensor = ir.at(SensorPose(own[:3], own[3:], np.eye(3)))
        z = sensor.h(truth) + rng.normal(size=2) * 5e-4
        state, track = begin.step(state, motion, 0.1 * k, own, sensor, z)
        if track is not None:
            return track, truth
    return None, truth


def test_a_track_where_range_is_observable_and_none_where_not() -> None:
    rng = np.random.default_rng(1)
    begun = [fly(True, rng) for _ in range(40)]
    consistency = []
    for track, truth in begun:
        assert track is not None
        error = track.x - truth
        consistency.append(error @ np.linalg.solve(track.P, error))
    # chi-square of 6 degrees of freedom has its median at 5.35; the median of 40 has a deviation of 0.7, three of them.
    # The prior of a target a third as far as expected is far from Gaussian in MSC too: a few such runs are too sure
    assert 3.2 < np.median(consistency) < 7.5
    assert np.mean(np.array(consistency) < 22.5) >= 0.9
    assert all(fly(False, rng)[0] is None for _ in range(40))


def test_mistakes_are_named() -> None:
    with pytest.raises(UserError, match="sigma_velocity"):
        BearingsOnly(sigma_velocity=-1.0)
