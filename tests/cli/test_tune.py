"""`boresight tune`: wrong noise is found from innovations, without truth."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from boresight.cli.simulate import simulate
from boresight.cli.tune import climb, tune
from boresight.errors import UserError
from boresight.io.recording import read_recording
from boresight.tracking.config import TrackerConfig

SCENARIO = """
name = "tune"
seed = 3
duration_s = 150.0
dimensions = 2
[site]
latitude_deg = 60.0
longitude_deg = 10.0
height_m = 0.0
[[targets]]
id = "a"
kind = "nearly_constant_velocity"
position_enu_m = [800.0, 300.0, 0.0]
velocity_enu_m_s = [-4.0, 3.0, 0.0]
q_m2_s3 = 0.1
[[targets]]
id = "b"
kind = "nearly_constant_velocity"
position_enu_m = [-600.0, -500.0, 0.0]
velocity_enu_m_s = [3.0, 4.0, 0.0]
q_m2_s3 = 0.1
[[sensors]]
id = "radar"
kind = "radar"
period_s = 0.5
sigma_range_m = 4.0
sigma_azimuth_deg = 0.5
p_detection = 0.95
clutter_per_scan = 0.5
coverage = { range_m = [0.0, 3000.0] }
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("tune")
    (place / "scenario.toml").write_text(SCENARIO)
    simulate(place / "scenario.toml", output=place / "rec")
    for path in (place / "rec").glob("truth*"):
        path.unlink()  # nothing may read it
    return place


def test_wrong_noise_is_found_without_truth(folder: Path) -> None:
    recording = read_recording(folder / "rec")
    wrong = np.ones(7)
    wrong[0], wrong[1] = 2.5, 0.5  # declared range sigma too large, azimuth too small
    sensors = tuple(dataclasses.replace(s, sigma=s.sigma * wrong) for s in recording.sensors)
    detections = dataclasses.replace(recording.detections, sigma=recording.detections.sigma * wrong)
    recording = dataclasses.replace(recording, sensors=sensors, detections=detections)
    rows, sigmas, consistency = climb(recording, TrackerConfig(q=2.0), None)
    likelihoods = [row["log_likelihood"] for row in rows]
    assert likelihoods == sorted(likelihoods)
    tuned = {row["key"]: row["tuned"] for row in sigmas}
    # some 500 reports: a sigma has a relative deviation of 1/sqrt(1000) = 3 %, q of much more: a factor of three
    assert tuned["sigma_range_m"] == pytest.approx(4.0, rel=0.15)
    assert tuned["sigma_azimuth_deg"] == pytest.approx(0.5, rel=0.15)
    assert 0.033 < rows[-1]["process_noise_m2_s3"] < 0.3
    assert consistency["radar"] == pytest.approx(1.0, abs=0.15)


def test_toml_can_be_used_and_json_holds_the_curve(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from boresight.config.tracker import read_tracker_config

    tune(folder / "rec", output=folder / "tracker.toml", json=True)
    told = json.loads(capsys.readouterr().out)
    assert told["command"] == "tune"
    assert {"step", "process_noise_m2_s3", "log_likelihood", "nis_per_dof", "radar_range_factor"} <= set(
        told["rows"][0]
    )
    config = read_tracker_config(folder / "tracker.toml", ["radar"])
    assert config.q == pytest.approx(told["rows"][-1]["process_noise_m2_s3"], rel=1e-3)
    with pytest.raises(UserError, match="give --force"):
        tune(folder / "rec", output=folder / "tracker.toml")
    assert not list(folder.glob("*.part"))
    for sensors, says in (("radio", "unknown sensor 'radio'"), (",", "names no sensor")):
        with pytest.raises(UserError, match=says):
            tune(folder / "rec", sensors=sensors)
