"""Agreement with FilterPy (test extra) and Stone Soup (bench extra) on the same inputs; skipped where not installed."""

from __future__ import annotations

import datetime
import warnings
from typing import Any

import numpy as np
import pytest

from boresight.filters import ekf, stream
from boresight.filters.imm import InteractingModels
from boresight.models import Infrared, NearlyConstantVelocity, Radar

MOTION = NearlyConstantVelocity(q=0.5)
X0, P0 = np.array([900.0, 500, 80, -10, 5, 0]), np.diag([400.0, 400, 400, 100, 100, 100])
SENSORS = [Radar(5.0, 0.01, 0.01), Infrared(2e-3, 2e-3), Infrared(2e-3, 2e-3)]
NO_FILTERPY = "filterpy is not installed (test extra)"
NO_STONESOUP = "stonesoup is not installed (bench extra)"


def rows(k: int = 300) -> list[tuple[float, Any, np.ndarray]]:
    rng = np.random.default_rng(1)
    out = []
    for i in range(k):
        t = 0.1 * (i + 1)
        truth = np.array([900 - 10 * t, 500 + 5 * t, 80.0, -10, 5, 0])
        sensor = SENSORS[i % 3]
        out.append((t, sensor, sensor.h(truth) + rng.normal(size=sensor.dimension) * np.sqrt(np.diag(sensor.R(truth)))))
    return out


def ours() -> stream.Filtered:
    return stream.run(ekf.init(0.0, X0, P0), MOTION, stream.stack(*map(list, zip(*rows()))))


