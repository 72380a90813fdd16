"""The methods side by side: the paper's pipeline, mended, and filters that take every sample at its own time."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from boresight.align.compression import combine, compress, compressed_variance
from boresight.filters.stream import Reports
from boresight.kernels import msc_stream, smoothing
from boresight.kernels.msc import EXACT, PRINTED, inverse_jacobian, msc_from_world, world_from_msc
from boresight.kernels.stream import ekf_stream
from boresight.kernels.unscented_stream import ukf_stream
from boresight.models import Infrared, Radar
from boresight.papers.montecarlo import Estimates, nees, wrapped
from boresight.papers.shao2012.alignment import aligned
from boresight.papers.shao2012.scenario import Data, IndexArray, MaskArray, Setup, own_ship, pose
from boresight.types.sensor import FloatArray

UNSCENTED = np.array([1.0, 0.0, 0.0])  # cubature points
Runner = Callable[[Reports, list[FloatArray]], int]


def _arrays(k: int, n: int = 6) -> list[FloatArray]:
    """Room for what a stream kernel fills: x, P, predicted x, P, F, nis."""
    shapes = ((k, n), (k, n, n), (k, n), (k, n, n), (k, n, n), (k, 2))
    return [np.full(s, np.nan) for s in shapes]


def _collect(
    reports: Callable[[int], Reports], at: IndexArray, runs: int, run_one: Runner, smooth: bool = False
) -> tuple[FloatArray, FloatArray, float]:
    """Run a filter over all runs; return means and covariances at the reports `at`, and microseconds per report."""
    means, covariances, spent, count = np.empty((runs, len(at), 6)), np.empty((runs, len(at), 6, 6)), 0.0, 0
    run_one(reports(0), _arrays(len(reports(0).t)))  # compiled and warm
    for run in range(runs):
        one = reports(run)
        out = _arrays(len(one.t))
        begin = time.perf_counter()
        done = run_one(one, out)
        if smooth and done == len(one.t):
            x, P = np.empty_like(out[0]), np.empty_like(out[1])
            smoothing.smooth_back(out[0], out[1], out[2], out[3], out[4], 0, done - 1, x, P)
            out[:2] = [x, P]
        spent += time.perf_counter() - begin
        count += len(one.t)
        means[run], covariances[run] = out[0][at], out[1][at]
    return means, covariances, 1e6 * spent / count


def cartesian(
    setup: Setup, data: Data, kind: str = "ekf", only: MaskArray | None = None, smooth: bool = False
) -> Estimates:
    """EKF, iterated EKF (`iekf`) or unscented filter (`ukf`) in world ENU on every report at its own time."""
    prior, motion = setup.prior, setup.motion
    chosen = np.ones(len(data.t), bool) if only is None else only

    def run_one(one: Reports, out: list[FloatArray]) -> int:
        kernel: Any = ukf_stream if kind == "ukf" else ekf_stream
        option = UNSCENTED if kind == "ukf" else 10 if kind == "iekf" else 1
        head = (motion.kernel, motion.parameters, one.observe, prior.x, prior.P, prior.t)
        return int(kernel(*head, *one[:3], option, *out))

    at = _epochs(data, chosen)
    x, P, us = _collect(lambda run: data.reports(run, chosen), at, len(data.z), run_one, smooth)
    truth = data.truth[:, chosen][:, at]
    return Estimates(x, nees(x - truth, P), 6, us)


def _epochs(data: Data, chosen: MaskArray) -> IndexArray:
    """Indices, among the chosen reports, of the last report at each scored time."""
    times = data.t[data.scored()]
    return np.asarray(np.searchsorted(data.t[chosen], times + 1e-9) - 1)


def _msc(
    setup: Setup, reports: Callable[[int], Reports], own: FloatArray, truth: FloatArray, at: IndexArray, variant: int
) -> Estimates:
    """The MSC filter over given reports; `truth` (runs, e, 6) at the reports `at`."""
    prior, motion = setup.prior, setup.motion
    own0 = own_ship(np.array(0.0))
    y0 = msc_from_world(prior.x, own0)
    inverse = inverse_jacobian(y0)
    P0 = inverse @ prior.P @ inverse.T

    def run_one(one: Reports, out: list[FloatArray]) -> int:
        head = (motion.kernel, motion.parameters, one.observe, y0, P0, prior.t, own0)
        return int(msc_stream.msc_stream(*head, *one[:3], own, variant, *out))

    y, P, us = _collect(reports, at, len(truth), run_one)
    x, error = np.empty_like(y), np.empty_like(y)
    for run in range(len(y)):
        for i, k in enumerate(at):
            x[run, i] = world_from_msc(y[run, i], own[k]) if np.isfinite(y[run, i]).all() else np.nan
            error[run, i] = y[run, i] - msc_from_world(truth[run, i], own[k])
    error[..., 2] = wrapped(error[..., 2])
    return Estimates(x, nees(error, P), 6, us)


def msc(setup: Setup, data: Data) -> Estimates:
    """The MSC filter on every report at its own time."""
    at = data.scored()
    return _msc(setup, data.reports, data.own, data.truth[:, at], at, EXACT)


def pipeline(setup: Setup, data: Data, with_range: bool, variant: int = EXACT) -> Estimates:
    """The paper's way: compress infrared to the radar's time (4)-(7), combine with it (8)-(13), filter in MSC."""
    n = setup.samples
    at = np.flatnonzero(data.is_radar)
    runs = len(data.z)
    z = np.full((runs, len(at), 7), np.nan)
    for c in (1, 2):
        infrared = compress(data.z[:, ~data.is_radar, c].reshape(runs, len(at), n))
        z[:, :, c], variance = combine(
            data.z[:, at, c], setup.radar_angle**2, infrared, compressed_variance(setup.infrared, n)
        )
    sigma = float(np.sqrt(variance))
    sensor = Radar(setup.radar_range, sigma, sigma) if with_range else Infrared(sigma, sigma)
    if with_range:
        z[:, :, 0] = data.z[:, at, 0]
    context = np.array([sensor.at(pose(own)).context for own in data.own[at]])
    epochs = np.flatnonzero(np.isin(at, data.scored()))

    def reports(run: int) -> Reports:
        return Reports(data.t[at], z[run], context, Radar.kernel)

    return _msc(setup, reports, data.own[at], data.truth[:, at][:, epochs], epochs, variant)


METHODS: dict[str, Callable[[Setup, Data], Estimates]] = {
    "as_printed": lambda s, d: pipeline(s, d, with_range=False, variant=PRINTED),
    "corrected_angles_only": lambda s, d: pipeline(s, d, with_range=False),
    "corrected": lambda s, d: pipeline(s, d, with_range=True),
    "msc": msc,
    "ekf": cartesian,
    "iekf": lambda s, d: cartesian(s, d, "iekf"),
    "ukf": lambda s, d: cartesian(s, d, "ukf"),
    "radar_only": lambda s, d: cartesian(s, d, only=d.is_radar),
    "ir_only": lambda s, d: cartesian(s, d, only=~d.is_radar),
    "interpolate": lambda s, d: aligned(s, d, "interpolate"),
    "compress": lambda s, d: aligned(s, d, "compress"),
    "compressed_innovations": lambda s, d: aligned(s, d, "innovations"),
    "rts": lambda s, d: cartesian(s, d, smooth=True),
}
