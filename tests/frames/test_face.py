"""The array face: its angle systems against closed forms and the sky."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boresight.errors import UserError
from boresight.frames import array_face as face
from boresight.frames.array_face import Pole
from boresight.frames.azel import enu_from_azel
from boresight.frames.tangent import direction_from_tangent, separation, tangent_basis, tangent_from_direction, unit

A, E = np.radians(90.0), np.radians(40.0)


def test_the_boresight_points_where_it_is_told() -> None:
    R = face.enu_from_face(A, E)
    np.testing.assert_allclose(R[:, 1], enu_from_azel(A, E), atol=1e-15)
    assert R[2, 0] == pytest.approx(0.0)  # right is level
    assert R[2, 2] > 0  # up looks up
    np.testing.assert_allclose(np.linalg.det(R), 1.0)
    assert face.angles_from_face(R.T @ R[:, 1], Pole.IN_FACE)[:2] == pytest.approx((0.0, 0.0), abs=1e-15)
    assert face.angles_from_face(R.T @ R[:, 1], Pole.ON_NORMAL)[1] == pytest.approx(np.pi / 2, abs=1e-7)


def test_to_the_right_is_a_growing_azimuth() -> None:
    R = face.enu_from_face(0.3, 0.0)
    a, e, _ = face.angles_from_face(R.T @ np.array(enu_from_azel(0.5, 0.1)), Pole.IN_FACE)
    assert (a, e) == pytest.approx((0.2, 0.1), abs=1e-15)  # an upright face has the angles of the sky, turned
    u, v = face.cosines_from_face(R.T @ np.array(enu_from_azel(0.5, 0.1)))
    assert (u, v) == pytest.approx((np.sin(0.2) * np.cos(0.1), np.sin(0.1)))


@given(st.floats(-np.pi, np.pi), st.floats(0.01, 1.57))
def test_a_flat_face_has_the_angles_of_the_sky(azimuth: float, elevation: float) -> None:
    R = face.enu_from_face(0.0, np.pi / 2)
    a, e, _ = face.angles_from_face(R.T @ np.array(enu_from_azel(azimuth, elevation)), Pole.ON_NORMAL)
    assert e == pytest.approx(elevation, abs=1e-14)
    assert abs(np.sin(a - azimuth)) * np.cos(elevation) < 1e-14


@given(st.floats(-3.14, 3.14), st.floats(-1.57, 1.57), st.sampled_from(list(Pole)))
def test_angles_come_back(azimuth: float, elevation: float, pole: Pole) -> None:
    d = face.face_from_angles(azimuth, elevation, pole)
    a, e, r = face.angles_from_face(d, pole)
    assert abs(np.sin(a - azimuth)) * np.cos(elevation) < 1e-12
    assert e == pytest.approx(elevation, abs=1e-12)
    assert r == pytest.approx(1.0)


def test_cosines_come_back_and_the_back_is_refused() -> None:
    u, v = np.meshgrid(np.linspace(-0.7, 0.7, 11), np.linspace(-0.7, 0.7, 11))
    back = face.cosines_from_face(face.face_from_cosines(u, v))
    np.testing.assert_allclose(back, [u, v], atol=1e-15)
    with pytest.raises(UserError, match="in front of the face"):
        face.cosines_from_face([0.0, -1.0, 0.0])
    with pytest.raises(UserError, match="u² \\+ v² < 1"):
        face.face_from_cosines(0.8, 0.8)


@given(st.floats(-3.14, 3.14), st.floats(-1.5707, 1.5707), st.floats(-1.5, 1.5), st.floats(-1.5, 1.5))
def test_the_tangent_plane_comes_back(azimuth: float, elevation: float, right: float, up: float) -> None:
    c = np.array(enu_from_azel(azimuth, elevation))
    d = direction_from_tangent(c, [right, up])
    np.testing.assert_allclose(tangent_from_direction(c, d), [right, up], atol=1e-14)
    assert separation(c, d) == pytest.approx(np.hypot(right, up), abs=1e-14)


def test_the_tangent_plane_at_the_zenith() -> None:
    np.testing.assert_allclose(tangent_basis([0.0, 0.0, 1.0]), [[1, 0, 0], [0, -1, 0]])
    np.testing.assert_allclose(tangent_from_direction([0.0, 0, 1], unit([0.01, 0, 1])), [np.arctan(0.01), 0.0])
    np.testing.assert_allclose(tangent_from_direction([0.0, 1, 0], [0.0, -1, 0]), [np.pi, 0.0])
    with pytest.raises(UserError, match="no direction"):
        unit([0.0, 0.0, 0.0])
