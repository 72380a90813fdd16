"""Registration off line: derivatives, simulated truth inside its own bands, what cannot be seen said to be so."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from benchmarks.registration import CONFIG, case
from benchmarks.registration_batch import with_camera

from boresight.cli.register import PRIOR, fit, rows_of
from boresight.errors import UserError
from boresight.kernels.registration import AZIMUTH, ELEVATION, RANGE, SCALE, TIME
from boresight.kernels.registration_batch import reports_of
from boresight.register.apply import corrected
from boresight.register.batch import BatchConfig, parameters_of
from boresight.register.observe import observed_of
from boresight.register.paths import KNOT, first_path, interval
from boresight.register.residuals import linearise
from boresight.types import Axes, Component, Detections, Mount, Recording, Sensor, SensorKind, Site


def test_reports_and_their_derivatives_equal_differences() -> None:
    rng = np.random.default_rng(1)
    n = 12
    p, v = 300.0 * rng.normal(size=(n, 3)), 10.0 * rng.normal(size=(n, 3))
    s, u = 20.0 * rng.normal(size=(n, 3)), rng.normal(size=(n, 3))
    axes = np.array([np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(n)])
    errors = np.array([0.0, 3.0, 0.02, 0.04, -0.03]) * rng.normal(size=(n, 5))

    def report(p: np.ndarray, v: np.ndarray, errors: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        z, H, S = np.empty((n, 7)), np.empty((n, 7, 6)), np.empty((n, 7, 5))
        reports_of(p, v, s, u, axes, errors, z, H, S)
        return z, H, S

    z, H, S = report(p, v, errors)
    bearing = z[:, [4, 5, 6]] / np.linalg.norm(z[:, 4:], axis=1)[:, None]
    np.testing.assert_allclose(np.linalg.norm(z[:, 4:], axis=1), z[:, 0], rtol=1e-12)
    np.testing.assert_allclose(np.sin(z[:, 2]), bearing[:, 2], atol=1e-12)
    h = 1e-4
    for a in range(3):
        step = np.zeros(3)
        step[a] = h
        slope = (report(p + step, v, errors)[0] - report(p - step, v, errors)[0]) / (2 * h)
        slope[:, 1] = np.angle(np.exp(1j * slope[:, 1] * 2 * h)) / (2 * h)
        np.testing.assert_allclose(H[:, :3, a], slope[:, :3], atol=2e-5)
        # the turn by an elevation offset is left out of the Cartesian rows: 3 % at most
        np.testing.assert_allclose(H[:, 4:, a], slope[:, 4:], atol=0.15)
    for parameter in (RANGE, SCALE, AZIMUTH, ELEVATION):
        step = np.zeros(5)
        step[parameter] = 1e-6
        slope = (report(p, v, errors + step)[0] - report(p, v, errors - step)[0]) / 2e-6
        np.testing.assert_allclose(S[:, 4:, parameter], slope[:, 4:], rtol=0.05, atol=0.02 * np.abs(slope).max())


def test_estimates_lie_in_their_own_bands() -> None:
    """15 runs of 4 parameters: mean 57 of 60, sigma 1.7; four of these. All 200: benchmarks.registration_batch."""
    inside = total = 0
    for seed in range(15):
        recording, truth = case(4000 + seed)
        found, tracks = fit(recording, CONFIG, None, recording.sensor_index("right"))
        assert tracks >= 2
        for row in rows_of(recording, found):
            assert row["sensor"] == "off"
            error = row["value"] - truth.get(row["parameter"], 0.0)
            inside += row["low_95"] <= truth.get(row["parameter"], 0.0) <= row["high_95"]
            total += 1
            assert abs(error) < 6 * row["sigma"]
            if row["parameter"] == "time_offset_s":
                assert "±" in row["text"]
    assert total == 60
    assert inside >= 50


def test_a_camera_in_the_same_place_does_not_show_range() -> None:
    for seed in range(3):
        recording, truth = with_camera(5000 + seed)
        found, _ = fit(recording, CONFIG, None, recording.sensor_index("camera"))
        rows = {row["parameter"]: row for row in rows_of(recording, found)}
        assert rows["range_scale"]["text"] == "range scale: not observable from this geometry"
        assert rows["range_offset_m"]["sigma"] > 0.3 * PRIOR[RANGE]
        assert rows["range_offset_m"]["verdict"] != "observable"
        assert abs(rows["azimuth_offset_deg"]["value"] - truth["azimuth_offset_deg"]) < 1.0


def test_taking_the_errors_out_takes_them_out() -> None:
    recording, truth = case(6001)
    off = recording.sensor_index("off")
    found, _ = fit(recording, CONFIG, None, recording.sensor_index("right"))
    errors = np.zeros(5)
    errors[found.parameter] = found.value
    better = corrected(recording, {off: errors})
    assert better.sensors[off].latency == pytest.approx(recording.sensors[off].latency + errors[TIME])
    again, _ = fit(better, CONFIG, None, recording.sensor_index("right"))
    assert (np.abs(again.value) < np.sqrt(np.diag(again.covariance))).all()
    assert abs(truth["time_offset_s"]) > 0.2  # there was something to take out


@pytest.mark.parametrize("axes", [Axes.BODY, Axes.SITE_ENU])
def test_polar_cartesian_and_mounted_sensors_are_corrected_alike(axes: Axes) -> None:
    errors = np.array([0.5, 4.0, 0.01, 0.03, -0.02])
    true = np.array([300.0, 0.4, 0.1])
    r, az, el = true[0] * 1.01 + 4.0, true[1] + 0.03, true[2] - 0.02
    z = np.full((2, 7), np.nan)
    z[0, :3] = r, az, el
    z[1, 4:] = r * math.cos(el) * math.sin(az), r * math.cos(el) * math.cos(az), r * math.sin(el)
    sensor = Sensor("s", SensorKind.RADAR, axes=axes, sigma=np.ones(7), latency=1.0)
    two = np.zeros(2, np.int64)
    detections = Detections(
        np.arange(2.0), np.arange(2.0), two, np.arange(2), z, np.where(np.isnan(z), np.nan, 1.0), {}
    )
    recording = Recording("r", 3, Site(0.0, 0.0, 0.0), (sensor,), detections, duplicates=np.zeros(2, bool))
    out = corrected(recording, {0: errors})
    assert out.sensors[0].latency == 1.5
    turned = 0.03 if axes == Axes.BODY else 0.0  # the mount takes it
    if axes == Axes.BODY:
        assert (out.sensors[0].axes, out.sensors[0].mount) == (Axes.MOUNT, Mount(yaw=-0.03))
    np.testing.assert_allclose(out.detections.z[0, :3], true + [0.0, turned, 0.0], atol=1e-9)
    box = out.detections.z[1, 4:]
    assert np.linalg.norm(box) == pytest.approx(300.0)
    assert math.atan2(box[0], box[1]) == pytest.approx(0.4 + turned)


def test_knots_and_first_paths() -> None:
    recording, _ = case(6002, duration=40.0)
    track = np.where(np.isfinite(recording.detections.z[:, Component.RANGE]), 7, -1)
    observed = observed_of(recording, track, {}, (0, 1), {0: 2.0})
    assert observed.tracks == 1
    mine = observed.sensor == 0
    t = np.sort(observed.t[mine])
    expected = [np.sum(np.abs(t - x) <= 1.0 + 1e-9) for x in observed.t[mine]]
    np.testing.assert_array_equal(observed.alike[mine], expected)
    path = first_path(observed, 0, 2, 0.1)
    assert np.diff(path.t) == pytest.approx(KNOT)
    assert path.t[0] < observed.t.min()
    k = interval(path.t, observed.t)
    assert ((path.t[k] <= observed.t + 1e-9) & (observed.t < path.t[k] + KNOT + 1e-9)).all()
    lines = linearise(observed, [path], np.zeros((2, 5)), recording.sensors, {}, 0, np.zeros(0), 3.0, np.ones(2), 0.0)
    assert lines.lines == 2 * len(observed.t)
    assert np.isfinite(lines.y).all()
    assert lines.place([10]).min() >= 10


def test_parameters_follow_what_a_sensor_measures() -> None:
    radar = Sensor("r", SensorKind.RADAR, sigma=np.array([1.0, 0.1, 0.1, *[np.nan] * 4]))
    camera = Sensor("c", SensorKind.INFRARED, sigma=np.array([np.nan, 0.1, *[np.nan] * 5]))
    assert parameters_of([radar, camera], [0, 1], 0, False) == [(1, TIME), (1, AZIMUTH)]
    expected = [(0, TIME), (0, RANGE), (0, SCALE), (0, AZIMUTH), (0, ELEVATION)]
    assert parameters_of([radar, camera], [0, 1], 1, False) == expected
    assert dataclasses.replace(BatchConfig(0.1, np.array(PRIOR)), robust=2.0).robust == 2.0


def test_nothing_to_register_is_told() -> None:
    recording, _ = case(6003, duration=20.0)
    with pytest.raises(UserError, match="no track long enough"):
        observed_of(recording, np.full(len(recording.detections), -1), {}, (0, 1), {})
