"""What simulated sensors report, against what was asked of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from boresight.frames.pose import pose_track, sensor_pose
from boresight.kernels.measurement import measure
from boresight.models.motion import NearlyConstantVelocity
from boresight.sim.actors import Attitude, Drawn, Platform, Target
from boresight.sim.looks import SimulatedSensor
from boresight.sim.paths import Waypoints
from boresight.sim.scenario import Scenario, simulate
from boresight.types import Axes, Coverage, Mount, Recording, Sensor, SensorKind, Site

SITE = Site(0.8, 0.1, 100.0)
SIGMA = np.array([5.0, 0.01, 0.02, 0.5, np.nan, np.nan, np.nan])
FAR = Coverage(range=(0.0, 20000.0))


def target(name: str = "a", east: float = 1000.0) -> Target:
    x0 = np.array([east, 2000.0, 500.0, 30.0, -20.0, 5.0])
    return Target(name, Drawn(NearlyConstantVelocity(0.5), x0))


def radar(**changes: object) -> SimulatedSensor:
    declared = Sensor("radar", SensorKind.RADAR, sigma=SIGMA, p_detection=1.0, clutter_per_scan=0.0, coverage=FAR)
    own = {k: v for k, v in changes.items() if hasattr(declared, k) and k not in ("latency", "period")}
    rest = {k: v for k, v in changes.items() if k not in own}
    return SimulatedSensor(replace(declared, **own), **{"period": 0.5, **rest})


def run(*sensors: SimulatedSensor, seed: int = 1, platforms: tuple[Platform, ...] = (), **changes: object) -> Recording:
    base = {"targets": (target(),), "duration": 500.0, "dimensions": 3, "epoch": 0.0}
    scenario = Scenario("x", site=SITE, sensors=sensors, platforms=platforms, **{**base, **changes})
    return simulate(scenario, np.random.default_rng(seed))


def expected(rec: Recording, i: int = 0, latency: float = 0.0) -> np.ndarray:
    """Noise-free measurements at the rows' own times, from the recorded truth and platform."""
    truth, sensor = rec.truth[0], rec.sensors[i]
    rows = np.flatnonzero((rec.detections.sensor == i) & ~np.isnan(rec.detections.z).all(axis=1))
    t = rec.detections.t[rows] - latency
    track = pose_track(rec.platforms[0], rec.site) if sensor.platform else None
    s, v, R = sensor_pose(sensor, track, t)
    out, H = np.empty((len(t), 7)), np.empty((7, 6))
    for k in range(len(t)):
        p = np.array([np.interp(t[k], truth.t, truth.position[:, j]) for j in range(3)])
        u = np.array([np.interp(t[k], truth.t, truth.velocity[:, j]) for j in range(3)])
        measure(p, u, s[k], v[k], R[k], out[k], H)
    return out


def test_errors_are_as_declared() -> None:
    rec = run(radar(bias=(3.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.0)))
    error = (rec.detections.z - expected(rec))[:, :4]
    n = len(error)
    assert n == 1001
    # 5 standard errors of a mean and of a standard deviation
    assert (abs(error.mean(axis=0) - [3.0, 0.0, 0.01, 0.0]) < 5 * SIGMA[:4] / math.sqrt(n)).all()
    assert (abs(error.std(axis=0) / SIGMA[:4] - 1.0) < 5 / math.sqrt(2 * n)).all()
    assert np.isnan(rec.detections.z[:, 4:]).all()


def test_detection_probability_clutter_and_dropouts() -> None:
    rec = run(radar(p_detection=0.7, clutter_per_scan=3.0, p_dropout=0.2, outages=((100.0, 200.0),)))
    d = rec.detections
    looks = len(np.unique(d.scan))
    asked = 1001 - 201
    assert abs(looks - 0.8 * asked) < 5 * math.sqrt(asked * 0.16)
    assert not ((d.t >= 100.0) & (d.t <= 200.0)).any()
    # a row is of the target when it lies within 5 sigma of it in range, azimuth, elevation
    seen = ~np.isnan(d.z).all(axis=1)
    near = (abs((d.z[seen] - expected(rec))[:, :3]) < 5 * SIGMA[:3]).all(axis=1)
    assert abs(near.sum() - 0.7 * looks) < 5 * math.sqrt(looks * 0.21)
    assert abs((~near).sum() - 3.0 * looks) < 5 * math.sqrt(3.0 * looks)
    # clutter is uniform in range over the coverage: mean far/2, standard deviation far/√12
    ranges = d.z[seen][~near, 0]
    assert abs(ranges.mean() - 10000.0) < 5 * 20000.0 / math.sqrt(12 * len(ranges))


def test_empty_looks_are_rows_of_nothing() -> None:
    rec = run(radar(coverage=Coverage(range=(0.0, 10.0))), duration=10.0)
    assert np.isnan(rec.detections.z).all()
    assert rec.detections.scan.tolist() == list(range(21))


