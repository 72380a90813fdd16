"""Probability in the beam against closed forms and Monte Carlo; the aim against central differences."""

from __future__ import annotations

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.frames.array_face import Pole, enu_from_face
from boresight.frames.azel import azel_from_enu
from boresight.pointing.beam import aim_at, probability_in_beam


def test_a_round_error_has_a_closed_form() -> None:
    for ratio in (0.1, 1.0, 3.0):
        assert probability_in_beam(np.eye(2), ratio) == pytest.approx(-np.expm1(-0.5 * ratio**2), abs=1e-12)


@pytest.mark.parametrize("thin", [0.5, 0.2, 0.05, 1e-3])
def test_an_oblong_error_against_monte_carlo(thin: float) -> None:
    rng = np.random.default_rng(20)
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    S = turn @ np.diag([1.0, thin**2]) @ turn.T
    e = rng.standard_normal((400_000, 2)) * [1.0, thin]
    for radius in (0.3, 1.0, 2.5):
        inside = (np.hypot(e[:, 0], e[:, 1]) < radius).mean()
        assert probability_in_beam(S, radius) == pytest.approx(inside, abs=0.003)  # 3.5 · 0.5 / sqrt(4e5)


def test_the_ends_of_the_scale() -> None:
    assert probability_in_beam(np.zeros((2, 2)), 0.01) == 1.0
    assert probability_in_beam(1e-12 * np.eye(2), 0.01) == pytest.approx(1.0)
    assert probability_in_beam(1e6 * np.eye(2), 0.01) == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(UserError, match="not positive"):
        probability_in_beam(-np.eye(2), 0.01)


def test_rates_are_derivatives() -> None:
    p, v = np.array([3000.0, -4000.0, 2500.0]), np.array([-120.0, 60.0, 10.0])
    aim = aim_at(p, v, np.diag([25.0, 25.0, 25.0]), enu_from_face(1.0, 0.3), Pole.IN_FACE, 0.01)
    h = 1e-3
    a1, a0 = azel_from_enu(*(p + h * v)), azel_from_enu(*(p - h * v))
    assert aim.azimuth_rate == pytest.approx((a1[0] - a0[0]) / (2 * h), rel=1e-6)
    assert aim.elevation_rate == pytest.approx((a1[1] - a0[1]) / (2 * h), rel=1e-6)
    assert aim.sigma == pytest.approx(np.sqrt(2) * 5.0 / np.linalg.norm(p))


@pytest.mark.parametrize("pole", list(Pole))
def test_the_aim_is_what_the_frames_say(pole: Pole) -> None:
    """Angles, covariance and direction cosines against `frames`, which are tested against other programs."""
    from boresight.frames.array_face import angles_from_face, cosines_from_face
    from boresight.frames.tangent import tangent_basis

    rng = np.random.default_rng(21)
    face = enu_from_face(1.0, 0.3, 0.2)
    for _ in range(20):
        p = 1e4 * (face @ [rng.uniform(-0.5, 0.5), 1.0, rng.uniform(-0.5, 0.5)])
        A = rng.standard_normal((3, 3))
        C, d = A @ A.T, p / np.linalg.norm(p)
        aim = aim_at(p, A[0], C, face, pole, 0.01)
        np.testing.assert_allclose([aim.azimuth, aim.elevation], azel_from_enu(*p)[:2], atol=1e-14)
        np.testing.assert_allclose(
            [aim.face_azimuth, aim.face_elevation], angles_from_face(face.T @ d, pole)[:2], atol=1e-14
        )
        np.testing.assert_allclose([aim.cosine_right, aim.cosine_up], cosines_from_face(face.T @ d), atol=1e-14)
        T = tangent_basis(d)
        np.testing.assert_allclose(aim.covariance, T @ C @ T.T / (p @ p), atol=1e-20)
    up = aim_at(np.array([0.0, 0.0, 9.0]), A[0], C, face, pole, 0.01)
    assert up.elevation == pytest.approx(np.pi / 2)
    with pytest.raises(UserError, match="no direction"):
        aim_at(np.zeros(3), A[0], C, face, pole, 0.01)
