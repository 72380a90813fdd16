"""`boresight point --replay`: the file that other tools read."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from tests.cli.conftest import Run

SCENARIO = """
name = "one"
duration_s = 60.0
dimensions = 3
[site]
latitude_deg = 47.45
longitude_deg = 8.56
height_m = 430.0
[[targets]]
id = "a"
kind = "nearly_constant_velocity"
position_enu_m = [-9000.0, 6000.0, 2500.0]
velocity_enu_m_s = [140.0, -20.0, 0.0]
q_m2_s3 = 0.2
[[sensors]]
id = "radar"
kind = "radar"
period_s = 1.0
sigma_range_m = 20.0
sigma_azimuth_deg = 0.2
sigma_elevation_deg = 0.2
p_detection = 0.9
clutter_per_scan = 0.0
coverage = { range_m = [0.0, 60000.0] }
arrival_delay_s = 0.3
"""
SITE = """
[site]
latitude_deg = 47.45
longitude_deg = 8.56
height_m = 430.0
[beam]
width_deg = 1.0
[face]
azimuth_deg = -60.0
elevation_deg = 30.0
pole = "in_face"
"""
COLUMNS = ["t_s", "t_aim_s", "az_deg", "el_deg", "face_az_deg", "face_el_deg", "az_rate_deg_s", "el_rate_deg_s"]
COLUMNS += ["sigma_deg", "p_in_beam", "mount_az_deg", "mount_el_deg", "mode"]


@pytest.fixture
def files(run: Run, tmp_path: Path) -> tuple[Path, Path]:
    (tmp_path / "scenario.toml").write_text(SCENARIO, encoding="utf-8")
    (tmp_path / "site.toml").write_text(SITE, encoding="utf-8")
    assert run("simulate", tmp_path / "scenario.toml", "-o", tmp_path / "rec", "--seed", 3).code == 0
    return tmp_path / "site.toml", tmp_path / "rec"


def test_the_beam_follows(run: Run, files: tuple[Path, Path], tmp_path: Path) -> None:
    site, rec = files
    done = run("point", site, "--replay", rec, "-o", tmp_path / "out", "--json")
    assert done.code == 0, done.err
    assert json.loads(done.out)["command"] == "point"
    table = pq.read_table(tmp_path / "out" / "pointing.parquet")
    assert table.column_names == COLUMNS
    d = {k: np.array(v) for k, v in table.to_pydict().items()}
    assert (np.diff(d["t_s"]) > 0).all()
    np.testing.assert_allclose(d["t_aim_s"] - d["t_s"], 0.5)
    truth = pq.read_table(rec / "truth.parquet").to_pydict()
    p = np.stack([np.interp(d["t_aim_s"], truth["t_s"], truth[k]) for k in ("east_m", "north_m", "up_m")])
    late = (d["t_s"] > 15.0) & (d["t_aim_s"] < 60.0)
    az, el = np.arctan2(p[0], p[1]), np.arctan2(p[2], np.hypot(p[0], p[1]))
    off = np.hypot((d["az_deg"] - np.degrees(az)) * np.cos(el), d["el_deg"] - np.degrees(el))[late]
    # honest: within 3.5 sigma nearly always, and about one sigma in the mean
    assert (off < 3.5 * d["sigma_deg"][late]).mean() > 0.97
    assert 0.4 < np.sqrt(np.mean((off / d["sigma_deg"][late]) ** 2)) < 1.6
    assert set(d["mode"][late]) == {"fused"}


def test_a_recording_cut_off_gives_the_same_rows(run: Run, files: tuple[Path, Path], tmp_path: Path) -> None:
    """Causal: rows up to T need nothing that arrives after T."""
    site, rec = files
    assert run("point", site, "--replay", rec, "-o", tmp_path / "all").code == 0
    path = rec / "detections.parquet"
    table = pq.read_table(path)
    pq.write_table(table.filter(np.asarray(table["t_recv_s"]) <= 30.0), path)
    assert run("point", site, "--replay", rec, "-o", tmp_path / "half").code == 0
    whole, half = (pq.read_table(tmp_path / n / "pointing.parquet") for n in ("all", "half"))
    n = half.num_rows - 1
    assert n > 200
    assert whole.slice(0, n).equals(half.slice(0, n))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[site]\nlatitude_deg = 47.0\n", "longitude_deg"),
        ("[site]\nlatitude_deg = 147.0\nlongitude_deg = 8.0\n", "between -90 and 90"),
        (SITE + "[beem]\nwidth_deg = 1.0\n", "did you mean 'beam'"),
        (SITE + '[[source]]\nid = "rader"\nsigma_angle_deg = 0.1\n', "did you mean 'radar'"),
    ],
)
def test_mistakes_end_with_one_line(run: Run, files: tuple[Path, Path], tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "bad.toml").write_text(text, encoding="utf-8")
    done = run("point", tmp_path / "bad.toml", "--replay", files[1], "-o", tmp_path / "out")
    assert done.code == 2
    assert says in done.err
    assert done.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


SHIP = """
[[platforms]]
id = "ship"
kind = "constant_velocity"
position_enu_m = [500.0, -300.0, 0.0]
velocity_enu_m_s = [4.0, 6.0, 0.0]
attitude = { yaw_deg = 30.0, sway_ypr_deg = [2.0, 3.0, 8.0], sway_period_s = [14.0, 6.5, 9.0] }
navigation = { rate_hz = 20.0 }
"""


def test_an_antenna_on_a_rolling_ship(run: Run, tmp_path: Path) -> None:
    """Face angles against the truth, turned by the ship's true attitude when the beam is there."""
    from boresight.frames.array_face import Pole, angles_from_face, enu_from_face
    from boresight.frames.attitude import enu_from_body

    text = SCENARIO.replace("[[targets]]", SHIP + "[[targets]]").replace(
        'kind = "radar"', 'kind = "radar"\nplatform = "ship"\naxes = "platform_enu"'
    )
    (tmp_path / "scenario.toml").write_text(text, encoding="utf-8")
    (tmp_path / "site.toml").write_text('platform = "ship"\n' + SITE, encoding="utf-8")
    rec, out = tmp_path / "rec", tmp_path / "out"
    assert run("simulate", tmp_path / "scenario.toml", "-o", rec, "--seed", 3).code == 0
    done = run("point", tmp_path / "site.toml", "--replay", rec, "-o", out)
    assert done.code == 0, done.err
    d = {k: np.array(v) for k, v in pq.read_table(out / "pointing.parquet").to_pydict().items()}
    truth = pq.read_table(rec / "truth.parquet").to_pydict()
    t = d["t_aim_s"]
    p = np.stack([np.interp(t, truth["t_s"], truth[k]) for k in ("east_m", "north_m", "up_m")], axis=-1)
    p = p - np.array([500.0, -300.0, 0.0]) - t[:, None] * [4.0, 6.0, 0.0]
    wave = 2 * np.pi * t
    yaw, pitch, roll = 30 + 2 * np.sin(wave / 14), 3 * np.sin(wave / 6.5), 8 * np.sin(wave / 9)
    body = enu_from_body(*np.radians([yaw, pitch, roll]))
    face = body @ [[0, 1, 0], [1, 0, 0], [0, 0, -1]] @ enu_from_face(np.radians(-60.0), np.radians(30.0))
    az, el, _ = angles_from_face(np.einsum("nji,nj->ni", face, p), Pole.IN_FACE)
    late = (d["t_s"] > 15.0) & (t < 59.0)
    off = np.hypot((d["face_az_deg"] - np.degrees(az)) * np.cos(el), d["face_el_deg"] - np.degrees(el))[late]
    # own error about 0.1°; half a second of foretold attitude adds up to ½ · 8° (2π/9)² · 0.5² = 0.5°
    assert off.max() < 1.2
    assert np.median(off) < 0.5
    wrong = (tmp_path / "site.toml").read_text(encoding="utf-8").replace('"ship"', '"shipp"')
    (tmp_path / "bad.toml").write_text(wrong, encoding="utf-8")
    told = run("point", tmp_path / "bad.toml", "--replay", rec, "-o", tmp_path / "no")
    assert told.code == 2
    assert "did you mean 'ship'" in told.err


