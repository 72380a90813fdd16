"""The packed filter and its tiles against a NumPy twin in dense Joseph form, and against the friendly filter."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from numba import njit

from boresight.errors import UserError
from boresight.filters import ekf, packed
from boresight.kernels.arctan import arctan2, near
from boresight.kernels.packed import BACKWARDS
from boresight.models import Infrared, NearlyConstantVelocity, Position, Radar, SensorPose
from boresight.models.base import KernelSensor

MOTION = NearlyConstantVelocity(q=0.5)
X0, P0 = np.array([4000.0, 3000, 1000, -10, 5, 0]), np.diag([1e4, 1e4, 1e4, 400, 400, 400.0])
TURN = SensorPose(
    np.array([50.0, -30, 8]), np.array([1.0, 2, 0]), np.array([[0.8, 0.48, 0.36], [-0.6, 0.64, 0.48], [0, -0.6, 0.8]])
)
SENSORS = (
    Radar(sigma_range=5.0, sigma_azimuth=0.01, sigma_elevation=0.01),
    Infrared(sigma_azimuth=0.002, sigma_elevation=0.002),
    Radar(sigma_range=5.0, sigma_azimuth=0.01, sigma_range_rate=0.5, pose=TURN),
    Infrared(sigma_azimuth=0.002, sigma_elevation=0.002, pose=TURN),
    Position(20.0, pose=TURN),
)


def test_arctangent_and_wrap() -> None:
    rng = np.random.default_rng(1)
    points = np.concatenate(
        (rng.normal(size=(20_000, 2)) * 10.0 ** rng.uniform(-9, 9, (20_000, 1)), np.eye(2), -np.eye(2))
    )
    compiled, wrapped = njit(arctan2.py_func), njit(near.py_func)
    for y, x in points:
        assert abs(compiled(y, x) - math.atan2(y, x)) < 2e-15
    assert compiled(0.0, 0.0) == 0.0
    for angle in (-9.0, -math.pi, 0.3, 3.2, 40.0):
        assert math.remainder(wrapped(angle) - angle, 2 * math.pi) == pytest.approx(0.0, abs=1e-14)
        assert -math.pi <= wrapped(angle) <= math.pi


def test_arctan_coefficients() -> None:
    """The polynomial of `arctan2`, found again: Newton's interpolation of (atan(√s)/√s - 1)/s in long double."""
    import inspect

    L = np.longdouble
    top = (np.sqrt(L(2)) - 1) ** 2
    k = np.arange(11).astype(L)
    s = top / 2 * (1 + np.cos(4 * np.arctan(L(1)) * (k + L(0.5)) / 11))
    c = (np.arctan(np.sqrt(s)) / np.sqrt(s) - 1) / s
    for j in range(1, 11):
        c[j:] = (c[j:] - c[j - 1 : -1]) / (s[j:] - s[: 11 - j])
    p = c[10:]
    for j in range(9, -1, -1):
        p = np.concatenate(([L(0)], p)) - s[j] * np.concatenate((p, [L(0)]))
        p[0] += c[j]
    source = inspect.getsource(arctan2.py_func)
    written = [
        float(line.split("=")[1].split("+")[0]) for line in source.splitlines() if line.strip().startswith("p = ")
    ]
    # the highest coefficients are the least determined: what counts is the value
    at = np.linspace(0.0, float(top), 1001)
    np.testing.assert_allclose(np.polyval(written, at), np.polyval(p[::-1].astype(float), at), rtol=0, atol=2e-16)


def twin(count: int, dt: float, q: float, sensors: tuple[KernelSensor, ...], z: list[np.ndarray]) -> np.ndarray:
    """Plain NumPy, dense, Joseph form, all components of a report at once; returns (count, 27) as packed."""
    x, P, out = X0.copy(), P0.copy(), []
    F = np.eye(6) + dt * np.eye(6, k=3)
    Q = q * np.kron([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]], np.eye(3))
    upper = np.triu_indices(3)
    for i in range(count):
        x, P = F @ x, F @ P @ F.T + Q
        sensor = sensors[i % len(sensors)]
        H, R, y = sensor.H(x), sensor.R(x), sensor.innovation(z[i], x)
        K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
        x, A = x + K @ y, np.eye(6) - K @ H
        P = A @ P @ A.T + K @ R @ K.T
        P = 0.5 * (P + P.T)
        out.append(np.r_[x, P[:3, :3][upper], P[:3, 3:].ravel(), P[3:, 3:][upper]])
    return np.array(out)


