"""The bound equals the Kalman filter's covariance where all is linear, and orders as theory says where it is not."""

from __future__ import annotations

import numpy as np

from boresight.bounds import trajectory_bound, unconditional_bound
from boresight.filters import ekf, stream
from boresight.models import Infrared, NearlyConstantVelocity, Position, Radar

MOTION = NearlyConstantVelocity(q=0.5)
T = np.arange(1, 31) * 0.5
P0 = np.diag([100.0, 100, 100, 25, 25, 25])


def paths(rng: np.random.Generator, runs: int) -> tuple[np.ndarray, np.ndarray]:
    start = np.array([300.0, 400, 50, -8, 2, 0]) + rng.normal(size=(runs, 6)) * np.sqrt(np.diag(P0))
    F, root = MOTION.F(start[0], 0.5), np.linalg.cholesky(MOTION.Q(start[0], 0.5))
    x, out = start, np.empty((runs, len(T), 6))
    for k in range(len(T)):
        x = x @ F.T + rng.normal(size=(runs, 6)) @ root.T
        out[:, k] = x
    return start, out


def test_linear_bound_is_the_kalman_filter_and_smoother() -> None:
    start, truth = paths(np.random.default_rng(7), 1)
    reports = stream.stack(T, [Position(3.0)] * len(T), list(truth[0, :, :3]))
    out = stream.run(ekf.init(0.0, np.zeros(6), P0), MOTION, reports)
    prior = ekf.init(0.0, start[0], P0)
    np.testing.assert_allclose(trajectory_bound(prior, MOTION, reports, truth[0]), out.P, rtol=1e-12, atol=1e-13)
    for lag in (1.0, None):
        smoothed = stream.smooth(out, lag)[1]
        # one is dense, the other straight-line algebra: elements that cancel agree to rounding of those that do not
        bound = trajectory_bound(prior, MOTION, reports, truth[0], lag)
        np.testing.assert_allclose(bound, smoothed, rtol=1e-12, atol=1e-13)
    unconditional = unconditional_bound(prior, MOTION, reports, truth, start)
    np.testing.assert_allclose(unconditional, out.P, rtol=1e-8, atol=1e-10)


def test_no_filter_beats_the_bound_and_the_unconditional_one_lies_below_it() -> None:
    rng = np.random.default_rng(8)
    runs = 60
    start, truth = paths(rng, runs)
    sensors = [Radar(5.0, 0.02, 0.02) if k % 3 == 0 else Infrared(2e-3, 2e-3) for k in range(len(T))]
    errors, bounds = [], []
    for run in range(runs):
        z = [s.h(x) + rng.normal(size=s.dimension) * np.sqrt(np.diag(s.R(x))) for s, x in zip(sensors, truth[run])]
        reports = stream.stack(T, sensors, z)
        out = stream.run(ekf.init(0.0, np.array([300.0, 400, 50, -8, 2, 0]), P0), MOTION, reports)
        errors.append(np.sum((out.x - truth[run])[10:, :3] ** 2, axis=1))
        bound = trajectory_bound(ekf.init(0.0, start[run], P0), MOTION, reports, truth[run])
        bounds.append(np.trace(bound[10:, :3, :3], axis1=1, axis2=2))
    # some 60 x 3 x 5 independent squares: the RMS ratio has a standard deviation of about 2.5 %; four of them
    ratio = np.sqrt(np.mean(errors) / np.mean(bounds))
    assert 0.9 < ratio < 1.1, ratio
    unconditional = unconditional_bound(ekf.init(0.0, start[0], P0), MOTION, reports, truth, start)
    assert np.trace(unconditional[10:, :3, :3], axis1=1, axis2=2).mean() < np.mean(bounds)
