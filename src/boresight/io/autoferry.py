"""The Autoferry benchmark (Helgesen et al., Ocean Engineering 2022): its JSON lists to a Recording."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pyarrow as pa

from boresight.errors import UserError
from boresight.io.declaration import CoverageTable, Declaration, SensorTable, SiteTable, sensor_of, site_of
from boresight.io.detections import REQUIRED, SCHEMA
from boresight.io.files import read_text
from boresight.io.paths import IGNORE_SCHEMA, TRUTH_SCHEMA
from boresight.io.recording import assemble
from boresight.io.table import NUMBER, TEXT, Table, check_table, read_csv
from boresight.types import Recording

SITE = SiteTable(latitude_deg=63.4389029083, longitude_deg=10.39908278, height_m=39.923)
PLATFORM = "ferry"
IGNORE_RADIUS_M = 40.0
IGNORE_HOLD_S = 5.0  # an ignored path stands still this long before its first and after its last point
# What is declared of each sensor, by the data's sensorID; the numbers are documented in docs/recordings.md.
SENSORS: dict[int, SensorTable] = {
    1: SensorTable(
        id="lidar",
        kind="lidar",
        platform=PLATFORM,
        axes="platform_enu",
        sigma_position_m=3.0,
        latency_s=0.4,
        period_s=0.5,
        p_detection=0.5,
        clutter_per_scan=1.0,
        coverage=CoverageTable(range_m=(0.0, 120.0)),
    ),
    2: SensorTable(
        id="radar",
        kind="radar",
        platform=PLATFORM,
        axes="platform_enu",
        sigma_position_m=2.0,
        latency_s=2.0,
        period_s=1.68,
        p_detection=0.8,
        clutter_per_scan=3.0,
        coverage=CoverageTable(range_m=(0.0, 700.0)),
    ),
    3: SensorTable(
        id="ir",
        kind="infrared",
        platform=PLATFORM,
        axes="platform_enu",
        sigma_azimuth_deg=0.5,
        period_s=0.117,
        p_detection=0.4,
        clutter_per_scan=2.0,
    ),
    4: SensorTable(
        id="eo",
        kind="optical",
        platform=PLATFORM,
        axes="platform_enu",
        sigma_azimuth_deg=0.5,
        period_s=0.2,
        p_detection=0.5,
        clutter_per_scan=3.0,
    ),
}
RANGING = (1, 2)
# The errors beyond white noise, and where the sensors answer for what is there: one set for every scenario.
TRACKER_TOML = """\
# Settings for the Autoferry sensor suite, one set for all scenarios; `boresight track` uses this file unless --config
# names another.
[tracker]
process_noise_m2_s3 = 0.106
gate_probability = 0.967
speed_sigma_m_s = 4.7
birth_rate = 0.00174
targets_at_start = 1.81
hide_time_s = 95.6
show_time_s = 3.41
survival_time_s = 280.0
static_share = 0.333
static_wander_m2_s = 0.0946
stop_floor = 0.00772
start_speed_m_s = 0.588         # what stood sets off at about this speed
doubt = 0.037
confirm_above = 0.985
hide_below = 0.477
merge_distance_m = 17.8
apart_m = 24.8
blob_share = 0.1
clutter_memory_looks = 17.8
extent_m = 1.2                # from the part of a boat that is reported to what is meant by its place

[[sensor]]
id = "radar"
bias_position_m = 1.32
bias_time_s = 19.3
resolution_m = 21.7
report_range_m = 310.0

[[sensor]]
id = "lidar"
bias_position_m = 1.95
bias_time_s = 18.3
resolution_m = 10.0
sees_targets = 0.75         # it never reports some boats
report_range_m = 0.0        # begins and moves tracks; they are shown when the radar sees them

[[sensor]]
id = "ir"
bias_azimuth_deg = 2.87     # of the kind that no two bearings agree on: evidence, not position
bias_time_s = 30.0
decorrelation_s = 1.94
moves_tracks = false
sees_targets = 0.9
sees_static = 0.0197        # it was trained on boats, and passes over what stands about
fade_range_m = 405.0

