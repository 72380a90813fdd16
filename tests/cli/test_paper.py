"""`boresight paper`: the JSON object that other tools read."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest


def boresight(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", "from boresight.cli import main; main()", *arguments],
        capture_output=True,
        text=True,
        check=False,
    )


def test_shao2012_json() -> None:
    done = boresight("paper", "shao2012", "--set", "C", "--runs", "3", "--seed", "2", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["command"] == "paper shao2012"
    assert told["parameters"] == {"set": "C", "runs": 3, "seed": 2}
    keys = {"method", "az_mrad", "el_mrad", "range_m", "velocity_m_s", "az_ratio", "el_ratio", "range_ratio"}
    keys |= {"velocity_ratio", "anees_per_dim", "us_per_update"}
    assert all(set(row) == keys for row in told["rows"])
    methods = {row["method"] for row in told["rows"]}
    assert methods >= {"as_printed", "corrected_angles_only", "corrected", "msc", "ekf", "iekf", "ukf", "radar_only"}
    assert methods >= {"ir_only", "rts"}


def test_plot_over_time(tmp_path: Path) -> None:
    done = boresight("paper", "shao2012", "--runs", "2", "--plot", str(tmp_path / "a.svg"))
    assert done.returncode == 0, done.stderr
    assert "bound" in done.stdout
    assert (tmp_path / "a.svg").read_text().count("<path") > 20
    assert [p.name for p in tmp_path.iterdir()] == ["a.svg"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--set", "X"), "--set must be one of A"),
        (("--runs", "0"), "--runs must be at least 1"),
        (("--plot", "a.xyz"), "must end in"),
    ],
)
def test_mistakes_end_with_one_line(arguments: tuple[str, ...], message: str) -> None:
    done = boresight("paper", "shao2012", *arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert done.stderr.count("\n") == 1
    assert not done.stdout


def test_async_ekf_plot(tmp_path: Path) -> None:
    picture = tmp_path / "a.png"
    done = boresight("paper", "async_ekf", "--scenario", "S2", "--runs", "1", "--plot", str(picture))
    assert done.returncode == 0, done.stderr
    assert picture.stat().st_size > 10_000
    done = boresight("paper", "async_ekf", "--runs", "1", "--plot", str(picture))
    assert done.returncode == 2
    assert "give --scenario S0 or S2" in done.stderr


def test_async_ekf_json() -> None:
    done = boresight("paper", "async_ekf", "--runs", "1", "--json")
    assert done.returncode == 0, done.stderr
    rows = json.loads(done.stdout)["rows"]
    assert {row["scenario"] for row in rows} >= {"S0", "S2"}
    keys = {"scenario", "method", "position_m", "velocity_m_s", "position_ratio", "anees_per_dim"}
    assert all(set(row) >= keys for row in rows)
    methods = {row["method"] for row in rows}
    assert methods >= {
        "as_printed",
        "interpolated",
        "radar_only",
        "cv",
        "ca",
        "imm",
        "adaptive_q",
        "adaptive_r",
        "rts_ca",
        "rts_imm",
    }


@pytest.mark.parametrize("paper", ["shao2012", "async_ekf", "phased_array"])
def test_runs_and_seed_are_checked(paper: str) -> None:
    for words, says in ((("--runs", "0"), "--runs must be at least 1"), (("--seed", "-3"), "--seed must be 0 or more")):
        done = boresight("paper", paper, *words)
        assert done.returncode == 2
        assert says in done.stderr
        assert done.stderr.count("\n") == 1
