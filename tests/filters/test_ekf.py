"""The extended Kalman filter against the Kalman filter, a NumPy reference, and itself after 20,000 reports."""

from __future__ import annotations

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.filters import ekf
from boresight.models import Infrared, NearlyConstantVelocity, Position, Radar, SensorPose


def textbook(x, P, F, Q, H, R, z):  # type: ignore[no-untyped-def]
    """One cycle of the Kalman filter as every textbook has it."""
    x, P = F @ x, F @ P @ F.T + Q
    S = H @ P @ H.T + R
    K = P @ H.T @ np.linalg.inv(S)
    return x + K @ (z - H @ x), (np.eye(len(x)) - K @ H) @ P


def test_linear_problem_equals_the_kalman_filter() -> None:
    rng = np.random.default_rng(1)
    motion = NearlyConstantVelocity(q=0.5)
    R = np.array([[4.0, 1.0, 0.0], [1.0, 3.0, 0.5], [0.0, 0.5, 2.0]])
    sensor = Position(2.0, covariance=R)
    x, P = rng.normal(size=6), np.diag([100.0, 100, 100, 10, 10, 10])
    state = ekf.init(0.0, x, P)
    H = np.eye(3, 6)
    for k in range(200):
        dt = float(rng.uniform(0.01, 1.0))
        z = rng.normal(size=3) * 5
        F = np.eye(6) + dt * np.eye(6, k=3)
        Q = 0.5 * np.kron(np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]), np.eye(3))
        x, P = textbook(x, P, F, Q, H, R, z)
        state, info = ekf.update(ekf.predict(state, motion, state.t + dt), sensor, z)
        scale = max(1.0, float(np.abs(P).max()))
        assert np.abs(state.x - x).max() < 1e-12 * max(1.0, float(np.abs(x).max())), k
        assert np.abs(state.P - P).max() < 1e-12 * scale, k
        assert info.nis == pytest.approx(info.y @ np.linalg.solve(info.S, info.y), rel=1e-10)