CAMERA = """
[[sensors]]
id = "camera"
kind = "infrared"
period_s = 0.1
sigma_azimuth_deg = 0.05
{elevation}
p_detection = 1.0
clutter_per_scan = 0.0
"""


def azimuth_error(run: Run, tmp_path: Path, name: str, sensors: str) -> tuple[float, float]:
    """Median error of azimuth and elevation (deg) of a target at about 40° of elevation."""
    text = SCENARIO.replace("[-9000.0, 6000.0, 2500.0]", "[-3000.0, 2500.0, 4000.0]").replace("140.0", "60.0")
    (tmp_path / f"{name}.toml").write_text(text + sensors, encoding="utf-8")
    (tmp_path / "site.toml").write_text(SITE, encoding="utf-8")
    rec, out = tmp_path / f"{name}_rec", tmp_path / f"{name}_out"
    assert run("simulate", tmp_path / f"{name}.toml", "-o", rec, "--seed", 11).code == 0
    done = run("point", tmp_path / "site.toml", "--replay", rec, "-o", out)
    assert done.code == 0, done.err
    d = {k: np.array(v) for k, v in pq.read_table(out / "pointing.parquet").to_pydict().items()}
    truth = pq.read_table(rec / "truth.parquet").to_pydict()
    p = np.stack([np.interp(d["t_aim_s"], truth["t_s"], truth[k]) for k in ("east_m", "north_m", "up_m")])
    az, el = np.degrees(np.arctan2(p[0], p[1])), np.degrees(np.arctan2(p[2], np.hypot(p[0], p[1])))
    late = (d["t_s"] > 10.0) & (d["t_aim_s"] < 60.0)
    wrapped = (d["az_deg"] - az + 180.0) % 360.0 - 180.0
    return float(np.median(np.abs(wrapped[late]))), float(np.median(np.abs(d["el_deg"] - el)[late]))


