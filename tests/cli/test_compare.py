"""`boresight compare`: the same figures as `track` and `score`, configuration by configuration."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest

from boresight.io.recording import write_recording
from tests.cli.conftest import Run
from tests.tracking.conftest import make_recording


def test_the_command(run: Run, tmp_path: Path) -> None:
    rec = tmp_path / "harbour"
    recording = make_recording(duration=30.0)
    write_recording(recording, rec)
    a, b = tmp_path / "a.toml", tmp_path / "b.toml"
    a.write_text("[tracker]\nprocess_noise_m2_s3 = 0.1\n", encoding="utf-8")
    b.write_text("[tracker]\nprocess_noise_m2_s3 = 5.0\n", encoding="utf-8")
    done = run("compare", rec, "--config", a, b, "--json")
    assert done.code == 0, done.err
    told = json.loads(done.out)
    assert told["command"] == "compare"
    assert [row["config"] for row in told["rows"]] == [str(a), str(b)]
    assert run("track", rec, "-o", tmp_path / "out", "--config", b, "--no-report").code == 0
    scored = json.loads(run("score", tmp_path / "out", rec, "--json").out)["rows"]
    expected = next(r for r in scored if r["item"] == "tracks")
    for key in ("gospa_rms_m", "tracked_fraction", "position_rmse_m", "false_track_s", "nees_mean"):
        assert told["rows"][1][key] == pytest.approx(expected[key], rel=1e-9)
    assert told["rows"][0]["gospa_rms_m"] != told["rows"][1]["gospa_rms_m"]
    assert "2 configurations" in run("compare", rec, "--config", a, b).out

    blind = tmp_path / "blind"
    write_recording(dataclasses.replace(recording, truth=()), blind)
    rows = json.loads(run("compare", blind, "--config", a, b, "--json").out)["rows"]
    assert all(row["gospa_rms_m"] is None and row["seconds"] > 0 for row in rows)
    one = run("compare", rec, "--config", a)
    assert one.code == 2
    assert "two or more" in one.err
    assert run("compare", rec, "--config", a, tmp_path / "no.toml").code == 2
