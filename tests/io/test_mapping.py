"""Other people's CSV: names, units, stamps, several files, numbers of looks, and what is told of them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.io.columns import like_name, split_unit
from boresight.io.declaration import read_declaration
from boresight.io.mapping import guess_map, north_mark, read_map, read_raw, write_map
from boresight.io.proposal import propose, turn_of
from boresight.io.user_csv import Options, import_csv
from boresight.types import Axes, Component, Recording, Reporting

SHIP = """
dimensions = 3
[site]
latitude_deg = 54.0
longitude_deg = 8.0
[[sensor]]
id = "radar"
kind = "radar"
platform = "ship"
sigma_range_m = 10.0
sigma_azimuth_deg = 0.3
period_s = 2.5
[[sensor]]
id = "eo"
kind = "optical"
platform = "ship"
sigma_azimuth_deg = 0.03
sigma_elevation_deg = 0.03
"""
FIXED = """
dimensions = 2
[site]
latitude_deg = 54.0
longitude_deg = 8.0
[[sensor]]
id = "radar"
kind = "radar"
sigma_range_m = 10.0
sigma_azimuth_deg = 0.3
[[sensor]]
id = "ais"
kind = "position"
sigma_position_m = 10.0
"""


def write(folder: Path, toml: str = FIXED, **files: str) -> Path:
    (folder / "s.toml").write_text(toml)
    for name, text in files.items():
        (folder / f"{name}.csv").write_text(text)
    return folder / "s.toml"


def read(folder: Path, *names: str, toml: str = FIXED, **options) -> Recording:
    files = [folder / f"{n}.csv" for n in names]
    return import_csv(files, write(folder, toml), options=Options(**options))[0]


@pytest.mark.parametrize(
    ("header", "split"),
    [
        ("Range [km]", ("range", "km")),
        ("alt (ft)", ("alt", "ft")),
        ("sog_kn", ("sog", "kn")),
        ("time_ms", ("time", "ms")),
        ("range_rate_m_s", ("range_rate", "m_s")),
        ("azimuth", ("azimuth", "")),
        ("Speed (km/h)", ("speed", "km/h")),
    ],
)
def test_units_are_read_from_headings(header: str, split: tuple[str, str]) -> None:
    assert split_unit(header) == split


def test_headings_that_are_not_known_stay_unknown() -> None:
    assert like_name("snr_db") is None
    assert like_name("temperature [K]") is None
    assert like_name("range_db") is None  # a known name with a unit that is none


UNITS = [
    ("t_s,sensor,scan,range_km,azimuth_rad", "1,radar,0,1.5,0.5", 1500.0, 0.5),
    ("t_ms,sensor,scan,range_nmi,azimuth_mrad", "1000,radar,0,1,500", 1852.0, 0.5),
    ("t_us,sensor,scan,range_ft,azimuth_deg", "1000000,radar,0,1000,90", 304.8, math.pi / 2),
    ("t_ns,sensor,scan,range_yd,azimuth_mil", "1000000000,radar,0,100,1600", 91.44, math.pi / 2),
]


@pytest.mark.parametrize(("header", "row", "far", "azimuth"), UNITS)
def test_units_by_the_name_of_the_column(header: str, row: str, far: float, azimuth: float, tmp_path: Path) -> None:
    write(tmp_path, d=f"{header}\n{row}\n")
    d = read(tmp_path, "d").detections
    assert d.t[0] == 1.0
    np.testing.assert_allclose(d.z[0, :2], [far, azimuth], rtol=1e-12)


@pytest.mark.parametrize(
    "text",
    [
        "t_s;sensor;scan;range_m;azimuth_deg\n0,5;radar;0;900,25;20,5\n1,5;radar;1;;\n",
        "t_s\tsensor\tscan\trange_m\tazimuth_deg\n0.5\tradar\t0\t900.25\t20.5\n1.5\tradar\t1\t\t\n",
        "t_s\tsensor\tscan\trange_m\tazimuth_deg\n0,5\tradar\t0\t900,25\t20,5\n1,5\tradar\t1\t\t\n",
    ],
)
def test_semicolons_tabs_and_decimal_commas(text: str, tmp_path: Path) -> None:
    write(tmp_path, d=text)
    d = read(tmp_path, "d").detections
    assert d.t.tolist() == [0.5, 1.5]
    assert d.z[0, 0] == 900.25


@pytest.mark.parametrize(
    ("stamp", "seconds", "noted"),
    [
        ("2026-01-31T12:00:00+01:00", 1769857200.0, False),
        ("2026-01-31T11:00:00.250Z", 1769857200.25, False),
        ("2026-01-31 11:00:00,5+00:00", 1769857200.5, False),
        ("20260131T110000Z", 1769857200.0, False),
        ("2026-01-31 11:00:00", 1769857200.0, True),
    ],
)
def test_iso_8601(stamp: str, seconds: float, noted: bool, tmp_path: Path) -> None:
    write(tmp_path, d=f't_s,sensor,scan,range_m,azimuth_deg\n"{stamp}",radar,0,900,20\n')
    recording = read(tmp_path, "d")
    assert recording.detections.t[0] == seconds
    assert any("taken as UTC" in n for n in recording.notes) == noted


@pytest.mark.parametrize(
    ("unit", "stamps", "seconds"),
    [
        ("ms", (1764547200123, 1764547201123), (1764547200.123, 1764547201.123)),
        ("s-of-day", (86399.5, 0.5), (86399.5, 86400.5)),
        ("s-of-week", (604799.0, 1.0), (604799.0, 604801.0)),
        ("min", (1.0, 2.0), (60.0, 120.0)),
    ],
)
def test_time_unit(unit: str, stamps, seconds, tmp_path: Path) -> None:
    rows = "".join(f"{t},radar,{i},900,20\n" for i, t in enumerate(stamps))
    write(tmp_path, d="t_s,sensor,scan,range_m,azimuth_deg\n" + rows)
    np.testing.assert_allclose(read(tmp_path, "d", time_unit=unit).detections.t, seconds, rtol=1e-15)
    with pytest.raises(UserError, match="--time-unit furlong: not known"):
        read(tmp_path, "d", time_unit="furlong")


def test_time_unit_leaves_files_in_seconds_alone(tmp_path: Path) -> None:
    write(tmp_path, d="t_s,sensor,scan,range_m,azimuth_deg\n1764547200000,radar,0,900,20\n")
    (tmp_path / "t.csv").write_text("t_s,target,east_m,north_m\n1764547199.5,a,1,2\n1764547210,a,1,2\n")
    recording, _ = import_csv(
        tmp_path / "d.csv", write(tmp_path), truth=tmp_path / "t.csv", options=Options(time_unit="ms")
    )
    assert recording.detections.t[0] == 1764547200.0
    assert recording.truth[0].t[0] == 1764547199.5


def test_time_offset_and_ignored_columns(tmp_path: Path) -> None:
    rows = "0,radar,0,900,20,4.2,x\n18.5,ais,0,,,1,y\n"
    write(tmp_path, d="t_s,sensor,scan,range_m,azimuth_deg,snr,note\n" + rows)
    options = {"ignore_columns": ["snr", "note"], "time_offset": {"ais": -18.0}}
    assert read(tmp_path, "d", **options).detections.t.tolist() == [0.0, 0.5]
    with pytest.raises(UserError, match=r"unknown column 'snr'.*unknown column 'note'"):
        read(tmp_path, "d")
    with pytest.raises(UserError, match=r"--time-offset aiz.*did you mean 'ais'"):
        read(tmp_path, "d", ignore_columns=["snr", "note"], time_offset={"aiz": 1.0})


def test_all_problems_of_a_file_are_told_at_once(tmp_path: Path) -> None:
    write(tmp_path, d="t_s,sensor,scan,range_m,azimuth_deg\nx,radar,0,900,20\n1,radar,a,900,2o\n2,radar,2,9_,20\n")
    with pytest.raises(UserError) as error:
        read(tmp_path, "d")
    text = str(error.value)
    assert "\n" not in text
    for word in ("line 2: t_s is 'x'", "line 3: scan is 'a'", "line 3: azimuth_deg is '2o'", "line 4: range_m is '9_'"):
        assert word in text


def ship(folder: Path, seconds: float = 60.0) -> None:
    """A rotating radar (two targets that stand, one turn in 2.5 s, azimuth by its stamp), a camera, navigation."""
    turn = np.arange(0.0, seconds, 2.5)
    rows = []
    for bearing, far in ((30.0, 4000.0), (200.0, 7000.0)):
        t = turn + 2.5 * ((bearing + 77.0) % 360.0) / 360.0  # north 0.53 s before each turn of the file
        rows += [(a, far, bearing) for a in t.tolist()]
    rows.sort()
    at = "2026-05-04T10:00:{:06.3f}Z"
    minute = [r for r in rows if r[0] < 60.0]
    radar = "time,rng_km,brg,snr_db\n" + "".join(f"{at.format(t)},{r / 1e3},{b},10\n" for t, r, b in minute)
    camera = "time,az,el\n" + "".join(f"{at.format(k * 0.1)},{90 + 0.001 * k},{1.0}\n" for k in range(500))
    nav = "time,lat,lon,alt_ft,heading,pitch,roll,sog_kn,cog\n" + "".join(
        f"{at.format(k)},54.0,8.0,100,10,0,0,10,90\n" for k in range(59, -1, -1)
    )
    write(folder, SHIP, radar=radar, eo=camera, nav=nav)


def test_a_ships_logs_by_guess(tmp_path: Path) -> None:
    ship(tmp_path)
    recording = read(tmp_path, "radar", "eo", "nav", toml=SHIP, guess=True)
    radar, camera = recording.sensors
    assert radar.axes is Axes.PLATFORM_ENU
    assert (radar.reporting, camera.reporting) == (Reporting.SCAN, Reporting.SINGLE)
    d = recording.detections
    mine = d.sensor == 0
    assert set(np.unique(d.z[mine, Component.RANGE]).tolist()) == {4000.0, 7000.0}
    scans, counts = np.unique(d.scan[mine], return_counts=True)
    assert counts[1:-1].tolist() == [2] * (len(scans) - 2)
    for scan in scans:  # north to north: 30° before 200°
        assert (np.diff(d.z[mine & (d.scan == scan), Component.AZIMUTH] % (2.0 * np.pi)) > 0.0).all()
    (platform,) = recording.platforms
    assert (np.diff(platform.t) > 0.0).all()
    np.testing.assert_allclose(platform.velocity[0, :2], [10.0 * 1852.0 / 3600.0, 0.0], atol=1e-12)
    assert platform.position[0, 2] == pytest.approx(30.48, abs=1e-6)
    text = "\n".join(recording.notes)
    for words in ("looks are numbered by north mark", "not used: snr_db", "rows sorted by stamp", "merged by stamp",
                  'axes = "platform_enu"', "follows one target"):  # fmt: skip
        assert words in text


def test_a_mapping_that_was_guessed_says_the_same_when_it_is_read(tmp_path: Path) -> None:
    ship(tmp_path)
    files = [tmp_path / f"{n}.csv" for n in ("radar", "eo", "nav")]
    one, maps = import_csv(files, tmp_path / "s.toml", options=Options(guess=True))
    (tmp_path / "m.toml").write_text(write_map(maps, tmp_path))
    assert 'path = "radar.csv"' in (tmp_path / "m.toml").read_text()
    two, again = import_csv([], tmp_path / "s.toml", options=Options(mapping=tmp_path / "m.toml"))
    assert [m.columns for m in again] == [m.columns for m in maps]
    np.testing.assert_array_equal(one.detections.z, two.detections.z)
    np.testing.assert_array_equal(one.detections.scan, two.detections.scan)
    assert read_map(tmp_path / "m.toml")[0].scan == "north mark"
    (tmp_path / "m.toml").write_text((tmp_path / "m.toml").read_text().replace("brg =", "bearing ="))
    with pytest.raises(UserError, match="no column 'bearing'"):
        import_csv([], tmp_path / "s.toml", options=Options(mapping=tmp_path / "m.toml"))


def test_north_mark_of_a_rotating_sensor() -> None:
    t = np.array([0.1, 0.9, 1.7, 2.9, 4.0])
    begin, agree = north_mark(t, (360.0 * (t + 0.4) / 2.0) % 360.0, 2.0)
    assert begin == pytest.approx(-0.4)
    assert agree == pytest.approx(1.0)
    assert north_mark(t, np.array([0.0, 180.0, 90.0, 270.0, 45.0]), 2.0)[1] < 0.8


def test_latitudes_of_reports_become_positions(tmp_path: Path) -> None:
    rows = "".join(f"{k},{211000000 + k % 2},{54.0 + 0.1 * (k % 2)},8.0,12.5,{360.0}\n" for k in range(40))
    write(tmp_path, ais="timestamp,mmsi,lat,lon,sog,cog\n" + rows + "41,211000001,91,181,102.3,360\n")
    recording = read(tmp_path, "ais", guess=True)
    d = recording.detections
    assert np.unique(d.sensor).tolist() == [1]
    np.testing.assert_allclose(d.z[1, Component.EAST : Component.UP], [0.0, 11130.0], atol=10.0)
    assert recording.sensors[1].reporting is Reporting.SINGLE
    assert d.source_id is not None
    assert d.source_id[0] == "211000000"


@pytest.mark.parametrize(
    ("toml", "radar", "words"),
    [
        (FIXED, "foo,bar\n1,2\n", "neither detections, nor"),
        (FIXED, "range,azimuth\n1,2\n", "no column of times"),
        (FIXED, "time,range,azimuth,sensor\n1,2,3,sonar\n", "unknown sensor 'sonar'"),
        (FIXED, "time,range [parsec],azimuth\n1,2,3\n", "no noise|not|needs"),
    ],
)
def test_what_cannot_be_guessed_is_said(toml: str, radar: str, words: str, tmp_path: Path) -> None:
    write(tmp_path, toml, radar=radar)
    if "parsec" in radar:  # the column is left out, and that is said
        assert any("parsec" in n for n in read(tmp_path, "radar", toml=toml, guess=True).notes)
        return
    with pytest.raises(UserError, match=words):
        read(tmp_path, "radar", toml=toml, guess=True)


@pytest.mark.parametrize("name", ["t_ms", "timestamp", "epoch"])
def test_unix_milliseconds_are_known_by_their_size(name: str, tmp_path: Path) -> None:
    write(tmp_path, radar=f"{name},range,azimuth\n1764547200123,900,20\n")
    raw = read_raw(tmp_path / "radar.csv")
    of, _ = guess_map(raw, read_declaration(tmp_path / "s.toml"))
    assert of.units[name] == "ms"


PLACES = [
    ("54.1,8.2", False, "km from the site"),
    ("8.2,54.1", True, "the other way round"),
    ("-33.9,151.2", True, "give --far"),
]


@pytest.mark.parametrize(("where", "refused", "words"), PLACES)
def test_a_platform_far_from_the_site_is_a_mistake_unless_told(
    where: str, refused: bool, words: str, tmp_path: Path
) -> None:
    nav = "time,lat,lon,alt,heading\n" + "".join(f"{k},{where},10,0\n" for k in range(3))
    write(tmp_path, SHIP, radar="time,range,azimuth\n1,900,20\n", nav=nav)
    if refused:
        with pytest.raises(UserError, match=words):
            read(tmp_path, "radar", "nav", toml=SHIP, guess=True)
    notes = read(tmp_path, "radar", "nav", toml=SHIP, guess=True, far=True).notes
    assert any("from the site" in n for n in notes)


@pytest.mark.parametrize("period", [0.5, 1.2, 2.5, 11.87])
def test_the_turn_of_a_rotating_sensor_is_found(period: float) -> None:
    rng = np.random.default_rng(3)
    t = np.sort(rng.uniform(0.0, 60.0 * period, 400))
    azimuth = (360.0 * (t + 0.3) / period + rng.normal(0.0, 1.0, len(t))) % 360.0
    assert turn_of(t, azimuth) == pytest.approx(period, rel=1e-3)
    assert turn_of(t, rng.uniform(0.0, 360.0, len(t))) is None


def test_a_recording_toml_is_proposed_where_there_is_none(tmp_path: Path) -> None:
    ship(tmp_path)
    files = [tmp_path / f"{n}.csv" for n in ("radar", "eo", "nav")]
    text, declared = propose(files)
    (tmp_path / "p.toml").write_text(text)
    again = read_declaration(tmp_path / "p.toml")
    assert [(s.id, str(s.kind), s.platform) for s in again.sensors] == [
        ("radar", "radar", "platform"),
        ("eo", "optical", "platform"),
    ]
    assert again.sensors[0].period == pytest.approx(2.5)
    assert math.degrees(declared.site.latitude) == pytest.approx(54.0)
    recording = import_csv(files, tmp_path / "p.toml", options=Options(guess=True))[0]
    assert len(recording.platforms) == 1
    with pytest.raises(UserError, match="no file holds detections"):
        propose([tmp_path / "nav.csv"])


def test_messages_that_share_a_stamp_by_chance_are_no_look(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    t, who = np.sort(rng.integers(0, 60, 120)), rng.integers(0, 20, 120)
    rows = "".join(
        f"{a},{211000000 + w},{54.0 + 0.01 * w},8.0\n" for a, w in zip(t.tolist(), who.tolist(), strict=True)
    )
    write(tmp_path, ais="t_s,mmsi,lat,lon\n" + rows)
    recording = read(tmp_path, "ais", guess=True)
    assert len(np.unique(recording.detections.scan)) == 120
    assert recording.sensors[1].reporting is Reporting.SINGLE
    every = "".join(f"{a},{w},{54.0 + 0.01 * w},8.0\n" for a in range(10) for w in range(20))
    write(tmp_path, ais="t_s,icao24,lat,lon\n" + every)
    recording = read(tmp_path, "ais", guess=True)
    assert len(np.unique(recording.detections.scan)) == 10
    assert recording.sensors[1].reporting is Reporting.SCAN
