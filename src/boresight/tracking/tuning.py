"""Process and measurement noise from a recording's own innovations: no truth is asked for.

Which report belongs to which track is taken from a tracker's decisions. Along those tracks the likelihood of the
innovations of a nearly-constant-velocity filter is climbed in log q and in the log of one factor for every sensor's
every sigma, one at a time, with steps that halve.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.errors import UserError
from boresight.filters.stream import Reports
from boresight.frames.pose import PoseTrack, sensor_pose
from boresight.kernels.observation import CONTEXT_SIZE, DIMENSIONS, NOISE, POSITION, observe
from boresight.kernels.stream import ekf_stream
from boresight.models import NearlyConstantVelocity
from boresight.types import FATES, NO_TRACK, Component, DecisionRows, Fate, Recording
from boresight.types.sensor import FloatArray

FEWEST = 10  # reports that a track must have to count
SKIPPED = 3  # first reports of a track, whose innovations tell of the prior
FIRST_STEP, LAST_STEP = math.log(4.0), math.log(1.05)
WIDEST = math.log(100.0)  # no factor goes farther than this from what was declared


class Thread(NamedTuple):
    """The reports of one track, by time, and where it begins."""

    reports: Reports
    sensor: NDArray[np.int64]  # (k,)
    x0: FloatArray  # (2d,)
    P0: FloatArray  # (2d, 2d)


class Step(NamedTuple):
    """One accepted step of the climb."""

    q: float  # m²/s³
    factors: dict[tuple[int, int], float]  # (sensor, component) -> factor of sigma
    log_likelihood: float
    nis_per_dof: float


@dataclass(frozen=True)
class Tuned:
    """The climb, first to last, and the consistency that it ends with, by sensor."""

    curve: tuple[Step, ...]
    nis_by_sensor: dict[int, tuple[float, int]]  # NIS per degree of freedom, degrees of freedom


def threads(
    recording: Recording, decisions: DecisionRows, poses: Mapping[str, PoseTrack], speed_sigma: float
) -> list[Thread]:
    """Return the reports of every track that has enough of them; it begins at its first report that tells position."""
    taken = np.isin(decisions.fate, [FATES.index(Fate.UPDATED), FATES.index(Fate.INITIATED)])
    taken &= decisions.track_id != NO_TRACK
    out = []
    for track in np.unique(decisions.track_id[taken]):
        thread = _thread(recording, decisions.row[taken & (decisions.track_id == track)], poses, speed_sigma)
        if thread is not None:
            out.append(thread)
    return out


def _thread(
    recording: Recording, rows: NDArray[np.int64], poses: Mapping[str, PoseTrack], speed_sigma: float
) -> Thread | None:
    d, n = recording.detections, recording.dimensions
    latency = np.array([s.latency for s in recording.sensors])
    t = d.t[rows] - latency[d.sensor[rows]]
    order = np.argsort(t, kind="stable")
    rows, t = rows[order], t[order]
    fixes = np.isfinite(d.z[rows, Component.RANGE] + d.z[rows, Component.AZIMUTH]) | np.isfinite(d.z[rows, 4])
    if n == 3:
        fixes &= np.isfinite(d.z[rows, Component.ELEVATION]) | np.isfinite(d.z[rows, Component.UP])
    if not fixes.any():
        return None
    first = int(np.argmax(fixes))
    rows, t = rows[first:], t[first:]
    if len(rows) < FEWEST:
        return None
    context = _contexts(recording, rows, t, poses)
    position, covariance = _fix(d.z[rows[0]], context[0], n)
    P0 = np.zeros((2 * n, 2 * n))
    P0[:n, :n], P0[n:, n:] = covariance, speed_sigma**2 * np.eye(n)
    z = d.z[rows].copy()
    if n == 2:
        z[:, [Component.ELEVATION, Component.UP]] = np.nan
    reports = Reports(t, z, context, observe)
    return Thread(reports, d.sensor[rows], np.r_[position, np.zeros(n)], P0)


def _contexts(
    recording: Recording, rows: NDArray[np.int64], t: FloatArray, poses: Mapping[str, PoseTrack]
) -> FloatArray:
    """Return the sensor contexts (k, c) of rows, each sensor where it was at the report's time."""
    d = recording.detections
    out = np.zeros((len(rows), CONTEXT_SIZE))
    out[:, DIMENSIONS] = recording.dimensions
    for s, sensor in enumerate(recording.sensors):
        of = d.sensor[rows] == s
        if of.any():
            track = poses.get(sensor.platform) if sensor.platform is not None else None
            place = sensor_pose(sensor, track, t[of])
            out[of, POSITION:NOISE] = np.concatenate([part.reshape(int(of.sum()), -1) for part in place], axis=1)
    variance = np.nan_to_num(d.sigma[rows] ** 2)
    out[:, NOISE::8] = variance  # the diagonal of a 7 by 7 matrix by rows
    for i, row in enumerate(rows):
        if int(row) in d.covariance:
            out[i, NOISE:] = np.nan_to_num(d.covariance[int(row)]).ravel()
    return out


