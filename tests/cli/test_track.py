"""`boresight track` and `boresight score` as a user meets them: results, and one clear line for every mistake."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from boresight.io.recording import write_recording
from tests.tracking.conftest import make_recording

COLUMNS = [
    "t_s", "t_known_s", "track_id", "status", "east_m", "north_m", "up_m", "ve_m_s", "vn_m_s", "vu_m_s",
    "cov_ee", "cov_en", "cov_nn", "cov_eu", "cov_nu", "cov_uu",
]  # fmt: skip


def boresight(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "boresight", *map(str, arguments)], capture_output=True, text=True, check=False
    )


@pytest.fixture(scope="module")
def rec(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recordings") / "harbour"
    write_recording(make_recording(duration=30.0), folder)
    return folder


@pytest.fixture(scope="module")
def out(rec: Path) -> Path:
    folder = rec.parent / "out"
    done = boresight("track", rec, "-o", folder, "--sensors", "radar,ir")
    assert done.returncode == 0, done.stderr
    return folder


def one_line(done: subprocess.CompletedProcess[str], *words: str) -> None:
    assert done.returncode == 2, done.stdout + done.stderr
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert "Traceback" not in done.stderr
    for word in words:
        assert word in done.stderr


def test_results_are_those_of_the_contract(rec: Path, out: Path) -> None:
    tracks = pq.read_table(out / "tracks.parquet")
    assert tracks.column_names == COLUMNS
    assert tracks.num_rows > 50
    assert set(tracks["status"].to_pylist()) <= {"tentative", "confirmed", "coasting"}
    assert tracks["up_m"].null_count == tracks.num_rows  # two dimensions
    detections = pq.read_table(rec / "detections.parquet")
    decisions = pq.read_table(out / "decisions.parquet")
    assert decisions["row"].to_pylist() == list(range(detections.num_rows))
    summary = json.loads((out / "summary.json").read_text())
    assert sum(summary["counts"]["fates"].values()) == detections.num_rows
    assert summary["parameters"]["tracker"]["gate_probability"] == 0.999
    assert (out / "report.html").is_file()


def test_score_json_is_one_object(rec: Path, out: Path) -> None:
    done = boresight("score", out, rec, "--json")
    assert done.returncode == 0, done.stderr
    data = json.loads(done.stdout)
    assert set(data) == {"command", "version", "parameters", "rows"}
    ours, empty = data["rows"][:2]
    assert ours["gospa_rms_m"] < empty["gospa_rms_m"]
    assert [r["target"] for r in data["rows"] if r["item"] == "target"] == ["boat-0", "boat-1"]
    table = boresight("score", out, rec)
    assert max(len(line.rstrip()) for line in table.stdout.splitlines()) <= 80


def test_two_runs_are_equal(rec: Path, out: Path, tmp_path: Path) -> None:
    assert boresight("track", rec, "-o", tmp_path / "again", "--sensors", "radar,ir", "--no-report").returncode == 0
    first, second = (pq.read_table(f / "tracks.parquet") for f in (out, tmp_path / "again"))
    assert first.equals(second)


def test_mistakes_of_usage(rec: Path, out: Path, tmp_path: Path) -> None:
    one_line(boresight("track", rec), "--output")
    one_line(boresight("track", tmp_path / "nowhere", "-o", tmp_path / "o"), "nowhere")
    one_line(boresight("track", rec, "-o", out), "exists", "--force")
    one_line(boresight("track", rec, "-o", tmp_path / "o", "--sensors", "radr"), "radr", "radar")
    one_line(boresight("track", rec, "-o", tmp_path / "o", "--sensors", ","), "--sensors")
    one_line(boresight("score", tmp_path, rec), str(tmp_path))
    one_line(boresight("trakc", rec), "trakc")
    assert not (tmp_path / "o").exists()


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_unwritable_output(rec: Path, tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    one_line(boresight("track", rec, "-o", tmp_path / "o"), "cannot be written")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[tracker]\nprocess_noise = 1.0\n", ["process_noise", "process_noise_m2_s3"]),
        ("[tracker]\ngate_probability = 1.5\n", ["gate_probability"]),
        ("[tracker]\nhide_time_s = -3.0\n", ["hide_time_s", "negative"]),
        ("[tracker]\nhide_time_s = 0.0\n", ["hide_time"]),
        ("[tracker]\nprocess_noise_m2_s3 = nan\n", ["process_noise_m2_s3", "NaN"]),
        ('[[sensor]]\nid = "radr"\n', ["radr", "radar"]),
        ('[[sensor]]\nid = "ir"\nbias_azimut_deg = 1.0\n', ["bias_azimut_deg", "bias_azimuth_deg"]),
        ("[tracker\n", ["not valid TOML"]),
        ("", ["empty"]),
    ],
)
def test_mistakes_in_the_configuration(rec: Path, tmp_path: Path, text: str, words: list[str]) -> None:
    config = tmp_path / "mine.toml"
    config.write_text(text)
    one_line(boresight("track", rec, "-o", tmp_path / "o", "--config", config), "mine.toml", *words)
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize("spoil", ["empty", "binary", "truncated", "missing"])
@pytest.mark.parametrize("name", ["recording.toml", "detections.parquet", "platform.parquet"])
def test_spoilt_recordings(rec: Path, tmp_path: Path, name: str, spoil: str) -> None:
    copy = tmp_path / "copy"
    copy.mkdir()
    for file in rec.iterdir():
        (copy / file.name).write_bytes(file.read_bytes())
    good = (copy / name).read_bytes()
    match spoil:
        case "empty":
            (copy / name).write_bytes(b"")
        case "binary":
            (copy / name).write_bytes(np.random.default_rng(1).bytes(500))
        case "truncated":
            (copy / name).write_bytes(good[: len(good) // 2])
        case "missing":
            (copy / name).unlink()
    one_line(boresight("track", copy, "-o", tmp_path / "o"))
    assert not (tmp_path / "o").exists()


def test_score_without_truth(rec: Path, out: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    copy.mkdir()
    for file in rec.iterdir():
        if file.name != "truth.parquet":
            (copy / file.name).write_bytes(file.read_bytes())
    one_line(boresight("score", out, copy), "truth")


def test_lag_writes_smoothed_tracks_that_score_takes(rec: Path) -> None:
    folder = rec.parent / "lagged"
    done = boresight("track", rec, "-o", folder, "--lag", "4", "--no-report")
    assert done.returncode == 0, done.stderr
    smoothed = pq.read_table(folder / "smoothed.parquet")
    assert smoothed.column_names == COLUMNS
    assert smoothed.num_rows > 20
    causal = json.loads(boresight("score", folder, rec, "--json").stdout)["rows"][0]
    later = json.loads(boresight("score", folder, rec, "--smoothed", "--json").stdout)["rows"][0]
    assert later["position_rmse_m"] < causal["position_rmse_m"]


@pytest.mark.parametrize("lag", ["-1", "1000", "nan"])
def test_a_lag_out_of_range_ends_in_one_line(rec: Path, lag: str) -> None:
    done = boresight("track", rec, "-o", rec.parent / "never", f"--lag={lag}")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "--lag" in done.stderr
    assert not (rec.parent / "never").exists()


def test_score_smoothed_without_them_says_how(rec: Path, out: Path) -> None:
    done = boresight("score", out, rec, "--smoothed")
    assert done.returncode == 2
    assert "--lag" in done.stderr


def test_registration_is_printed_and_written(rec: Path) -> None:
    settings = rec.parent / "register.toml"
    settings.write_text('[[sensor]]\nid = "radar"\noffset_time_s = 0.5\noffset_azimuth_deg = 1.0\n')
    folder = rec.parent / "registered"
    done = boresight("track", rec, "-o", folder, "--config", settings)
    assert done.returncode == 0, done.stderr
    assert "radar: time_offset_s" in done.stdout
    table = pq.read_table(folder / "registration.parquet").to_pydict()
    assert set(table["parameter"]) == {"time_offset_s", "azimuth_offset_deg"}
    assert "registration" in (folder / "report.html").read_text(encoding="utf-8")
