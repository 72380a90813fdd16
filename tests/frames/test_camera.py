"""The camera: both ways, closed forms, and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boresight.errors import UserError
from boresight.frames.camera import Camera, camera_from_fov, direction_from_pixel, pixel_from_direction, visible

PLAIN = Camera(256, 256, 128.0, 128.0, 128.0, 128.0)
BARREL = Camera(640, 480, 500.0, 510.0, 320.0, 235.0, -0.28, 0.07, 1e-3, -5e-4, 0.01)
CUSHION = Camera(640, 480, 500.0, 510.0, 320.0, 235.0, 0.35, 0.1, -2e-3, 1e-3, 0.02)


@given(st.floats(-0.5, 639.5), st.floats(-0.5, 479.5), st.sampled_from([BARREL, CUSHION]))
def test_pixels_come_back(px: float, py: float, camera: Camera) -> None:
    inner = np.clip([px, py], -0.499, [639.499, 479.499])
    back = pixel_from_direction(camera, direction_from_pixel(camera, *inner))
    np.testing.assert_allclose(back, inner, atol=1e-9)


def test_distortion_is_the_published_formula() -> None:
    """Brown–Conrady as OpenCV's documentation prints it, written out once more."""
    x, y = 0.31, -0.22
    k1, k2, p1, p2, k3 = -0.28, 0.07, 1e-3, -5e-4, 0.01
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    xd = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    yd = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    np.testing.assert_allclose(pixel_from_direction(BARREL, [1.0, x, y]), [500 * xd + 320, 510 * yd + 235], atol=1e-12)


def test_field_of_view() -> None:
    camera = camera_from_fov(256, 256, np.pi / 2)
    assert camera.fx == pytest.approx(128.0)
    edge = direction_from_pixel(camera, 255.5, 127.5)
    np.testing.assert_allclose(edge, [np.sqrt(0.5), np.sqrt(0.5), 0.0], atol=1e-15)
    wide = camera_from_fov(640, 480, 1.2, 0.8)
    top = direction_from_pixel(wide, 319.5, -0.5)
    assert np.arctan2(-top[2], top[0]) == pytest.approx(0.4)
    with pytest.raises(UserError, match="between 0 and 180"):
        camera_from_fov(640, 480, 3.2)


def test_shapes() -> None:
    assert direction_from_pixel(PLAIN, 3.0, 4.0).shape == (3,)
    d = direction_from_pixel(PLAIN, np.full((2, 5), 3.0), 4.0)
    assert d.shape == (2, 5, 3)
    assert pixel_from_direction(PLAIN, d).shape == (2, 5, 2)
    np.testing.assert_allclose(np.linalg.norm(d, axis=-1), 1.0)


def test_what_it_cannot_see_is_told() -> None:
    with pytest.raises(UserError, match="in front of the camera"):
        pixel_from_direction(PLAIN, [-1.0, 0.0, 0.0])
    with pytest.raises(UserError, match=r"row 1.*inside the picture"):
        pixel_from_direction(PLAIN, [[1.0, 0.0, 0.0], [1.0, 3.0, 0.0]])
    with pytest.raises(UserError, match="inside the picture of 256"):
        direction_from_pixel(PLAIN, 300.0, 10.0)
    with pytest.raises(UserError, match="inside the picture"):
        direction_from_pixel(PLAIN, np.nan, 10.0)
    np.testing.assert_array_equal(
        visible(PLAIN, [[1, 0, 0], [-1, 0, 0], [1, 5, 0], [np.nan, 0, 0]]), [True, False, False, False]
    )
    with pytest.raises(UserError, match="positive"):
        Camera(640, 480, 0.0, 500.0, 320.0, 240.0)


def test_the_fold_of_a_barrel_lens_is_no_ghost() -> None:
    """With k1 = -0.3 alone, rays beyond r = 1/sqrt(0.9) would be folded back into the picture."""
    fold = Camera(640, 480, 500.0, 500.0, 320.0, 240.0, -0.3)
    r = 1.5
    assert 500 * r * (1 - 0.3 * r * r) + 320 < 640  # the bare formula has a pixel for it
    assert not visible(fold, [1.0, r, 0.0])
    with pytest.raises(UserError, match="folds over"):
        pixel_from_direction(fold, [1.0, r, 0.0])
    tele = Camera(4000, 480, 500.0, 500.0, 320.0, 240.0, -0.3)
    with pytest.raises(UserError, match="distortion can be undone"):
        direction_from_pixel(tele, 3000.0, 240.0)
