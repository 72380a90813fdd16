"""One radar/infrared EKF over one stream, ours and the peers', in the same run: `python benchmarks/filters.py`.

Prints microseconds a report and the ratio to ours (stream).
Peers need the bench extra; those missing are left out.
"""

from __future__ import annotations

import datetime
import importlib.util
import time
import warnings
from collections.abc import Callable

import numpy as np

from boresight.filters import ekf, stream
from boresight.filters.msc import MscFilter
from boresight.filters.ukf import UnscentedKalman
from boresight.models import Infrared, NearlyConstantVelocity, Radar

MOTION = NearlyConstantVelocity(q=0.5)
RADAR, INFRARED = Radar(5.0, 0.01, 0.01), Infrared(2e-3, 2e-3)
PRIOR = ekf.init(0.0, np.array([900.0, 500, 80, -10, 5, 0]), np.diag([400.0, 400, 400, 100, 100, 100]))
Rows = list[tuple[float, Radar | Infrared, np.ndarray]]


def rows(k: int) -> Rows:
    """Return k reports, every third of the radar."""
    rng, out = np.random.default_rng(1), []
    for i in range(k):
        t = 0.01 * (i + 1)
        truth = np.array([900 - 10 * t, 500 + 5 * t, 80.0, -10, 5, 0])
        sensor = RADAR if i % 3 == 0 else INFRARED
        out.append((t, sensor, sensor.h(truth) + rng.normal(size=sensor.dimension) * np.sqrt(np.diag(sensor.R(truth)))))
    return out


def per_report(call: Callable[[], object], k: int) -> float:
    """Return the best of five times, in microseconds a report; the first call, which may compile, is not counted."""
    call()
    times = []
    for _ in range(5):
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return 1e6 * min(times) / k


def steps(data: Rows) -> None:
    """Predict and update, one call each a report."""
    state = PRIOR
    for t, sensor, z in data:
        state, _ = ekf.update(ekf.predict(state, MOTION, t), sensor, z)


def filterpy(data: Rows) -> None:
    """FilterPy's ExtendedKalmanFilter with our models."""
    from filterpy.kalman import ExtendedKalmanFilter

    peer = ExtendedKalmanFilter(dim_x=6, dim_z=3)
    peer.x, peer.P, now = PRIOR.x.copy(), PRIOR.P.copy(), 0.0
    for t, sensor, z in data:
        peer.F, peer.Q = MOTION.F(peer.x, t - now), MOTION.Q(peer.x, t - now)
        peer.predict()
        peer.dim_z, now = sensor.dimension, t
        peer.update(z, sensor.H, sensor.h, R=sensor.R(peer.x))


def stone_soup(data: Rows) -> None:
    """Stone Soup's extended predictor and updater with its own models."""
    from stonesoup.models.measurement.nonlinear import CartesianToElevationBearing, CartesianToElevationBearingRange
    from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
    from stonesoup.predictor.kalman import ExtendedKalmanPredictor
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.types.state import GaussianState, StateVector
    from stonesoup.updater.kalman import ExtendedKalmanUpdater

    order = np.array([0, 3, 1, 4, 2, 5])
    full = CartesianToElevationBearingRange(6, (2, 0, 4), np.diag([1e-4, 1e-4, 25.0]))
    angles = CartesianToElevationBearing(6, (2, 0, 4), np.diag([4e-6, 4e-6]))
    predictor = ExtendedKalmanPredictor(CombinedLinearGaussianTransitionModel([ConstantVelocity(0.5)] * 3))
    updater, start = ExtendedKalmanUpdater(None, force_symmetric_covariance=True), datetime.datetime(2026, 1, 1)
    state = GaussianState(PRIOR.x[order].reshape(-1, 1), PRIOR.P[np.ix_(order, order)], timestamp=start)
    for t, sensor, z in data:
        at, is_radar = start + datetime.timedelta(seconds=t), sensor.dimension == 3
        vector = StateVector([z[2], z[1], z[0]] if is_radar else [z[1], z[0]])
        detection = Detection(vector, timestamp=at, measurement_model=full if is_radar else angles)
        state = updater.update(SingleHypothesis(predictor.predict(state, timestamp=at), detection))


def main() -> None:
    """Print the table."""
    k, few = 20_000, 500
    data = rows(k)
    reports, ukf, msc = stream.stack(*map(list, zip(*data))), UnscentedKalman(), MscFilter()
    begin, still = msc.init(0.0, PRIOR.x, PRIOR.P), np.zeros((k, 6))
    times = {
        "ours, EKF, stream": per_report(lambda: stream.run(PRIOR, MOTION, reports), k),
        "ours, iterated EKF, stream": per_report(lambda: stream.run(PRIOR, MOTION, reports, 10), k),
        "ours, UKF, stream": per_report(lambda: ukf.run(PRIOR, MOTION, reports), k),
        "ours, MSC, stream": per_report(lambda: msc.run(begin, MOTION, reports, still), k),
        "ours, EKF, step by step": per_report(lambda: steps(data[:2000]), 2000),
    }
    for name, package, call in (("FilterPy", "filterpy", filterpy), ("Stone Soup", "stonesoup", stone_soup)):
        if importlib.util.find_spec(package):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                times[name] = per_report(lambda call=call: call(data[:few]), few)  # type: ignore[misc]
    base = times["ours, EKF, stream"]
    print(f"{'one radar/infrared report':28} {'µs':>9} {'ratio':>8}")
    for name, value in times.items():
        print(f"{name:28} {value:9.2f} {value / base:8.1f}")


if __name__ == "__main__":
    main()
