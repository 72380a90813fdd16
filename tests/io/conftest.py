"""A small recording folder that each test may spoil."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

TOML = """
format = 1
name = "harbour"
dimensions = 2
[site]
latitude_deg = 63.4389029083
longitude_deg = 10.39908278
height_m = 39.923
[[sensor]]
id = "radar"
kind = "radar"
platform = "ferry"
axes = "platform_enu"
sigma_range_m = 5.0
sigma_azimuth_deg = 1.0
period_s = 1.68
p_detection = 0.9
clutter_per_scan = 3.0
coverage = { range_m = [0.0, 600.0], azimuth_deg = [-180.0, 180.0], elevation_deg = [-90.0, 90.0] }
[[sensor]]
id = "lidar"
kind = "lidar"
platform = "ferry"
axes = "body"
sigma_position_m = 1.5
[[sensor]]
id = "ir"
kind = "infrared"
sigma_azimuth_deg = 0.3
"""


def tables() -> dict[str, dict[str, Any]]:
    """Columns of the four files, as plain lists."""
    return {
        "detections": {
            "t_s": [1.0, 1.1, 1.05, 2.0, 2.0, 2.5],
            "sensor": ["radar", "radar", "ir", "lidar", "lidar", "ir"],
            "scan": [1, 1, 1, 1, 1, 2],
            "range_m": [100.0, 200.0, None, None, None, None],
            "azimuth_deg": [10.0, 270.0, -180.0, None, None, None],
            "x_m": [None, None, None, 5.0, 7.0, None],
            "y_m": [None, None, None, 1.0, -2.0, None],
        },
        "platform": {
            "t_s": [0.0, 10.0],
            "platform": ["ferry", "ferry"],
            "east_m": [0.0, 10.0],
            "north_m": [0.0, 0.0],
            "yaw_deg": [90.0, 90.0],
        },
        "truth": {"t_s": [0.0, 5.0], "target": ["a", "a"], "east_m": [0.0, 5.0], "north_m": [1.0, 1.0]},
        "ignore": {
            "t_s": [0.0, 5.0],
            "object": ["b", "b"],
            "east_m": [0.0, 5.0],
            "north_m": [1.0, 1.0],
            "radius_m": [40.0, 40.0],
        },
    }


Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Write the folder, with `edit(tables)` applied and `toml` in place of the usual one."""

    def make(edit: Callable[[dict[str, dict[str, Any]]], object] | None = None, toml: str = TOML) -> Path:
        folder = tmp_path / "rec"
        folder.mkdir()
        (folder / "recording.toml").write_text(toml)
        columns = tables()
        if edit is not None:
            edit(columns)
        for name, table in columns.items():
            pq.write_table(pa.table(table), folder / f"{name}.parquet")
        return folder

    return make
