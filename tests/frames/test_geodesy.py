"""Geodetic, ECEF, local level and az/el against pymap3d, pyproj and themselves."""

from __future__ import annotations

import numpy as np
import pymap3d
import pyproj
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boresight.errors import UserError
from boresight.frames import azel, geodetic, local
from boresight.types import Site

SITE = Site(0.68, 1.74, 1400.0)
ECEF_METRE = 1e-6
RADIAN = 1e-11


def points(n: int = 20000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Random points from pole to pole and -10 km to 40,000 km, with the poles, the equator and the axis."""
    rng = np.random.default_rng(1)
    latitude = rng.uniform(-np.pi / 2, np.pi / 2, n)
    longitude = rng.uniform(-np.pi, np.pi, n)
    height = np.where(rng.random(n) < 0.5, rng.uniform(-1e4, 2e4, n), rng.uniform(0, 4e7, n))
    latitude[:4] = [np.pi / 2, -np.pi / 2, 0.0, 0.0]
    longitude[:4] = [0.0, 1.0, np.pi, -np.pi / 2]
    latitude[4:1000] = np.copysign(np.pi / 2, latitude[4:1000]) - np.sign(latitude[4:1000]) * 10 ** rng.uniform(
        -12, -3, 996
    )
    return latitude, longitude, height


def test_ecef_agrees_with_pymap3d_and_pyproj() -> None:
    latitude, longitude, height = points()
    ours = np.stack(geodetic.ecef_from_geodetic(latitude, longitude, height))
    theirs = np.stack(pymap3d.geodetic2ecef(latitude, longitude, height, deg=False))
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=ECEF_METRE)
    proj = pyproj.Transformer.from_crs(4979, 4978, always_xy=True)
    theirs = np.stack(proj.transform(np.degrees(longitude), np.degrees(latitude), height))
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=ECEF_METRE)


def test_geodetic_agrees_with_pymap3d_and_pyproj() -> None:
    """Their inverses stop early away from the Earth (2e-6 rad and 8e-9 rad at 40,000 km, by their own round trip).

    So their inverses judge ours up to 20 km, and their forward transforms, which agree to 1e-8 m, everywhere.
    """
    latitude, longitude, height = points()
    ecef = geodetic.ecef_from_geodetic(latitude, longitude, height)
    lat, lon, h = geodetic.geodetic_from_ecef(*ecef)
    off_axis = np.hypot(ecef[0], ecef[1]) > 1.0
    np.testing.assert_allclose(lat, latitude, rtol=0, atol=RADIAN)
    np.testing.assert_allclose(np.sin(lon - longitude)[off_axis], 0.0, atol=RADIAN)
    np.testing.assert_allclose(h, height, rtol=0, atol=ECEF_METRE)
    proj = pyproj.Transformer.from_crs(4979, 4978, always_xy=True)
    for x in (pymap3d.geodetic2ecef(lat, lon, h, deg=False), proj.transform(np.degrees(lon), np.degrees(lat), h)):
        np.testing.assert_allclose(np.stack(x), np.stack(ecef), rtol=0, atol=ECEF_METRE)
    near = height < 2e4
    lat_m, lon_m, h_m = pymap3d.ecef2geodetic(*(c[near] for c in ecef), deg=False)
    lon_p, lat_p, h_p = proj.transform(*(c[near] for c in ecef), direction="INVERSE")
    for theirs in (lat_m, np.radians(lat_p)):
        np.testing.assert_allclose(lat[near], theirs, rtol=0, atol=RADIAN)
    for theirs in (lon_m, np.radians(lon_p)):
        np.testing.assert_allclose(np.sin(lon[near] - theirs)[off_axis[near]], 0.0, atol=RADIAN)
    np.testing.assert_allclose(h[near], h_m, rtol=0, atol=ECEF_METRE)
    np.testing.assert_allclose(h[near], h_p, rtol=0, atol=1e-5)  # PROJ's height at 20 km is good to 4e-6 m


def test_the_axis_is_an_ordinary_place() -> None:
    assert geodetic.geodetic_from_ecef(0.0, 0.0, 6356752.314245179) == pytest.approx((np.pi / 2, 0.0, 0.0), abs=1e-8)
    assert geodetic.geodetic_from_ecef(0.0, 0.0, -7e6)[0] == -np.pi / 2
    assert np.isfinite(geodetic.ecef_from_geodetic_jacobian(np.pi / 2, 0.0, 0.0)).all()
    assert np.isfinite(geodetic.geodetic_from_ecef_jacobian(0.0, 0.0, 7e6)).all()


def test_local_level_agrees_with_pymap3d() -> None:
    latitude, longitude, height = points()
    ecef = geodetic.ecef_from_geodetic(latitude, longitude, height)
    enu = local.enu_from_ecef(*ecef, SITE)
    theirs = pymap3d.ecef2enu(*ecef, SITE.latitude, SITE.longitude, SITE.height, deg=False)
    np.testing.assert_allclose(np.stack(enu), np.stack(theirs), rtol=0, atol=ECEF_METRE)
    np.testing.assert_allclose(np.stack(local.ecef_from_enu(*enu, SITE)), np.stack(ecef), rtol=0, atol=ECEF_METRE)
    aer = azel.azel_from_geodetic(latitude, longitude, height, SITE)
    az, el, r = pymap3d.geodetic2aer(latitude, longitude, height, SITE.latitude, SITE.longitude, SITE.height, deg=False)
    sound = np.abs(enu[0]) > 1e-2  # pymap3d sets less than 1 mm to zero
    np.testing.assert_allclose(np.sin(aer[0] - az)[sound], 0.0, atol=RADIAN)
    np.testing.assert_allclose(aer[1], el, rtol=0, atol=RADIAN)
    np.testing.assert_allclose(aer[2], r, rtol=0, atol=ECEF_METRE)
    lat, _, h = azel.geodetic_from_azel(*aer, SITE)
    np.testing.assert_allclose(lat, latitude, rtol=0, atol=RADIAN)
    np.testing.assert_allclose(h, height, rtol=0, atol=ECEF_METRE)


def test_ned_is_enu_swapped() -> None:
    e, n, u = local.enu_from_geodetic(0.69, 1.75, 2000.0, SITE)
    assert local.ned_from_geodetic(0.69, 1.75, 2000.0, SITE) == (n, e, -u)
    assert local.geodetic_from_ned(n, e, -u, SITE) == pytest.approx((0.69, 1.75, 2000.0), abs=1e-8)
    np.testing.assert_array_equal(local.ENU_FROM_NED @ [n, e, -u], [e, n, u])


@given(st.floats(-np.pi, np.pi, exclude_min=True), st.floats(-1.5707, 1.5707), st.floats(1.0, 1e8))
def test_azel_round_trip(azimuth: float, elevation: float, range_m: float) -> None:
    back = azel.azel_from_enu(*azel.enu_from_azel(azimuth, elevation, range_m))
    # an angle near the zenith is only as good as the direction it stands for
    assert abs(np.sin(back[0] - azimuth)) * np.cos(elevation) < 1e-15 + 1e-12 * np.cos(elevation)
    assert abs(back[1] - elevation) < 1e-12
    assert back[2] == pytest.approx(range_m, rel=1e-14)
    assert -np.pi < back[0] <= np.pi


def test_south_is_plus_pi() -> None:
    assert azel.azel_from_enu(-0.0, -1.0, 0.0)[0] == np.pi
    assert azel.azel_from_enu(np.array([-0.0]), np.array([-1.0]), np.array([0.0]))[0][0] == np.pi


def test_scalars_and_arrays_agree_bit_for_bit() -> None:
    lat, lon, h = 0.7, 0.2, 3000.0
    for function, values in (
        (geodetic.ecef_from_geodetic, (lat, lon, h)),
        (geodetic.geodetic_from_ecef, (4e6, 1e6, 4.8e6)),
        (azel.azel_from_enu, (10.0, -20.0, 5.0)),
        (azel.enu_from_azel, (1.0, 0.3, 50.0)),
    ):
        one = function(*values)
        many = function(*(np.full((2, 3), v) for v in values))
        assert all(isinstance(v, float) for v in one)
        assert all((m == v).all() and m.shape == (2, 3) for v, m in zip(one, many))
        assert function(*(np.array(v) for v in values)) == one


@pytest.mark.parametrize(
    ("function", "values", "says"),
    [
        (geodetic.ecef_from_geodetic, (1.6, 0.0, 0.0), "latitude"),
        (geodetic.ecef_from_geodetic, (np.nan, 0.0, 0.0), "row 0"),
        (geodetic.ecef_from_geodetic, ([0.0, 2.0], 0.0, 0.0), "row 1"),
        (geodetic.geodetic_from_ecef, (10.0, 0.0, 0.0), "centre"),
        (geodetic.geodetic_from_ecef, (np.inf, 0.0, 0.0), "finite"),
        (azel.azel_from_enu, (np.nan, 0.0, 0.0), "finite"),
        (azel.enu_from_azel, (0.0, 0.0, np.inf), "finite"),
    ],
)
def test_bad_input_is_told(function: object, values: tuple[float, ...], says: str) -> None:
    with pytest.raises(UserError, match=says):
        function(*values)  # type: ignore[operator]


def test_sine_and_cosine_are_those_of_the_library() -> None:
    from boresight.kernels.trig import sincos

    rng = np.random.default_rng(9)
    angles = np.concatenate(
        [rng.uniform(-7, 7, 20000), rng.uniform(-1e6, 1e6, 2000), np.arange(-8, 9) * np.pi / 4, [1e7, 0.0]]
    )
    ours = np.array([sincos(float(a)) for a in angles])
    # one unit in the last place of either, also close to a zero
    np.testing.assert_allclose(ours[:, 0], np.sin(angles), rtol=3e-16, atol=0)
    np.testing.assert_allclose(ours[:, 1], np.cos(angles), rtol=3e-16, atol=0)
    assert np.isnan(sincos(np.inf)).all()
