"""tracker.toml: units in the keys, unknown keys named, to `tracking.TrackerConfig`."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

from boresight.config.pipeline import take_pipeline
from boresight.errors import UserError, did_you_mean
from boresight.io.toml import TableModel, convert, read_toml
from boresight.tracking.config import SensorErrors, TrackerConfig

DEG = math.pi / 180.0
# key in the file -> (field, factor to SI)
TRACKER_KEYS = {
    "process_noise_m2_s3": ("q", 1.0),
    "manoeuvre_noise_m2_s3": ("q_manoeuvre", 1.0),
    "manoeuvre_every_s": ("manoeuvre_every", 1.0),
    "manoeuvre_lasts_s": ("manoeuvre_lasts", 1.0),
    "speed_sigma_m_s": ("speed_sigma", 1.0),
    "climb_sigma_m_s": ("climb_sigma", 1.0),
    "gate_probability": ("gate_probability", 1.0),
    "birth_rate": ("birth_rate", 1.0),
    "survival_time_s": ("survival_time", 1.0),
    "hide_time_s": ("hide_time", 1.0),
    "show_time_s": ("show_time", 1.0),
    "static_share": ("static_share", 1.0),
    "static_wander_m2_s": ("static_q", 1.0),
    "stop_floor": ("stop_floor", 1.0),
    "rest_time_s": ("rest_time", 1.0),
    "start_speed_m_s": ("start_speed", 1.0),
    "targets_at_start": ("targets_at_start", 1.0),
    "apart_m": ("apart", 1.0),
    "doubt": ("doubt", 1.0),
    "confirm_above": ("confirm_above", 1.0),
    "hide_below": ("hide_below", 1.0),
    "delete_below": ("delete_below", 1.0),
    "merge_distance_m": ("merge_distance", 1.0),
    "association": ("association", 1.0),
    "blob_share": ("blob_share", 1.0),
    "lonely_bearings": ("lonely_bearings", 1.0),
    "clutter_memory_looks": ("clutter_memory", 1.0),
    "extent_m": ("extent", 1.0),
    "coast_after_s": ("coast_after", 1.0),
    "hide_after_s": ("hide_after", 1.0),
    "window_s": ("window", 1.0),
    "smoothing_lag_s": ("smoothing_lag", 1.0),
}
SENSOR_KEYS = {
    "bias_range_m": ("bias_range", 1.0),
    "bias_azimuth_deg": ("bias_azimuth", DEG),
    "bias_elevation_deg": ("bias_elevation", DEG),
    "bias_position_m": ("bias_position", 1.0),
    "bias_time_s": ("bias_time", 1.0),
    "offset_time_s": ("offset_time", 1.0),
    "offset_range_m": ("offset_range", 1.0),
    "offset_range_scale": ("offset_scale", 1.0),
    "offset_azimuth_deg": ("offset_azimuth", DEG),
    "offset_elevation_deg": ("offset_elevation", DEG),
    "decorrelation_s": ("decorrelation", 1.0),
    "fade_range_m": ("fade_range", 1.0),
    "resolution_m": ("resolution", 1.0),
    "report_range_m": ("report_range", 1.0),
    "moves_tracks": ("moves_tracks", 1.0),
    "sees_static": ("sees_static", 1.0),
    "sees_targets": ("sees_targets", 1.0),
    "association": ("association", 1.0),
}


class TrackerTable(TableModel, frozen=True):
    """`[tracker]`; what is left out takes the default of `TrackerConfig`."""

    process_noise_m2_s3: float | None = None
    manoeuvre_noise_m2_s3: float | None = None
    manoeuvre_every_s: float | None = None
    manoeuvre_lasts_s: float | None = None
    speed_sigma_m_s: float | None = None
    climb_sigma_m_s: float | None = None
    gate_probability: float | None = None
    birth_rate: float | None = None
    survival_time_s: float | None = None
    hide_time_s: float | None = None
    show_time_s: float | None = None
    static_share: float | None = None
    static_wander_m2_s: float | None = None
    stop_floor: float | None = None
    rest_time_s: float | None = None
    start_speed_m_s: float | None = None
    targets_at_start: float | None = None
    apart_m: float | None = None
    doubt: float | None = None
    confirm_above: float | None = None
    hide_below: float | None = None
    delete_below: float | None = None
    merge_distance_m: float | None = None
    association: str | None = None
    blob_share: float | None = None
    lonely_bearings: bool | None = None
    clutter_memory_looks: float | None = None
    extent_m: float | None = None
    coast_after_s: float | None = None
    hide_after_s: float | None = None
    window_s: float | None = None
    smoothing_lag_s: float | None = None


class ErrorsTable(TableModel, frozen=True):
    """One `[[sensor]]`: errors beyond the white noise that the recording declares."""

    id: str
    bias_range_m: float | None = None
    bias_azimuth_deg: float | None = None
    bias_elevation_deg: float | None = None
    bias_position_m: float | None = None
    bias_time_s: float | None = None
    offset_time_s: float | None = None
    offset_range_m: float | None = None
    offset_range_scale: float | None = None
    offset_azimuth_deg: float | None = None
    offset_elevation_deg: float | None = None
    decorrelation_s: float | None = None
    fade_range_m: float | None = None
    resolution_m: float | None = None
    report_range_m: float | None = None
    moves_tracks: bool | None = None
    sees_static: float | None = None
    sees_targets: float | None = None
    association: str | None = None


class ConfigTable(TableModel, frozen=True):
    """The whole file."""

    tracker: TrackerTable = TrackerTable()
    sensor: tuple[ErrorsTable, ...] = ()


def read_tracker_config(path: Path, sensor_ids: list[str]) -> TrackerConfig:
    """Read a tracker configuration for a recording with these sensors; raises UserError with file and key."""
    config, pipeline = read_configuration(path, sensor_ids)
    if pipeline:
        raise UserError(f"{path}: [pipeline] is applied by `boresight track` and `compare` only; leave it out here")
    return config


def read_configuration(path: Path, sensor_ids: list[str]) -> tuple[TrackerConfig, dict[str, Any]]:
    """Read a configuration: the tracker's settings, and the pipeline before it as `take_pipeline` gives it."""
    raw = read_toml(path)
    pipeline = take_pipeline(raw, str(path))
    return tracker_config_of(raw, str(path), sensor_ids), pipeline


