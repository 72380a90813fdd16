"""The stream kernels against the step-by-step filter, and the smoothers against the joint Gaussian."""

from __future__ import annotations

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.filters import ekf, stream
from boresight.models import Infrared, NearlyConstantVelocity, Position, Radar, SensorPose


def circling(rng: np.random.Generator, k: int = 300) -> tuple[np.ndarray, list[Radar], list[np.ndarray]]:
    """Radar and infrared in turn, from a ship on the move."""
    t = np.cumsum(rng.uniform(0.0, 0.1, k))
    sensors, z = [], []
    for i, now in enumerate(t):
        pose = SensorPose(position=np.array([3.0 * now, -2.0 * now, 5.0]), velocity=np.array([3.0, -2.0, 0.0]))
        sensor = (Radar(5.0, 0.01, 0.01, 0.5) if i % 4 == 0 else Infrared(1e-3, 1e-3)).at(pose)
        truth = np.array([800 + 10 * now, 600 - 20 * now, 100.0, 10, -20, 0])
        sensors.append(sensor)
        z.append(sensor.h(truth) + rng.normal(size=sensor.dimension) * np.sqrt(np.diag(sensor.R(truth))))
    return t, sensors, z


PRIOR = ekf.init(0.0, np.array([850.0, 550, 120, 0, 0, 0]), np.diag([2500.0, 2500, 2500, 400, 400, 400]))


def test_stream_equals_step_by_step() -> None:
    t, sensors, z = circling(np.random.default_rng(4))
    z[7][1] = np.nan
    motion = NearlyConstantVelocity(q=0.3)
    out = stream.run(PRIOR, motion, stream.stack(t, sensors, z))
    state = PRIOR
    for k, now in enumerate(t):
        state, info = ekf.update(ekf.predict(state, motion, now), sensors[k], z[k])
        np.testing.assert_allclose(out.x[k], state.x, rtol=1e-11, atol=1e-11)
        np.testing.assert_allclose(out.P[k], state.P, rtol=1e-11, atol=1e-12)
        assert (out.nis[k], out.dof[k]) == (pytest.approx(info.nis), len(info.y))


def joint(t: np.ndarray, R: float, z: np.ndarray, used: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance (plane, CV, q = 0.2) of every state given the first `used` reports, by one big Gaussian."""
    k = len(t)
    prior = ekf.init(0.0, np.array([1.0, 2, 3, 4]), np.diag([9.0, 9, 4, 4]))
    motion = NearlyConstantVelocity(q=0.2, dimensions=2)
    F, Q = motion.F(prior.x, t[1] - t[0]), motion.Q(prior.x, t[1] - t[0])
    A = np.eye(4 * (k + 1)) - np.kron(np.eye(k + 1, k=-1), F)
    noise = np.kron(np.eye(k + 1), Q)
    noise[:4, :4] = prior.P
    inverse = np.linalg.inv(A)
    mean, cov = inverse @ np.r_[prior.x, np.zeros(4 * k)], inverse @ noise @ inverse.T
    H = np.kron(np.eye(k + 1)[1 : used + 1], np.eye(2, 4))
    K = cov @ H.T @ np.linalg.inv(H @ cov @ H.T + R * np.eye(2 * used))
    mean = mean + K @ (z[:used].ravel() - H @ mean)
    return mean.reshape(-1, 4)[1:], cov - K @ H @ cov


def test_smoothers_equal_the_joint_gaussian() -> None:
    rng = np.random.default_rng(5)
    t, z = np.arange(1, 13) * 0.7, rng.normal(size=(12, 2)) * 10
    sensor = Position(2.0, dimensions=2)
    prior = ekf.init(0.0, np.array([1.0, 2, 3, 4]), np.diag([9.0, 9, 4, 4]))
    out = stream.run(prior, NearlyConstantVelocity(q=0.2, dimensions=2), stream.stack(t, [sensor] * 12, list(z)))
    for lag, ahead in ((None, 99), (0.0, 0), (1.5, 2)):
        x, P = stream.smooth(out, lag)
        for k in range(12):
            mean, cov = joint(t, 4.0, z, min(12, k + 1 + ahead))
            np.testing.assert_allclose(x[k], mean[k], rtol=1e-9, atol=1e-9)
            at = slice(4 * (k + 1), 4 * (k + 2))
            np.testing.assert_allclose(P[k], cov[at, at], rtol=1e-9, atol=1e-9)


def test_iterated_equals_plain_where_linear_and_lowers_the_cost_where_not() -> None:
    rng = np.random.default_rng(6)
    sensor = Position(2.0)
    reports = stream.stack(np.arange(20.0), [sensor] * 20, list(rng.normal(size=(20, 3))))
    motion = NearlyConstantVelocity(q=0.3)
    plain, iterated = (stream.run(PRIOR, motion, reports, n) for n in (1, 10))
    np.testing.assert_allclose(iterated.x, plain.x, rtol=1e-9, atol=1e-9)
    # one sharp range report against a wide prior: the maximum a posteriori by brute force
    radar, wide = (
        Radar(sigma_range=0.1, dimensions=2),
        ekf.init(0.0, np.array([10.0, 0, 0, 0]), np.diag([25.0, 100, 1, 1])),
    )
    out = stream.run(wide, NearlyConstantVelocity(1e-9, 2), stream.stack([0.0], [radar], [np.array([5.0])]), 30)
    grid = np.stack(np.meshgrid(np.linspace(0, 12, 2401), np.linspace(-6, 6, 2401)), -1).reshape(-1, 2)
    cost = ((np.hypot(*grid.T) - 5) / 0.1) ** 2 + (grid[:, 0] - 10) ** 2 / 25 + grid[:, 1] ** 2 / 100
    best = grid[np.argmin(cost)]
    assert np.abs(out.x[0, :2] - best).max() < 0.01 or np.abs(out.x[0, :2] - best * [1, -1]).max() < 0.01


def test_mistakes_are_named() -> None:
    radar, z = Radar(1.0), np.array([10.0])
    with pytest.raises(UserError, match="at least one report"):
        stream.stack([], [], [])
    with pytest.raises(UserError, match="must not run backwards"):
        stream.stack([1.0, 0.5], [radar, radar], [z, z])
    with pytest.raises(UserError, match="cannot go past report 0"):
        stream.run(PRIOR, NearlyConstantVelocity(1.0), stream.stack([-1.0], [radar], [z]))
