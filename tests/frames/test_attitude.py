"""Rotations against SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from boresight.errors import UserError
from boresight.frames import attitude

RNG = np.random.default_rng(2)
YPR = np.stack([RNG.uniform(-np.pi, np.pi, 5000), RNG.uniform(-1.57, 1.57, 5000), RNG.uniform(-np.pi, np.pi, 5000)])
SCIPY = Rotation.from_euler("ZYX", YPR.T)


def wxyz(r: Rotation) -> np.ndarray:
    return np.roll(r.as_quat(canonical=True), 1, axis=-1)


def same_attitude(a: np.ndarray, b: np.ndarray, tolerance: float) -> None:
    """Quaternions of one sign or the other."""
    np.testing.assert_allclose(np.abs((a * b).sum(axis=-1)), 1.0, atol=tolerance)
    np.testing.assert_allclose(a * np.sign((a * b).sum(axis=-1))[..., None], b, atol=tolerance)


def test_rotations_agree_with_scipy() -> None:
    R = attitude.ned_from_body(*YPR)
    np.testing.assert_allclose(R, SCIPY.as_matrix(), atol=1e-14)
    same_attitude(attitude.quaternion_from_ypr(*YPR), wxyz(SCIPY), 1e-14)
    same_attitude(attitude.quaternion_from_rotation(R), wxyz(SCIPY), 1e-14)
    np.testing.assert_allclose(attitude.rotation_from_quaternion(wxyz(SCIPY)), R, atol=1e-14)


def test_angles_come_back() -> None:
    back = np.stack(attitude.ypr_from_rotation(attitude.ned_from_body(*YPR)))
    np.testing.assert_allclose(attitude.ned_from_body(*back), attitude.ned_from_body(*YPR), atol=1e-14)
    plain = np.abs(YPR[1]) < 1.4
    np.testing.assert_allclose(back[:, plain], YPR[:, plain], atol=1e-13)
    one = attitude.ypr_from_quaternion(attitude.quaternion_from_ypr(0.3, -0.2, 2.9))
    assert one == pytest.approx((0.3, -0.2, 2.9), abs=1e-14)


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2])
def test_gimbal_lock_gives_roll_zero(pitch: float) -> None:
    R = attitude.ned_from_body(0.4, pitch, 0.1)
    yaw, p, roll = attitude.ypr_from_rotation(R)
    assert roll == 0.0
    assert p == pytest.approx(pitch, abs=1e-9)
    np.testing.assert_allclose(attitude.ned_from_body(yaw, p, roll), R, atol=1e-9)


def test_slerp_agrees_with_scipy() -> None:
    p, q = wxyz(SCIPY[0]), wxyz(SCIPY[1])
    fraction = np.linspace(0, 1, 101)
    theirs = Slerp([0, 1], SCIPY[:2])(fraction)
    same_attitude(attitude.slerp(p, q, fraction), wxyz(theirs), 1e-14)
    same_attitude(attitude.slerp(p, -q, fraction), wxyz(theirs), 1e-14)  # the shorter way, whatever the sign
    assert attitude.slerp(p, q, 0.5).shape == (4,)


def test_product_reads_as_matrices() -> None:
    p, q = wxyz(SCIPY[:100]), wxyz(SCIPY[100:200])
    product = attitude.rotation_from_quaternion(attitude.multiply(p, q))
    np.testing.assert_allclose(product, (SCIPY[:100] * SCIPY[100:200]).as_matrix(), atol=1e-14)


def test_body_axes() -> None:
    """Heading east: forward is east, right is south, down is down."""
    R = attitude.enu_from_body(np.pi / 2, 0.0, 0.0)
    np.testing.assert_allclose(R.T, [[1, 0, 0], [0, -1, 0], [0, 0, -1]], atol=1e-15)
    nose_up = attitude.enu_from_body(0.0, 0.1, 0.0) @ [1, 0, 0]
    assert nose_up[2] > 0
    right_wing_down = attitude.enu_from_body(0.0, 0.0, 0.1) @ [0, 1, 0]
    assert right_wing_down[2] < 0


def test_bad_rotations_are_told() -> None:
    with pytest.raises(UserError, match="norm 2"):
        attitude.rotation_from_quaternion(np.array([2.0, 0, 0, 0]))
    with pytest.raises(UserError, match="row 1"):
        attitude.rotation_from_quaternion([[1.0, 0, 0, 0], [0.5, 0, 0, 0]])
    with pytest.raises(UserError, match="mirrors"):
        attitude.ypr_from_rotation(np.diag([1.0, 1.0, -1.0]))
    with pytest.raises(UserError, match="not a rotation"):
        attitude.quaternion_from_rotation(np.full((3, 3), np.nan))
    with pytest.raises(UserError, match="pitch is not finite"):
        attitude.ned_from_body(0.0, np.nan, 0.0)
    with pytest.raises(UserError, match="shape"):
        attitude.rotation_from_quaternion([1.0, 0.0, 0.0])