def _fix(z: FloatArray, context: FloatArray, n: int) -> tuple[FloatArray, FloatArray]:
    """Return position (n,) and a generous covariance (n, n) from one report that tells position."""
    R = context[NOISE - 9 : NOISE].reshape(3, 3)
    sigma = np.sqrt(np.diag(context[NOISE:].reshape(7, 7)))
    if np.isfinite(z[Component.EAST]):
        local, spread = np.nan_to_num(z[4:7]), float(sigma[4:7].max())
    else:
        r, azimuth, elevation = z[0], z[1], np.nan_to_num(z[2])
        flat = r * math.cos(elevation)
        local = np.array([flat * math.sin(azimuth), flat * math.cos(azimuth), r * math.sin(elevation)])
        spread = max(sigma[0], r * max(sigma[1], sigma[2]))
    return (context[POSITION : POSITION + 3] + R @ local)[:n], (3.0 * spread) ** 2 * np.eye(n)


def _parameters(found: list[Thread]) -> list[tuple[int, int]]:
    """Return which sensor's which components the threads hold; position counts as one, under its first component."""
    pairs = {
        (int(s), min(c, int(Component.EAST)))
        for thread in found
        for s in np.unique(thread.sensor)
        for c in np.flatnonzero(np.isfinite(thread.reports.z[thread.sensor == s]).any(axis=0)).tolist()
    }
    return sorted(pairs)


class _Likelihood:
    """The innovations' log likelihood as a function of log q and log factors."""

    def __init__(self, found: list[Thread], dimensions: int) -> None:
        self.found, self.dimensions, self.pairs = found, dimensions, _parameters(found)

    def __call__(self, at: FloatArray) -> tuple[float, FloatArray]:
        """Return the total and, per sensor, NIS and its degrees of freedom (s, 2)."""
        motion = NearlyConstantVelocity(math.exp(at[0]), self.dimensions)
        sensors = 1 + max(s for s, _ in self.pairs)
        root = np.ones((sensors, 7))
        for (s, c), value in zip(self.pairs, at[1:]):
            root[s, slice(c, None) if c == Component.EAST else c] = math.exp(value)
        total, seen = 0.0, np.zeros((sensors, 2))
        for thread in self.found:
            k, n = len(thread.reports.t), len(thread.x0)
            factor = root[thread.sensor]
            context = thread.reports.context.copy()
            context[:, NOISE:] *= (factor[:, :, None] * factor[:, None, :]).reshape(k, 49)
            out = [np.empty(s) for s in ((k, n), (k, n, n), (k, n), (k, n, n), (k, n, n))]
            nis = np.zeros((k, 3))
            head = (motion.kernel, motion.parameters, observe, thread.x0, thread.P0, float(thread.reports.t[0]))
            filter_stream: Any = ekf_stream
            if filter_stream(*head, thread.reports.t, thread.reports.z, context, 1, *out, nis) < k:
                return -math.inf, seen
            total += float(nis[SKIPPED:, 2].sum())
            np.add.at(seen, thread.sensor[SKIPPED:], nis[SKIPPED:, :2])
        return total, seen


def likelihoods(found: list[Thread], dimensions: int, noises: FloatArray, stretch: int) -> FloatArray:
    """Return the log likelihood (s, k) of the innovations of each stretch of so many reports under k process noises.

    The sensors' sigmas are those declared; the first reports of each track, whose innovations tell of the prior, are
    left out.
    """
    filter_stream: Any = ekf_stream
    columns = []
    for noise in noises:
        motion = NearlyConstantVelocity(float(noise), dimensions)
        column: list[float] = []
        for thread in found:
            k, n = len(thread.reports.t), len(thread.x0)
            out = [np.empty(s) for s in ((k, n), (k, n, n), (k, n), (k, n, n), (k, n, n))]
            nis = np.zeros((k, 3))
            head = (motion.kernel, motion.parameters, observe, thread.x0, thread.P0, float(thread.reports.t[0]))
            done = filter_stream(*head, thread.reports.t, thread.reports.z, thread.reports.context, 1, *out, nis)
            values = nis[SKIPPED:, 2] if done == k else np.full(k - SKIPPED, -1e6)
            column += [float(values[i : i + stretch].sum()) for i in range(0, len(values), stretch)]
        columns.append(column)
    return np.array(columns).T


def tune(found: list[Thread], dimensions: int, q: float, progress: Callable[[Step], None] = lambda step: None) -> Tuned:
    """Climb the likelihood from process noise `q` (m²/s³) and the declared sigmas; raises UserError without tracks."""
    if not found:
        raise UserError(f"no track has {FEWEST} reports after one that tells its position: nothing to tune on")
    likelihood = _Likelihood(found, dimensions)
    at = np.array([math.log(q)] + [0.0] * len(likelihood.pairs))
    start = at.copy()
    best, seen = likelihood(at)
    curve: list[Step] = []

    def accept() -> None:
        factors = {pair: math.exp(v) for pair, v in zip(likelihood.pairs, at[1:])}
        curve.append(Step(math.exp(at[0]), factors, best, float(seen[:, 0].sum() / max(seen[:, 1].sum(), 1.0))))
        progress(curve[-1])

    accept()
    step = FIRST_STEP
    while step > LAST_STEP:
        moved = False
        for i in range(len(at)):
            for sign in (1.0, -1.0):
                trial = at.copy()
                trial[i] += sign * step
                limit = 2.0 * WIDEST if i == 0 else WIDEST
                if abs(trial[i] - start[i]) > limit:
                    continue
                value, trial_seen = likelihood(trial)
                if value > best + 1e-6:
                    at, best, seen, moved = trial, value, trial_seen, True
                    accept()
                    break
        if not moved:
            step *= 0.5
    by_sensor = {s: (float(a / b), int(b)) for s, (a, b) in enumerate(seen) if b > 0}
    return Tuned(tuple(curve), by_sensor)
