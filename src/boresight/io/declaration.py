"""recording.toml: what is declared of the site and the sensors, to and from `types`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from boresight.errors import UserError, did_you_mean
from boresight.io import limits
from boresight.io.toml import TableModel, convert, read_toml, write_toml
from boresight.types import Axes, Component, Coverage, Mount, Reporting, Sensor, SensorKind, Site, Station

DEG = math.pi / 180.0
SIGMA_KEYS: dict[str, tuple[tuple[Component, ...], float]] = {
    "sigma_range_m": ((Component.RANGE,), 1.0),
    "sigma_azimuth_deg": ((Component.AZIMUTH,), DEG),
    "sigma_elevation_deg": ((Component.ELEVATION,), DEG),
    "sigma_range_rate_m_s": ((Component.RANGE_RATE,), 1.0),
    "sigma_position_m": ((Component.EAST, Component.NORTH, Component.UP), 1.0),
}


class SiteTable(TableModel, frozen=True):
    """`[site]`."""

    latitude_deg: float
    longitude_deg: float
    height_m: float = 0.0


class MountTable(TableModel, frozen=True):
    """`mount = {…}` of a sensor."""

    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0
    lever_arm_frd_m: tuple[float, float, float] = (0.0, 0.0, 0.0)


class PositionTable(TableModel, frozen=True):
    """`position = {…}` of a sensor that stands at a place of its own: geodetic, or in the site's east/north/up."""

    latitude_deg: float | None = None
    longitude_deg: float | None = None
    height_m: float | None = None
    east_m: float | None = None
    north_m: float | None = None
    up_m: float | None = None


class CoverageTable(TableModel, frozen=True):
    """`coverage = {…}` of a sensor."""

    range_m: tuple[float, float] = (0.0, math.inf)
    azimuth_deg: tuple[float, float] = (-180.0, 180.0)
    elevation_deg: tuple[float, float] = (-90.0, 90.0)


class SensorTable(TableModel, frozen=True):
    """One `[[sensor]]`."""

    id: str
    kind: str
    platform: str | None = None
    axes: str | None = None  # platform_enu where a platform is named, else site_enu
    position: PositionTable | None = None
    mount: MountTable = MountTable()
    sigma_range_m: float | None = None
    sigma_azimuth_deg: float | None = None
    sigma_elevation_deg: float | None = None
    sigma_range_rate_m_s: float | None = None
    sigma_position_m: float | None = None
    latency_s: float = 0.0
    period_s: float | None = None
    p_detection: float = 0.9
    clutter_per_scan: float = 1.0
    coverage: CoverageTable = CoverageTable()
    reporting: str = "scan"
    p_wrong_id: float | None = None
    height_m: tuple[float, float] | None = None


class RecordingTable(TableModel, frozen=True):
    """The whole of recording.toml."""

    site: SiteTable
    sensor: tuple[SensorTable, ...]
    format: int = 1
    name: str = ""
    dimensions: int = 3


@dataclass(frozen=True, slots=True)
class Declaration:
    """What recording.toml says, in SI and radians."""

    name: str
    dimensions: int
    site: Site
    sensors: tuple[Sensor, ...]


def read_declaration(path: Path | str) -> Declaration:
    """Read and check a recording.toml; raises UserError that names file and key."""
    where = str(path)
    return declaration_of(convert(read_toml(path), RecordingTable, where), where)


def declaration_of(table: RecordingTable, where: str) -> Declaration:
    """Check the tables of a recording.toml, called `where` in errors."""
    if table.format != 1:
        raise UserError(f"{where}: format = {table.format}; this version reads format = 1")
    if table.dimensions not in (2, 3):
        raise UserError(f"{where}: dimensions = {table.dimensions}; give 2 or 3")
    if not table.sensor:
        raise UserError(f"{where}: no [[sensor]] table; declare at least one sensor")
    site = site_of(table.site, where)
    sensors = tuple(sensor_of(s, where, site, table.dimensions) for s in table.sensor)
    ids = [s.id for s in sensors]
    for i in ids:
        if ids.count(i) > 1:
            raise UserError(f"{where}: sensor id '{i}' stands twice; give each sensor its own id")
    return Declaration(table.name, table.dimensions, site, sensors)


def site_of(table: SiteTable, where: str) -> Site:
    """Return the Site of a `[site]` table."""
    for key, limit in (("latitude_deg", 90.0), ("longitude_deg", 180.0), ("height_m", math.inf)):
        value = getattr(table, key)
        if not (math.isfinite(value) and abs(value) <= limit):
            raise UserError(f"{where}: site.{key} = {value} is out of range")
    return Site(table.latitude_deg * DEG, table.longitude_deg * DEG, table.height_m)


