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
