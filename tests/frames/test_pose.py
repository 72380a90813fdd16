"""The pose of a platform between its stamps, and of a sensor on it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from boresight.align.smooth import polynomial_weights
from boresight.errors import UserError
from boresight.frames import attitude, local
from boresight.frames.pose import add_navigation_noise, pose_track, sensor_pose
from boresight.kernels.measurement import measure
from boresight.types import Axes, Mount, PlatformTrack, Sensor, SensorKind, Site

LEVEL = Mount()
T = np.arange(0.0, 20.0, 0.1)
NAN = np.full((len(T), 3), np.nan)


def truth(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """An aircraft that weaves: position, velocity, yaw-pitch-roll."""
    t = np.asarray(t)
    p = np.stack([100 * t, 200 * np.sin(0.3 * t), 500 + 10 * np.sin(0.2 * t)], axis=-1)
    v = np.stack([np.full_like(t, 100.0), 60 * np.cos(0.3 * t), 2 * np.cos(0.2 * t)], axis=-1)
    ypr = np.stack([3.0 + 0.05 * t, 0.1 * np.sin(0.4 * t), 0.5 * np.sin(0.5 * t)], axis=-1)
    return p, v, ypr


def platform(velocity: bool = True, ypr: bool = True) -> PlatformTrack:
    p, v, a = truth(T)
    none = np.full(len(T), np.nan)
    return PlatformTrack("plane", T, p, v if velocity else NAN, a if ypr else NAN, none, none)


def sensor(axes: Axes, mount: Mount = LEVEL, on: str | None = "plane") -> Sensor:
    return Sensor("eye", SensorKind.INFRARED, on, axes, mount)


def test_hermite_and_slerp_follow_the_truth() -> None:
    t = np.random.default_rng(3).uniform(0, 19.9, 3000)
    pose = pose_track(platform()).at(t)
    p, v, a = truth(t)
    np.testing.assert_allclose(pose.position, p, atol=1e-5)  # h^4/384 max|p''''| = 4e-7 m
    np.testing.assert_allclose(pose.velocity, v, atol=1e-3)
    np.testing.assert_allclose(pose.enu_from_body, attitude.enu_from_body(*a.T), atol=3e-4)
    yaw, pitch, roll = truth(T)[2].T
    theirs = Slerp(T, Rotation.from_euler("ZYX", np.stack([yaw, pitch, roll], axis=-1)))(t).as_matrix()
    np.testing.assert_allclose(pose.enu_from_body, local.ENU_FROM_NED @ theirs, atol=1e-13)


def test_without_velocity_it_is_linear_and_the_slope_is_smoothed() -> None:
    rng = np.random.default_rng(4)
    noisy = replace(platform(velocity=False), position=truth(T)[0] + rng.normal(0, 0.1, (len(T), 3)))
    t = rng.uniform(1.0, 18.0, 500)
    pose = pose_track(noisy).at(t)
    # 21 stamps over ±1 s: slope noise 0.1 / sqrt(7.7) = 0.036 m/s; two-point slopes would have 1.4 m/s
    assert np.sqrt(np.mean((pose.velocity - truth(t)[1]) ** 2)) < 1.0
    assert np.abs(pose.position - truth(t)[0]).max() < 0.6


def test_rows_without_attitude_are_bridged() -> None:
    track = platform()
    ypr = track.ypr.copy()
    ypr[1::2] = np.nan
    pose = pose_track(replace(track, ypr=ypr)).at(T[:-1])
    np.testing.assert_allclose(pose.enu_from_body, attitude.enu_from_body(*truth(T[:-1])[2].T), atol=1.5e-3)


def test_yaw_through_south_goes_the_short_way() -> None:
    ypr = np.zeros((2, 3))
    ypr[:, 0] = np.radians([179.0, -179.0])
    nav = PlatformTrack("p", T[:2], np.zeros((2, 3)), NAN[:2], ypr, NAN[:2, 0], NAN[:2, 0])
    track = pose_track(nav)
    yaw, _, _ = attitude.ypr_from_rotation(local.ENU_FROM_NED @ track.at(0.05).enu_from_body)
    assert abs(yaw) == pytest.approx(np.pi, abs=1e-12)


def test_limits_are_kept() -> None:
    track = pose_track(platform(), max_extrapolation=1.0, max_gap=2.0)
    end = track.at(T[-1] + 0.5)
    np.testing.assert_allclose(end.position, truth(T[-1])[0] + 0.5 * truth(T[-1])[1], atol=1e-9)
    with pytest.raises(UserError, match="more than 1 s outside the navigation"):
        track.at(T[-1] + 1.1)
    with pytest.raises(UserError, match="outside"):
        track.at(np.nan)
    p = platform()
    keep = (T < 5) | (T > 8)
    holed = PlatformTrack("p", *(np.asarray(c)[keep] for c in (p.t, p.position, p.velocity, p.ypr)), T[keep], T[keep])
    track = pose_track(holed, max_gap=2.0)
    with pytest.raises(UserError, match="gap of 3"):
        track.at([1.0, 6.0])
    np.testing.assert_array_equal(track.usable([1.0, 6.0, 9.0, 30.0], attitude=True), [True, False, True, False])
    assert np.isfinite(pose_track(holed).at(6.0).position).all()


def test_bad_navigation_is_told() -> None:
    p = platform()
    with pytest.raises(UserError, match="must ascend"):
        pose_track(replace(p, t=T[::-1].copy()))
    with pytest.raises(UserError, match="no row has a position"):
        pose_track(replace(p, position=NAN))


def test_sensor_axes() -> None:
    track = pose_track(platform())
    t = np.array([1.0, 7.03])
    p, _, a = truth(t)
    position, velocity, R = sensor_pose(sensor(Axes.SITE_ENU), track, t)
    assert not position.any()
    assert not velocity.any()
    np.testing.assert_array_equal(R, np.broadcast_to(np.eye(3), (2, 3, 3)))
    position, velocity, R = sensor_pose(sensor(Axes.PLATFORM_ENU), track, t)
    np.testing.assert_allclose(position, p, atol=1e-5)
    np.testing.assert_array_equal(R, np.broadcast_to(np.eye(3), (2, 3, 3)))
    enu_from_body = attitude.enu_from_body(*a.T)
    _, _, R = sensor_pose(sensor(Axes.BODY), track, t)
    np.testing.assert_allclose(R, enu_from_body @ [[0, 1, 0], [1, 0, 0], [0, 0, -1]], atol=3e-4)
    mount = Mount(0.5, -0.2, 0.1, (2.0, 0.5, -1.0))
    position, velocity, R = sensor_pose(sensor(Axes.MOUNT, mount), track, t)
    turned = enu_from_body @ attitude.ned_from_body(0.5, -0.2, 0.1)
    np.testing.assert_allclose(R, turned @ [[0, 1, 0], [1, 0, 0], [0, 0, -1]], atol=3e-4)
    np.testing.assert_allclose(position, p + enu_from_body @ [2.0, 0.5, -1.0], atol=1e-3)


def test_lever_arm_moves_as_the_derivative_of_its_position() -> None:
    track = pose_track(platform())
    eye = sensor(Axes.BODY, Mount(lever_arm=(2.0, 0.5, -1.0)))
    t, h = np.array([3.033, 11.27]), 1e-4
    velocity = sensor_pose(eye, track, t)[1]
    numeric = (sensor_pose(eye, track, t + h)[0] - sensor_pose(eye, track, t - h)[0]) / (2 * h)
    np.testing.assert_allclose(velocity, numeric, atol=1e-6)


def test_a_body_sensor_measures_what_its_bore_sees() -> None:
    """A target 10° right of the nose and level is at azimuth +10°, elevation 0 in body axes."""
    heading = np.radians(75.0)
    ypr = np.tile([heading, 0.0, 0.0], (2, 1))
    track = pose_track(PlatformTrack("p", T[:2], np.zeros((2, 3)), NAN[:2], ypr, NAN[:2, 0], NAN[:2, 0]))
    s, u, R = sensor_pose(sensor(Axes.BODY), track, 0.05)
    bearing = heading + np.radians(10.0)
    z, H = np.empty(7), np.empty((7, 6))
    measure(1000 * np.array([np.sin(bearing), np.cos(bearing), 0.0]), np.zeros(3), s[0], u[0], R[0], z, H)
    np.testing.assert_allclose(z[:3], [1000.0, np.radians(10.0), 0.0], atol=1e-9)


def test_what_is_missing_is_told() -> None:
    bare = pose_track(platform(ypr=False))
    np.testing.assert_array_equal(bare.at(1.0).enu_from_body, local.ENU_FROM_NED)
    with pytest.raises(UserError, match="needs the attitude of platform 'plane'"):
        sensor_pose(sensor(Axes.BODY), bare, 1.0)
    with pytest.raises(UserError, match="lever arm"):
        sensor_pose(sensor(Axes.PLATFORM_ENU, Mount(lever_arm=(1.0, 0, 0))), bare, 1.0)
    with pytest.raises(UserError, match="no track of its platform 'plane'"):
        sensor_pose(sensor(Axes.BODY), None, 1.0)
    position, _, R = sensor_pose(sensor(Axes.MOUNT, Mount(yaw=0.3), on=None), None, 1.0)
    assert not position.any()
    np.testing.assert_allclose(R[0][:, 1], [np.sin(0.3), np.cos(0.3), 0.0], atol=1e-15)


def test_local_level_turns_with_the_place() -> None:
    """100 km north of the site, up there leans north by 100/6371 rad in the site's axes."""
    site = Site(0.7, 0.3, 0.0)
    e, n, u = local.enu_from_geodetic(0.7 + 100e3 / 6.37e6, 0.3, 0.0, site)
    where = np.tile([e, n, u], (2, 1))
    nav = PlatformTrack("p", T[:2], where, NAN[:2], np.zeros((2, 3)), NAN[:2, 0], NAN[:2, 0])
    R = sensor_pose(sensor(Axes.PLATFORM_ENU), pose_track(nav, site), 0.05)[2][0]
    lean = 100e3 / 6.37e6
    np.testing.assert_allclose(R[:, 2], [0.0, np.sin(lean), np.cos(lean)], atol=1e-12)
    body = sensor_pose(sensor(Axes.BODY), pose_track(nav, site), 0.05)[2][0]
    np.testing.assert_allclose(body, R, atol=1e-12)  # heading north, level


