"""SCENARIO.toml to a `sim.Scenario`. Units are in the key names; unknown keys are refused by name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from boresight.config.kinds import MOTIONS, WAYPOINTS, MotionTable, check_kind
from boresight.errors import UserError, did_you_mean
from boresight.io.declaration import DEG, SensorTable, SiteTable, sensor_of, site_of
from boresight.io.toml import TableModel, convert, read_toml
from boresight.models.motion import KernelMotion
from boresight.sim.actors import Attitude, Drawn, Navigation, Platform, Target
from boresight.sim.looks import SimulatedSensor
from boresight.sim.paths import Straight, Waypoints
from boresight.sim.scenario import Scenario
from boresight.types import FloatArray, Site

Vector = tuple[float, float, float]
Interval = tuple[float, float]


class WaypointsTable(TableModel, frozen=True):
    """A path through waypoints."""

    points_enu_m: tuple[Vector, ...]
    speed_m_s: float | None = None
    speeds_m_s: tuple[float, ...] | None = None
    times_s: tuple[float, ...] | None = None
    turn_radius_m: float = 0.0

    def build(self, start: float) -> Waypoints:
        """Return the path."""
        points = np.array(self.points_enu_m, dtype=np.float64).reshape(-1, 3)
        given = [k for k in ("speed_m_s", "speeds_m_s", "times_s") if getattr(self, k) is not None]
        if len(given) != 1:
            raise UserError(f"give one of speed_m_s, speeds_m_s and times_s, not {' and '.join(given) or 'none'}")
        speeds: FloatArray | None = None
        if self.times_s is None:
            speeds = np.array(self.speeds_m_s) if self.speeds_m_s else np.full(len(points), self.speed_m_s)
        times = np.array(self.times_s) if self.times_s is not None else None
        return Waypoints(points, speeds, times, self.turn_radius_m, start)


class AttitudeTable(TableModel, frozen=True):
    """How a platform is turned; yaw follows the course when it is left out."""

    yaw_deg: float | None = None
    pitch_deg: float = 0.0
    roll_deg: float = 0.0
    sway_ypr_deg: Vector = (0.0, 0.0, 0.0)
    sway_period_s: Vector = (10.0, 10.0, 10.0)

    def build(self) -> Attitude:
        """Return the attitude."""
        if not all(p > 0 for p in self.sway_period_s):
            raise UserError("attitude.sway_period_s must be above zero")
        yaw = None if self.yaw_deg is None else self.yaw_deg * DEG
        sway = tuple(a * DEG for a in self.sway_ypr_deg)
        return Attitude(yaw, self.pitch_deg * DEG, self.roll_deg * DEG, (sway[0], sway[1], sway[2]), self.sway_period_s)


class NavigationTable(TableModel, frozen=True):
    """What is recorded of a platform."""

    rate_hz: float = 10.0
    sigma_position_m: float = 0.0
    sigma_attitude_deg: float = 0.0


class PlatformTable(TableModel, frozen=True):
    """`[[platforms]]`: kind = "fixed", "constant_velocity" or "waypoints"."""

    id: str
    kind: str
    position_enu_m: Vector | None = None
    velocity_enu_m_s: Vector | None = None
    path: WaypointsTable | None = None
    attitude: AttitudeTable = AttitudeTable()
    navigation: NavigationTable = NavigationTable()


class GroupTable(TableModel, frozen=True):
    """`[[groups]]`: many targets drawn at random; every interval is uniform."""

    id: str
    count: int
    area_enu_m: tuple[Interval, Interval, Interval]
    speed_m_s: Interval
    motion: dict[str, Any]
    climb_m_s: Interval = (0.0, 0.0)
    course_deg: Interval = (-180.0, 180.0)
    birth_s: Interval = (0.0, 0.0)
    life_s: Interval = (math.inf, math.inf)


class SimulatedSensorTable(SensorTable, frozen=True):
    """`[[sensors]]`: every key of recording.toml's [[sensor]], and what the sensor does beyond its declaration."""

    rate_hz: float | None = None
    start_s: float = 0.0
    true_latency_s: float | None = None
    period_jitter_s: float = 0.0
    stamp_jitter_s: float = 0.0
    arrival_delay_s: float = 0.0
    arrival_jitter_s: float = 0.0
    bias_range_m: float = 0.0
    bias_azimuth_deg: float = 0.0
    bias_elevation_deg: float = 0.0
    bias_range_rate_m_s: float = 0.0
    bias_position_enu_m: Vector = (0.0, 0.0, 0.0)
    p_dropout: float = 0.0
    outages_s: tuple[Interval, ...] = ()
    rotating: bool = False
    clutter_box_enu_m: tuple[Interval, Interval, Interval] | None = None


