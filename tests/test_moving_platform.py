"""A target tracked from a turning, rolling aircraft has the same NEES as from a fixed site: files to score."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from boresight.cli.score import score_rows
from boresight.cli.track import track_recording
from boresight.config.scenario import read_scenario
from boresight.frames.local import geodetic_from_enu
from boresight.io.recording import read_recording, write_recording
from boresight.sim.scenario import simulate
from boresight.tracking.config import TrackerConfig
from boresight.types import Recording

RUNS = 12
SCENARIO = """
name = "aircraft seen from an aircraft"
duration_s = 120.0
dimensions = 3
[site]
latitude_deg = 47.45
longitude_deg = 8.56
height_m = 430.0
[[platforms]]
id = "plane"
kind = "waypoints"
attitude = { pitch_deg = 3.0, sway_ypr_deg = [0.0, 3.0, 30.0], sway_period_s = [10.0, 6.5, 9.0] }
navigation = { rate_hz = 10.0 }
[platforms.path]
points_enu_m = [[-6000.0, -9000.0, 3000.0], [-4500.0, -5000.0, 3100.0],
  [-4500.0, 0.0, 3000.0], [-7000.0, 4300.0, 3050.0]]
speed_m_s = 110.0
turn_radius_m = 1500.0
[[targets]]
id = "other"
kind = "nearly_constant_velocity"
position_enu_m = [2000.0, 3000.0, 4000.0]
velocity_enu_m_s = [-60.0, -90.0, 5.0]
q_m2_s3 = 0.5
"""
SENSORS = """
[[sensors]]
id = "radar"
kind = "radar"
{place}
period_s = 1.0
start_s = 0.193
sigma_range_m = 15.0
sigma_azimuth_deg = 0.3
sigma_elevation_deg = 0.3
p_detection = 0.95
clutter_per_scan = 0.0
coverage = {{ range_m = [0.0, 60000.0] }}
[[sensors]]
id = "camera"
kind = "infrared"
{place}
period_s = 0.2
start_s = 0.097
sigma_azimuth_deg = 0.1
sigma_elevation_deg = 0.1
p_detection = 0.9
clutter_per_scan = 0.0
"""
ON_BOARD = """platform = "plane"
axes = "mount"
mount = { yaw_deg = 40.0, pitch_deg = -5.0, roll_deg = 10.0, lever_arm_frd_m = [2.0, 0.0, 0.0] }"""


def recorded(folder: Path, place: str, seed: int) -> Recording:
    """Simulate, write, turn the platform's columns to latitude, longitude, height, and read it back."""
    (folder / "scenario.toml").write_text(SCENARIO + SENSORS.format(place=place), encoding="utf-8")
    plan, _ = read_scenario(folder / "scenario.toml", seed)
    recording = simulate(plan, np.random.default_rng(seed))
    write_recording(recording, folder / "rec", False)
    path = folder / "rec" / "platform.parquet"
    table = pq.read_table(path)
    if "east_m" in table.column_names:
        enu = [table[name].to_numpy() for name in ("east_m", "north_m", "up_m")]
        latitude, longitude, height = geodetic_from_enu(*enu, recording.site)
        table = table.drop_columns(["east_m", "north_m", "up_m"])
        for name, column in (
            ("latitude_deg", np.degrees(latitude)), ("longitude_deg", np.degrees(longitude)), ("height_m", height)
        ):  # fmt: skip
            table = table.append_column(name, pa.array(column))
        pq.write_table(table, path)
    return read_recording(folder / "rec")


def nees(recording: Recording) -> float:
    results = track_recording(recording, TrackerConfig(), None)
    rows = score_rows(recording, results)
    (target,) = (r for r in rows if r["item"] == "target")
    assert target["tracked_fraction"] > 0.8
    return float(target["nees_mean"])


@pytest.mark.slow
def test_a_rolling_aircraft_tracks_as_well_as_a_fixed_site(tmp_path: Path) -> None:
    means = {}
    for name, place in (("fixed", ""), ("aircraft", ON_BOARD)):
        values = []
        for seed in range(RUNS):
            folder = tmp_path / f"{name}{seed}"
            folder.mkdir()
            values.append(nees(recorded(folder, place, seed)))
        means[name] = (np.mean(values), np.std(values) / np.sqrt(RUNS))
    (fixed, a), (aircraft, b) = means["fixed"], means["aircraft"]
    # the difference of the two means within three of its own standard errors
    assert abs(aircraft - fixed) < 3.0 * np.hypot(a, b)