def test_coverage_and_lifetime_hold() -> None:
    box = Coverage(range=(0.0, 20000.0), azimuth=(math.radians(170), math.radians(-170)))
    south = Target("s", Waypoints(np.array([[-500.0, -1000.0, 0.0], [500.0, -1000.0, 0.0]]), speeds=np.full(2, 10.0)))
    short = replace(south, birth=20.0, death=80.0)
    rec = run(radar(coverage=box), targets=(short,), duration=100.0)
    seen = rec.detections.t[~np.isnan(rec.detections.z).all(axis=1)]
    # azimuth 180° ± 10° is |east| < 1000 tan 10° = 176.3 m, from 32.4 s to 67.6 s
    assert seen.min() == pytest.approx(32.5)
    assert seen.max() == pytest.approx(67.5)
    assert (rec.truth[0].t[0], rec.truth[0].t[-1]) == (20.0, 80.0)


def test_stamps_latency_and_arrival() -> None:
    rec = run(radar(latency=0.3, arrival_delay=0.2, arrival_jitter=0.5, sigma=1e-6 * SIGMA), duration=50.0)
    d = rec.detections
    assert (np.diff(d.t_recv) >= 0).all()  # file order is arrival order
    assert (np.diff(d.t) < 0).any()  # ... and some stamps are out of order
    assert ((d.t_recv - d.t) >= 0.2).all()
    np.testing.assert_allclose(d.z[:, 0], expected(rec, latency=0.3)[:, 0], atol=0.05)


def test_a_rotating_beam_gives_each_detection_its_own_time() -> None:
    rec = run(radar(rotating=True, period=4.0, sigma=1e-9 * SIGMA), duration=100.0)
    d = rec.detections
    turn = np.mod(d.z[:, 1], 2 * math.pi) / (2 * math.pi)
    np.testing.assert_allclose(d.t, 4.0 * d.scan + 4.0 * turn, atol=1e-6)
    np.testing.assert_allclose(d.z[:, 0], expected(rec)[:, 0], atol=0.05)


@pytest.mark.parametrize("axes", list(Axes))
def test_every_kind_of_axes_agrees_with_the_filters_measurement(axes: Axes) -> None:
    corners = np.array([[0.0, 0.0, 50.0], [400.0, 300.0, 80.0], [900.0, 100.0, 60.0]])
    ship = Platform(
        "ship",
        Waypoints(corners, speeds=np.full(3, 20.0), turn_radius=100.0),
        Attitude(pitch=0.05, roll=0.1, sway=(0.02, 0.05, 0.1), sway_period=(7.0, 5.0, 3.0)),
    )
    fine = replace(ship, navigation=replace(ship.navigation, rate=100.0))
    mount = Mount(0.4, -0.1, 0.05, (3.0, 1.0, -10.0) if axes is not Axes.SITE_ENU else (0.0, 0.0, 0.0))
    sensor = radar(axes=axes, mount=mount, sigma=1e-9 * np.ones(7), platform=None if axes is Axes.SITE_ENU else "ship")
    rec = run(sensor, platforms=(fine,), duration=40.0)
    error = rec.detections.z - expected(rec)
    assert len(error) == 81
    # the recorded truth is linear between 0.1 s nodes, and the attitude between 0.01 s
    np.testing.assert_allclose(error[:, [0, 4, 5, 6]], 0.0, atol=0.05)
    np.testing.assert_allclose(error[:, 1:3], 0.0, atol=1e-4)


def test_one_seed_gives_one_recording_and_sensors_do_not_change_the_truth() -> None:
    a, b, c = (run(radar(clutter_per_scan=1.0), duration=20.0, seed=s) for s in (1, 1, 2))
    np.testing.assert_array_equal(a.detections.z, b.detections.z)
    np.testing.assert_array_equal(a.detections.t_recv, b.detections.t_recv)
    assert not np.array_equal(a.truth[0].position, c.truth[0].position)
    two = run(radar(), radar(id="other"), duration=20.0)
    np.testing.assert_array_equal(two.truth[0].position, a.truth[0].position)


def test_navigation_carries_its_own_errors() -> None:
    line = Waypoints(np.array([[0.0, 0.0, 0.0], [1000.0, 0.0, 0.0]]), speeds=np.full(2, 10.0))
    ship = Platform("ship", line)
    noisy = replace(ship, navigation=replace(ship.navigation, sigma_position=2.0, sigma_attitude=0.01))
    track = run(radar(), platforms=(noisy,), duration=100.0).platforms[0]
    error = track.position - np.stack([10.0 * track.t, 0 * track.t, 0 * track.t], axis=1)
    assert error.std() == pytest.approx(2.0, rel=5 / math.sqrt(2 * error.size))
    assert track.ypr[:, 1].std() == pytest.approx(0.01, rel=5 / math.sqrt(2 * len(track.t)))
    assert (track.sigma_position == 2.0).all()
