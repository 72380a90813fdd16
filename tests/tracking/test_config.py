"""Settings outside their range are named; those of a file arrive in SI units."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from boresight.config.tracker import SENSOR_KEYS, read_tracker_config
from boresight.errors import UserError
from boresight.tracking.config import SensorErrors, TrackerConfig
from boresight.tracking.core import make_plan


@pytest.mark.parametrize(
    "values",
    [
        {"survival_time": 0.0},
        {"clutter_memory": float("nan")},
        {"gate_probability": 1.0},
        {"confirm_above": 0.3, "hide_below": 0.4},
        {"blob_share": 1.5},
        {"static_share": -0.1},
        {"speed_sigma": 0.0},
        {"q": -1.0},
        {"clutter_memory": 0.5},
        {"manoeuvre_lasts": 5.0},
        {"manoeuvre_every": 0.0, "q_manoeuvre": 1.0},
        {"manoeuvre_lasts": float("inf"), "q_manoeuvre": 1.0},
    ],
)
def test_a_value_out_of_range_is_named(values: dict[str, Any]) -> None:
    with pytest.raises(UserError, match=f"tracker: .*{next(iter(values))}"):
        TrackerConfig(**values)


@pytest.mark.parametrize(
    "values",
    [
        {"bias_time": 0.0},
        {"fade_range": 0.0},
        {"bias_range": float("inf")},
        {"decorrelation": float("nan")},
        {"sees_static": 1.5},
        {"sees_static": -0.1},
    ],
)
def test_of_a_sensor_too(values: dict[str, float]) -> None:
    with pytest.raises(UserError, match=rf"sensor\['ir'\]: {next(iter(values))}"):
        TrackerConfig(sensors={"ir": SensorErrors(**values)})


def test_an_unknown_association_is_named() -> None:
    with pytest.raises(UserError, match="did you mean 'nearest'"):
        TrackerConfig(association="neares")
    with pytest.raises(UserError, match=r"sensor\['radar'\]"):
        TrackerConfig(sensors={"radar": SensorErrors(association="gnn")})


def test_a_manoeuvre_is_rougher_than_quiet_motion() -> None:
    for q, q_manoeuvre in ((0.5, 0.5), (None, 0.05), (0.1, float("inf"))):
        with pytest.raises(UserError, match="q_manoeuvre must be finite and larger"):
            make_plan(TrackerConfig(q=q, q_manoeuvre=q_manoeuvre), (), 2)


@pytest.mark.parametrize("key", sorted(set(SENSOR_KEYS) - {"association", "moves_tracks"}))
def test_a_sensors_key_reaches_its_field_in_the_unit_of_its_name(key: str, tmp_path: Path) -> None:
    path = tmp_path / "tracker.toml"
    path.write_text(f'[[sensor]]\nid = "ir"\n{key} = 0.3\n', encoding="utf-8")
    errors = read_tracker_config(path, ["ir"]).sensors["ir"]
    unit = math.pi / 180.0 if key.endswith("_deg") else 1.0
    assert getattr(errors, SENSOR_KEYS[key][0]) == pytest.approx(0.3 * unit)


def test_every_field_of_a_sensor_has_one_key() -> None:
    fields = sorted(field.name for field in dataclasses.fields(SensorErrors))
    assert sorted(field for field, _ in SENSOR_KEYS.values()) == fields


def test_what_ranges_goes_by_what_is_measured_and_that_nothing_can_begin_is_said() -> None:
    from boresight.tracking.tracker import Tracker
    from boresight.types import Sensor, SensorKind

    def one(name: str, kind: SensorKind, *known: int) -> Sensor:
        sigma = np.full(7, np.nan)
        sigma[list(known)] = 1e-2
        return Sensor(name, kind, sigma=sigma)

    finder = one("finder", SensorKind.RADAR, 1, 3)  # azimuth and range rate: called a radar, and ranges nothing
    rangefinder = one("rangefinder", SensorKind.OPTICAL, 0, 1)
    assert not finder.ranging
    assert rangefinder.ranging
    assert one("ais", SensorKind.POSITION, 4, 5).begins
    assert not one("ring", SensorKind.RADAR, 0).begins  # a range alone is no place
    alone = Tracker(TrackerConfig(), (finder,), 2)
    assert "no sensor in use can begin a track (finder)" in alone.cannot_begin()
    assert Tracker(TrackerConfig(), (finder, rangefinder), 2).cannot_begin() == ""
    assert Tracker(TrackerConfig(), (finder, rangefinder), 2, use=(0,)).cannot_begin()


def test_sensors_that_could_not_be_told_apart_are_refused() -> None:
    from boresight.tracking.tracker import Tracker
    from boresight.types import Sensor, SensorKind

    sigma = np.full(7, np.nan)
    sigma[[0, 1]] = 1.0, 0.01
    many = tuple(Sensor(f"r{i}", SensorKind.RADAR, sigma=sigma) for i in range(63))
    with pytest.raises(UserError, match="at most 62"):
        Tracker(TrackerConfig(), many, 2)
    Tracker(TrackerConfig(), many, 2, use=tuple(range(1, 63)))