def test_a_camera_that_measures_azimuth_alone_makes_the_beam_better(run: Run, tmp_path: Path) -> None:
    """Radar 0.2° at 1 Hz, camera 0.05° at 10 Hz: without an elevation nothing is made up in its place."""
    radar = azimuth_error(run, tmp_path, "radar", "")
    azimuth_only = azimuth_error(run, tmp_path, "both", CAMERA.format(elevation=""))
    both_angles = azimuth_error(run, tmp_path, "angles", CAMERA.format(elevation="sigma_elevation_deg = 0.05"))
    assert azimuth_only[0] < 0.5 * radar[0]
    assert azimuth_only[1] < 1.3 * radar[1]
    assert both_angles[0] < 0.5 * radar[0]
    assert both_angles[1] < 0.5 * radar[1]


def test_range_of_one_sensor_and_angles_of_another(run: Run, tmp_path: Path) -> None:
    """A camera of both angles and a ranger without any: together they begin and hold the target."""
    angles = CAMERA.format(elevation="sigma_elevation_deg = 0.05")
    ranger = SCENARIO[SCENARIO.index("[[sensors]]") :].replace(
        "sigma_azimuth_deg = 0.2\nsigma_elevation_deg = 0.2\n", ""
    )
    text = SCENARIO[: SCENARIO.index("[[sensors]]")] + ranger.replace('"radar"', '"ranger"', 1) + angles
    (tmp_path / "s.toml").write_text(text, encoding="utf-8")
    (tmp_path / "site.toml").write_text(SITE, encoding="utf-8")
    done = run("simulate", tmp_path / "s.toml", "-o", tmp_path / "rec", "--seed", 4)
    assert done.code == 0, done.err
    done = run("point", tmp_path / "site.toml", "--replay", tmp_path / "rec", "-o", tmp_path / "out")
    assert done.code == 0, done.err
    d = {k: np.array(v) for k, v in pq.read_table(tmp_path / "out" / "pointing.parquet").to_pydict().items()}
    assert d["t_s"][0] < 3.0
    truth = pq.read_table(tmp_path / "rec" / "truth.parquet").to_pydict()
    p = np.stack([np.interp(d["t_aim_s"], truth["t_s"], truth[k]) for k in ("east_m", "north_m", "up_m")])
    late = (d["t_s"] > 15.0) & (d["t_aim_s"] < 60.0)
    off = (d["az_deg"] - np.degrees(np.arctan2(p[0], p[1])) + 180.0) % 360.0 - 180.0
    assert np.median(np.abs(off[late])) < 0.1
    assert set(d["mode"][late]) == {"fused"}
