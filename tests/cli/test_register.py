"""`boresight register`: values, verdicts, a copy that the tracker uses, mistakes in one line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from benchmarks.registration import case

from boresight.io.recording import read_recording, write_recording
from tests.cli.conftest import Run


@pytest.fixture(scope="module")
def rec(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, float]]:
    folder = tmp_path_factory.mktemp("rec") / "boats"
    recording, truth = case(6004)
    write_recording(recording, folder)
    return folder, truth


def test_the_command_and_its_copy(run: Run, rec: tuple[Path, dict[str, float]], tmp_path: Path) -> None:
    folder, truth = rec
    copy = tmp_path / "copy"
    arguments = ("--reference", "right", "-o", copy, "--plot", tmp_path / "r.png")
    done = run("register", folder, *arguments, "--json")
    assert done.code == 0, done.err
    told = json.loads(done.out)
    assert told["command"] == "register"
    assert told["parameters"]["reference"] == "right"
    rows = {row["parameter"]: row for row in told["rows"]}
    assert set(rows) == {"time_offset_s", "range_offset_m", "range_scale", "azimuth_offset_deg"}
    for name, value in truth.items():
        assert abs(rows[name]["value"] - value) < 4 * rows[name]["sigma"]
        assert rows[name]["low_95"] < rows[name]["value"] < rows[name]["high_95"]
    assert (tmp_path / "r.png").stat().st_size > 10_000
    old, new = read_recording(folder), read_recording(copy)
    off = old.sensor_index("off")
    latency = rows["time_offset_s"]["latency_s"]
    assert new.sensors[off].latency == pytest.approx(latency)
    assert latency == pytest.approx(old.sensors[off].latency + rows["time_offset_s"]["value"])
    kept = json.loads((copy / "registration.json").read_text(encoding="utf-8"))
    assert kept["rows"][0]["written"] is True
    scores = []
    for one in (folder, copy):
        out = tmp_path / f"out-{one.name}"
        assert run("track", one, "-o", out, "--no-report").code == 0
        scored = json.loads(run("score", out, one, "--json").out)["rows"]
        scores.append(next(r for r in scored if r["item"] == "tracks")["position_rmse_m"])
    assert scores[1] < scores[0]
    again = run("register", folder, "--reference", "right", "-o", copy)
    assert again.code == 2
    assert "--force" in again.err
    (folder / "tracker.toml").write_text('[pipeline]\nscreen = "prediction"\n', encoding="utf-8")
    text = run("register", folder, "--reference", "right")  # a pipeline is left aside
    (folder / "tracker.toml").unlink()
    assert "time offset:" in text.out
    assert "±" in text.out


def test_mistakes_end_in_one_line(run: Run, rec: tuple[Path, dict[str, float]], tmp_path: Path) -> None:
    folder, _ = rec
    for words, expected in (
        (("--reference", "rihgt"), "did you mean 'right'"),
        (("--sensors", "off"), "two or more"),
        (("--sensors", "offf,right"), "did you mean"),
        (("-o", folder), "replace its own input"),
        (("--plot", tmp_path / "x.doc"), "must end in"),
    ):
        done = run("register", folder, *words)
        assert done.code == 2, words
        assert expected in done.err
        assert len(done.err.strip().splitlines()) == 1
