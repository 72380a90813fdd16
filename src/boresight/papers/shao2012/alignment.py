"""Alignment rows: infrared brought to the radar's times in three ways, one update of the EKF per radar period."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from boresight.align.compression import combine, compress, compress_innovations, compressed_variance
from boresight.kernels.measurement import measure
from boresight.papers.montecarlo import Estimates, nees, wrapped
from boresight.papers.shao2012.scenario import Data, IndexArray, Setup
from boresight.types.sensor import FloatArray

Source = Callable[[Setup, Data, int, int, int, FloatArray], tuple[FloatArray, FloatArray, FloatArray]]


def aligned(setup: Setup, data: Data, kind: str) -> Estimates:
    """EKF in world ENU at the radar's rate, infrared aligned and combined with the radar's angles first.

    `interpolate`: the infrared sample of the radar's time (here there always is one; the others are left out);
    `compress`: shao2012 (4)–(11); `innovations`: all samples' innovations against the predicted track, compressed
    with the radar's own (`align.compress_innovations`).
    """
    at = np.flatnonzero(data.is_radar)
    scored = np.flatnonzero(np.isin(at, data.scored()))
    x = np.empty((len(data.z), len(scored), 6))
    P = np.empty((len(data.z), len(scored), 6, 6))
    spent = 0.0
    for run in range(len(data.z)):
        reports: Source = _innovations if kind == "innovations" else _Reduced(setup, data, at, run, kind)
        begin = time.perf_counter()
        means, covariances = _filter(setup, data, at, run, reports)
        spent += time.perf_counter() - begin
        x[run], P[run] = means[scored], covariances[scored]
    truth = data.truth[:, at][:, scored]
    return Estimates(x, nees(x - truth, P), 6, 1e6 * spent / (len(data.z) * len(at)))


def _filter(setup: Setup, data: Data, at: IndexArray, run: int, reports: Source) -> tuple[FloatArray, FloatArray]:
    x, P, before, first = setup.prior.x, setup.prior.P, setup.prior.t, 0
    means, covariances = np.empty((len(at), 6)), np.empty((len(at), 6, 6))
    for epoch, k in enumerate(at):
        x, F, Q = setup.motion.move(x, float(data.t[k]) - before)
        P = F @ P @ F.T + Q
        y, H, variance = reports(setup, data, run, first, int(k), x)
        short, rows = compress_innovations(y, H, variance)
        S = rows @ P @ rows.T + np.eye(len(short))
        K = np.linalg.solve(S, rows @ P).T
        x = x + K @ short
        A = np.eye(6) - K @ rows
        P = A @ P @ A.T + K @ K.T
        means[epoch], covariances[epoch] = x, P
        before, first = float(data.t[k]), int(k) + 1
    return means, covariances


def _innovations(
    setup: Setup, data: Data, run: int, first: int, k: int, x: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Innovations of every report since the last update, with Jacobians by the state at the update."""
    y, H, variance = [], [], []
    for i in range(first, k + 1):
        back = float(data.t[i] - data.t[k])
        z, J = _predicted(x[:3] + back * x[3:], x[3:], data.own[i])
        J[:, 3:] += back * J[:, :3]
        sigmas = _sigmas(setup, bool(data.is_radar[i]))
        for c in range(3):
            if np.isfinite(data.z[run, i, c]):
                d = data.z[run, i, c] - z[c]
                y.append(float(wrapped(np.array(d))) if c else d)
                H.append(J[c])
                variance.append(sigmas[c] ** 2)
    return np.array(y), np.array(H), np.array(variance)


class _Reduced:
    """One report per radar period: range, and angles combined of the radar's and the aligned infrared's."""

    def __init__(self, setup: Setup, data: Data, at: IndexArray, run: int, kind: str) -> None:
        n = setup.samples
        self.z = data.z[run, at, :3].copy()
        for c in (1, 2):
            samples = data.z[run, ~data.is_radar, c].reshape(len(at), n)
            infrared = compress(samples) if kind == "compress" else samples[:, -1]
            spread = compressed_variance(setup.infrared, n if kind == "compress" else 1)
            self.z[:, c], variance = combine(data.z[run, at, c], setup.radar_angle**2, infrared, spread)
        self.variance = np.array([setup.radar_range**2, variance, variance])
        self.row = {int(k): i for i, k in enumerate(at)}

    def __call__(
        self, setup: Setup, data: Data, run: int, first: int, k: int, x: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        z, J = _predicted(x[:3], x[3:], data.own[k])
        y = self.z[self.row[k]] - z[:3]
        y[1:] = wrapped(y[1:])
        return y, J[:3], self.variance


def _predicted(position: FloatArray, velocity: FloatArray, own: FloatArray) -> tuple[FloatArray, FloatArray]:
    z, J = np.empty(7), np.empty((7, 6))
    measure(position, velocity, own[:3], own[3:], np.eye(3), z, J)
    return z, J


def _sigmas(setup: Setup, radar: bool) -> tuple[float, float, float]:
    angle = setup.radar_angle if radar else setup.infrared
    return setup.radar_range, angle, angle