def reference_h(x: np.ndarray, ship: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Range, azimuth, elevation and their Jacobian, written down independently."""
    e, n, u = x[:3] - ship
    rho = np.hypot(e, n)
    r = np.sqrt(e * e + n * n + u * u)
    h = np.array([r, np.arctan2(e, n), np.arctan2(u, rho)])
    H = np.zeros((3, 6))
    H[0, :3] = np.array([e, n, u]) / r
    H[1, :2] = np.array([n, -e]) / rho**2
    H[2, :3] = np.array([-u * e / rho, -u * n / rho, rho]) / r**2
    return h, H


def test_20000_reports_stay_positive_definite_and_agree_with_numpy() -> None:
    """Radar and infrared in turn from a moving ship, a target that circles so that nothing drifts out of sight."""
    rng = np.random.default_rng(2)
    motion = NearlyConstantVelocity(q=5.0)
    radar, infrared = Radar(10.0, 5e-3, 5e-3), Infrared(5e-4, 5e-4)
    x, P = np.array([3000.0, 0, 500, 0, 150, 0]), np.diag([1e4, 1e4, 1e4, 2500, 2500, 2500])
    state = ekf.init(0.0, x, P)
    t = 0.0
    for k in range(20_000):
        dt = float(rng.uniform(0.005, 0.04))
        t += dt
        angle = 0.05 * t
        ship = np.array([10.0 * np.sin(0.1 * t), 5.0 * t / 400.0, 0.0])
        target = np.array([3000 * np.cos(angle), 3000 * np.sin(angle), 500.0])
        sensor, rows = (radar, slice(0, 3)) if k % 5 == 0 else (infrared, slice(1, 3))
        R = sensor.R(x)
        z = reference_h(np.r_[target, 0, 0, 0], ship)[0][rows] + rng.normal(size=len(R)) * np.sqrt(np.diag(R))
        state, _ = ekf.update(ekf.predict(state, motion, state.t + dt), sensor.at(SensorPose(position=ship)), z)
        F = np.eye(6) + dt * np.eye(6, k=3)
        Q = 5.0 * np.kron(np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]), np.eye(3))
        x, P = F @ x, F @ P @ F.T + Q
        h, H = reference_h(x, ship)
        y, H = z - h[rows], H[rows]
        y[-2:] = (y[-2:] + np.pi) % (2 * np.pi) - np.pi
        S = H @ P @ H.T + R
        K = np.linalg.solve(S, H @ P).T
        A = np.eye(6) - K @ H
        x, P = x + K @ y, A @ P @ A.T + K @ R @ K.T
        P = (P + P.T) / 2
        assert np.array_equal(state.P, state.P.T)
        assert np.linalg.eigvalsh(state.P)[0] > 0.0, k
        if k % 50 == 0:
            np.testing.assert_allclose(state.x, x, rtol=1e-9, atol=1e-9 * 3000)
            np.testing.assert_allclose(state.P, P, rtol=1e-9, atol=1e-9 * float(np.abs(P).max()))
    np.testing.assert_allclose(state.x, x, rtol=1e-9, atol=1e-9 * 3000)


def test_considered_states_widen_but_do_not_move() -> None:
    """A constant bias that is considered: the covariance stays that of the actual error (checked by Monte Carlo)."""

    class BiasedPosition:
        dimension = 1

        def innovation(self, z: np.ndarray, x: np.ndarray) -> np.ndarray:
            return z - x[:1] - x[1:]

        def H(self, x: np.ndarray) -> np.ndarray:
            return np.array([[1.0, 1.0]])

        def R(self, x: np.ndarray) -> np.ndarray:
            return np.array([[0.25]])

    rng = np.random.default_rng(3)
    errors = []
    for _ in range(2000):
        truth, bias = rng.normal(0, 3.0), rng.normal(0, 0.5)
        state = ekf.init(0.0, np.zeros(2), np.diag([9.0, 0.25]))
        for _ in range(10):
            z = np.array([truth + bias + rng.normal(0, 0.5)])
            state, _ = ekf.update(state, BiasedPosition(), z, n_estimated=1)
        errors.append(state.x[0] - truth)
        assert state.x[1] == 0.0
        assert state.P[1, 1] == pytest.approx(0.25)
    # 2000 runs: a variance ratio has a standard deviation of sqrt(2/2000) = 0.032; four of them
    assert np.mean(np.square(errors)) / state.P[0, 0] == pytest.approx(1.0, abs=0.13)


def test_targets_below_the_horizon_and_straight_above() -> None:
    """A sensor that looks down measures negative elevations; straight above, azimuth says nothing and is left out."""
    infrared = Infrared(1e-3, 1e-3)
    below = ekf.init(0.0, np.array([100.0, 50, -400, 0, 0, 0]), np.diag([100.0] * 6))
    z = infrared.h(np.array([102.0, 50, -400, 0, 0, 0]))
    assert z[1] < -1.2
    after, _ = ekf.update(below, infrared, z)
    assert after.x[0] == pytest.approx(102.0, abs=0.5)
    above = ekf.init(0.0, np.array([0.0, 0, 500, 0, 0, 0]), np.diag([100.0] * 6))
    after, info = ekf.update(above, Radar(1.0, 1e-3, 1e-3), np.array([501.0, 0.3, np.pi / 2]))
    assert len(info.y) == 2
    assert np.isfinite(after.x).all()
    assert after.x[2] == pytest.approx(501.0, abs=0.1)


def test_mistakes_are_named() -> None:
    state = ekf.init(1.0, np.zeros(6), np.eye(6))
    with pytest.raises(UserError, match="backwards"):
        ekf.predict(state, NearlyConstantVelocity(1.0), 0.5)
    with pytest.raises(UserError, match="no component"):
        ekf.update(state, Radar(1.0, 1.0), np.array([np.nan, np.nan]))
    with pytest.raises(UserError, match="no component"):
        ekf.update(state, Infrared(0.1, 0.1), np.array([0.0, 0.0]))
    with pytest.raises(UserError, match="must hold range, azimuth"):
        ekf.update(state, Radar(1.0, 1.0), np.array([1.0]))
    with pytest.raises(UserError, match="not positive definite"):
        ekf.init(0.0, np.zeros(2), np.diag([1.0, -1.0]))
    with pytest.raises(UserError, match="not finite"):
        ekf.init(0.0, np.zeros(2), np.diag([1.0, np.inf]))
    with pytest.raises(UserError, match="finite vector"):
        ekf.init(0.0, np.array([np.nan, 0.0]), np.eye(2))
