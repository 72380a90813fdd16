"""simulate and play from the outside."""

from __future__ import annotations

import json
from pathlib import Path

import pyarrow.parquet as pq

from tests.cli.conftest import Run
from tests.cli.test_io_commands import out, rec, refused
from tests.sim.test_scenario_files import GOOD

__all__ = ["out", "rec"]


def test_one_seed_gives_one_recording(run: Run, tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(GOOD)
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        assert run("simulate", tmp_path / "s.toml", "-o", tmp_path / name, "--seed", seed).code == 0
    tables = [pq.read_table(tmp_path / n / "detections.parquet") for n in ("a", "b", "c")]
    assert tables[0].equals(tables[1])
    assert not tables[0].equals(tables[2])
    data = json.loads(run("info", tmp_path / "a", "--json").out)
    assert [r["id"] for r in data["rows"] if r["item"] == "target"] == ["a", "many-1", "many-2", "many-3"]


def test_simulate_refuses_in_one_line(run: Run, tmp_path: Path) -> None:
    scenario = tmp_path / "s.toml"
    refused(run("simulate", scenario, "-o", tmp_path / "r"), "no such file")
    for content in (b"", b"\x00\xff\xfe", b"name = "):
        scenario.write_bytes(content)
        refused(run("simulate", scenario, "-o", tmp_path / "r"), "s.toml")
    scenario.write_text(GOOD)
    refused(run("simulate", scenario, "-o", tmp_path / "r", "--seed", "-1"), "seed")
    refused(run("simulate", scenario, "-o", tmp_path / "r", "--seed", "x"), "seed")
    refused(run("simulate", scenario), "output")
    assert run("simulate", scenario, "-o", tmp_path / "r").code == 0
    refused(run("simulate", scenario, "-o", tmp_path / "r"), "--force")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["r", "s.toml"]


def test_play_piped_prints_the_whole_plan_once(run: Run, out: Path, rec: Path, tmp_path: Path) -> None:
    ran = run("play", out, rec)
    assert ran.code == 0
    assert "\x1b" not in ran.out
    assert max(map(len, ran.out.splitlines())) <= 80
    refused(run("play", out, rec, "--to", tmp_path / "x.avi"), "ends in")
    refused(run("play", out, rec, "--speed", "0"), "--speed")
    refused(run("play", tmp_path / "none"), "no such results folder")
