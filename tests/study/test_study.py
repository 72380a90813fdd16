"""Studies: cells, bound, engines, and the same table after a kill."""

from __future__ import annotations

import importlib.util
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from boresight.config.scenario import read_scenario
from boresight.errors import UserError
from boresight.sim.scenario import simulate
from boresight.study.bound import FAR, bound_at
from boresight.study.engine import run_all
from boresight.study.journal import JOURNAL, Journal
from boresight.study.plan import read_study, set_value
from boresight.study.run import one_run
from tests.cli.conftest import Run, run
from tests.study import crew

EXAMPLES = Path(__file__).parents[2] / "examples"
NO_RAY = "Ray is not installed (extra ray)"
__all__ = ["run"]


def small(folder: Path, extra: str = "") -> Path:
    """A study of two cells over twenty seconds of the example's scenario."""
    (folder / "crossing.toml").write_text((EXAMPLES / "crossing.toml").read_text(encoding="utf-8"), encoding="utf-8")
    plan = folder / "plan.toml"
    plan.write_text(
        'name = "small"\nscenario = "crossing.toml"\nruns = 6\nseed = 3\n'
        '[[grid]]\nkey = "tracker.process_noise_m2_s3"\nvalues = [0.1, 5.0]\n'
        '[[grid]]\nkey = "scenario.duration_s"\nvalues = [20.0]\n' + extra,
        encoding="utf-8",
    )
    return plan


def test_the_example_is_a_study_and_its_cells_differ_by_parameters_alone() -> None:
    study = read_study(EXAMPLES / "study.toml")
    assert len(study.cells) == 8
    assert study.cells[1] == (0.01, 20.0)
    scenario = json.loads(study.scenarios[1])
    assert scenario["sensors"][0]["sigma_range_m"] == 20.0
    assert json.loads(study.trackers[0]) == {"tracker": {"process_noise_m2_s3": 0.01}}
    assert study.task(0, 4).seed == study.task(5, 4).seed != study.task(0, 5).seed


def test_the_example_runs(tmp_path: Path, run: Run) -> None:
    done = run("study", EXAMPLES / "study.toml", "-o", tmp_path / "out", "--runs", "1", "--workers", "1")
    assert done.code == 0, done.err
    assert "8 cells of 1 runs" in done.out


def test_a_run_is_what_the_commands_give(tmp_path: Path, run: Run) -> None:
    study = read_study(small(tmp_path))
    row = one_run(study.task(1, 0))
    scenario, tracker = tmp_path / "s.toml", tmp_path / "t.toml"
    scenario.write_text(
        (tmp_path / "crossing.toml").read_text(encoding="utf-8").replace("duration_s = 60.0", "duration_s = 20.0"),
        encoding="utf-8",
    )
    tracker.write_text("[tracker]\nprocess_noise_m2_s3 = 5.0\n", encoding="utf-8")
    assert run("simulate", scenario, "-o", tmp_path / "rec", "--seed", row["seed"]).code == 0
    assert run("track", tmp_path / "rec", "-o", tmp_path / "out", "--config", tracker, "--no-report").code == 0
    told = json.loads(run("score", tmp_path / "out", tmp_path / "rec", "--cut-off-m", "20", "--json").out)["rows"]
    expected = next(r for r in told if r["item"] == "tracks")
    for key in ("gospa_rms_m", "tracked_fraction", "position_rmse_m", "nees_mean"):
        assert row[key] == pytest.approx(expected[key], rel=1e-9)


def test_the_bound_against_information_added_up_by_hand(tmp_path: Path) -> None:
    """One target that does not move and hardly may: after k looks of a Cartesian sensor, P = σ²/(p k) per axis."""
    path = tmp_path / "still.toml"
    path.write_text(
        'name = "still"\nduration_s = 10.0\ndimensions = 2\n[[targets]]\nid = "a"\nkind = "nearly_constant_velocity"\n'
        "position_enu_m = [100.0, 50.0, 0.0]\nvelocity_enu_m_s = [0.0, 0.0, 0.0]\n"
        '[[sensors]]\nid = "p"\nkind = "position"\nrate_hz = 1.0\nsigma_position_m = 3.0\np_detection = 0.8\n'
        "clutter_per_scan = 0.0\n",
        encoding="utf-8",
    )
    scenario, seed = read_scenario(path)
    truth = simulate(scenario, np.random.default_rng(seed)).truth[0]
    clock = np.array([0.2, 4.2, 9.0])
    found = bound_at(scenario, truth, {}, clock, 1e-12, 1e-6)
    for value, looks in zip(found, (1, 5, 10)):
        assert value == pytest.approx(2.0 / (0.8 * looks / 9.0 + 1.0 / FAR**2), rel=1e-3)


def test_grid_keys() -> None:
    data: dict[str, Any] = {"scenario": {"sensors": [{"id": "radar"}], "site": {}}, "tracker": {}}
    set_value(data, "scenario.sensors.radar.p_detection", 0.5, "x")
    set_value(data, "scenario.site.height_m", 2.0, "x")
    set_value(data, "tracker.sensor.radar.bias_range_m", 4.0, "x")
    set_value(data, "tracker.window_s", 1.0, "x")
    assert data["scenario"] == {"sensors": [{"id": "radar", "p_detection": 0.5}], "site": {"height_m": 2.0}}
    assert data["tracker"] == {"sensor": [{"id": "radar", "bias_range_m": 4.0}], "tracker": {"window_s": 1.0}}
    for key, message in (
        ("scenario.sensors.rada.p", r"no id 'rada' \(did you mean 'radar'\?\)"),
        ("scenaro.x", r"did you mean 'scenario'"),
        ("scenario.sensors.x", "leads to no table|no id"),
    ):
        with pytest.raises(UserError, match=message):
            set_value(data, key, 1.0, "x")