def measurements(rng: np.random.Generator, count: int, dt: float) -> list[np.ndarray]:
    out = []
    for i in range(count):
        t = dt * (i + 1)
        truth = np.array([4000 - 10 * t, 3000 + 5 * t, 1000, -10, 5, 0])
        sensor = SENSORS[i % len(SENSORS)]
        out.append(sensor.h(truth) + rng.normal(size=sensor.dimension) * np.sqrt(np.diag(sensor.R(truth))))
    return out


def test_20_000_updates_agree_with_the_numpy_twin_to_1e9() -> None:
    count, dt = 20_000, 0.02
    z = measurements(np.random.default_rng(2), count, dt)
    reference = twin(count, dt, 0.5, SENSORS, z)
    sensors = [SENSORS[i % len(SENSORS)] for i in range(count)]
    reports = packed.table(np.cumsum(np.full(count, dt)), sensors, z)
    belief, kept = packed.pack(ekf.init(0.0, X0, P0), MOTION), np.empty((count, 27))
    packed.run(belief, reports, kept)
    scale = np.maximum(1.0, np.abs(reference))
    assert np.max(np.abs(kept - reference) / scale) < 1e-9
    np.testing.assert_array_equal(belief[2:], kept[-1])
    # the covariance of the last report is symmetric by storage, and positive definite
    assert np.linalg.eigvalsh(packed.unpack(belief).P).min() > 0.0


