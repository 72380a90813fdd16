"""Covariance of a bearing and of a place on the Earth against Monte Carlo."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from boresight.errors import UserError
from boresight.frames import attitude
from boresight.frames.azel import azel_from_enu, enu_from_azel
from boresight.frames.bearing import Noise, bearing_from_pixel, turns_from_ypr
from boresight.frames.camera import Camera, direction_from_pixel
from boresight.frames.geolocate import error_ellipse, place_at_height, place_from_range
from boresight.frames.local import enu_from_geodetic, geodetic_from_enu, ned_from_enu
from boresight.frames.tangent import tangent_from_direction
from boresight.types import Site

LENS = Camera(640, 480, 500.0, 510.0, 320.0, 235.0, -0.28, 0.07, 1e-3, -5e-4, 0.01)
SITE = Site(0.68, 1.74, 1400.0)
N = 200_000
# a sample variance of N draws scatters by sqrt(2 / N) = 0.32 %; 2 % is what is asked
PERCENT = 0.02
MOUNT = (0.4, -0.3, 0.1)
SIGMA_PIXEL = np.array([0.8, 0.6])
SIGMA_YPR = np.radians([0.20, 0.10, 0.15])
SIGMA_MOUNT = np.radians([0.05, 0.08, 0.06])
SIGMA_POSITION = np.array([5.0, 8.0, 3.0])
RANGE = 4000.0
PIXEL = (410.0, 150.0)


def at_elevation(elevation: float) -> np.ndarray:
    """Yaw, pitch, roll of a body whose camera sees PIXEL at this elevation, at azimuth 1.1 rad."""
    seen = attitude.ned_from_body(*MOUNT) @ direction_from_pixel(LENS, *PIXEL)
    wanted = np.array(ned_from_enu(*enu_from_azel(1.1, elevation)))
    R, _ = Rotation.align_vectors([wanted, [0, 0, 1]], [seen, [0.2, 0.1, 1.0]], weights=[np.inf, 1.0])
    return np.array(attitude.ypr_from_rotation(R.as_matrix()))


def sample(ypr: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Directions (N, 3) of the whole chain with all its noises drawn, none of it linear."""
    px = PIXEL + SIGMA_PIXEL * rng.standard_normal((N, 2))
    body = attitude.enu_from_body(*(ypr + SIGMA_YPR * rng.standard_normal((N, 3))).T)
    small = SIGMA_MOUNT * rng.standard_normal((N, 3))
    half = 0.5 * np.linalg.norm(small, axis=1, keepdims=True)
    q = np.concatenate([np.cos(half), np.sinc(half / np.pi) * 0.5 * small], axis=1)
    mount = attitude.ned_from_body(*MOUNT) @ attitude.rotation_from_quaternion(q)
    d = (body @ mount @ direction_from_pixel(LENS, px[:, 0], px[:, 1])[:, :, None])[:, :, 0]
    return d + SIGMA_POSITION * rng.standard_normal((N, 3)) / RANGE


def noise(ypr: np.ndarray) -> Noise:
    E = turns_from_ypr(*ypr)
    return Noise(
        pixel=np.diag(SIGMA_PIXEL**2),
        attitude=E @ np.diag(SIGMA_YPR**2) @ E.T,
        mount=np.diag(SIGMA_MOUNT**2),
        position=np.diag(SIGMA_POSITION**2),
    )


def close(P: np.ndarray, S: np.ndarray) -> None:
    """Variances within 2 %, covariances within 2 % of the geometric mean of the variances."""
    scale = np.sqrt(np.outer(np.diag(S), np.diag(S)))
    np.testing.assert_array_less(np.abs(P - S) / scale, PERCENT)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0, 75.0])
def test_azimuth_and_elevation(degrees: float) -> None:
    ypr = at_elevation(np.radians(degrees))
    b = bearing_from_pixel(
        LENS, *PIXEL, attitude.enu_from_body(*ypr), attitude.ned_from_body(*MOUNT), noise(ypr), RANGE
    )
    assert np.degrees(b.elevation) == pytest.approx(degrees, abs=0.01)
    az, el, _ = azel_from_enu(*sample(ypr, np.random.default_rng(5)).T)
    az = (az - b.azimuth + np.pi) % (2 * np.pi) - np.pi
    close(b.covariance, np.cov(az, el))


@pytest.mark.parametrize("degrees", [30.0, 75.0, 89.5])
def test_the_tangent_plane_holds_at_the_zenith(degrees: float) -> None:
    ypr = at_elevation(np.radians(degrees))
    b = bearing_from_pixel(
        LENS, *PIXEL, attitude.enu_from_body(*ypr), attitude.ned_from_body(*MOUNT), noise(ypr), RANGE
    )
    d = sample(ypr, np.random.default_rng(6))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    close(b.tangent_covariance, np.cov(tangent_from_direction(np.tile(b.direction, (N, 1)), d).T))


