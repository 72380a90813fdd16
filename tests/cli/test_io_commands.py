"""import, info and export from the outside: exit codes, one-line errors, nothing half-written."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from boresight.io import read_recording, write_results
from tests.cli.conftest import Ran, Run
from tests.io.test_results import some_results
from tests.io.test_user_csv import files


@pytest.fixture
def rec(run: Run, tmp_path: Path) -> Path:
    """A small recording."""
    detections, sensors = files(tmp_path)
    assert run("import", "csv", detections, "--sensors", sensors, "-o", tmp_path / "rec").code == 0
    return tmp_path / "rec"


@pytest.fixture
def out(rec: Path, tmp_path: Path) -> Path:
    """A small results folder."""
    folder = tmp_path / "out"
    folder.mkdir()
    write_results(some_results(), read_recording(rec), folder)
    return folder


def refused(ran: Ran, *words: str) -> None:
    assert ran.code == 2
    assert ran.out == ""
    assert ran.err.count("\n") == 1
    assert ran.err.startswith("boresight: ")
    for word in words:
        assert word in ran.err


def test_info_prints_one_json_object(run: Run, rec: Path) -> None:
    data = json.loads(run("info", rec, "--json").out)
    assert data["command"] == "info"
    row = data["rows"][0]
    assert (row["id"], row["looks"], row["empty_looks"], row["detections"]) == ("radar", 3, 1, 2)
    assert row["median_period_s"] == 1.0
    assert row["platform"] is None


def test_info_fits_80_columns_without_colour_when_piped(run: Run, rec: Path) -> None:
    ran = run("info", rec)
    assert ran.code == 0
    assert "\x1b" not in ran.out
    assert max(map(len, ran.out.splitlines())) <= 80
    assert "radar" in ran.out


def test_export_to_standard_output_and_to_a_file(run: Run, out: Path, rec: Path, tmp_path: Path) -> None:
    text = run("export", out, "--to", "csv").out
    assert text.startswith("t_s,t_known_s,track_id")
    assert run("export", out, rec, "--to", "geojson", "-o", tmp_path / "x.json").code == 0
    assert json.loads((tmp_path / "x.json").read_text())["type"] == "FeatureCollection"
    refused(run("export", out, "--to", "geojson", "-o", tmp_path / "x.json"), "--force")
    refused(run("export", out, "--to", "shp"), "geojson")


def test_an_existing_output_is_kept(run: Run, rec: Path, tmp_path: Path) -> None:
    before = (rec / "detections.parquet").read_bytes()
    words = ("import", "csv", tmp_path / "d.csv", "--sensors", tmp_path / "s.toml", "-o", rec)
    refused(run(*words), "--force", "rec")
    assert (rec / "detections.parquet").read_bytes() == before
    assert run(*words, "--force").code == 0


def test_a_failed_import_leaves_nothing_and_keeps_the_old(run: Run, rec: Path, tmp_path: Path) -> None:
    (tmp_path / "d.csv").write_text("t_s,sensor,scan,range_m\nx,radar,0,1\n")
    refused(run("import", "csv", tmp_path / "d.csv", "--sensors", tmp_path / "s.toml", "-o", rec, "--force"), "line 2")
    assert (rec / "detections.parquet").exists()
    refused(run("import", "csv", tmp_path / "d.csv", "--sensors", tmp_path / "s.toml", "-o", tmp_path / "new"))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["d.csv", "rec", "s.toml"]


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="the superuser may write everywhere")
def test_an_unwritable_folder_is_named(run: Run, tmp_path: Path) -> None:
    detections, sensors = files(tmp_path)
    (tmp_path / "locked").mkdir(mode=0o500)
    refused(run("import", "csv", detections, "--sensors", sensors, "-o", tmp_path / "locked" / "rec"), "written")


def test_an_output_under_a_file_is_named(run: Run, tmp_path: Path) -> None:
    detections, sensors = files(tmp_path)
    refused(run("import", "csv", detections, "--sensors", sensors, "-o", detections / "rec"), "cannot be made")
    (tmp_path / "file").write_text("x")
    refused(run("import", "csv", detections, "--sensors", sensors, "-o", tmp_path / "file"), "not a folder")


def test_usage_errors_are_one_line(run: Run, tmp_path: Path) -> None:
    refused(run("infoo"), "info")
    refused(run("info"), "REC")
    refused(run("info", tmp_path / "none"), "no such recording folder")
    refused(run("info", tmp_path, "--jsn"), "--json")
    refused(run("import", "autoferry", tmp_path / "none.json", "-o", tmp_path / "r"), "no such file")
    refused(run("export", tmp_path / "none", "--to", "kml"), "no such results folder")


def test_force_never_destroys_an_input_or_other_files(run: Run, rec: Path, out: Path, tmp_path: Path) -> None:
    words = ("import", "csv", tmp_path / "d.csv", "--sensors", rec / "recording.toml")
    refused(run(*words, "-o", rec, "--force"), "its own input")
    refused(run(*words, "-o", tmp_path, "--force"), "its own input")
    refused(run(*words, "-o", out, "--force"), "did not write")  # results are no recording
    refused(run("track", rec, "-o", rec, "--force"), "its own input")
    refused(run("track", rec, "-o", rec.parent, "--force"), "its own input")
    assert (rec / "detections.parquet").exists()


def test_odd_files_are_refused_in_one_line(run: Run, rec: Path, tmp_path: Path) -> None:
    (tmp_path / "semi.csv").write_text("t_s sensor scan range_m\n1 radar 0 5\n")
    refused(
        run("import", "csv", tmp_path / "semi.csv", "--sensors", tmp_path / "s.toml", "-o", tmp_path / "x"),
        "unknown column",
    )
    refused(run("import", "csv", rec, "--sensors", tmp_path / "s.toml", "-o", tmp_path / "x"), "cannot be read")
    refused(run("info", rec / "detections.parquet"), "not a recording folder")
    big = tmp_path / "big.json"
    big.write_text(f'[{{"sensorID": 3, "time": {10**400}, "ownshipPosition": [0, 0], "measurement": 1}}]')
    refused(run("import", "autoferry", big, "-o", tmp_path / "x"), "entry 0: time")
    text = (rec / "recording.toml").read_text()
    (rec / "recording.toml").write_text(text.replace("sigma_range_m = 5.0", f"sigma_range_m = {10**400}"))
    refused(run("info", rec), "sigma_range_m")


def test_a_column_that_stands_twice_is_refused(run: Run, rec: Path) -> None:
    table = pq.read_table(rec / "detections.parquet")
    pq.write_table(table.append_column("t_s", table["t_s"]), rec / "detections.parquet")
    refused(run("info", rec), "'t_s' stands twice")


def test_notes_go_to_standard_error_and_json_stays_alone(run: Run, tmp_path: Path) -> None:
    rows = "".join(f"{1764547200 + k},radar,{k},900,20\n" for k in range(50))
    detections, sensors = files(
        tmp_path, "t_s,sensor,scan,range_m,azimuth_deg\n" + rows + "2147483647,radar,50,900,20\n"
    )
    ran = run("import", "csv", detections, "--sensors", sensors, "-o", tmp_path / "rec")
    assert ran.code == 0
    assert "line 52 is refused" in ran.err
    assert "1 refused" in ran.out
    ran = run("info", tmp_path / "rec", "--json")
    data = json.loads(ran.out)
    assert "row 50 is refused" in ran.err
    assert (data["parameters"]["refused"], data["rows"][0]["refused"]) == (1, 1)
    assert data["parameters"]["height_above"] == "WGS84 ellipsoid"
    assert data["rows"][0]["measured"] == {"range_m": [900.0, 900.0], "azimuth_deg": [20.0, 20.0]}
    assert data["parameters"]["duration_s"] == 49.0


def test_import_takes_an_offset_of_time_and_a_geoid_height(run: Run, tmp_path: Path) -> None:
    detections, sensors = files(tmp_path)
    words = ("import", "csv", detections, "--sensors", sensors, "-o", tmp_path / "x", "--force")
    assert run(*words, "--time-offset", "radar=100.5").code == 0
    assert read_recording(tmp_path / "x").detections.t.tolist() == [101.5, 102.5, 103.5]
    refused(run(*words, "--time-offset", "radar"), "give SENSOR=SECONDS")
    sensors.write_text(sensors.read_text().replace('kind = "radar"', 'kind = "radar"\nplatform = "ship"'))
    sensors.write_text(sensors.read_text().replace("dimensions = 2", "dimensions = 3"))
    (tmp_path / "ship.csv").write_text("time,lat,lon,alt_msl_ft\n0,50,8,100\n9,50,8,100\n")
    words = (*words[:2], detections, tmp_path / "ship.csv", *words[3:], "--guess")
    refused(run(*words), "above mean sea level", "--geoid-height-m")
    assert run(*words, "--geoid-height-m", "47.5").code == 0
    assert read_recording(tmp_path / "x").platforms[0].position[:, 2].tolist() == pytest.approx([77.98, 77.98])


def test_names_are_shown_as_they_are(run: Run, tmp_path: Path) -> None:
    for name in ("[/north]", "cam[left]", "@@SCRIPT@@", "a\\u001b[31mb"):
        detections, sensors = files(tmp_path, "t_s,sensor,scan,range_m,azimuth_deg\n1,cam,0,900,20\n")
        toml = sensors.read_text().replace('id = "radar"', f'id = "{name}"')
        sensors.write_text(f'name = "{name}"\n' + toml)
        detections.write_text(detections.read_text().replace("cam", name.replace("\\u001b", "\x1b")))
        assert run("import", "csv", detections, "--sensors", sensors, "-o", tmp_path / "n", "--force").code == 0
        ran = run("info", tmp_path / "n")
        assert ran.code == 0
        assert name.replace("\\u001b", "\\x1b") in ran.out
        assert "\x1b" not in ran.out


def test_results_of_another_recording_are_refused(run: Run, out: Path, tmp_path: Path) -> None:
    detections, sensors = files(tmp_path, "t_s,sensor,scan,range_m,azimuth_deg\n1,radar,0,900,20\n")
    (tmp_path / "t.csv").write_text("t_s,target,east_m,north_m\n0,a,1,2\n9,a,2,3\n")
    words = ("--sensors", sensors, "--truth", tmp_path / "t.csv", "-o", tmp_path / "other")
    assert run("import", "csv", detections, *words).code == 0
    for command in ("score", "report", "play"):
        refused(run(command, out, tmp_path / "other"), "give the recording that was tracked")