def sensor_of(table: SensorTable, where: str, site: Site | None = None, dimensions: int = 3) -> Sensor:
    """Return the Sensor of a `[[sensor]]` table; a geodetic `position` needs the site. Raises UserError."""
    if not table.id:
        raise UserError(f"{where}: a [[sensor]] has an empty id")
    at = f"{where}: sensor '{table.id}'"
    sigma = np.full(len(Component), np.nan)
    for key, (components, unit) in SIGMA_KEYS.items():
        value = getattr(table, key)
        if value is not None:
            _need(at, key, value, math.isfinite(value) and value > 0, "a standard deviation above zero")
            sigma[list(components)] = value * unit
    sigma.flags.writeable = False
    _need(at, "latency_s", table.latency_s, math.isfinite(table.latency_s), "a finite number")
    if table.period_s is not None:
        _need(at, "period_s", table.period_s, 0 < table.period_s < math.inf, "a time above zero")
    _need(at, "p_detection", table.p_detection, 0 < table.p_detection <= 1, "a probability in (0, 1]")
    clutter = table.clutter_per_scan
    _need(at, "clutter_per_scan", clutter, 0 <= clutter < math.inf, "a mean number of zero or more")
    wrong, height = table.p_wrong_id, table.height_m
    if wrong is not None:
        _need(at, "p_wrong_id", wrong, 0 < wrong < 1, "a probability in (0, 1)")
    if height is not None:
        good = math.isfinite(height[0]) and 0 < height[1] < math.inf
        _need(at, "height_m", list(height), good, "[mean, sigma] with sigma above zero")
    return Sensor(
        id=table.id,
        kind=SensorKind(_word(at, "kind", table.kind, list(SensorKind))),
        platform=table.platform,
        axes=_axes(table, at),
        mount=mount_of(table.mount, at),
        sigma=sigma,
        latency=table.latency_s,
        period=table.period_s,
        p_detection=table.p_detection,
        clutter_per_scan=clutter,
        coverage=coverage_of(table.coverage, at),
        station=station_of(table, at, site, dimensions),
        reporting=Reporting(_word(at, "reporting", table.reporting, list(Reporting))),
        p_wrong_id=wrong,
        height=height,
    )


def _axes(table: SensorTable, at: str) -> Axes:
    """The declared axes; without, those of a sensor that moves with its platform, or stands fixed."""
    if table.axes is None:
        return Axes.PLATFORM_ENU if table.platform is not None else Axes.SITE_ENU
    axes = Axes(_word(at, "axes", table.axes, list(Axes)))
    if axes == Axes.SITE_ENU and table.platform is not None:
        raise UserError(
            f"{at}: rides on platform '{table.platform}', but axes = \"site_enu\" is for a sensor fixed at the site; "
            'give axes = "platform_enu" (north-aligned), "body" or "mount", or leave out the platform'
        )
    return Axes.SITE_ENU if axes == Axes.PLATFORM_ENU and table.position is not None else axes


def station_of(table: SensorTable, at: str, site: Site | None, dimensions: int) -> Station | None:
    """Return where a fixed sensor stands: None at the site's origin. Raises UserError."""
    p = table.position
    if p is None:
        return None
    if table.platform is not None:
        raise UserError(
            f"{at}: has a position of its own and rides on platform '{table.platform}'; give one of the two"
        )
    geodetic, enu = (p.latitude_deg, p.longitude_deg, p.height_m), (p.east_m, p.north_m, p.up_m)
    if (geodetic == (None, None, None)) == (enu == (None, None, None)):
        raise UserError(f"{at}: position: give either latitude_deg, longitude_deg, height_m or east_m, north_m, up_m")
    names = (
        ("latitude_deg", "longitude_deg", "height_m") if enu == (None, None, None) else ("east_m", "north_m", "up_m")
    )
    values = []
    for name in names:
        value = getattr(p, name)
        if value is None and name in ("height_m", "up_m") and dimensions == 2:
            value = 0.0 if name == "up_m" or site is None else site.height
        if value is None:
            raise UserError(f"{at}: position: key '{name}' is missing")
        if (why := limits.problem(name, value)) is not None:
            raise UserError(f"{at}: position: {why}")
        values.append(float(value))
    return _station(values, names[0] == "latitude_deg", at, site, dimensions)


