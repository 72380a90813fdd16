"""A tracker with one track is the extended Kalman filter: the same state and covariance, report by report."""

from __future__ import annotations

import numpy as np
import pytest

from boresight.filters.ekf import predict, update
from boresight.models import Infrared, NearlyConstantVelocity, Radar
from boresight.tracking.config import TrackerConfig
from boresight.tracking.tracker import Tracker
from boresight.types import GaussianState, Scan, Sensor, SensorKind

SIGMA = {"range": 15.0, "angle": 2e-3, "infrared": 4e-4}


def sensor(name: str, kind: SensorKind, **sigma: float) -> Sensor:
    values = np.full(7, np.nan)
    for i, key in enumerate(("range", "azimuth", "elevation")):
        values[i] = sigma.get(key, np.nan)
    return Sensor(name, kind, sigma=values, p_detection=0.95, clutter_per_scan=1e-6)


def look(number: int, t: float, z: np.ndarray, one: Sensor) -> Scan:
    full, R = np.full((1, 7), np.nan), np.full((1, 7, 7), np.nan)
    full[0, :3] = z
    known = np.flatnonzero(np.isfinite(full[0]))
    R[0][np.ix_(known, known)] = np.diag(one.sigma[known] ** 2)
    return Scan(number, t, t, np.array([t]), full, R, np.array([round(1000 * t)]))


@pytest.mark.parametrize("q", [0.5, 20.0])
def test_one_track_is_the_extended_kalman_filter(q: float) -> None:
    """Radar at 2 Hz and infrared at 10 Hz, biases off: from the tenth look on to 1e-9, 200 looks long."""
    rng = np.random.default_rng(11)
    radar = sensor("radar", SensorKind.RADAR, range=SIGMA["range"], azimuth=SIGMA["angle"], elevation=SIGMA["angle"])
    camera = sensor("ir", SensorKind.INFRARED, azimuth=SIGMA["infrared"], elevation=SIGMA["infrared"])
    config = TrackerConfig(q=q, speed_sigma=100.0, static_share=0.0, extent=0.0, gate_probability=0.999999)
    tracker = Tracker(config, (radar, camera), 3)
    motion = NearlyConstantVelocity(q=q)
    models = (
        Radar(sigma_range=SIGMA["range"], sigma_azimuth=SIGMA["angle"], sigma_elevation=SIGMA["angle"]),
        Infrared(sigma_azimuth=SIGMA["infrared"], sigma_elevation=SIGMA["infrared"]),
    )
    state = tracker.init()
    truth = np.array([4000.0, 3000.0, 1500.0, -120.0, 40.0, 5.0])
    plain: GaussianState | None = None
    compared = 0
    for k in range(200):
        t = 0.1 * (k + 1)
        where = motion.transition(truth, t)
        number = 0 if k % 5 == 0 else 1
        model, one = models[number], (radar, camera)[number]
        exact = model.h(where)
        z = np.full(3, np.nan)
        z[np.isfinite(one.sigma[:3])] = exact + np.sqrt(np.diag(model.R(where))) * rng.normal(size=len(exact))
        measured = z[np.isfinite(z)]
        if plain is not None:
            plain, _ = update(predict(plain, motion, t), model, measured)
        state, _ = tracker.step(state, look(number, t, z, one))
        tracks = state.window.tracks
        assert int(tracks.live[0]) == 1
        x, P = tracks.x[0], tracks.P[0]
        if k < 10:  # the tracker begins the track; from then on the filter has the same to go by
            plain = GaussianState(t, x.copy(), P.copy())
            continue
        assert plain is not None
        scale = np.sqrt(np.diag(P))
        np.testing.assert_allclose((plain.x - x) / scale, 0.0, atol=1e-9)
        np.testing.assert_allclose((plain.P - P) / np.outer(scale, scale), 0.0, atol=1e-9)
        compared += 1
    assert compared == 190
    error = (x - motion.transition(truth, 20.0)) / scale
    assert float(error @ np.linalg.solve(P / np.outer(scale, scale), error)) < 33.0  # 1e-5 of chi-square with 6


def test_the_guide_without_biases_is_the_kalman_filter_of_constant_acceleration() -> None:
    """Positions of one source, 100 of them at uneven times: mean and covariance to 1e-9 of the standard deviation.

    The guide works in the inertial frame of t = 0: the plain filter gets the same positions turned by the Earth's rate.
    """
    from boresight.kernels.guide import EARTH_RATE
    from boresight.models import NearlyConstantAcceleration, Position
    from boresight.pointing.guide import GuideFilter, GuideSource

    rng = np.random.default_rng(4)
    q, sigma = 2.0, 20.0
    guide = GuideFilter((GuideSource("gps", sigma_position=sigma),), False, q, gate=1e6, forget=0.0)
    motion, model = NearlyConstantAcceleration(q=q), Position(sigma=sigma)
    state, plain = guide.init(), None
    place = np.array([4.2e6, 6.3e5, 4.7e6])
    t = 0.0
    for k in range(110):
        t += rng.uniform(0.05, 0.6)
        z = place + t * np.array([120.0, -60.0, 90.0]) + sigma * rng.normal(size=3)
        guide.step(state, 0, t, z)
        c, s = np.cos(EARTH_RATE * t), np.sin(EARTH_RATE * t)
        turned = np.array([c * z[0] - s * z[1], s * z[0] + c * z[1], z[2]])
        x, P = state.X[0, :9], state.P[0, :9, :9]
        if plain is None or k < 10:
            plain = GaussianState(t, x.copy(), P.copy())
            continue
        plain, _ = update(predict(plain, motion, t), model, turned)
        scale = np.sqrt(np.diag(P))
        # positions are millions of metres: their last bit is 1e-9 m, some 1e-10 of a standard deviation
        np.testing.assert_allclose((plain.x - x) / scale, 0.0, atol=1e-8)
        np.testing.assert_allclose((plain.P - P) / np.outer(scale, scale), 0.0, atol=1e-9)