class ScenarioTable(TableModel, frozen=True):
    """The whole of SCENARIO.toml; targets have keys that depend on their kind."""

    name: str
    duration_s: float
    sensors: tuple[SimulatedSensorTable, ...]
    seed: int = 0
    dimensions: int = 3
    epoch_s: float = 0.0
    step_s: float = 0.05
    truth_period_s: float = 0.1
    site: SiteTable = SiteTable(latitude_deg=0.0, longitude_deg=0.0)
    targets: tuple[dict[str, Any], ...] = ()
    groups: tuple[GroupTable, ...] = ()
    platforms: tuple[PlatformTable, ...] = ()


def read_scenario(path: Path | str, seed: int | None = None) -> tuple[Scenario, int]:
    """Read and check a scenario; returns it with its seed (the file's, or `seed`). Raises UserError."""
    return scenario_of(read_toml(path), str(path), seed)


def scenario_of(data: dict[str, Any], where: str, seed: int | None = None) -> tuple[Scenario, int]:
    """Check a scenario's tables, called `where` in errors; as `read_scenario`."""
    table = convert(data, ScenarioTable, where)
    if table.dimensions not in (2, 3):
        raise UserError(f"{where}: dimensions = {table.dimensions}; give 2 or 3")
    chosen = table.seed if seed is None else seed
    if chosen < 0:
        raise UserError(f"{where}: seed = {chosen}; give zero or more")
    targets = [_named(where, "target", t, i, table.dimensions) for i, t in enumerate(table.targets)]
    site = site_of(table.site, where)
    rng = np.random.default_rng([chosen, 1])  # groups draw from a stream of their own
    for group in table.groups:
        targets += _group(group, table.dimensions, rng, f"{where}: groups['{group.id}']")
    try:
        scenario = Scenario(
            name=table.name,
            duration=table.duration_s,
            dimensions=table.dimensions,
            site=site,
            targets=tuple(targets),
            sensors=tuple(_sensor(s, where, site, table.dimensions) for s in table.sensors),
            platforms=tuple(_platform(p, where) for p in table.platforms),
            epoch=table.epoch_s,
            step=table.step_s,
            truth_period=table.truth_period_s,
        )
    except UserError as error:
        text = str(error)
        raise UserError(text if text.startswith(where) else f"{where}: {text}") from None
    return scenario, chosen


class TargetTable(TableModel, frozen=True):
    """The keys that every kind of target has."""

    id: str
    kind: str
    birth_s: float = 0.0
    death_s: float = math.inf


class DrawnTable(TargetTable, frozen=True, kw_only=True):
    """A target that moves by a motion model, which adds keys of its own."""

    position_enu_m: Vector
    velocity_enu_m_s: Vector


def _named(where: str, what: str, data: dict[str, Any], i: int, dimensions: int) -> Target:
    at = f"{where}: {what}s['{data.get('id', i)}']"
    kind = check_kind(data.get("kind"), [*MOTIONS, WAYPOINTS], at)
    model: type[WaypointsTable | MotionTable] = WaypointsTable if kind == WAYPOINTS else MOTIONS[kind]
    common: type[TargetTable] = TargetTable if kind == WAYPOINTS else DrawnTable
    own = {f.name for f in msgspec.structs.fields(model)}
    shared = {f.name for f in msgspec.structs.fields(common)}
    for key in data:
        if key not in own | shared:
            raise UserError(f"{at}: unknown key '{key}'{did_you_mean(key, own | shared)}")
    head = convert({k: v for k, v in data.items() if k in shared}, common, at)
    body = convert({k: v for k, v in data.items() if k in own}, model, at)
    try:
        if isinstance(body, WaypointsTable):
            return Target(head.id, body.build(head.birth_s), head.birth_s, head.death_s)
        assert isinstance(head, DrawnTable)
        motion, rest = body.build(dimensions), body.rest(dimensions)
        return _drawn(head.id, motion, head.position_enu_m, head.velocity_enu_m_s, head, rest)
    except UserError as error:
        raise UserError(f"{at}: {error}") from None


