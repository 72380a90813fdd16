"""What one simulated sensor reports: its looks, what they detect, clutter, and when they arrive."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.errors import UserError
from boresight.frames.pose import PoseTrack, sensor_pose
from boresight.kernels import simulate as kernel
from boresight.kernels.pose import interpolate_position
from boresight.sim.paths import Trajectory
from boresight.types import N_COMPONENTS, Component, Coverage, FloatArray, Sensor

TURNS = 4  # fixed-point steps for the time at which a rotating beam meets a moving target


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedSensor:
    """A declared sensor and what it does beyond its declaration.

    It measures the components that have a sigma. Clutter is uniform in range, azimuth and elevation over the coverage
    (for Cartesian sensors uniform in area), or over `clutter_box`. Raises UserError.
    """

    sensor: Sensor
    period: float  # s between looks
    start: float = 0.0  # s, the first look
    latency: float = 0.0  # s, stamp minus validity (the declared one may differ)
    period_jitter: float = 0.0  # s, standard deviation of the look's time, stamped as it is
    stamp_jitter: float = 0.0  # s, standard deviation of the stamp's error
    arrival_delay: float = 0.0  # s from stamp to arrival
    arrival_jitter: float = 0.0  # s, mean of an exponential further delay
    bias: tuple[float, ...] = (0.0,) * N_COMPONENTS  # by Component, m, rad, m/s
    p_dropout: float = 0.0  # of a whole look
    outages: tuple[tuple[float, float], ...] = ()  # s, from and to
    rotating: bool = False  # each detection has its own time: one turn from north, clockwise, per period
    clutter_box: tuple[tuple[float, float], ...] | None = None  # m, site ENU

    def __post_init__(self) -> None:
        name = f"sensor '{self.sensor.id}'"
        if not 0.0 < self.period < math.inf:
            raise UserError(f"{name}: the period must be above zero")
        if np.isnan(self.sensor.sigma).all():
            raise UserError(f"{name} measures nothing: give at least one sigma")
        if not 0.0 <= self.p_dropout < 1.0:
            raise UserError(f"{name}: p_dropout must lie in [0, 1)")
        for key in ("period_jitter", "stamp_jitter", "arrival_delay", "arrival_jitter"):
            if not 0.0 <= getattr(self, key) < math.inf:
                raise UserError(f"{name}: {key} must not be negative")
        far = self.sensor.coverage.range[1]
        ranged = ~np.isnan(self.sensor.sigma[[Component.RANGE, Component.EAST]])
        if self.sensor.clutter_per_scan > 0 and self.clutter_box is None and ranged.any() and math.isinf(far):
            raise UserError(f"{name} has clutter: give coverage.range_m an upper end, or a clutter box")


class Reports(NamedTuple):
    """Rows of detections of one sensor; a look that saw nothing is one row of NaN."""

    t: FloatArray  # (n,) s, stamp
    t_recv: FloatArray  # (n,) s
    scan: NDArray[np.int64]  # (n,)
    z: FloatArray  # (n, 7)


def reports(
    plan: SimulatedSensor,
    targets: Sequence[Trajectory],
    track: PoseTrack | None,
    end: float,
    dimensions: int,
    rng: np.random.Generator,
) -> Reports:
    """Return every row that the sensor reports up to time `end` (s)."""
    looks = _look_times(plan, end, rng)
    t, z, look = _detect(plan, targets, track, looks, dimensions, rng)
    t_false, z_false, look_false = _clutter(plan, track, looks, dimensions, rng)
    t, z, look = np.concatenate([t, t_false]), np.concatenate([z, z_false]), np.concatenate([look, look_false])
    z[:, np.isnan(plan.sensor.sigma)] = np.nan
    blind = np.setdiff1d(np.arange(len(looks)), look)
    t = np.concatenate([t, looks[blind]])
    z = np.concatenate([z, np.full((len(blind), N_COMPONENTS), np.nan)])
    look = np.concatenate([look, blind])
    order = np.lexsort((rng.random(len(t)), t, look))  # within a look by time, else in no order of targets
    t, z, look = t[order], z[order], look[order]
    stamp = t + plan.latency
    if plan.stamp_jitter > 0.0:
        stamp = stamp + plan.stamp_jitter * rng.standard_normal(len(looks))[look]
    newest = np.full(len(looks), -math.inf)
    np.maximum.at(newest, look, stamp)
    delay = plan.arrival_delay + plan.arrival_jitter * rng.standard_exponential(len(looks))
    return Reports(stamp, (newest + delay)[look], look, z)


def _look_times(plan: SimulatedSensor, end: float, rng: np.random.Generator) -> FloatArray:
    end = end - plan.period if plan.rotating else end  # a turn that is begun is finished
    n = max(math.floor((end - plan.start) / plan.period + 1e-9) + 1, 0)
    t = plan.start + plan.period * np.arange(n)
    jitter = np.clip(plan.period_jitter * rng.standard_normal(n), -0.45 * plan.period, 0.45 * plan.period)
    keep = rng.random(n) >= plan.p_dropout
    for begin, finish in plan.outages:
        keep &= (t < begin) | (t > finish)
    t = (t + jitter)[keep]
    return t[(t >= 0.0) & (t <= end)]


def _detect(
    plan: SimulatedSensor,
    targets: Sequence[Trajectory],
    track: PoseTrack | None,
    looks: FloatArray,
    dimensions: int,
    rng: np.random.Generator,
) -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    """Detections of the targets: times, measurements with their noise, and which look."""
    times, measured, which = [np.zeros(0)], [np.zeros((0, N_COMPONENTS))], [np.zeros(0, dtype=np.int64)]
    for target in targets:
        look = np.arange(len(looks))
        t = looks
        z = _measure(plan.sensor, track, target, t)
        for _ in range(TURNS if plan.rotating else 0):
            t = looks + plan.period * (np.mod(z[:, Component.AZIMUTH], 2.0 * math.pi) / (2.0 * math.pi))
            z = _measure(plan.sensor, track, target, t)
        alive = (t >= target.t[0]) & (t <= target.t[-1]) & in_coverage(plan.sensor.coverage, z)
        seen = alive & (rng.random(len(t)) < plan.sensor.p_detection)
        noise = rng.standard_normal(z.shape) * np.nan_to_num(plan.sensor.sigma)
        times.append(t[seen])
        measured.append(_proper((z + noise + np.array(plan.bias))[seen], dimensions))
        which.append(look[seen])
    return np.concatenate(times), np.concatenate(measured), np.concatenate(which)


def _clutter(
    plan: SimulatedSensor, track: PoseTrack | None, looks: FloatArray, dimensions: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    """False detections: points that stand still, Poisson in number."""
    look = np.repeat(np.arange(len(looks)), rng.poisson(plan.sensor.clutter_per_scan, len(looks)))
    n, cover = len(look), plan.sensor.coverage
    t = looks[look]
    if plan.clutter_box is not None:
        low, high = np.array(plan.clutter_box).T
        points = rng.uniform(low, high, (n, 3))
        z = _measure_points(plan.sensor, track, points, np.zeros((n, 3)), t)
    else:
        z = _measure_points(plan.sensor, track, _scattered(plan.sensor, track, t, dimensions, rng), np.zeros((n, 3)), t)
    if plan.rotating:
        t = t + plan.period * np.mod(z[:, Component.AZIMUTH], 2.0 * math.pi) / (2.0 * math.pi)
    seen = in_coverage(cover, z) if plan.clutter_box is not None else np.ones(n, dtype=bool)
    return t[seen], _proper(z[seen], dimensions), look[seen]


def _scattered(
    sensor: Sensor, track: PoseTrack | None, t: FloatArray, dimensions: int, rng: np.random.Generator
) -> FloatArray:
    """Points spread over the coverage, in world ENU."""
    n, cover = len(t), sensor.coverage
    near, far = cover.range[0], cover.range[1] if math.isfinite(cover.range[1]) else cover.range[0] + 1000.0
    r = rng.uniform(near, far, n)
    if not np.isnan(sensor.sigma[Component.EAST]):
        r = np.sqrt(rng.uniform(near**2, far**2, n))
    low, high = cover.azimuth
    width = high - low if high > low else high - low + 2.0 * math.pi
    azimuth = low + min(width, 2.0 * math.pi) * rng.random(n)
    elevation = rng.uniform(*cover.elevation, n) if dimensions == 3 else np.zeros(n)
    flat = r * np.cos(elevation)
    local = np.stack([flat * np.sin(azimuth), flat * np.cos(azimuth), r * np.sin(elevation)], axis=1)
    position, _, enu_from_sensor = sensor_pose(sensor, track, t)
    points: FloatArray = position + np.einsum("kij,kj->ki", enu_from_sensor, local)
    return points


def _measure(sensor: Sensor, track: PoseTrack | None, target: Trajectory, t: FloatArray) -> FloatArray:
    cubic = np.ones(len(target.t) - 1, dtype=bool)
    position, velocity = interpolate_position(target.t, target.position, target.velocity, cubic, t)
    return _measure_points(sensor, track, position, velocity, t)


def _measure_points(
    sensor: Sensor, track: PoseTrack | None, position: FloatArray, velocity: FloatArray, t: FloatArray
) -> FloatArray:
    z = np.empty((len(t), N_COMPONENTS))
    if len(t):
        kernel.measure_many(position, velocity, *sensor_pose(sensor, track, t), z)
    return z


def in_coverage(coverage: Coverage, z: FloatArray) -> NDArray[np.bool_]:
    """Return which noise-free measurements (n, 7) lie within a coverage."""
    r, azimuth, elevation = z[:, Component.RANGE], z[:, Component.AZIMUTH], z[:, Component.ELEVATION]
    inside = (r >= coverage.range[0]) & (r <= coverage.range[1])
    inside &= (elevation >= coverage.elevation[0]) & (elevation <= coverage.elevation[1])
    low, high = coverage.azimuth
    width = high - low if high > low else high - low + 2.0 * math.pi
    inside &= np.mod(azimuth - low, 2.0 * math.pi) <= width
    out: NDArray[np.bool_] = inside
    return out


def _proper(z: FloatArray, dimensions: int) -> FloatArray:
    """Bring noisy measurements back to where they can be: range ≥ 0, elevation within ±π/2, azimuth in (-π, π]."""
    z[:, Component.RANGE] = np.abs(z[:, Component.RANGE])
    over = np.abs(z[:, Component.ELEVATION]) > 0.5 * math.pi
    z[over, Component.ELEVATION] = np.sign(z[over, Component.ELEVATION]) * math.pi - z[over, Component.ELEVATION]
    z[over, Component.AZIMUTH] += math.pi
    z[:, Component.AZIMUTH] = math.pi - np.mod(math.pi - z[:, Component.AZIMUTH], 2.0 * math.pi)
    if dimensions == 2:
        z[:, [Component.ELEVATION, Component.UP]] = np.nan
    return z