def test_one_report_at_a_time_equals_the_stream_and_the_friendly_filter() -> None:
    z = measurements(np.random.default_rng(3), 200, 0.1)
    z[7][1] = np.nan
    belief, other = (packed.pack(ekf.init(0.0, X0, P0), MOTION) for _ in range(2))
    state = ekf.init(0.0, X0, P0)
    reports = packed.table([0.1 * (i + 1) for i in range(200)], [SENSORS[i % 5] for i in range(200)], z)
    nis = np.empty(200)
    packed.run(other, reports, nis=nis)
    for i in range(200):
        sensor, t = SENSORS[i % 5], 0.1 * (i + 1)
        value = packed.step(belief, packed.report(sensor, t, z[i]))
        state, info = ekf.update(ekf.predict(state, MOTION, t), sensor, z[i])
        assert value == pytest.approx(info.nis, rel=1e-8)
        assert value == pytest.approx(nis[i], rel=1e-12)
    np.testing.assert_allclose(belief, other, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(packed.unpack(belief).x, state.x, rtol=1e-9)
    np.testing.assert_allclose(packed.unpack(belief).P, state.P, rtol=1e-9, atol=1e-9)


def compare_tiles(sensors: tuple[KernelSensor, ...], count: int, tracks: tuple[int, ...], threads: int) -> None:
    """100 tracks, one full tile and a part, some reports and some components missed by some, against the stream."""
    rng, n, k = np.random.default_rng(4), 100, count
    t, used = np.cumsum(rng.uniform(0.0, 0.2, k)), [sensors[i % len(sensors)] for i in range(k)]
    x0 = X0 + rng.normal(size=(n, 6)) * np.sqrt(np.diag(P0))
    z = []
    for now, sensor in zip(t, used):
        truth = X0.copy()
        truth[:3] += now * X0[3:]
        noise = rng.normal(size=(n, sensor.dimension)) * np.sqrt(np.diag(sensor.R(truth)))
        z.append(sensor.h(truth) + noise)
        z[-1][rng.random(n) < 0.2] = np.nan
        z[-1][rng.random(n) < 0.1, 0] = np.nan
    many = packed.run_many(MOTION, 0.0, x0, P0, t, used, z, keep=True, threads=threads)
    for i in tracks:
        belief, nis = packed.pack(ekf.init(0.0, x0[i], P0), MOTION), np.empty(k)
        kept = np.empty((k, 27))
        packed.run(belief, packed.table(t, used, [row[i] for row in z]), kept, nis)
        one = packed.unpack(belief)
        np.testing.assert_allclose(many.x[i], one.x, rtol=1e-11, atol=1e-9)
        np.testing.assert_allclose(many.P[i], one.P, rtol=1e-10, atol=1e-9)
        np.testing.assert_allclose(many.kept[:, i], kept[:, :6], rtol=1e-10, atol=1e-9)
        assert many.nis[i] == pytest.approx(nis.sum(), rel=1e-9)
        assert many.dof[i] == sum(int(np.isfinite(row[i]).sum()) for row in z)


@pytest.mark.parametrize("threads", [1, 2])
def test_tiles_equal_the_stream(threads: int) -> None:
    compare_tiles(SENSORS, 60, (0, 1, 63, 64, 99), threads)


MIXED = tuple(
    Radar(*(sigma if measured else None for sigma, measured in zip((5.0, 0.01, 0.02, 0.5), which)), pose=pose)
    for pose in (SENSORS[0].pose, TURN)
    for which in itertools.product((True, False), repeat=4)
    if any(which)
)


@pytest.mark.parametrize("sensor", [*MIXED, None])
def test_tiles_take_every_mix_of_components(sensor: Radar | None) -> None:
    """Each mix alone, so that nothing that another left behind can stand in for what it should have noted; and all."""
    compare_tiles((sensor,) if sensor else MIXED, 12 if sensor else 3 * len(MIXED), (0, 77), 1)


def test_directions_that_are_not_defined_are_left_out() -> None:
    above = ekf.init(0.0, np.array([0.0, 0, 1000, 0, 0, 0]), np.eye(6))
    belief = packed.pack(above, MOTION)
    sensor = SENSORS[0]
    packed.step(belief, packed.report(sensor, 0.0, np.array([1001.0, 0.3, math.pi / 2])))
    state, info = ekf.update(above, sensor, np.array([1001.0, 0.3, math.pi / 2]))
    assert len(info.y) == 2  # no azimuth
    np.testing.assert_allclose(packed.unpack(belief).x, state.x, atol=1e-9)
    many = packed.run_many(
        MOTION, 0.0, above.x[None], above.P, np.zeros(1), [sensor], [np.array([[1001.0, 0.3, math.pi / 2]])]
    )
    np.testing.assert_allclose(many.x[0], state.x, atol=1e-9)
    assert many.dof[0] == 2


def test_mistakes_are_named() -> None:
    state = ekf.init(0.0, X0, P0)
    belief = packed.pack(state, MOTION)
    before = belief.copy()
    for t in (-1.0, math.nan):
        assert packed.step(belief, packed.report(SENSORS[0], t, np.zeros(3))) == BACKWARDS
        np.testing.assert_array_equal(belief, before)
    for sensor in (Radar(5.0, 0.01, 0.01, tangent=True), Radar(5.0, dimensions=2)):
        assert not packed.fits(MOTION, [sensor])
        with pytest.raises(UserError, match="uncorrelated noise"):
            packed.report(sensor)
    correlated = Radar(1.0, 1.0, covariance=np.array([[1.0, 0.5], [0.5, 1.0]]))
    with pytest.raises(UserError, match="uncorrelated noise"):
        packed.table([0.0], [correlated], [np.zeros(2)])
    with pytest.raises(UserError, match="6 components"):
        packed.pack(ekf.init(0.0, np.zeros(4), np.eye(4)), MOTION)
    with pytest.raises(UserError, match="cannot go past report 1"):
        packed.run(belief, packed.table([1.0, 0.5], [SENSORS[0]] * 2, [SENSORS[0].h(X0)] * 2))
    with pytest.raises(UserError, match="none before t0"):
        packed.run_many(MOTION, 2.0, X0[None], P0, np.ones(1), [SENSORS[0]], [np.zeros((1, 3))])
    with pytest.raises(UserError, match="N = 1 tracks"):
        packed.run_many(MOTION, 0.0, X0[None], P0, np.ones(1), [SENSORS[0]], [np.zeros((2, 3))])
