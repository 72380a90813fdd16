"""Values that say "not available", and values that cannot be: refused with row and value wherever they come from."""

from __future__ import annotations

import math

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.io import iter_scans, read_recording
from boresight.io.limits import NOT_AVAILABLE, RANGES, absent, is_absent, is_outside, outside, problem
from tests.io.conftest import TOML, Write

GEODETIC = {
    "latitude_deg": [63.4389, 63.4389, 63.4389],
    "longitude_deg": [10.399, 10.3991, 10.3992],
    "height_m": [40.0] * 3,
}
TOML_3D = TOML.replace("dimensions = 2", "dimensions = 3")


def with_platform(row: int = 1, **values: float):
    """Edit of the tables: a platform by latitude and longitude, one row with other values."""

    def edit(tables) -> None:
        table = {"t_s": [0.0, 1.0, 10.0], "platform": ["ferry"] * 3, "yaw_deg": [90.0] * 3, **GEODETIC}
        table |= {
            "pitch_deg": [0.0] * 3,
            "roll_deg": [0.0] * 3,
            "ve_m_s": [0.5] * 3,
            "vn_m_s": [0.0] * 3,
            "vu_m_s": [0.0] * 3,
        }
        tables["platform"] = {k: list(v) for k, v in table.items()}
        tables["truth"]["up_m"] = [0.0, 0.0]
        for name, value in values.items():
            tables["platform"][name][row] = value

    return edit


@pytest.mark.parametrize("scalar", sorted(NOT_AVAILABLE))
def test_scalars_and_columns_agree(scalar: str) -> None:
    low, high = RANGES.get(scalar, (-1e3, 1e3))
    values = [*NOT_AVAILABLE[scalar], low, 0.0, min(high, 1e6), low - 1e-4, min(high, 1e6) + 1e-4]
    column = np.array(values)
    assert absent(scalar, column).tolist() == [is_absent(scalar, v) for v in values]
    assert outside(scalar, column).tolist() == [is_outside(scalar, v) for v in values]
    for v in values:
        assert (problem(scalar, v) is None) == (not is_absent(scalar, v) and not is_outside(scalar, v))


@pytest.mark.parametrize("value", [511.0, 655.35, 65535.0, 327.67])
def test_a_heading_that_is_not_available_is_not_measured(value: float, write: Write) -> None:
    recording = read_recording(write(with_platform(yaw_deg=value)))
    assert np.isnan(recording.platforms[0].ypr[:, 0]).tolist() == [False, True, False]
    (note,) = [n for n in recording.notes if "yaw_deg" in n]
    assert "row 1" in note
    assert f"{value:g}" in note


@pytest.mark.parametrize(
    ("name", "value"),
    [("latitude_deg", 91.0), ("longitude_deg", 181.0), ("latitude_deg", 214.7483647), ("height_m", 2147483.647)],
)
def test_a_position_that_is_not_available_is_no_row(name: str, value: float, write: Write) -> None:
    recording = read_recording(write(with_platform(**{name: value}), toml=TOML_3D.replace('axes = "body"', "")))
    assert recording.platforms[0].t.tolist() == [0.0, 10.0]
    assert any(name in n and "row 1" in n for n in recording.notes)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("latitude_deg", 90.1),
        ("latitude_deg", -90.0001),
        ("longitude_deg", 180.0001),
        ("longitude_deg", -180.0001),
        ("longitude_deg", 360.0),
        ("yaw_deg", 361.0),
        ("yaw_deg", 512.0),
        ("pitch_deg", 90.5),
        ("roll_deg", -181.0),
    ],
)
def test_what_cannot_be_is_refused_with_its_row(name: str, value: float, write: Write) -> None:
    with pytest.raises(UserError, match=f"row 1: {name} is {value}, outside"):
        read_recording(write(with_platform(**{name: value})))


@pytest.mark.parametrize(("name", "value"), [("azimuth_deg", 511.0), ("range_m", 2147483647.0), ("range_m", 65535.0)])
def test_a_detection_of_which_a_part_is_not_available(name: str, value: float, write: Write) -> None:
    def edit(tables) -> None:
        tables["detections"][name][0] = value

    recording = read_recording(write(edit))
    assert any(name in n and "row 0" in n for n in recording.notes)
    assert not recording.refused
    assert np.isnan(recording.detections.z[0]).sum() == 6


def test_a_detection_of_which_nothing_is_available_is_refused_not_an_empty_look(write: Write) -> None:
    def edit(tables) -> None:
        tables["detections"]["azimuth_deg"][2] = 511.0

    recording = read_recording(write(edit))
    assert list(recording.refused) == [2]
    assert [s.row.tolist() for s in iter_scans(recording)] == [[0, 1], [3, 4], []]


@pytest.mark.parametrize("azimuth", [361.0, 400.0, -360.5, math.inf])
def test_an_azimuth_outside_its_range(azimuth: float, write: Write) -> None:
    def edit(tables) -> None:
        tables["detections"]["azimuth_deg"][0] = azimuth

    with pytest.raises(UserError, match="row 0: azimuth_deg is"):
        read_recording(write(edit))


@pytest.mark.parametrize("place", ["latitude_deg = 91.0", "latitude_deg = 90.1", "longitude_deg = 180.0001"])
def test_a_site_that_cannot_be(place: str, write: Write) -> None:
    key = place.split(" = ")[0]
    toml = "\n".join(place if line.startswith(key) else line for line in TOML.splitlines())
    with pytest.raises(UserError, match=key):
        read_recording(write(toml=toml))
