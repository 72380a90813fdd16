"""The MSC filter: its prior, hand-over to Cartesian, and whether range is known."""

from __future__ import annotations

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.filters import ekf, stream
from boresight.filters.msc import MscFilter, to_cartesian, to_msc, to_world
from boresight.kernels.msc import msc_from_world
from boresight.models import Infrared, NearlyConstantVelocity, Radar, SensorPose

MSC = MscFilter()
OWN = np.array([10.0, -20.0, 5.0, 3.0, 100.0, 1.0])


def test_prior_from_a_direction_has_the_moments_of_its_draws() -> None:
    rng = np.random.default_rng(1)
    n, s, velocity = 400_000, 0.4, np.array([-30.0, -60.0, 2.0])
    state = MSC.from_direction(0.0, 0.7, 0.3, 1e-4, 2000.0, s, 20.0, OWN, velocity)
    r = np.exp(np.log(2000.0) - s * s / 2 + s * rng.normal(size=n))
    u = np.array([np.cos(0.3) * np.sin(0.7), np.cos(0.3) * np.cos(0.7), np.sin(0.3)])
    world = np.c_[r[:, None] * u + OWN[:3], velocity + 20.0 * rng.normal(size=(n, 3))]
    y = np.array([msc_from_world(x, OWN) for x in world[:100_000]])
    scale = np.sqrt(np.diag(state.Py))
    # 100,000 draws: means within 4/sqrt(1e5) = 1.3 % of a sigma, covariances of a skew distribution within 5 %
    assert np.abs((y.mean(axis=0) - state.y) / scale)[[1, 3, 4, 5]].max() < 0.02
    rates = np.ix_([1, 3, 4, 5], [1, 3, 4, 5])
    correlation = (np.cov(y.T) / np.outer(scale, scale))[rates]
    np.testing.assert_allclose(correlation, (state.Py / np.outer(scale, scale))[rates], atol=0.05)