def _station(values: list[float], geodetic: bool, at: str, site: Site | None, dimensions: int) -> Station:
    from boresight.frames.local import (  # compiled code: loaded only where it is needed
        ecef_from_enu_rotation,
        enu_from_geodetic,
        geodetic_from_enu,
    )

    if site is None:
        if geodetic:
            raise UserError(f"{at}: position: latitude and longitude need a [site]; give east_m, north_m, up_m")
        return Station((values[0], values[1], values[2] if dimensions == 3 else 0.0))
    if geodetic:
        here = Site(values[0] * DEG, values[1] * DEG, values[2])
        east, north, up = (float(v) for v in enu_from_geodetic(here.latitude, here.longitude, here.height, site))
    else:
        east, north, up = values
        here = Site(*(float(v) for v in geodetic_from_enu(east, north, up, site)))
    turn = ecef_from_enu_rotation(site).T @ ecef_from_enu_rotation(here)
    rows = tuple((float(a), float(b), float(c)) for a, b, c in turn)
    return Station((east, north, up if dimensions == 3 else 0.0), rows)


def mount_of(table: MountTable, at: str) -> Mount:
    """Return the Mount of a `mount` table."""
    angles = (table.yaw_deg, table.pitch_deg, table.roll_deg)
    if not all(math.isfinite(v) for v in (*angles, *table.lever_arm_frd_m)):
        raise UserError(f"{at}: mount holds a number that is not finite")
    return Mount(table.yaw_deg * DEG, table.pitch_deg * DEG, table.roll_deg * DEG, table.lever_arm_frd_m)


def coverage_of(table: CoverageTable, at: str) -> Coverage:
    """Return the Coverage of a `coverage` table."""
    for key in ("range_m", "elevation_deg"):
        low, high = getattr(table, key)
        _need(at, f"coverage.{key}", [low, high], low < high and math.isfinite(low), "[low, high] with low < high")
    _need(at, "coverage.range_m", table.range_m[0], table.range_m[0] >= 0, "a range of zero or more")
    low, high = table.azimuth_deg
    good = math.isfinite(low) and math.isfinite(high) and low != high
    _need(at, "coverage.azimuth_deg", [low, high], good, "two different finite angles")
    low, high = table.elevation_deg
    return Coverage(
        table.range_m,
        (table.azimuth_deg[0] * DEG, table.azimuth_deg[1] * DEG),
        (max(low, -90.0) * DEG, min(high, 90.0) * DEG),
    )


def write_declaration(declaration: Declaration) -> str:
    """Return the text of recording.toml."""
    site = declaration.site
    top: dict[str, Any] = {"format": 1, "name": declaration.name, "dimensions": declaration.dimensions}
    top["site"] = {
        "latitude_deg": _deg(site.latitude),
        "longitude_deg": _deg(site.longitude),
        "height_m": site.height,
    }
    top["sensor"] = [_sensor_table(s) for s in declaration.sensors]
    return write_toml(top)


def _sensor_table(sensor: Sensor) -> dict[str, Any]:
    table: dict[str, Any] = {"id": sensor.id, "kind": str(sensor.kind)}
    if sensor.platform is not None:
        table["platform"] = sensor.platform
    mount, cover = sensor.mount, sensor.coverage
    if sensor.station is not None:
        east, north, up = sensor.station.position
        table["position"] = {"east_m": east, "north_m": north, "up_m": up}
    table["axes"] = str(sensor.axes)
    table["mount"] = {
        "yaw_deg": _deg(mount.yaw),
        "pitch_deg": _deg(mount.pitch),
        "roll_deg": _deg(mount.roll),
        "lever_arm_frd_m": list(mount.lever_arm),
    }
    for key, (components, unit) in SIGMA_KEYS.items():
        value = float(sensor.sigma[components[0]])
        if not math.isnan(value):
            table[key] = value if unit == 1.0 else _deg(value)
    table["latency_s"] = sensor.latency
    if sensor.period is not None:
        table["period_s"] = sensor.period
    table |= {"p_detection": sensor.p_detection, "clutter_per_scan": sensor.clutter_per_scan}
    table["coverage"] = {
        "range_m": list(cover.range),
        "azimuth_deg": [_deg(a) for a in cover.azimuth],
        "elevation_deg": [_deg(a) for a in cover.elevation],
    }
    if sensor.reporting is not Reporting.SCAN:
        table["reporting"] = str(sensor.reporting)
    if sensor.p_wrong_id is not None:
        table["p_wrong_id"] = sensor.p_wrong_id
    if sensor.height is not None:
        table["height_m"] = list(sensor.height)
    return table


def _deg(angle: float) -> float:
    """Radians to degrees, rounded so that a number a person wrote comes back as written."""
    return float(f"{angle / DEG:.14g}")


def _need(at: str, key: str, value: Any, good: bool, wanted: str) -> None:
    if not good:
        raise UserError(f"{at}: {key} = {value}; give {wanted}")


def _word(at: str, key: str, word: str, known: list[str]) -> str:
    if word not in known:
        choices = ", ".join(known)
        raise UserError(f"{at}: {key} = '{word}' is not known{did_you_mean(word, known)}; give one of {choices}")
    return word
