"""MSC coordinates: round trips, Jacobians, and the mended first-order matrices against the exact ones."""

from __future__ import annotations

import numpy as np

from boresight.kernels import msc
from boresight.kernels.msc import msc_from_world, world_from_msc
from boresight.models import NearlyConstantVelocity

X = np.array([300.0, -700.0, 250.0, 30.0, 12.0, -7.0])


def test_round_trip_and_definition() -> None:
    y = msc.msc_from_cartesian(X)
    np.testing.assert_allclose(msc.cartesian_from_msc(y), X, rtol=1e-13)
    later = X.copy()
    h = 1e-4
    later[:3] += h * X[3:]
    rate = (msc.msc_from_cartesian(later) - y) / h
    np.testing.assert_allclose([rate[0], rate[2] * np.cos(y[0])], [y[1], y[3]], rtol=1e-4)
    np.testing.assert_allclose(y[4], X[:3] @ X[3:] / (X[:3] @ X[:3]), rtol=1e-13)


def test_jacobians_are_derivatives_and_inverses() -> None:
    y = msc.msc_from_cartesian(X)
    steps = np.diag([1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 1e-9])
    numeric = np.array(
        [(msc.cartesian_from_msc(y + s) - msc.cartesian_from_msc(y - s)) / (2 * s.max()) for s in steps]
    ).T
    np.testing.assert_allclose(msc.jacobian(y), numeric, rtol=1e-5, atol=1e-3)
    np.testing.assert_allclose(msc.inverse_jacobian(y) @ msc.jacobian(y), np.eye(6), atol=1e-10)
    near_zenith = msc.msc_from_cartesian(np.array([0.1, 0.2, 500.0, 30.0, 5.0, 1.0]))
    np.testing.assert_allclose(msc.inverse_jacobian(near_zenith) @ msc.jacobian(near_zenith), np.eye(6), atol=1e-6)


def exact(y: np.ndarray, T: float, a: np.ndarray, q: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Φ and Q through Cartesian with an observer that accelerates by `a` (ENU) from rest."""
    own = np.r_[0.5 * a * T * T, a * T]
    motion = NearlyConstantVelocity(q)
    moved, F, Q = motion.move(world_from_msc(y, np.zeros(6)), T)
    inverse = msc.inverse_jacobian(msc_from_world(moved, own))
    return inverse @ F @ msc.jacobian(y), inverse @ Q @ inverse.T


def test_mended_first_order_matrices_are_the_exact_ones_to_first_order() -> None:
    """The error of (26) mended falls as T²; as printed it does not."""
    y = msc.msc_from_cartesian(X)
    a = np.array([5.0, -3.0, 8.0])
    los = msc.inverse_jacobian(y)[:, 3:] @ a / y[5]
    along = np.array([los[4], los[3], -los[1]])
    scale = np.outer(1 / np.array([1, 1, 1, 1, 1, y[5]]), np.array([1, 1, 1, 1, 1, y[5]]))
    errors = {}
    for printed in (True, False):
        for T in (0.02, 0.01):
            F = msc.first_order_transition(y, T, along, printed)
            errors[printed, T] = np.abs((F - exact(y, T, a)[0]) * scale).max()
    assert 3.5 < errors[False, 0.02] / errors[False, 0.01] < 4.5
    assert errors[False, 0.01] < 1e-3
    assert errors[True, 0.01] > 0.9  # (3,3) is printed as 0


def test_noise_as_printed_is_indefinite_and_mended_close_to_the_integral() -> None:
    y, T = msc.msc_from_cartesian(X), 0.02
    F = msc.first_order_transition(y, T, np.zeros(3), False)
    mended = msc.first_order_noise(y, T, F, 1.0, False)
    Q = exact(y, T, np.zeros(3))[1]
    np.testing.assert_allclose(np.diag(mended)[:5], np.diag(Q)[:5], rtol=0.05)
    np.testing.assert_allclose(mended[[0, 2], [1, 3]], Q[[0, 2], [1, 3]], rtol=0.05)
    printed = msc.first_order_noise(y, T, F, 1.0, True)
    assert np.linalg.eigvalsh(printed)[0] < 0.0