def test_mistakes_show_before_the_first_run(tmp_path: Path, run: Run) -> None:
    bad = small(tmp_path, '[[grid]]\nkey = "tracker.proces_noise_m2_s3"\nvalues = [1.0]\n')
    done = run("study", bad, "-o", tmp_path / "out")
    assert done.code == 2
    assert "did you mean 'process_noise_m2_s3'" in done.err
    assert not (tmp_path / "out").exists()
    assert run("study", small(tmp_path), "--engine", "loca", "-o", tmp_path / "out").code == 2
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("dear", encoding="utf-8")
    assert run("study", small(tmp_path), "--force", "-o", tmp_path / "mine").code == 2
    assert (tmp_path / "mine" / "letter.txt").exists()


def test_a_study_never_deletes_its_own_plan(tmp_path: Path, run: Run) -> None:
    plan = small(tmp_path)
    (tmp_path / JOURNAL).write_text("{}\n", encoding="utf-8")  # whatever lies there
    done = run("study", plan, "-o", plan.parent, "--force")
    assert done.code == 2
    assert "did not write" in done.err
    assert plan.exists()


def test_a_torn_journal_goes_on_and_another_study_is_refused(tmp_path: Path) -> None:
    with Journal(tmp_path, "one") as journal:
        journal.add({"a": 0.1})
        journal.add({"a": 0.2})
    path = tmp_path / JOURNAL
    path.write_bytes(path.read_bytes()[:-4])
    with Journal(tmp_path, "one") as journal:
        assert journal.rows == [{"a": 0.1}]
        journal.add({"a": 0.3})
    with Journal(tmp_path, "one") as journal:
        assert journal.rows == [{"a": 0.1}, {"a": 0.3}]
    with pytest.raises(UserError, match="another study"):
        Journal(tmp_path, "two")


def test_a_worker_that_dies_is_retried_and_reported(tmp_path: Path) -> None:
    told: list[str] = []
    tasks = [(i, str(tmp_path / "died")) for i in range(5)]
    rows = dict(run_all("local", crew.die_once, tasks, 2, told.append))
    assert [rows[i]["value"] for i in range(5)] == list(range(5))
    assert len(told) == 1
    assert "run 3; attempt 1 of 3" in told[0]
    with pytest.raises(UserError, match="died 3 times"):
        list(run_all("local", crew.die_always, [0], 1, told.append))
    with pytest.raises(UserError, match="run 1 of 1 failed: ValueError: no 7"):
        list(run_all("local", crew.fail, [7], 1, told.append))


def test_ctrl_c_is_for_the_parent_alone() -> None:
    """Else every worker that is still importing prints where it was."""
    before = signal.getsignal(signal.SIGINT)
    assert dict(run_all("local", crew.interrupted, [0], 1, print)) == {0: {"ignored": True}}
    assert signal.getsignal(signal.SIGINT) is before


def table(folder: Path) -> tuple[Any, Any]:
    return pq.read_table(folder / "runs.parquet"), pq.read_table(folder / "cells.parquet")


def test_killed_half_way_and_started_again_gives_the_same_table(tmp_path: Path, run: Run) -> None:
    plan, straight, cut = small(tmp_path), tmp_path / "straight", tmp_path / "cut"
    done = run("study", plan, "-o", straight, "--workers", "1", "--json")
    assert done.code == 0, done.err
    rows = json.loads(done.out)["rows"]
    assert [r["tracker.process_noise_m2_s3"] for r in rows] == [0.1, 5.0]
    assert all(r["runs"] == 6 and r["rmse_over_bound"] > 0.5 and r["nees_mean"] > 0 for r in rows)
    assert (straight / "study.png").stat().st_size > 10_000

    words = [sys.executable, "-m", "boresight", "study", str(plan), "-o", str(cut), "--workers", "1"]
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    journal, until = cut / JOURNAL, time.monotonic() + 60.0
    while time.monotonic() < until and (not journal.exists() or journal.read_bytes().count(b"\n") < 4):
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert not (cut / "cells.parquet").exists(), "it was too fast to be killed half-way"
    again = run("study", plan, "-o", cut, "--workers", "1")
    assert again.code == 0, again.err
    assert "going on after" in again.err
    for one, other in zip(table(straight), table(cut)):
        assert one.equals(other)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # Ray's own
@pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason=NO_RAY)
def test_ray_and_local_agree_bit_for_bit(tmp_path: Path, run: Run) -> None:
    plan = small(tmp_path)
    for engine in ("local", "ray"):
        done = run("study", plan, "-o", tmp_path / engine, "--engine", engine, "--workers", "1", "--runs", "3")
        assert done.code == 0, done.err
    for one, other in zip(table(tmp_path / "local"), table(tmp_path / "ray")):
        assert one.equals(other)
    told: list[str] = []
    tasks = [(i, str(tmp_path / "died")) for i in range(4)]
    rows = dict(run_all("ray", crew.die_once, tasks, 1, told.append))
    assert [rows[i]["value"] for i in range(4)] == list(range(4))
    assert len(told) == 1


@pytest.mark.skipif(importlib.util.find_spec("ray") is not None, reason="Ray is installed")
def test_without_ray_one_line_says_so() -> None:
    with pytest.raises(UserError, match="Ray is not installed"):
        list(run_all("ray", crew.square, [1], 1, print))
