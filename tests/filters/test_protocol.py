"""One test over all filters: steps equal streams, linear problems equal the Kalman filter, covariances stay sound."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.filters import ekf, stream
from boresight.filters.extended import ExtendedKalman
from boresight.filters.msc import MscFilter
from boresight.filters.ukf import UnscentedKalman
from boresight.models import Infrared, NearlyConstantAcceleration, NearlyConstantVelocity, Position, Radar, SensorPose

FILTERS = [
    ExtendedKalman(),
    ExtendedKalman(iterations=10),
    UnscentedKalman(),
    UnscentedKalman(alpha=0.5, beta=2.0, kappa=1.0),
    MscFilter(),
]
LINEAR = FILTERS[:4]
PRIOR = np.array([900.0, 500, 80, -10, 5, 0]), np.diag([400.0, 400, 400, 100, 100, 100])


def reports(rng: np.random.Generator, k: int) -> list[tuple[float, Any, np.ndarray]]:
    out, t = [], 0.0
    for i in range(k):
        t += float(rng.uniform(0.0, 0.2))
        truth = np.array([900 - 10 * t, 500 + 5 * t, 80.0, -10, 5, 0])
        pose = SensorPose(position=np.array([2.0 * t, 0.0, 0.0]), velocity=np.array([2.0, 0.0, 0.0]))
        sensor = (Radar(5.0, 0.01, 0.01, 0.5) if i % 3 == 0 else Infrared(2e-3, 2e-3)).at(pose)
        out.append((t, sensor, sensor.h(truth) + rng.normal(size=sensor.dimension) * np.sqrt(np.diag(sensor.R(truth)))))
    return out


@pytest.mark.parametrize("filter_", LINEAR)
def test_linear_problem_equals_the_kalman_filter(filter_: Any) -> None:
    rng = np.random.default_rng(1)
    motion, sensor = NearlyConstantVelocity(0.5), Position(2.0)
    state, plain = filter_.init(0.0, *PRIOR), ekf.init(0.0, *PRIOR)
    for k in range(50):
        z = rng.normal(size=3) * 20 + PRIOR[0][:3]
        state, info = filter_.update(filter_.predict(state, motion, 0.3 * k), sensor, z)
        plain, seen = ekf.update(ekf.predict(plain, motion, 0.3 * k), sensor, z)
        np.testing.assert_allclose(state.x, plain.x, rtol=1e-12, atol=1e-11)
        np.testing.assert_allclose(state.P, plain.P, rtol=1e-11, atol=1e-11)
        assert info.nis == pytest.approx(seen.nis, rel=1e-9)


@pytest.mark.parametrize("filter_", FILTERS)
def test_all_follow_a_target_and_stay_sound(filter_: Any) -> None:
    motion = NearlyConstantVelocity(0.1)
    state = filter_.init(0.0, *PRIOR)
    for t, sensor, z in reports(np.random.default_rng(2), 400):
        state, _ = filter_.update(filter_.predict(state, motion, t), sensor, z)
        assert np.array_equal(state.P, state.P.T)
        assert np.linalg.eigvalsh(state.P)[0] > 0.0
    truth = np.array([900 - 10 * t, 500 + 5 * t, 80.0, -10, 5, 0])
    error = state.x - truth
    assert error @ np.linalg.solve(state.P, error) < 22.5  # chi-square, 6 degrees of freedom, 99.9 %


def test_20000_reports_stay_positive_definite_in_every_stream() -> None:
    """A target that circles at 3 km, radar every fifth report and infrared between, through EKF, iterated, UKF, MSC."""
    rng = np.random.default_rng(6)
    t = np.cumsum(rng.uniform(0.005, 0.04, 20_000))
    path = np.stack([3000 * np.cos(0.05 * t), 3000 * np.sin(0.05 * t), np.full(len(t), 500.0)], axis=1)
    radar, infrared = Radar(10.0, 5e-3, 5e-3), Infrared(5e-4, 5e-4)
    sensors = [radar if k % 5 == 0 else infrared for k in range(len(t))]
    sigma = {3: np.array([10.0, 5e-3, 5e-3]), 2: np.array([5e-4, 5e-4])}
    still = np.zeros(3)
    z = [s.h(np.r_[p, still]) + sigma[s.dimension] * rng.normal(size=s.dimension) for s, p in zip(sensors, path)]
    prior = ekf.init(0.0, np.array([3000.0, 0, 500, 0, 150, 0]), np.diag([1e4, 1e4, 1e4, 2500, 2500, 2500]))
    motion, reports = NearlyConstantVelocity(5.0), stream.stack(t, sensors, z)
    msc = MscFilter()
    streams = {
        "ekf": stream.run(prior, motion, reports),
        "iekf": stream.run(prior, motion, reports, iterations=5),
        "ukf": UnscentedKalman(2.0, 2.0, -3.0).run(prior, motion, reports),
        "msc": msc.run(msc.init(0.0, prior.x, prior.P), motion, reports, np.zeros((len(t), 6))),
    }
    for name, out in streams.items():
        assert np.array_equal(out.P, out.P.transpose(0, 2, 1)), name
        scale = np.sqrt(np.einsum("kii->ki", out.P))  # MSC mixes 1/m and rad/s: look at correlations
        assert np.linalg.eigvalsh(out.P / scale[:, :, None] / scale[:, None, :]).min() > 0.0, name
        smoothed = stream.smooth(out)[1]
        scale = np.sqrt(np.einsum("kii->ki", smoothed))
        assert np.linalg.eigvalsh(smoothed / scale[:, :, None] / scale[:, None, :]).min() > 0.0, name


@pytest.mark.parametrize("filter_", FILTERS)
def test_accelerations_ride_along(filter_: Any) -> None:
    motion = NearlyConstantAcceleration(0.01)
    state = filter_.init(0.0, np.r_[PRIOR[0], 0, 0, 0], np.diag([*np.diag(PRIOR[1]), 1.0, 1.0, 1.0]))
    for t, sensor, z in reports(np.random.default_rng(3), 200):
        state, _ = filter_.update(filter_.predict(state, motion, t), sensor, z)
    truth = np.array([900 - 10 * t, 500 + 5 * t, 80.0])
    assert np.linalg.norm(state.x[:3] - truth) < 10.0


def test_unscented_steps_equal_the_stream() -> None:
    motion, ukf = NearlyConstantVelocity(0.1), UnscentedKalman(0.7, 2.0, 0.5)
    rows = reports(np.random.default_rng(4), 100)
    out = ukf.run(ukf.init(0.0, *PRIOR), motion, stream.stack(*map(list, zip(*rows))))
    state = ukf.init(0.0, *PRIOR)
    for k, (t, sensor, z) in enumerate(rows):
        state, info = ukf.update(ukf.predict(state, motion, t), sensor, z)
        np.testing.assert_allclose(out.x[k], state.x, rtol=1e-9)
        assert out.nis[k] == pytest.approx(info.nis, rel=1e-7)


def test_iterated_steps_equal_the_stream() -> None:
    motion, filter_ = NearlyConstantVelocity(0.1), ExtendedKalman(5)
    rows = reports(np.random.default_rng(5), 100)
    out = stream.run(ekf.init(0.0, *PRIOR), motion, stream.stack(*map(list, zip(*rows))), iterations=5)
    state = filter_.init(0.0, *PRIOR)
    for k, (t, sensor, z) in enumerate(rows):
        state, _ = filter_.update(filter_.predict(state, motion, t), sensor, z)
        np.testing.assert_allclose(out.x[k], state.x, rtol=1e-8, atol=1e-6)  # both stop at 1e-9 of the cost


@pytest.mark.parametrize("filter_", FILTERS)
def test_mistakes_are_named(filter_: Any) -> None:
    state = filter_.init(1.0, *PRIOR)
    with pytest.raises(UserError, match="backwards"):
        filter_.predict(state, NearlyConstantVelocity(1.0), 0.5)
    with pytest.raises(UserError, match="no component"):
        filter_.update(state, Infrared(0.1, 0.1), np.array([np.nan, np.nan]))
    with pytest.raises(UserError, match="not positive definite"):
        filter_.init(0.0, PRIOR[0], -PRIOR[1])
    with pytest.raises(UserError, match="finite"):
        filter_.init(0.0, PRIOR[0] * np.nan, PRIOR[1])


def test_settings_are_checked() -> None:
    for make in (lambda: ExtendedKalman(0), lambda: UnscentedKalman(alpha=0.0), lambda: UnscentedKalman(kappa=np.nan)):
        with pytest.raises(UserError):
            make()
    with pytest.raises(UserError, match="leaves no spread"):
        UnscentedKalman(kappa=-6.0).init(0.0, *PRIOR)
