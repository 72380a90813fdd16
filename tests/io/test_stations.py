"""Fixed sensors at places of their own, platforms at rest, axes by default."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.frames.local import enu_from_geodetic, geodetic_from_enu
from boresight.frames.pose import pose_track, sensor_pose
from boresight.io import read_recording, write_recording
from boresight.io.declaration import Declaration, read_declaration, write_declaration
from boresight.types import Axes, Site
from tests.io.conftest import Write

SITE = '[site]\nlatitude_deg = 54.0\nlongitude_deg = 8.0\nheight_m = 10.0\n[[sensor]]\nid = "a"\nkind = "radar"\n'
RADAR = "sigma_range_m = 5.0\nsigma_azimuth_deg = 0.1\n"


def declare(folder: Path, keys: str, dimensions: int = 3) -> Declaration:
    (folder / "recording.toml").write_text(f"dimensions = {dimensions}\n{SITE}{RADAR}{keys}\n")
    return read_declaration(folder / "recording.toml")


def test_a_geodetic_position_is_that_place_with_its_own_north(tmp_path: Path) -> None:
    """What is straight north of a radar 130 km east of the site lies at its azimuth 0, 1.6° off the site's north."""
    d = declare(tmp_path, "position = { latitude_deg = 54.0, longitude_deg = 10.0, height_m = 30.0 }")
    position, velocity, axes = sensor_pose(d.sensors[0], None, [0.0, 5.0])
    place = np.array(enu_from_geodetic(math.radians(54.0), math.radians(10.0), 30.0, d.site))
    np.testing.assert_allclose(position, [place, place], atol=1e-6)
    assert not velocity.any()
    north = np.array(enu_from_geodetic(math.radians(54.01), math.radians(10.0), 30.0, d.site)) - place
    local = axes[0].T @ north
    assert math.degrees(math.atan2(local[0], local[1])) == pytest.approx(0.0, abs=1e-6)
    assert math.degrees(math.atan2(north[0], north[1])) == pytest.approx(-1.618, abs=0.01)
    high = np.array(enu_from_geodetic(math.radians(54.0), math.radians(10.0), 1030.0, d.site)) - place
    np.testing.assert_allclose(axes[0].T @ high, [0.0, 0.0, 1000.0], atol=1e-6)


@pytest.mark.parametrize("axes", ["site_enu", "platform_enu", "body", "mount"])
def test_an_offset_in_east_north_up_is_the_same_place(axes: str, tmp_path: Path) -> None:
    d = declare(tmp_path, f'axes = "{axes}"\nposition = {{ east_m = 1000.0, north_m = -2000.0, up_m = 50.0 }}')
    position, _, R = sensor_pose(d.sensors[0], None, [0.0])
    np.testing.assert_allclose(position[0], [1000.0, -2000.0, 50.0], atol=1e-9)
    np.testing.assert_allclose(np.abs(R[0]), np.eye(3), atol=4e-4)  # level there, 2.2 km away: 0.02°
    again = write_declaration(d)
    (tmp_path / "recording.toml").write_text(again)
    np.testing.assert_allclose(
        sensor_pose(read_declaration(tmp_path / "recording.toml").sensors[0], None, [0.0])[0], position
    )


def test_in_two_dimensions_no_height_is_asked_and_none_is_used(tmp_path: Path) -> None:
    d = declare(tmp_path, "position = { latitude_deg = 54.1, longitude_deg = 8.1 }", dimensions=2)
    position, _, _ = sensor_pose(d.sensors[0], None, [0.0])
    assert position[0, 2] == 0.0
    assert math.hypot(*position[0, :2]) == pytest.approx(12910.0, rel=0.01)


BAD = [
    ("position = {}", "give either latitude_deg"),
    ("position = { latitude_deg = 54.0, longitude_deg = 8.0, height_m = 0.0, east_m = 1.0 }", "give either"),
    ("position = { latitude_deg = 54.0, height_m = 0.0 }", "key 'longitude_deg' is missing"),
    ("position = { latitude_deg = 54.0, longitude_deg = 8.0 }", "key 'height_m' is missing"),
    ("position = { latitude_deg = 91.0, longitude_deg = 8.0, height_m = 0.0 }", "latitude_deg = 91"),
    ('platform = "ship"\nposition = { east_m = 1.0, north_m = 0.0, up_m = 0.0 }', "one of the two"),
    ('platform = "ship"\naxes = "site_enu"', 'give axes = "platform_enu"'),
]


@pytest.mark.parametrize(("keys", "words"), BAD)
def test_positions_that_cannot_be(keys: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=words):
        declare(tmp_path, keys)


def test_axes_move_with_the_platform_unless_declared(tmp_path: Path) -> None:
    assert declare(tmp_path, 'platform = "ship"').sensors[0].axes is Axes.PLATFORM_ENU
    assert declare(tmp_path, "").sensors[0].axes is Axes.SITE_ENU
    assert declare(tmp_path, 'platform = "ship"\naxes = "body"').sensors[0].axes is Axes.BODY


def test_a_platform_of_one_row_is_at_rest_for_all_times(write: Write, tmp_path: Path) -> None:
    def edit(tables) -> None:
        tables["platform"] = {k: v[:1] for k, v in tables["platform"].items()}

    recording = read_recording(write(edit))
    (platform,) = recording.platforms
    assert platform.at_rest
    track = pose_track(platform, recording.site)
    for t in (-1e6, 0.0, 1e9):
        np.testing.assert_array_equal(track.at(t).position, platform.position[0])
        np.testing.assert_allclose(
            track.at(t).enu_from_body[:, 0], [1.0, 0.0, 0.0], atol=1e-12
        )  # yaw 90°: forward is east
    write_recording(recording, tmp_path / "again")
    assert read_recording(tmp_path / "again").platforms[0].at_rest


def test_a_moving_platform_of_one_row_is_not_at_rest(write: Write) -> None:
    def edit(tables) -> None:
        one = {k: v[:1] for k, v in tables["platform"].items()}
        tables["platform"] = one | {"ve_m_s": [3.0], "vn_m_s": [0.0], "vu_m_s": [0.0]}

    assert not read_recording(write(edit)).platforms[0].at_rest


def test_the_way_back_of_a_place(tmp_path: Path) -> None:
    site = Site(math.radians(54.0), math.radians(8.0), 10.0)
    d = declare(tmp_path, "position = { latitude_deg = 53.2, longitude_deg = 7.1, height_m = 5.0 }")
    assert d.sensors[0].station is not None
    back = geodetic_from_enu(*d.sensors[0].station.position, site)
    np.testing.assert_allclose([math.degrees(back[0]), math.degrees(back[1]), back[2]], [53.2, 7.1, 5.0], atol=1e-7)
