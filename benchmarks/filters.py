"""One radar/IR stream through an extended Kalman filter: boresight, NumPy by hand, FilterPy, Stone Soup."""

from __future__ import annotations

import datetime
import math
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit

import boresight
from boresight.filters import ekf, own, packed, stream
from boresight.filters.msc import MscFilter
from boresight.filters.ukf import UnscentedKalman
from boresight.models import Infrared, NearlyConstantVelocity, Radar
from boresight.models.own import OwnMotion, OwnSensor

Rows = list[tuple[float, Any, np.ndarray]]
X0 = np.array([4000.0, 3000.0, 1000.0, -100.0, 20.0, 0.0])
P0 = np.diag([1e4, 1e4, 1e4, 400.0, 400.0, 400.0])
MOTION = NearlyConstantVelocity(q=0.5)
SENSORS = (
    Radar(sigma_range=5.0, sigma_azimuth=0.01, sigma_elevation=0.01),
    Infrared(sigma_azimuth=0.002, sigma_elevation=0.002),
)


def rows(count: int) -> Rows:
    """Return `count` reports, radar and IR in turn, 50 a second, of one target that keeps its course."""
    rng = np.random.default_rng(5)
    out = []
    for k in range(count):
        t = 0.02 * (k + 1)
        truth = X0.copy()
        truth[:3] += t * X0[3:]
        sensor = SENSORS[k % 2]
        z = sensor.h(truth) + rng.normal(size=sensor.dimension) * np.sqrt(np.diag(sensor.R(truth)))
        out.append((t, sensor, z))
    return out


def friendly(reports: Rows) -> np.ndarray:
    """The immutable public API, one predict and one update a report."""
    state = boresight.GaussianState(0.0, X0, P0)
    for t, sensor, z in reports:
        state, _ = boresight.update(boresight.predict(state, MOTION, t), sensor, z)
    return state.x


def packed_calls(reports: Rows) -> Callable[[], np.ndarray]:
    """One call a report on a packed belief, in place; laying the reports out is not part of it."""
    start, filled = packed.pack(ekf.init(0.0, X0, P0), MOTION), [packed.report(s, t, z) for t, s, z in reports]
    belief = start.copy()

    def call() -> np.ndarray:
        belief[:] = start
        for report in filled:
            packed.step(belief, report)
        return packed.unpack(belief).x

    return call


def packed_stream(reports: Rows) -> Callable[[], np.ndarray]:
    """The whole stream in one call on a packed belief."""
    start, table = packed.pack(ekf.init(0.0, X0, P0), MOTION), packed.table(*map(list, zip(*reports, strict=True)))
    belief = start.copy()

    def call() -> np.ndarray:
        belief[:] = start
        packed.run(belief, table)
        return packed.unpack(belief).x

    return call


@njit(cache=True, error_model="numpy")
def own_move(x, dt, p, x_out, F, Q):
    """A user's nearly constant velocity: p = (q,)."""
    F[:, :] = 0.0
    Q[:, :] = 0.0
    for i in range(3):
        F[i, i] = F[3 + i, 3 + i] = 1.0
        F[i, 3 + i] = dt
        Q[i, i], Q[3 + i, 3 + i] = p[0] * dt * dt * dt / 3.0, p[0] * dt
        Q[i, 3 + i] = Q[3 + i, i] = p[0] * dt * dt / 2.0
        x_out[i], x_out[3 + i] = x[i] + dt * x[3 + i], x[3 + i]


@njit(cache=True, error_model="numpy")
def own_see(x, z, c, y, H, R):
    """A user's range, azimuth and elevation at the origin: c = variances; range may be missing."""
    flat2 = x[0] * x[0] + x[1] * x[1]
    flat, r2 = math.sqrt(flat2), flat2 + x[2] * x[2]
    r = math.sqrt(r2)
    H[:3, :] = 0.0
    R[:3, :3] = 0.0
    m = 0
    if not math.isnan(z[0]):
        y[0], R[0, 0] = z[0] - r, c[0]
        H[0, 0], H[0, 1], H[0, 2] = x[0] / r, x[1] / r, x[2] / r
        m = 1
    y[m] = (z[1] - math.atan2(x[0], x[1]) + math.pi) % (2.0 * math.pi) - math.pi
    H[m, 0], H[m, 1] = x[1] / flat2, -x[0] / flat2
    y[m + 1] = z[2] - math.atan2(x[2], flat)
    H[m + 1, 0], H[m + 1, 1] = -x[0] * x[2] / (flat * r2), -x[1] * x[2] / (flat * r2)
    H[m + 1, 2] = flat / r2
    R[m, m], R[m + 1, m + 1] = c[1], c[2]
    return m + 2


def own_models(reports: Rows) -> tuple[Callable[[], np.ndarray], Callable[[], np.ndarray]]:
    """A user's own kernels: one call a report, and the whole stream."""
    motion = OwnMotion(own_move, 6, np.array([MOTION.q]))
    sensors = {
        3: OwnSensor(own_see, 3, np.array([25.0, 1e-4, 1e-4])),
        2: OwnSensor(own_see, 3, np.array([1.0, 4e-6, 4e-6])),
    }
    full = [(t, sensors[s.dimension], z if s.dimension == 3 else np.r_[np.nan, z]) for t, s, z in reports]
    used, start = own.models(motion, sensors[3]), own.pack(ekf.init(0.0, X0, P0), motion)
    filled, table = [own.report(s, t, z) for t, s, z in full], own.table(*map(list, zip(*full, strict=True)))
    belief = start.copy()

    def calls() -> np.ndarray:
        belief[:] = start
        for report in filled:
            own.step(belief, report, used.motion, used.observe)
        return own.unpack(belief).x

    def whole() -> np.ndarray:
        belief[:] = start
        own.run(belief, used, table)
        return own.unpack(belief).x

    return calls, whole