def _drawn(
    name: str,
    motion: KernelMotion,
    position: Vector,
    velocity: Vector,
    life: TargetTable,
    rest: Sequence[float] = (),
) -> Target:
    d = motion.dimensions
    x0 = np.zeros(motion.state_dimension)
    x0[:d], x0[d : 2 * d], x0[2 * d : 2 * d + len(rest)] = position[:d], velocity[:d], rest
    return Target(name, Drawn(motion, x0), life.birth_s, life.death_s)


def _group(group: GroupTable, dimensions: int, rng: np.random.Generator, at: str) -> list[Target]:
    if group.count < 1:
        raise UserError(f"{at}: count = {group.count}; give one or more")
    kind = check_kind(group.motion.get("kind"), list(MOTIONS), f"{at}.motion")
    rest = {k: v for k, v in group.motion.items() if k != "kind"}
    motion = convert(rest, MOTIONS[kind], f"{at}.motion").build(dimensions)
    out = []
    for i in range(group.count):
        position = rng.uniform(*np.array(group.area_enu_m).T)
        speed, course = rng.uniform(*group.speed_m_s), rng.uniform(*group.course_deg) * DEG
        climb, birth = rng.uniform(*group.climb_m_s), rng.uniform(*group.birth_s)
        life = rng.uniform(*group.life_s) if math.isfinite(group.life_s[1]) else math.inf
        velocity = (speed * math.sin(course), speed * math.cos(course), climb)
        name = f"{group.id}-{i + 1}"
        times = TargetTable(id=name, kind=kind, birth_s=birth, death_s=birth + life)
        out.append(_drawn(name, motion, (position[0], position[1], position[2]), velocity, times))
    return out


def _sensor(table: SimulatedSensorTable, where: str, site: Site, dimensions: int) -> SimulatedSensor:
    at = f"{where}: sensors['{table.id}']"
    if (table.rate_hz is None) == (table.period_s is None):
        raise UserError(f"{at}: give either rate_hz or period_s")
    if table.rate_hz is not None:
        if not 0 < table.rate_hz < math.inf:
            raise UserError(f"{at}: rate_hz = {table.rate_hz}; give a rate above zero")
        table = msgspec.structs.replace(table, period_s=1.0 / table.rate_hz)
    declared = sensor_of(table, where, site, dimensions)
    assert declared.period is not None
    bias = (table.bias_range_m, table.bias_azimuth_deg * DEG, table.bias_elevation_deg * DEG, table.bias_range_rate_m_s)
    return SimulatedSensor(
        sensor=declared,
        period=declared.period,
        start=table.start_s,
        latency=declared.latency if table.true_latency_s is None else table.true_latency_s,
        period_jitter=table.period_jitter_s,
        stamp_jitter=table.stamp_jitter_s,
        arrival_delay=table.arrival_delay_s,
        arrival_jitter=table.arrival_jitter_s,
        bias=(*bias, *table.bias_position_enu_m),
        p_dropout=table.p_dropout,
        outages=table.outages_s,
        rotating=table.rotating,
        clutter_box=table.clutter_box_enu_m,
    )


def _platform(table: PlatformTable, where: str) -> Platform:
    at = f"{where}: platforms['{table.id}']"
    kind = check_kind(table.kind, ["fixed", "constant_velocity", WAYPOINTS], at)
    wanted = {"fixed": ("position_enu_m",), "constant_velocity": ("position_enu_m", "velocity_enu_m_s")}
    for key in ("position_enu_m", "velocity_enu_m_s", "path"):
        needed = key in wanted.get(kind, ("path",))
        if needed != (getattr(table, key) is not None):
            raise UserError(f"{at}: kind = '{kind}' {'needs' if needed else 'has no'} {key}")
    nav = table.navigation
    if not (0 < nav.rate_hz < math.inf and nav.sigma_position_m >= 0 and nav.sigma_attitude_deg >= 0):
        raise UserError(f"{at}: navigation needs rate_hz above zero and sigmas of zero or more")
    try:
        path: Straight | Waypoints
        if table.path is not None:
            path = table.path.build(0.0)
        else:
            path = Straight(np.array(table.position_enu_m), np.array(table.velocity_enu_m_s or (0.0, 0.0, 0.0)))
        attitude = table.attitude.build()
    except UserError as error:
        raise UserError(f"{at}: {error}") from None
    return Platform(
        table.id, path, attitude, Navigation(nav.rate_hz, nav.sigma_position_m, nav.sigma_attitude_deg * DEG)
    )