[[sensor]]
id = "eo"
bias_azimuth_deg = 2.59
bias_time_s = 30.0
decorrelation_s = 2.12
moves_tracks = false
sees_targets = 0.95
sees_static = 0.0258
fade_range_m = 497.0
"""


def import_autoferry(detections: Path, truth: Path | None = None, ignore: Path | None = None) -> Recording:
    """Return the recording of one scenario; raises UserError that names file and entry.

    Args:
        detections: the list of looks; radar and lidar in north/east metres from the own ship, IR and EO as bearings.
        truth: the list whose entry i pairs with look i; becomes the unique (target, time) points.
        ignore: CSV with columns time, object, north, east: paths of real objects without truth.
    """
    entries = _read_list(detections)
    where = str(detections)
    looks = _looks(entries, detections)
    return assemble(
        Declaration(
            detections.stem.removesuffix("_detections"),
            2,
            site_of(SITE, where),
            tuple(sensor_of(s, where) for s in SENSORS.values()),
        ),
        check_table(Table(detections, pa.table(looks)), SCHEMA, REQUIRED),
        platform=Table(detections, pa.table(_ownship(entries))),
        truth=_truth(truth, len(entries)) if truth is not None else None,
        ignore=_ignore(ignore) if ignore is not None else None,
        where=where,
    )


def _fail(path: Path, entry: int, text: str) -> NoReturn:
    raise UserError(f"{path}: entry {entry}: {text}")


def _read_list(path: Path) -> list[Any]:
    try:
        data = json.loads(read_text(path))
    except (json.JSONDecodeError, RecursionError) as error:
        raise UserError(f"{path}: not valid JSON (truncated or damaged): {error}") from None
    if not isinstance(data, list):
        raise UserError(f"{path}: holds one JSON {type(data).__name__}, expected a list of entries")
    if not data:
        raise UserError(f"{path}: the list has no entries")
    return data


def _is_number(value: Any) -> bool:
    return isinstance(value, float) or (type(value) is int and abs(value) < 2**63)


def _number(path: Path, entry: int, item: dict[str, Any], key: str) -> float:
    if key not in item:
        _fail(path, entry, f"key '{key}' is missing")
    if not _is_number(item[key]) or not math.isfinite(item[key]):
        _fail(path, entry, f"{key} = {item[key]!r} is not a finite number")
    return float(item[key])


def _point(path: Path, entry: int, item: dict[str, Any], key: str) -> tuple[float, float]:
    value = item.get(key)
    good = isinstance(value, list) and len(value) >= 2 and all(_is_number(v) and math.isfinite(v) for v in value)
    if not good:
        _fail(path, entry, f"{key} = {value!r} is not [north, east] in metres")
    assert isinstance(value, list)
    return float(value[0]), float(value[1])


def _looks(entries: list[Any], path: Path) -> dict[str, Any]:
    """Columns of detections: one row per point or bearing, one row of nulls for an empty look."""
    rows: list[tuple[float, str, int, float | None, float | None, float | None]] = []
    counts = dict.fromkeys(SENSORS, 0)
    for i, item in enumerate(entries):
        if not isinstance(item, dict):
            _fail(path, i, f"is {item!r}, expected an object with sensorID, time, ownshipPosition, measurement")
        t, number = _number(path, i, item, "time"), item.get("sensorID")
        if type(number) is not int or number not in SENSORS:
            _fail(path, i, f"sensorID = {number!r}; known are 1 lidar, 2 radar, 3 IR, 4 EO")
        _point(path, i, item, "ownshipPosition")
        sensor, scan = SENSORS[number].id, counts[number]
        counts[number] += 1
        found: list[tuple[float | None, float | None, float | None]]
        if number in RANGING:
            found = [(None, east, north) for north, east in _points(path, i, item)]
        else:
            found = [(math.degrees(b), None, None) for b in _bearings(path, i, item)]
        rows += [(t, sensor, scan, *f) for f in found or [(None, None, None)]]
    names = ("t_s", "sensor", "scan", "azimuth_deg", "x_m", "y_m")
    columns = dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))
    return {
        k: pa.array(v, pa.float64()) if k in ("azimuth_deg", "x_m", "y_m") else pa.array(v) for k, v in columns.items()
    }


def _measurement(path: Path, entry: int, item: dict[str, Any]) -> list[Any]:
    if "measurement" not in item:
        _fail(path, entry, "key 'measurement' is missing")
    value = item["measurement"]
    return value if isinstance(value, list) else [value]


def _points(path: Path, entry: int, item: dict[str, Any]) -> list[tuple[float, float]]:
    value = _measurement(path, entry, item)
    if not value:
        return []
    if len(value) == 2 and all(isinstance(v, list) for v in value) and len(value[0]) == len(value[1]):
        norths, easts = value
    elif len(value) == 2 and all(_is_number(v) for v in value):
        norths, easts = [value[0]], [value[1]]
    else:
        _fail(path, entry, "measurement is neither [], [north, east] nor [[north …], [east …]]")
    _finite(path, entry, [*norths, *easts])
    return list(zip(norths, easts, strict=True))


def _bearings(path: Path, entry: int, item: dict[str, Any]) -> list[float]:
    value = _measurement(path, entry, item)
    _finite(path, entry, value)
    return value


def _finite(path: Path, entry: int, values: list[Any]) -> None:
    for v in values:
        if not _is_number(v) or not math.isfinite(v):
            _fail(path, entry, f"measurement holds {v!r}, not a finite number")


def _ownship(entries: list[Any]) -> dict[str, Any]:
    """Columns of the platform: one row per distinct time, ascending."""
    points = {float(e["time"]): e["ownshipPosition"] for e in reversed(entries)}
    times = sorted(points)
    return {
        "t_s": times,
        "platform": [PLATFORM] * len(times),
        "east_m": [float(points[t][1]) for t in times],
        "north_m": [float(points[t][0]) for t in times],
    }


def _truth(path: Path, n: int) -> Table:
    entries = _read_list(path)
    if len(entries) != n:
        raise UserError(f"{path}: {len(entries)} entries; the detections have {n}, and entry i pairs with entry i")
    points: dict[tuple[str, float], tuple[float, float]] = {}
    for i, entry in enumerate(entries):
        for item in entry if isinstance(entry, list) else [entry]:
            if not isinstance(item, dict) or "targetID" not in item:
                _fail(path, i, "expected objects with targetID, position, time")
            key = (str(item["targetID"]), _number(path, i, item, "time"))
            points.setdefault(key, _point(path, i, item, "position"))
    keys = sorted(points)
    columns = {
        "t_s": [t for _, t in keys],
        "target": [name for name, _ in keys],
        "east_m": [points[k][1] for k in keys],
        "north_m": [points[k][0] for k in keys],
    }
    return check_table(Table(path, pa.table(columns)), TRUTH_SCHEMA, ("t_s", "target"))


def _ignore(path: Path) -> Table:
    schema = {"time": NUMBER, "object": TEXT, "north": NUMBER, "east": NUMBER}
    table = read_csv(path, schema, tuple(schema))
    t, names = table.numbers("time", required=True), np.array(table.words("object"))
    xy = np.stack([table.numbers(k, required=True) for k in ("east", "north")], axis=1)
    rows = []
    for name in dict.fromkeys(names.tolist()):
        of = np.flatnonzero(names == name)
        back = np.flatnonzero(np.diff(t[of]) <= 0)
        if len(back):
            table.fail(int(of[back[0] + 1]), f"time of object '{name}' does not ascend")
        rows += [(t[of[0]] - IGNORE_HOLD_S, name, *xy[of[0]])]
        rows += [(t[r], name, *xy[r]) for r in of]
        rows += [(t[of[-1]] + IGNORE_HOLD_S, name, *xy[of[-1]])]
    columns = dict(zip(("t_s", "object", "east_m", "north_m"), map(list, zip(*rows, strict=True)), strict=True))
    columns["radius_m"] = [IGNORE_RADIUS_M] * len(rows)
    return check_table(Table(path, pa.table(columns)), IGNORE_SCHEMA, tuple(IGNORE_SCHEMA))
