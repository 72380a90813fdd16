"""Gate and assignment of a frame of detections: boresight, SciPy's dense optimum, Stone Soup."""

from __future__ import annotations

import datetime
import warnings
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from boresight.association import nearest

GATE = 13.8  # d² that 99.9 % of the right detections keep in two dimensions
SIGMA = 4.0  # m, of every innovation's component


class Frame(NamedTuple):
    """Predicted positions of n tracks, and m detections: one of each track, and a tenth as many false ones."""

    x: np.ndarray  # (n, 2)
    S: np.ndarray  # (n, 2, 2)
    z: np.ndarray  # (m, 2)


# A clutter density that makes staying alone worth exactly the gate: ½(d² - GATE) is what every contender adds up.
P_DETECTION = 0.9
DENSITY = P_DETECTION / (1 - P_DETECTION) / (2 * np.pi * SIGMA**2) * np.exp(-0.5 * GATE)


def frame(targets: int) -> Frame:
    """Return a frame in which a gate holds about two detections."""
    rng = np.random.default_rng(targets)
    side = 30.0 * np.sqrt(targets)
    x = rng.uniform(0.0, side, (targets, 2))
    false = rng.uniform(0.0, side, (targets // 10, 2))
    z = np.concatenate((x + rng.normal(0.0, SIGMA, x.shape), false))
    return Frame(x, np.tile(SIGMA**2 * np.eye(2), (targets, 1, 1)), rng.permutation(z))


def ours(f: Frame) -> float:
    """Gate and assignment by the public function: the total cost."""
    return nearest.assign(f.x, f.S, f.z, gate=GATE, p_detection=P_DETECTION, clutter_density=DENSITY).cost


def dense(f: Frame) -> float:
    """The same by one large matrix: every distance, then SciPy's optimum."""
    n, m = len(f.x), len(f.z)
    y = f.z[None] - f.x[:, None]
    d2 = np.einsum("nmi,nij,nmj->nm", y, np.linalg.inv(f.S), y)
    cost = np.full((n, m + n), 1e6)
    cost[:, :m] = np.where(d2 < GATE, 0.5 * (d2 - GATE), 1e6)
    cost[:, m:][np.diag_indices(n)] = 0.0
    rows, columns = linear_sum_assignment(cost)
    return float(cost[rows, columns].sum())


def stone_soup(f: Frame) -> tuple[Any, Any, Any, Any]:
    """Return Stone Soup's associator, tracks, detections and time for the frame: `stone_soup_cost` runs it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
        from stonesoup.hypothesiser.distance import DistanceHypothesiser
        from stonesoup.measures import SquaredMahalanobis
        from stonesoup.models.measurement.linear import LinearGaussian
        from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
        from stonesoup.predictor.kalman import KalmanPredictor
        from stonesoup.types.detection import Detection
        from stonesoup.types.state import GaussianState
        from stonesoup.types.track import Track
        from stonesoup.updater.kalman import KalmanUpdater
    now = datetime.datetime(2026, 1, 1)
    half = 0.5 * SIGMA**2  # of the prediction and of the measurement: S = SIGMA² I
    model = LinearGaussian(4, (0, 2), half * np.eye(2))
    P = np.diag([half, 1.0, half, 1.0])
    tracks = {Track([GaussianState([x, 0.0, y, 0.0], P, timestamp=now)]) for x, y in f.x}
    detections = {Detection(row.reshape(-1, 1), timestamp=now, measurement_model=model) for row in f.z}
    predictor = KalmanPredictor(CombinedLinearGaussianTransitionModel([ConstantVelocity(0.0)] * 2))
    hypothesiser = DistanceHypothesiser(predictor, KalmanUpdater(model), SquaredMahalanobis(), missed_distance=GATE)
    return GNNWith2DAssignment(hypothesiser), tracks, detections, now


def stone_soup_cost(prepared: tuple[Any, Any, Any, Any]) -> float:
    """Associate, and return the total cost as ours."""
    associator, tracks, detections, now = prepared
    found = associator.associate(tracks, detections, now)
    return sum(0.5 * (float(h.distance) - GATE) for h in found.values() if h)
