"""A scenario, and the recording that it gives."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from boresight.errors import UserError, did_you_mean
from boresight.frames.pose import PoseTrack, pose_track
from boresight.sim.actors import Platform, Target
from boresight.sim.looks import Reports, SimulatedSensor, reports
from boresight.sim.paths import Trajectory
from boresight.types import Detections, FloatArray, PlatformTrack, Recording, Site, Truth


@dataclass(frozen=True, slots=True, eq=False)
class Scenario:
    """Everything that a simulation needs but the seed. Times run from 0 to `duration`; `epoch` is added at the end."""

    name: str
    duration: float  # s
    dimensions: int
    site: Site
    targets: tuple[Target, ...]
    sensors: tuple[SimulatedSensor, ...]
    platforms: tuple[Platform, ...] = ()
    epoch: float = 0.0  # s
    step: float = 0.05  # s, of the fine clock on which paths are drawn
    truth_period: float = 0.1  # s

    def __post_init__(self) -> None:
        if not 0.0 < self.duration < math.inf:
            raise UserError(f"scenario '{self.name}': the duration must be above zero")
        if not self.sensors:
            raise UserError(f"scenario '{self.name}' has no sensor")
        if not (self.step > 0.0 and self.truth_period > 0.0):
            raise UserError(f"scenario '{self.name}': step and truth period must be above zero")
        for kind, ids in (
            ("target", [t.id for t in self.targets]),
            ("platform", [p.id for p in self.platforms]),
            ("sensor", [s.sensor.id for s in self.sensors]),
        ):
            for i in ids:
                if ids.count(i) > 1:
                    raise UserError(f"scenario '{self.name}': {kind} '{i}' stands twice")
        known = [p.id for p in self.platforms]
        for plan in self.sensors:
            name = plan.sensor.platform
            if name is not None and name not in known:
                raise UserError(f"sensor '{plan.sensor.id}': unknown platform '{name}'{did_you_mean(name, known)}")


def simulate(scenario: Scenario, rng: np.random.Generator) -> Recording:
    """Return the recording of a scenario, the same for the same generator.

    Targets, platforms and sensors draw from streams of their own: adding a sensor does not change the truth.
    """
    of_targets, of_platforms, of_sensors = rng.spawn(3)
    end = scenario.duration
    paths = [
        target.trajectory(end, scenario.step, stream)
        for target, stream in zip(scenario.targets, of_targets.spawn(len(scenario.targets)), strict=True)
        if target.birth < end
    ]
    names = [t.id for t in scenario.targets if t.birth < end]
    true = {p.id: pose_track(p.true_track(-1.0, end + 1.0, scenario.step), scenario.site) for p in scenario.platforms}
    recorded = [
        platform.recorded_track(0.0, end, stream)
        for platform, stream in zip(scenario.platforms, of_platforms.spawn(len(scenario.platforms)), strict=True)
    ]
    rows = [
        reports(plan, paths, _track(plan, true), end, scenario.dimensions, stream)
        for plan, stream in zip(scenario.sensors, of_sensors.spawn(len(scenario.sensors)), strict=True)
    ]
    detections = _merged(scenario, rows)
    if len(detections) == 0:
        raise UserError(f"scenario '{scenario.name}': no sensor looks within {end} s")
    return Recording(
        name=scenario.name,
        dimensions=scenario.dimensions,
        site=scenario.site,
        sensors=tuple(plan.sensor for plan in scenario.sensors),
        detections=detections,
        platforms=tuple(_shifted(p, scenario.epoch) for p in recorded),
        truth=tuple(_truth(name, path, scenario) for name, path in zip(names, paths, strict=True)),
        duplicates=np.zeros(len(detections), dtype=bool),
    )


def _track(plan: SimulatedSensor, true: dict[str, PoseTrack]) -> PoseTrack | None:
    return true[plan.sensor.platform] if plan.sensor.platform is not None else None


def _merged(scenario: Scenario, rows: Sequence[Reports]) -> Detections:
    """All sensors' rows in order of arrival."""
    sensor = np.repeat(np.arange(len(rows)), [len(r.t) for r in rows])
    t, t_recv, scan, z = (np.concatenate([r[i] for r in rows]) for i in range(4))
    order = np.lexsort((np.arange(len(t)), scan, sensor, t_recv))
    sensor, z = sensor[order], z[order]
    sigma: FloatArray = np.stack([plan.sensor.sigma for plan in scenario.sensors])[sensor]
    sigma[np.isnan(z)] = np.nan
    return Detections(
        t[order] + scenario.epoch, t_recv[order] + scenario.epoch, sensor, scan[order], z, sigma, covariance={}
    )


def _shifted(track: PlatformTrack, epoch: float) -> PlatformTrack:
    return PlatformTrack(
        track.id, track.t + epoch, track.position, track.velocity, track.ypr, track.sigma_position, track.sigma_attitude
    )


def _truth(name: str, path: Trajectory, scenario: Scenario) -> Truth:
    """The path at about the truth's period: every so many nodes of the fine clock, and the last."""
    every = max(round(scenario.truth_period / max(path.t[1] - path.t[0], 1e-12)), 1)
    keep = np.unique(np.append(np.arange(0, len(path.t), every), len(path.t) - 1))
    return Truth(name, path.t[keep] + scenario.epoch, path.position[keep], path.velocity[keep])