def tracker_config_of(data: dict[str, Any], path: str, sensor_ids: list[str]) -> TrackerConfig:
    """Check a tracker configuration's tables, called `path` in errors; as `read_tracker_config`."""
    table = convert(data, ConfigTable, path)
    sensors = {}
    for item in table.sensor:
        if item.id not in sensor_ids:
            raise UserError(
                f"{path}: sensor '{item.id}' is not in the recording{did_you_mean(item.id, sensor_ids)}; "
                f"it has {', '.join(sensor_ids)}"
            )
        if item.id in sensors:
            raise UserError(f"{path}: sensor '{item.id}' stands twice")
        sensors[item.id] = SensorErrors(**_values(item, SENSOR_KEYS, f"{path}: sensor['{item.id}']"))
    values = _values(table.tracker, TRACKER_KEYS, f"{path}: tracker")
    try:
        return TrackerConfig(**values, sensors=sensors)
    except UserError as error:
        raise UserError(f"{path}: {error}") from None


def _values(table: TableModel, keys: dict[str, tuple[str, float]], where: str) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for key, (name, factor) in keys.items():
        value = getattr(table, key)
        if value is None:
            continue
        if not isinstance(value, bool | str):
            if not value >= 0.0:
                raise UserError(f"{where}: {key}: {value} is negative")
            value = value * factor
        out[name] = value
    return out


def parameters_of(config: TrackerConfig) -> dict[str, Any]:
    """Return the settings with the keys and units of the file, for summaries; None where the default depends."""

    def table(item: Any, keys: dict[str, tuple[str, float]]) -> dict[str, Any]:
        out = {}
        for key, (name, factor) in keys.items():
            value = getattr(item, name)
            out[key] = value if value is None or isinstance(value, bool | str) else value / factor
        return out

    assert {f.name for f in dataclasses.fields(SensorErrors)} == {name for name, _ in SENSOR_KEYS.values()}
    return {
        "tracker": table(config, TRACKER_KEYS),
        "sensor": [{"id": key, **table(value, SENSOR_KEYS)} for key, value in config.sensors.items()],
    }
