"""A user's own models: plain NumPy compiled, Numba kernels, and plain classes give one result."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numba import njit

from boresight.errors import UserError
from boresight.filters import ekf, stream
from boresight.models import NearlyConstantVelocity, Radar
from boresight.models.own import OwnMotion, own_motion, own_sensor


def drag(x, dt, p):  # type: ignore[no-untyped-def]
    """Velocity decays at rate p[0]."""
    k = np.exp(-p[0] * dt)
    return np.concatenate((x[:3] + x[3:] * (1 - k) / p[0], x[3:] * k))


def drag_F(x, dt, p):  # type: ignore[no-untyped-def]
    k = np.exp(-p[0] * dt)
    F = np.zeros((6, 6))
    for i in range(3):
        F[i, i], F[i, 3 + i], F[3 + i, 3 + i] = 1.0, (1 - k) / p[0], k
    return F


def drag_Q(x, dt, p):  # type: ignore[no-untyped-def]
    Q = np.zeros((6, 6))
    for i in range(3):
        Q[i, i], Q[i, 3 + i], Q[3 + i, i], Q[3 + i, 3 + i] = dt**3 / 3, dt**2 / 2, dt**2 / 2, dt
    return p[1] * Q


def bearing_and_range(x, p):  # type: ignore[no-untyped-def]
    return np.array(
        [np.arctan2(x[0] - p[0], x[1] - p[1]), np.sqrt((x[0] - p[0]) ** 2 + (x[1] - p[1]) ** 2 + x[2] ** 2)]
    )


def bearing_and_range_H(x, p):  # type: ignore[no-untyped-def]
    e, n = x[0] - p[0], x[1] - p[1]
    flat2 = e * e + n * n
    r = np.sqrt(flat2 + x[2] ** 2)
    return np.array([[n / flat2, -e / flat2, 0, 0, 0, 0], [e / r, n / r, x[2] / r, 0, 0, 0]])


@dataclass(frozen=True)
class PlainDrag:
    """The same in plain NumPy, not compiled."""

    p: tuple[float, float] = (0.1, 0.5)
    dimensions: int = 3
    state_dimension: int = 6

    def transition(self, x: np.ndarray, dt: float) -> np.ndarray:
        return drag(x, dt, self.p)

    def F(self, x: np.ndarray, dt: float) -> np.ndarray:
        return drag_F(x, dt, self.p)

    def Q(self, x: np.ndarray, dt: float) -> np.ndarray:
        return drag_Q(x, dt, self.p)


PRIOR = ekf.init(0.0, np.array([300.0, 200, 50, -10, 5, 1]), np.diag([100.0, 100, 100, 25, 25, 25]))


def test_compiled_plain_and_differenced_models_agree() -> None:
    rng = np.random.default_rng(1)
    R = np.diag([1e-4, 4.0])
    sensor = own_sensor(bearing_and_range, R, parameters=(10.0, -20.0), angles=(0,), H=bearing_and_range_H)
    exact, differenced = (
        own_motion(drag, drag_Q, state_dimension=6, parameters=(0.1, 0.5), F=F) for F in (drag_F, None)
    )
    t = np.cumsum(rng.uniform(0.05, 0.3, 100))
    z = [bearing_and_range(PRIOR.x, (10.0, -20.0)) + rng.normal(size=2) * [1e-2, 2.0] for _ in t]
    z[3][0] = np.nan
    runs = [stream.run(PRIOR, m, stream.stack(t, [sensor] * 100, z)) for m in (exact, differenced)]
    state = PRIOR
    for k, now in enumerate(t):
        state, _ = ekf.update(ekf.predict(state, PlainDrag(), now), sensor, z[k])
        np.testing.assert_allclose(runs[0].x[k], state.x, rtol=1e-9, atol=1e-9)
        # differences are good to 1e-10, and height is seen so weakly that this grows over 100 reports
        np.testing.assert_allclose(runs[1].x[k], state.x, rtol=1e-5, atol=1e-3)


def test_own_sensor_equals_the_built_in_one() -> None:
    R = np.diag([1e-4, 4.0])
    own = own_sensor(
        lambda x, p: np.array([np.arctan2(x[0], x[1]), np.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2)]), R, angles=(0,)
    )
    radar = Radar(sigma_range=2.0, sigma_azimuth=1e-2)
    x = np.array([1.0, -200.0, 20.0, 1, 2, 3])
    z = np.array([-3.1, 190.0])
    np.testing.assert_allclose(own.innovation(z, x), radar.innovation(z[::-1], x)[::-1], atol=1e-12)
    np.testing.assert_allclose(own.H(x), radar.H(x)[::-1], rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(own.R(x), R)


def test_a_numba_kernel_of_ones_own() -> None:
    @njit
    def still(x, dt, p, x_out, F, Q):  # type: ignore[no-untyped-def]
        x_out[:] = x
        F[:, :] = np.eye(6)
        Q[:, :] = p[0] * dt * np.eye(6)

    model = OwnMotion(still, 6, np.array([0.3]))
    state = ekf.predict(PRIOR, model, 2.0)
    np.testing.assert_allclose(state.P, PRIOR.P + 0.6 * np.eye(6))
    out = stream.run(PRIOR, model, stream.stack([2.0], [Radar(1.0)], [np.array([300.0])]))
    np.testing.assert_allclose(out.x_predicted[0], PRIOR.x)


def test_mistakes_are_named() -> None:
    with pytest.raises(UserError, match="cannot compile"):
        own_motion(lambda x, dt, p: {"no": open(x)}, drag_Q, state_dimension=6)  # noqa: SIM115
    with pytest.raises(UserError, match="not positive definite"):
        own_sensor(bearing_and_range, np.diag([1.0, 0.0]))
    with pytest.raises(UserError, match="must be a function"):
        own_motion(3, drag_Q, state_dimension=6)  # type: ignore[arg-type]
    with pytest.raises(UserError, match=r"shape \(2,\)"):
        own_sensor(bearing_and_range, np.eye(2)).innovation(np.zeros(3), np.ones(6))
    with pytest.raises(UserError, match="one observation kernel"):
        stream.stack([0.0, 1.0], [own_sensor(bearing_and_range, np.eye(2)), Radar(1.0)], [np.zeros(2), np.zeros(1)])
    assert NearlyConstantVelocity(1.0).layout == ("position", "velocity")