def prepared(reports: Rows) -> Callable[[], np.ndarray]:
    """The whole stream in one call; laying the reports out is not part of it."""
    stacked = stream.stack(*map(list, zip(*reports, strict=True)))
    start = ekf.init(0.0, X0, P0)
    return lambda: stream.run(start, MOTION, stacked).x[-1]


def other_streams(reports: Rows) -> dict[str, Callable[[], object]]:
    """Our other filters over the same stream: iterated EKF, UKF, and MSC with a platform that does not move."""
    stacked = stream.stack(*map(list, zip(*reports, strict=True)))
    start, ukf, msc = ekf.init(0.0, X0, P0), UnscentedKalman(), MscFilter()
    begin, still = msc.init(0.0, X0, P0), np.zeros((len(reports), 6))
    return {
        "boresight, iterated EKF": lambda: stream.run(start, MOTION, stacked, 10),
        "boresight, UKF": lambda: ukf.run(start, MOTION, stacked),
        "boresight, MSC": lambda: msc.run(begin, MOTION, stacked, still),
    }


def transition(dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Return F and Q of MOTION, by hand."""
    F = np.eye(6)
    F[:3, 3:] = dt * np.eye(3)
    Q = np.block([[dt**3 / 3 * np.eye(3), dt**2 / 2 * np.eye(3)], [dt**2 / 2 * np.eye(3), dt * np.eye(3)]])
    return F, MOTION.q * Q


def by_hand(reports: Rows) -> np.ndarray:
    """Plain NumPy as one would write it: dense matrices, Jacobian by hand."""
    x, P, now = X0.copy(), P0.copy(), 0.0
    eye = np.eye(6)
    for t, sensor, z in reports:
        F, Q = transition(t - now)
        x, P, now = F @ x, F @ P @ F.T + Q, t
        e, n, u = x[:3]
        rho2 = e * e + n * n
        rho, r2 = math.sqrt(rho2), rho2 + u * u
        r = math.sqrt(r2)
        H = np.zeros((3, 6))
        H[0, :3] = e / r, n / r, u / r
        H[1, :2] = n / rho2, -e / rho2
        H[2, :3] = -e * u / (rho * r2), -n * u / (rho * r2), rho / r2
        h = np.array([r, math.atan2(e, n), math.atan2(u, rho)])
        R = np.diag([25.0, 1e-4, 1e-4])
        if sensor.dimension == 2:
            H, h, R = H[1:], h[1:], np.diag([4e-6, 4e-6])
        y = z - h
        y[-2:] = (y[-2:] + np.pi) % (2 * np.pi) - np.pi
        S = H @ P @ H.T + R
        K = np.linalg.solve(S, H @ P).T
        x = x + K @ y
        A = eye - K @ H
        P = A @ P @ A.T + K @ R @ K.T
    return x


def filterpy(reports: Rows) -> np.ndarray:
    """FilterPy's ExtendedKalmanFilter, given the same h, H, F and Q."""
    from filterpy.kalman import ExtendedKalmanFilter

    peer = ExtendedKalmanFilter(dim_x=6, dim_z=3)
    peer.x, peer.P, now = X0.copy(), P0.copy(), 0.0

    def residual(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        d = a - b
        d[-2:] = (d[-2:] + np.pi) % (2 * np.pi) - np.pi
        return d

    for t, sensor, z in reports:
        peer.F, peer.Q = transition(t - now)
        peer.predict()
        peer.dim_z = sensor.dimension
        peer.update(z, sensor.H, sensor.h, R=sensor.R(X0), residual=residual)
        now = t
    return np.asarray(peer.x)


def stone_soup(reports: Rows) -> np.ndarray:
    """Stone Soup's predictor and updater with its own models (Jacobians by its finite differences)."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from stonesoup.models.measurement.nonlinear import CartesianToElevationBearing, CartesianToElevationBearingRange
        from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
        from stonesoup.predictor.kalman import ExtendedKalmanPredictor
        from stonesoup.types.detection import Detection
        from stonesoup.types.hypothesis import SingleHypothesis
        from stonesoup.types.state import GaussianState, StateVector
        from stonesoup.updater.kalman import ExtendedKalmanUpdater

        theirs = np.array([0, 3, 1, 4, 2, 5])  # their state is (position, velocity) per axis
        mapping = (2, 0, 4)  # their bearing runs from the first to the second: (north, east, up) for ours
        radar = CartesianToElevationBearingRange(6, mapping, np.diag([1e-4, 1e-4, 25.0]))
        infrared = CartesianToElevationBearing(6, mapping, np.diag([4e-6, 4e-6]))
        moves = CombinedLinearGaussianTransitionModel([ConstantVelocity(0.5)] * 3)
        predictor, start = ExtendedKalmanPredictor(moves), datetime.datetime(2026, 1, 1)
        updater = ExtendedKalmanUpdater(None, force_symmetric_covariance=True)
        state: Any = GaussianState(X0[theirs].reshape(-1, 1), P0[np.ix_(theirs, theirs)], timestamp=start)
        for t, sensor, z in reports:
            at = start + datetime.timedelta(seconds=t)
            is_radar = sensor.dimension == 3
            vector = StateVector([z[2], z[1], z[0]] if is_radar else [z[1], z[0]])
            detection = Detection(vector, timestamp=at, measurement_model=radar if is_radar else infrared)
            state = updater.update(SingleHypothesis(predictor.predict(state, timestamp=at), detection))
        x = np.empty(6)
        x[theirs] = np.asarray(state.state_vector, dtype=float).ravel()
        return x