def test_a_rolling_platform_is_foretold_by_its_change_of_rate() -> None:
    """30° of roll in 9 s, stamps at 10 Hz: up to one stamp ahead within 0.03°, where the last rate is 0.07° off."""
    t = np.arange(0.0, 20.0, 0.1)
    ypr = np.zeros((len(t), 3))
    ypr[:, 2] = np.radians(30.0) * np.sin(2 * np.pi * t / 9.0)
    none = np.full(len(t), np.nan)
    nav = PlatformTrack("p", t, np.zeros((len(t), 3)), np.full((len(t), 3), np.nan), ypr, none, none)
    track = pose_track(nav)
    worst = 0.0
    for known in np.arange(3.0, 18.0, 0.31):
        at = known + 0.099
        R = track.until(known).at(at).enu_from_body
        roll = attitude.ypr_from_rotation(local.ENU_FROM_NED @ R)[2]
        worst = max(worst, abs(roll - np.radians(30.0) * np.sin(2 * np.pi * at / 9.0)))
    assert np.degrees(worst) < 0.1  # the newest stamp is up to 0.1 s older than `known`
    far = track.until(5.0).at(6.9).enu_from_body
    assert np.abs(far @ far.T - np.eye(3)).max() < 1e-12
    rate = track.until(5.0).body_rate(5.05)[0]
    true = np.radians(30.0) * 2 * np.pi / 9.0 * np.cos(2 * np.pi * 5.05 / 9.0)
    assert rate[0] == pytest.approx(true, abs=np.radians(0.8))