def test_filterpy_ekf() -> None:
    kalman = pytest.importorskip("filterpy.kalman", reason=NO_FILTERPY)
    peer = kalman.ExtendedKalmanFilter(dim_x=6, dim_z=3)
    peer.x, peer.P, now = X0.copy(), P0.copy(), 0.0
    out = ours()
    for k, (t, sensor, z) in enumerate(rows()):
        peer.F, peer.Q = MOTION.F(X0, t - now), MOTION.Q(X0, t - now)
        peer.predict()
        peer._I = np.eye(6)

        def residual(a: np.ndarray, b: np.ndarray) -> np.ndarray:
            d = a - b
            d[-2:] = (d[-2:] + np.pi) % (2 * np.pi) - np.pi
            return d

        peer.dim_z = sensor.dimension
        peer.update(z, sensor.H, sensor.h, R=sensor.R(X0), residual=residual)
        peer.P = 0.5 * (peer.P + peer.P.T)
        now = t
        np.testing.assert_allclose(out.x[k], peer.x, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(out.P[k], peer.P, rtol=1e-9, atol=1e-9)


def test_filterpy_rts() -> None:
    kalman = pytest.importorskip("filterpy.kalman", reason=NO_FILTERPY)
    out = ours()
    k = len(out.t)
    peer = kalman.KalmanFilter(dim_x=6, dim_z=3)
    F = np.array([MOTION.F(X0, 0.1)] * k)
    Q = np.array([MOTION.Q(X0, 0.1)] * k)
    x, P, _, _ = peer.rts_smoother(out.x, out.P, F, Q)
    smoothed = stream.smooth(out)
    np.testing.assert_allclose(smoothed[0], x, rtol=1e-9, atol=1e-8)
    np.testing.assert_allclose(smoothed[1], P, rtol=1e-8, atol=1e-8)


def test_filterpy_imm() -> None:
    """Linear models and reports. FilterPy mixes after the update, ours before the prediction: the same chain."""
    kalman = pytest.importorskip("filterpy.kalman", reason=NO_FILTERPY)
    from boresight.kernels.imm import markov
    from boresight.models import Position

    quiet, lively, sensor = NearlyConstantVelocity(0.01), NearlyConstantVelocity(5.0), Position(2.0)
    models = InteractingModels((quiet, lively), (5.0, 3.0))
    rng = np.random.default_rng(2)
    path = [np.array([900 - t, 500 + 10 * np.sin(0.3 * t), 80.0]) for t in range(60)]
    z = [p + 2.0 * rng.normal(size=3) for p in path]
    peers = []
    for motion in (quiet, lively):
        one = kalman.KalmanFilter(dim_x=6, dim_z=3)
        one.x, one.P, one.F, one.Q = X0.copy(), P0.copy(), motion.F(X0, 1.0), motion.Q(X0, 1.0)
        one.H, one.R = np.eye(3, 6), sensor.R(X0)
        peers.append(one)
    transition = markov(models.rates, 1.0)
    peer = kalman.IMMEstimator(peers, np.array([0.5, 0.5]), transition)
    state = models.init(0.0, X0, P0, [0.0, 0.0], np.array([0.5, 0.5]))
    for k in range(60):
        peer.predict()
        peer.update(z[k])
        state, _ = models.update(models.predict(state, k + 1.0), sensor, z[k])
        np.testing.assert_allclose(state.x, peer.x, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(state.P, peer.P, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(state.weights, peer.mu, rtol=1e-9, atol=1e-9)


def test_stone_soup_ekf() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pytest.importorskip("stonesoup", reason=NO_STONESOUP)
        from stonesoup.models.measurement.nonlinear import (
            CartesianToElevationBearing,
            CartesianToElevationBearingRange,
        )
        from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
        from stonesoup.predictor.kalman import ExtendedKalmanPredictor
        from stonesoup.types.detection import Detection
        from stonesoup.types.hypothesis import SingleHypothesis
        from stonesoup.types.state import GaussianState, StateVector
        from stonesoup.updater.kalman import ExtendedKalmanUpdater

        # their bearing runs from the first mapped axis to the second: map (north, east, up) for ours; their state is
        # interleaved (position, velocity per axis)
        to_peer = np.array([0, 3, 1, 4, 2, 5])  # their order, by our indices
        mapping = (2, 0, 4)

        # they take Jacobians by finite differences, good to 1e-8; given the exact one, all else agrees to 1e-9
        def exact(kind: type, sensor: Any, order: list[int]) -> Any:
            def jacobian(self: Any, state: Any, **_: Any) -> np.ndarray:
                x = np.empty(6)
                x[to_peer] = np.asarray(state.state_vector, dtype=float).ravel()
                return sensor.H(x)[np.ix_(order, to_peer)]

            return type("Exact", (kind,), {"jacobian": jacobian})

        full = exact(CartesianToElevationBearingRange, SENSORS[0], [2, 1, 0])(6, mapping, np.diag([1e-4, 1e-4, 25.0]))
        angles = exact(CartesianToElevationBearing, SENSORS[1], [1, 0])(6, mapping, np.diag([4e-6, 4e-6]))
        moves = CombinedLinearGaussianTransitionModel([ConstantVelocity(0.5)] * 3)
        predictor, start = ExtendedKalmanPredictor(moves), datetime.datetime(2026, 1, 1)
        updater = ExtendedKalmanUpdater(None, force_symmetric_covariance=True)
        state = GaussianState(X0[to_peer].reshape(-1, 1), P0[np.ix_(to_peer, to_peer)], timestamp=start)
        out, reports = ours(), rows()
        for k, (t, sensor, z) in enumerate(reports):
            at = start + datetime.timedelta(seconds=t)
            is_radar = sensor.dimension == 3
            vector = StateVector([z[2], z[1], z[0]] if is_radar else [z[1], z[0]])
            detection = Detection(vector, timestamp=at, measurement_model=full if is_radar else angles)
            state = updater.update(SingleHypothesis(predictor.predict(state, timestamp=at), detection))
            x = np.asarray(state.state_vector, dtype=float).ravel()
            np.testing.assert_allclose(out.x[k][to_peer], x, rtol=1e-9, atol=1e-9)
            P = np.asarray(state.covar, dtype=float)
            np.testing.assert_allclose(out.P[k][np.ix_(to_peer, to_peer)], P, rtol=1e-9, atol=1e-9)
