"""The Cramér-Rao bound of one target in a scenario, at the times at which tracks are scored."""

from __future__ import annotations

import math

import numpy as np

from boresight.bounds.cramer_rao import trajectory_bound
from boresight.filters import ekf
from boresight.filters.stream import Reports
from boresight.frames.pose import PoseTrack, sensor_pose
from boresight.kernels import observation, simulate
from boresight.kernels.pose import interpolate_position
from boresight.models.motion import NearlyConstantVelocity
from boresight.sim.looks import SimulatedSensor, in_coverage
from boresight.sim.scenario import Scenario
from boresight.types import N_COMPONENTS, Component, FloatArray, Truth

FAR = 1e4  # m, how well the position is known before the first report
FLAT = [Component.ELEVATION, Component.UP]


def bound_at(
    scenario: Scenario, truth: Truth, poses: dict[str, PoseTrack], clock: FloatArray, q: float, speed_sigma: float
) -> FloatArray:
    """Return the bound on the mean squared position error (k,) (m²) at the times `clock` (k,), ascending.

    That of a filter with white acceleration `q` (m²/s³) and prior speed `speed_sigma` (m/s) that knows which reports
    are the target's and has each at once. A look detects with probability p and then tells H'R⁻¹H; the bound is given
    p·H'R⁻¹H at every look, which is below the mean over detections (Hernandez, Farina, Ristic 2006). Times are those
    of the recording, epoch included.
    """
    d = scenario.dimensions
    parts = [_looks(plan, truth, poses, scenario, d) for plan in scenario.sensors]
    blank = np.zeros((len(clock), observation.CONTEXT_SIZE))
    blank[:, observation.DIMENSIONS] = d
    blank[:, observation.ROTATION : observation.NOISE] = np.eye(3).ravel()
    parts.append((clock, np.full((len(clock), N_COMPONENTS), np.nan), blank))
    t, z, context = (np.concatenate([p[i] for p in parts]) for i in range(3))
    order = np.argsort(t, kind="stable")
    scored = order >= len(t) - len(clock)
    path = _state(truth, t[order], d)
    prior = ekf.init(float(t[order[0]]), path[0], np.diag(np.repeat([FAR**2, speed_sigma**2], d)))
    reports = Reports(t[order], z[order], context[order], observation.observe)
    P = trajectory_bound(prior, NearlyConstantVelocity(q, d), reports, path)
    return np.asarray(np.trace(P[scored][:, :d, :d], axis1=1, axis2=2))


def _state(truth: Truth, t: FloatArray, d: int) -> FloatArray:
    p, v = _path(truth, t)
    return np.concatenate((p[:, :d], v[:, :d]), axis=1)


def _path(truth: Truth, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    return interpolate_position(truth.t, truth.position, truth.velocity, np.ones(len(truth.t) - 1, dtype=bool), t)


def _looks(
    plan: SimulatedSensor, truth: Truth, poses: dict[str, PoseTrack], scenario: Scenario, d: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times, measurements (only which are NaN matters) and contexts of the looks that cover the target."""
    sensor = plan.sensor
    t = np.arange(plan.start, scenario.duration, plan.period)
    for begin, finish in plan.outages:
        t = t[(t < begin) | (t > finish)]
    t = t + scenario.epoch
    z = _seen(plan, truth, poses, t)
    if plan.rotating:
        t = t + plan.period * np.mod(z[:, Component.AZIMUTH], 2.0 * math.pi) / (2.0 * math.pi)
        z = _seen(plan, truth, poses, t)
    there = (t >= truth.t[0]) & (t <= truth.t[-1]) & in_coverage(sensor.coverage, z)
    t, z = t[there], z[there]
    z[:, np.isnan(sensor.sigma)] = np.nan
    if d == 2:
        z[:, FLAT] = np.nan
    position, velocity, rotation = sensor_pose(sensor, poses.get(sensor.platform or ""), t)
    context = np.zeros((len(t), observation.CONTEXT_SIZE))
    context[:, observation.DIMENSIONS] = d
    context[:, observation.POSITION : observation.ROTATION] = np.concatenate((position, velocity), axis=1)
    context[:, observation.ROTATION : observation.NOISE] = rotation.reshape(-1, 9)
    p = max(sensor.p_detection * (1.0 - plan.p_dropout), 1e-6)
    noise = np.diag(np.nan_to_num(sensor.sigma) ** 2 / p)
    context[:, observation.NOISE :] = noise.ravel()
    return t, z, context


def _seen(plan: SimulatedSensor, truth: Truth, poses: dict[str, PoseTrack], t: FloatArray) -> FloatArray:
    z = np.empty((len(t), N_COMPONENTS))
    if len(t):
        pose = sensor_pose(plan.sensor, poses.get(plan.sensor.platform or ""), t)
        simulate.measure_many(*_path(truth, t), *pose, z)
    return z