def test_the_error_of_navigation_enters_the_measurements() -> None:
    """Attitude noise of 1 mrad and 3 m of position, at 1000 m: in angles √(1² + 3²) mrad, in range 3 m."""
    declared = np.full(len(T), 1e-3)
    track = pose_track(replace(platform(), sigma_attitude=declared, sigma_position=np.full(len(T), 3.0)))
    z = np.array([[1000.0, 0.2, np.pi / 3, np.nan, np.nan, np.nan, np.nan]])
    R = np.full((1, 7, 7), np.nan)
    R[0, :3, :3] = np.diag([25.0, 1e-6, 1e-6])
    between, beyond = np.array([5.05]), np.array([T[-1] + 0.1])
    out = add_navigation_noise(sensor(Axes.BODY), track, between, z, R)
    np.testing.assert_allclose(np.diag(out[0])[:3], [25.0 + 9.0, 1e-6 + 4 * 1e-5, 1e-6 + 1e-5])
    out = add_navigation_noise(sensor(Axes.BODY), track, beyond, z, R)
    assert out[0, 2, 2] == pytest.approx(1e-6 + 9e-6 + 1e-6 * 2.8**2)
    level = add_navigation_noise(sensor(Axes.PLATFORM_ENU), track, between, z, R)
    assert level[0, 2, 2] == pytest.approx(1e-6 + 9e-6)  # north-aligned axes do not turn with the body
    assert add_navigation_noise(sensor(Axes.BODY), pose_track(platform()), between, z, R) is R
    # what is said of foretelling: four stamps, quadratic, one ahead
    w = polynomial_weights(np.arange(4.0), [4.0], 2)[0]
    assert np.sqrt(w @ w) == pytest.approx(2.8, abs=0.02)
