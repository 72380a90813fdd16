"""mao2015's table: root mean square errors at the radar's times, per trajectory and method."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from boresight.align.window import PolynomialWindow
from boresight.fuse.weights import inverse_variance
from boresight.papers.mao2015.scenario import (
    EPOCHS,
    INFRARED_DEG,
    PATHS,
    PER_RADAR,
    RADAR_DEG,
    SAMPLES,
    STEP,
    angles_deg,
)
from boresight.papers.mao2015.smoother import fixed_lag, white_jerk
from boresight.types.sensor import FloatArray

LAG = 10
PRIOR = np.diag([1e4, 1e3, 1e3])  # deg², deg²/s², deg²/s⁴
GRID = 10.0 ** np.arange(-6.0, 5.1, 0.5)  # deg²/s⁵
TUNING_RUNS = 30
BLOCK = 100  # runs at once: bounds memory
MATCHED_Q = 1.0  # deg²/s⁵


class Window(NamedTuple):
    """How many samples before and after, and how they are weighted."""

    past: int
    future: int
    polynomial: PolynomialWindow


WINDOWS: dict[str, Window] = {
    "past": Window(60, 0, PolynomialWindow(2)),
    "past_future": Window(60, LAG, PolynomialWindow(2)),
    "past10_future10": Window(10, 10, PolynomialWindow(2)),
    "past_future_time_weighted": Window(60, LAG, PolynomialWindow(3, time_distance=True)),
    "as_printed": Window(60, LAG, PolynomialWindow(3, time_distance=True, printed=True)),
}
METHODS = ("equal", "primary", *WINDOWS, "smoother")


class Reports(NamedTuple):
    """Both sensors' reports of one angle, in degrees."""

    radar: FloatArray  # (runs, e)
    infrared: FloatArray  # (runs, e), at the radar's times
    fused: FloatArray  # (runs, n): infrared, and the fusion (1) at every radar time
    sigma: FloatArray  # (n,) of `fused`


def draw(truth: FloatArray, radar_deg: float, runs: int, rng: np.random.Generator) -> Reports:
    """Draw the reports of one true angle: (n,), or (runs, n) with a truth of its own for each run."""
    every = np.arange(0, SAMPLES, PER_RADAR)
    infrared = truth + INFRARED_DEG * rng.normal(size=(runs, SAMPLES))
    radar = truth[..., every] + radar_deg * rng.normal(size=(runs, len(every)))
    a, b = inverse_variance([radar_deg**2, INFRARED_DEG**2])
    sigma = np.full(SAMPLES, INFRARED_DEG)
    sigma[every] = np.sqrt(a) * radar_deg  # √ of mao2015 (2), which is a variance
    fused = infrared.copy()
    fused[:, every] = a * radar + b * infrared[:, every]
    return Reports(radar[:, EPOCHS // PER_RADAR], infrared[:, EPOCHS], fused, sigma)


def estimates(method: str, data: Reports) -> FloatArray:
    """Return what a method without memory makes of the reports: (runs, e)."""
    if method == "equal":
        return 0.5 * (data.radar + data.infrared)
    if method == "primary":
        return data.fused[:, EPOCHS]
    past, future, polynomial = WINDOWS[method]
    offsets = np.arange(-past, future + 1)
    weights = polynomial.weights(STEP * offsets, data.sigma[EPOCHS[0] + offsets], 0.0)
    return np.asarray(data.fused[:, EPOCHS[:, None] + offsets] @ weights)


def tune(truth: FloatArray, radar_deg: float, rng: np.random.Generator) -> float:
    """Return the jerk density of GRID (deg²/s⁵) with the least error on a few runs of their own."""
    data = draw(truth, radar_deg, TUNING_RUNS, rng)
    z = np.broadcast_to(data.fused, (len(GRID), *data.fused.shape))
    error = _smooth(z, np.broadcast_to(data.sigma, (len(GRID), SAMPLES)), GRID)[0] - truth[EPOCHS]
    return float(GRID[np.argmin((error**2).mean(axis=(1, 2)))])


def table(runs: int, seed: int) -> list[dict[str, Any]]:
    """Return rows trajectory, method, az_deg, el_deg, ratio: RMSE, and it over the smoother's own deviation."""
    out: list[dict[str, Any]] = []
    for number, (name, path) in enumerate(PATHS.items()):
        rng = np.random.default_rng((seed, number))
        truth = angles_deg(path())
        q = np.array([tune(truth[i], RADAR_DEG[i], rng) for i in range(2)])
        squares, bound = np.zeros((len(METHODS), 2)), np.zeros(2)
        for first in range(0, runs, BLOCK):
            count = min(BLOCK, runs - first)
            data = [draw(truth[i], RADAR_DEG[i], count, rng) for i in range(2)]
            smoothed, variance = _smooth(np.stack([d.fused for d in data]), np.stack([d.sigma for d in data]), q)
            bound = np.sqrt(variance.mean(axis=1))
            for m, method in enumerate(METHODS):
                for i in range(2):
                    value = smoothed[i] if method == "smoother" else estimates(method, data[i])
                    squares[m, i] += ((value - truth[i, EPOCHS]) ** 2).mean(axis=1).sum()
        for method, rmse in zip((*METHODS, "bound"), (*np.sqrt(squares / runs), bound)):
            ratio = float(np.sqrt((rmse @ rmse) / (bound @ bound)))
            errors = {"az_deg": float(rmse[0]), "el_deg": float(rmse[1])}
            out.append({"trajectory": name, "method": method, **errors, "ratio": ratio})
    return out


def matched(runs: int, seed: int) -> FloatArray:
    """Return the smoother's RMSE over its bound, azimuth and elevation (2,), on angles drawn from its own model."""
    rng = np.random.default_rng((seed, len(PATHS)))
    F, Q = white_jerk(STEP)
    root = np.linalg.cholesky(MATCHED_Q * Q)
    out = np.empty(2)
    for i, radar_deg in enumerate(RADAR_DEG):
        x = rng.normal(size=(runs, 3)) @ np.sqrt(PRIOR)
        truth = np.empty((runs, SAMPLES))
        for k in range(SAMPLES):
            truth[:, k] = x[:, 0]
            x = x @ F.T + rng.normal(size=(runs, 3)) @ root.T
        data = draw(truth, radar_deg, runs, rng)
        value, variance = _smooth(data.fused[None], data.sigma[None], np.array([MATCHED_Q]))
        out[i] = np.sqrt(((value[0] - truth[:, EPOCHS]) ** 2).mean() / variance.mean())
    return out


def _smooth(z: FloatArray, sigma: FloatArray, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    return fixed_lag(z, sigma**2, q, PRIOR, STEP, EPOCHS, LAG)
