"""Motion and sensor models against closed forms, matrix exponentials and finite differences."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from boresight.errors import UserError
from boresight.models import (
    CoordinatedTurn,
    Infrared,
    KnownTurn,
    NearlyConstantAcceleration,
    NearlyConstantJerk,
    NearlyConstantVelocity,
    Position,
    Radar,
    SensorPose,
    Singer,
)


def van_loan(A: np.ndarray, G: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """F and Q of dx = A x dt + dw, cov(dw) = G dt, by the matrix exponential (Van Loan 1978)."""
    n = len(A)
    M = expm(np.block([[-A, G], [np.zeros((n, n)), A.T]]) * dt)
    F = M[n:, n:].T
    return F, F @ M[:n, n:]


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("dt", [0.0, 0.02, 1.7])
@pytest.mark.parametrize(
    ("model", "order"), [(NearlyConstantVelocity, 1), (NearlyConstantAcceleration, 2), (NearlyConstantJerk, 3)]
)
def test_chain_of_integrators_is_exact(model: type, order: int, d: int, dt: float) -> None:
    motion = model(q=0.7, dimensions=d)
    A = np.kron(np.eye(order + 1, k=1), np.eye(d))
    G = np.kron(np.diag([0.0] * order + [0.7]), np.eye(d))
    F, Q = van_loan(A, G, dt)
    x = np.arange(1.0, motion.state_dimension + 1)
    np.testing.assert_allclose(motion.F(x, dt), F, atol=1e-13)
    np.testing.assert_allclose(motion.Q(x, dt), Q, atol=1e-13)
    np.testing.assert_allclose(motion.transition(x, dt), F @ x, atol=1e-12)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("dt", [0.0, 0.02, 1.7, 60.0])
@pytest.mark.parametrize("tau", [0.5, 20.0, 1e5])
def test_singer_is_exact(d: int, dt: float, tau: float) -> None:
    motion = Singer(tau=tau, sigma=3.0, dimensions=d)
    A = np.kron(np.eye(3, k=1) - np.diag([0, 0, 1 / tau]), np.eye(d))
    G = np.kron(np.diag([0.0, 0.0, 2 * 9.0 / tau]), np.eye(d))
    F, Q = van_loan(A, G, min(dt, 1.7))  # the oracle loses digits over long intervals: chain it
    if dt == 60.0:
        F1, Q1, F, Q = F, Q, np.eye(3 * d), np.zeros((3 * d, 3 * d))
        F1, Q1 = van_loan(A, G, 1.0)
        for _ in range(60):
            F, Q = F1 @ F, F1 @ Q @ F1.T + Q1
    x = np.arange(1.0, 3 * d + 1)
    np.testing.assert_allclose(motion.F(x, dt), F, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(motion.Q(x, dt), Q, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("rate", [0.3, -1e-7, 0.0, 2.0])
@pytest.mark.parametrize("dt", [0.0, 0.02, 1.7])
def test_known_turn_is_exact(d: int, rate: float, dt: float) -> None:
    motion = KnownTurn(rate=rate, q=0.7, dimensions=d)
    A = np.kron(np.eye(2, k=1), np.eye(d))
    A[d, d + 1], A[d + 1, d] = -rate, rate
    G = np.kron(np.diag([0.0, 0.7]), np.eye(d))
    F, Q = van_loan(A, G, dt)
    x = np.arange(1.0, 2 * d + 1)
    np.testing.assert_allclose(motion.F(x, dt), F, atol=1e-12)
    np.testing.assert_allclose(motion.Q(x, dt), Q, atol=1e-12)


@pytest.mark.parametrize("rate", [0.4, 1e-5, 0.0])
def test_estimated_turn(rate: float) -> None:
    """The mean is that of the known turn, F its derivative, and Q what a fine chain of small steps adds up to."""
    motion, dt = CoordinatedTurn(q=0.5, q_rate=0.01), 1.2
    x = np.array([100.0, 50, 20, 30, -10, 2, rate])
    np.testing.assert_allclose(motion.transition(x, dt)[:6], KnownTurn(rate, 0.5).transition(x[:6], dt), rtol=1e-12)
    numeric = np.array([(motion.transition(x + s, dt) - motion.transition(x - s, dt)) / 2e-5 for s in 1e-5 * np.eye(7)])
    np.testing.assert_allclose(motion.F(x, dt), numeric.T, rtol=1e-6, atol=1e-6)
    Q, here = np.zeros((7, 7)), x
    for _ in range(400):
        here, F, step = motion.move(here, dt / 400)
        Q = F @ Q @ F.T + step
    np.testing.assert_allclose(motion.Q(x, dt), Q, rtol=1e-6, atol=1e-8)


TURNED = SensorPose(
    np.array([100.0, -50.0, 20.0]),
    np.array([5.0, -3.0, 1.0]),
    np.linalg.qr(np.array([[1, 2, 0.5], [-1, 1, 0], [0, 1, 3.0]]))[0],
)
SENSORS = [
    Radar(5.0, 0.01, 0.02, 0.5),
    Radar(5.0, 0.01, sigma_range_rate=0.5).at(TURNED),
    Infrared(0.001, 0.001).at(TURNED),
    Infrared(0.001, 0.001, tangent=True).at(TURNED),
    Infrared(0.001),
    Position(3.0).at(TURNED),
]


@pytest.mark.parametrize("sensor", SENSORS)
def test_jacobian_is_the_derivative_of_the_innovation(sensor: Radar) -> None:
    x = np.array([700.0, 400.0, -300.0, 20.0, -30.0, 5.0, 1.0, 2.0, 3.0])
    z = sensor.h(x)
    np.testing.assert_allclose(sensor.innovation(z, x), 0.0, atol=1e-12)
    H = np.empty((sensor.dimension, 9))
    for j in range(9):
        step = np.zeros(9)
        step[j] = 1e-2
        H[:, j] = (sensor.innovation(z, x - step) - sensor.innovation(z, x + step)) / 2e-2
    np.testing.assert_allclose(sensor.H(x), H, rtol=1e-6, atol=1e-9)


def test_plane_targets_have_no_up() -> None:
    flat, deep = Radar(5.0, 0.01, sigma_range_rate=1.0, dimensions=2), Radar(5.0, 0.01, sigma_range_rate=1.0)
    x = np.array([300.0, -200.0, 4.0, 5.0])
    x3 = np.array([300.0, -200.0, 0.0, 4.0, 5.0, 0.0])
    np.testing.assert_allclose(flat.h(x), deep.h(x3), rtol=1e-15)
    np.testing.assert_allclose(flat.H(x), deep.H(x3)[:, [0, 1, 3, 4]], rtol=1e-15)


def test_conventions() -> None:
    assert Radar(1.0, 1.0, 1.0).h(np.array([10.0, 0.0, 0.0, 0, 0, 0])) == pytest.approx([10.0, np.pi / 2, 0.0])
    east_of_south = np.array([1e-3, -10.0, 0.0, 0, 0, 0])
    assert Infrared(0.01, 0.01).innovation(np.array([-np.pi + 1e-4, 0.0]), east_of_south)[0] == pytest.approx(2e-4)


def test_undefined_and_unmeasured_components_are_left_out() -> None:
    radar = Radar(1.0, 0.1, 0.1)
    y = radar.innovation(np.array([5.0, 0.3, np.pi / 2]), np.array([0.0, 0.0, 5.0, 0, 0, 0]))
    assert np.isnan(y[1])
    assert y[[0, 2]] == pytest.approx([0.0, 0.0])
    assert np.isnan(radar.innovation(np.array([1.0, 0.0, 0.0]), np.zeros(6))).all()
    assert np.isnan(radar.innovation(np.array([5.0, np.nan, 0.0]), np.ones(6))).tolist() == [False, True, False]


def test_correlated_noise() -> None:
    R = np.array([[4.0, 0.3], [0.3, 1.0]])
    np.testing.assert_array_equal(Radar(1.0, 1.0, covariance=R).R(np.zeros(6)), R)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: NearlyConstantVelocity(q=0.0), "q must be a positive number"),
        (lambda: NearlyConstantVelocity(q=np.nan), "q must be a positive number"),
        (lambda: NearlyConstantVelocity(q=1.0, dimensions=4), "dimensions must be 2 or 3"),
        (lambda: Radar(), "measures nothing"),
        (lambda: Radar(sigma_range=-1.0), "sigma_range must be a positive number"),
        (lambda: Radar(1.0, 1.0, covariance=np.array([[1.0, 2.0], [2.0, 1.0]])), "not positive definite"),
        (lambda: Radar(1.0, 1.0, covariance=np.array([[1.0, np.inf], [2.0, 1.0]])), "not finite"),
        (lambda: Radar(1.0, 1.0, covariance=np.eye(3)), "shape"),
        (lambda: Radar(1.0).at(SensorPose(position=np.array([np.nan, 0.0, 0.0]))), "pose"),
        (lambda: NearlyConstantVelocity(q=1.0).F(np.zeros(4), 1.0), "length 6"),
    ],
)
def test_mistakes_are_named(make, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(UserError, match=message):
        make()