def test_hand_over_leaves_nees_unchanged_and_waits_for_range() -> None:
    rng = np.random.default_rng(2)
    prior = ekf.init(0.0, np.array([700.0, 1500, 300, 10, -20, 0]), np.diag([25.0, 100, 25, 9, 9, 9]))
    state = to_msc(prior, OWN)
    np.testing.assert_allclose(state.x, prior.x, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(state.P, prior.P, atol=1e-8)
    assert state.range_observable
    truth = prior.x + rng.normal(size=6) * np.sqrt(np.diag(prior.P)) * 0.3
    back = to_cartesian(state)
    e_world, e_msc = truth - back.x, msc_from_world(truth, OWN) - state.y
    nees_world, nees_msc = e_world @ np.linalg.solve(back.P, e_world), e_msc @ np.linalg.solve(state.Py, e_msc)
    assert nees_world == pytest.approx(nees_msc, rel=0.05)
    unknown = MSC.from_direction(0.0, 0.7, 0.3, 1e-3, 2000.0, 0.6, 20.0, OWN)
    assert not unknown.range_observable
    with pytest.raises(UserError, match="range is not observable yet"):
        to_cartesian(unknown)


def test_radar_range_makes_the_hand_over_consistent() -> None:
    """Infrared alone, then radar range: NEES stays that of chi-square before and after, 200 runs."""
    rng = np.random.default_rng(3)
    before, after = [], []
    ir, radar, motion = Infrared(5e-4, 5e-4), Radar(sigma_range=5.0), NearlyConstantVelocity(0.1)
    for _ in range(200):
        s = 0.4
        r = np.exp(np.log(3000.0) - s * s / 2 + s * rng.normal())
        u = np.array([0.3, 0.9, 0.1]) / np.linalg.norm([0.3, 0.9, 0.1])
        angles = np.array([np.arctan2(u[0], u[1]), np.arcsin(u[2])])
        truth = np.r_[r * u, rng.normal(size=3) * 20.0]
        first = angles + rng.normal(size=2) * 5e-4
        state = MSC.from_direction(0.0, first[0], first[1], 5e-4, 3000.0, s, 20.0, np.zeros(6))
        for k in range(1, 60):
            x, _, Q = motion.move(truth, 0.1)
            truth = x + np.linalg.cholesky(Q) @ rng.normal(size=6)
            state = MSC.predict(state, motion, 0.1 * k)
            state, _ = MSC.update(state, ir, ir.h(truth) + rng.normal(size=2) * 5e-4)
            if k == 50:
                assert not state.range_observable
                error = msc_from_world(truth, state.own) - state.y
                before.append(error @ np.linalg.solve(state.Py, error))
            if k > 50:
                state, _ = MSC.update(state, radar, radar.h(truth) + rng.normal(size=1) * 5.0)
        handed = to_cartesian(state)
        error = truth - handed.x
        after.append(error @ np.linalg.solve(handed.P, error))
    # 200 runs of 6 degrees of freedom: ANEES has a deviation of sqrt(12/200) = 0.25; four of them. Before, 1/r is
    # lognormal and not Gaussian, which shows: up to half as much again
    assert 5.0 < np.mean(after) < 7.0
    assert 4.0 < np.mean(before) < 9.0


def test_stream_equals_steps_and_its_smoother_the_cartesian_one() -> None:
    """Well-known range, so that both linearise alike; the target passes south, where azimuth wraps."""
    rng = np.random.default_rng(4)
    motion, radar = NearlyConstantVelocity(0.05), Radar(1.0, 1e-3, 1e-3)
    t = np.arange(1, 81) * 0.5
    own = np.array([[0.0, 2.0 * s, 0.0, 0.0, 2.0, 0.0] for s in t])
    sensors = [radar.at(SensorPose(o[:3], o[3:], np.eye(3))) for o in own]
    truth = [np.array([300.0 - 15 * s, -400.0, 60.0, -15, 0, 0]) for s in t]
    z = [s.h(x) + rng.normal(size=3) * [1.0, 1e-3, 1e-3] for s, x in zip(sensors, truth)]
    prior = ekf.init(0.0, np.array([302.0, -401, 61, -14, 0, 0]), np.diag([9.0, 9, 9, 4, 4, 4]))
    reports, begin = stream.stack(t, sensors, z), to_msc(prior, np.array([0.0, 0, 0, 0, 2.0, 0]))
    out, state = MSC.run(begin, motion, reports, own), begin
    for k, now in enumerate(t):
        state, _ = MSC.update(MSC.predict(state, motion, now, own[k]), sensors[k], z[k])
        np.testing.assert_allclose(
            to_world(out.x[k : k + 1], out.P[k : k + 1], own[k : k + 1])[0][0], state.x, rtol=1e-9
        )
    smoothed = to_world(*stream.smooth(out), own)
    cartesian = stream.smooth(stream.run(prior, motion, reports))
    scale = np.sqrt(np.einsum("kii->ki", cartesian[1]))
    assert np.abs((smoothed[0] - cartesian[0]) / scale).max() < 0.1
    np.testing.assert_allclose(np.einsum("kii->ki", smoothed[1]), scale**2, rtol=0.05)
    with pytest.raises(UserError, match="one position and velocity a report"):
        MSC.run(begin, motion, reports, own[:3])


def test_mistakes_are_named() -> None:
    with pytest.raises(UserError, match="sigma_log_range"):
        MSC.from_direction(0.0, 0.0, 0.0, 1e-3, 100.0, 0.0, 1.0, OWN)
    with pytest.raises(UserError, match="at the observer"):
        to_msc(ekf.init(0.0, OWN, np.eye(6)), OWN)
    state = MSC.from_direction(0.0, 0.7, 0.3, 1e-3, 2000.0, 0.6, 20.0, OWN)
    with pytest.raises(UserError, match="3 dimensions"):
        MSC.update(state, Infrared(0.1, dimensions=2).at(SensorPose()), np.array([0.0]))
