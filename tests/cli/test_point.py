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
COLUMNS += ["sigma_deg", "p_in_beam", "mode"]


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