def test_at_the_zenith_itself_azimuth_is_infinite_not_nan() -> None:
    up = attitude.enu_from_body(0.0, np.pi / 2, 0.0)
    plain = Camera(640, 480, 500.0, 500.0, 320.0, 240.0)
    b = bearing_from_pixel(plain, 320.0, 240.0, up, noise=Noise(pixel=np.eye(2)))
    np.testing.assert_allclose(b.tangent_covariance, np.eye(2) / 500.0**2, atol=1e-18)
    assert not np.isnan(b.covariance).any()
    assert b.covariance[0, 0] > 1e3


def test_position_noise_needs_a_range() -> None:
    with pytest.raises(UserError, match="range_m > 0"):
        bearing_from_pixel(LENS, *PIXEL, np.eye(3), noise=Noise(position=np.eye(3)))


def test_a_place_by_range_against_monte_carlo() -> None:
    rng = np.random.default_rng(7)
    az, el, r = 1.0, -0.1, 30e3
    sigma = np.radians([0.2, 0.1])
    d = np.array(enu_from_azel(az, el))
    place = place_from_range(
        [100.0, 50.0, 9000.0], d, r, SITE, tangent_covariance=np.diag(sigma**2), sigma_range=50.0,
        position_covariance=np.diag([4.0, 4.0, 9.0]),
    )  # fmt: skip
    samples = (
        np.stack(
            enu_from_azel(
                az + sigma[0] / np.cos(el) * rng.standard_normal(N),
                el + sigma[1] * rng.standard_normal(N),
                r + 50 * rng.standard_normal(N),
            ),
            axis=-1,
        )
        + [100.0, 50.0, 9000.0]
        + rng.standard_normal((N, 3)) * [2, 2, 3]
    )

    there = Site(float(place.latitude), float(place.longitude), float(place.height))
    local = np.stack(enu_from_geodetic(*geodetic_from_enu(*samples.T, SITE), there))
    close(place.covariance, np.cov(local))


def test_a_place_at_a_height_against_monte_carlo() -> None:
    rng = np.random.default_rng(8)
    az, el = -2.0, -0.35
    sigma, sigma_height = np.radians([0.05, 0.05]), 5.0
    here = np.array([0.0, 0.0, 3000.0])
    d = np.array(enu_from_azel(az, el))
    place = place_at_height(here, d, 200.0, SITE, tangent_covariance=np.diag(sigma**2), sigma_height=sigma_height)
    assert place.height == pytest.approx(200.0, abs=1e-6)
    directions = np.stack(
        enu_from_azel(az + sigma[0] / np.cos(el) * rng.standard_normal(N), el + sigma[1] * rng.standard_normal(N)),
        axis=-1,
    )
    places = place_at_height(here, directions, 200.0 + sigma_height * rng.standard_normal(N), SITE)
    there = Site(float(place.latitude), float(place.longitude), float(place.height))
    east, north, _ = enu_from_geodetic(places.latitude, places.longitude, places.height, there)
    close(place.covariance[:2, :2], np.cov(east, north))
    ellipse = error_ellipse(place.covariance, 0.95)
    # inside the ellipse: 95 % of 2e5 draws, give or take 0.05 %; the second order adds a little
    along = np.array([np.sin(ellipse.azimuth), np.cos(ellipse.azimuth)])
    a = east * along[0] + north * along[1]
    b = east * along[1] - north * along[0]
    inside = ((a / ellipse.semi_major) ** 2 + (b / ellipse.semi_minor) ** 2 < 1).mean()
    assert inside == pytest.approx(0.95, abs=0.003)


def test_rays_that_meet_nothing_are_told() -> None:
    with pytest.raises(UserError, match="does not meet the height"):
        place_at_height([0, 0, 3000.0], enu_from_azel(0.0, 0.2), 100.0, SITE)
    with pytest.raises(UserError, match="row 1"):
        place_at_height([0, 0, 3000.0], [enu_from_azel(0.0, -0.5), enu_from_azel(0.0, 0.2)], 100.0, SITE)
    above = place_at_height([0, 0, 0.0], enu_from_azel(0.3, 0.4), 10e3, SITE)  # from below, up to a height
    assert above.height == pytest.approx(10e3, abs=1e-6)
    assert 0 < above.range < 30e3
    with pytest.raises(UserError, match="positive"):
        place_from_range([0, 0, 0], [0, 1, 0], -5.0, SITE)
    with pytest.raises(UserError, match="probability"):
        error_ellipse(np.eye(2), 1.5)
