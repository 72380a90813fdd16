"""Pipelines in TOML: what is chosen is applied, what is mistaken is told in one line."""

from __future__ import annotations

import json
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from boresight.io.recording import write_recording
from tests.cli.conftest import Run
from tests.tracking.conftest import make_recording

MISTAKES = {
    'align = "compres"': "did you mean 'compress'",
    'aligned = "compress"': "did you mean 'align'",
    'align = "compress"\n[align]\nfsat = ["ir"]': "did you mean 'fast'",
    'align = "compress"\n[align]\nfast = ["irr"]': "did you mean 'ir'",
    'align = "compress"\n[align]\nfast = ["radar"]': "more than directions",
    'align = "compress"\n[align]\npast = 3': "unknown key 'past'",
    'fuse = "dynamic"': 'needs align = "interpolate"',
    'align = "window"\n[align]\norder = 7': "order",
    'align = "window"\n[align]\norder = "two"': "order",
    'screen = "prediction"\n[screen]\ngate = -1.0': "gate",
    "[smooth]\norder = 2": 'pipeline.smooth is "none"',
    'smooth = "savitzky_golay"\n[smooth]\nsamples = 3\norder = 3': "samples",
    'align = "compress"\n[align]\nhold_s = 0.0': "hold",
}


@pytest.fixture(scope="module")
def rec(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rec") / "harbour"
    write_recording(make_recording(duration=15.0), folder)
    return folder


@pytest.mark.parametrize("text", list(MISTAKES))
def test_mistakes_end_in_one_line(run: Run, rec: Path, tmp_path: Path, text: str) -> None:
    config = tmp_path / "x.toml"
    config.write_text(f"[pipeline]\n{text}\n", encoding="utf-8")
    done = run("track", rec, "-o", tmp_path / "out", "--config", config)
    assert done.code == 2
    said = [line for line in done.err.strip().splitlines() if not line.startswith("boresight: compil")]
    assert len(said) == 1
    assert "x.toml" in done.err
    assert MISTAKES[text] in done.err
    assert not (tmp_path / "out").exists()


def test_bearings_alone_have_nothing_to_be_aligned_to(run: Run, rec: Path, tmp_path: Path) -> None:
    config = tmp_path / "x.toml"
    config.write_text('[pipeline]\nalign = "compress"\n', encoding="utf-8")
    done = run("track", rec, "-o", tmp_path / "out", "--config", config, "--sensors", "ir")
    assert done.code == 2
    assert "no sensor in use measures range" in done.err


def test_the_file_beside_the_recording_is_applied_and_told(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "harbour"
    write_recording(make_recording(duration=15.0), folder)
    text = '[pipeline]\nscreen = "prediction"\nalign = "compress"\n\n[align]\nslow = "radar"\nfast = ["ir"]\n'
    (folder / "tracker.toml").write_text(text, encoding="utf-8")
    assert run("track", folder, "-o", tmp_path / "out").code == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    chosen = summary["parameters"]["pipeline"]
    assert chosen["align"] == {"kind": "compress", "slow": "radar", "fast": ["ir"]}
    assert chosen["values_correlated"] is False
    table = pq.read_table(tmp_path / "out" / "decisions.parquet")
    assert {"row", "fate", "track_id", "nis", "reason", "value_row", "value_reports"} <= set(table.column_names)
    assert sum(summary["counts"]["fates"].values()) == table.num_rows
    assert run("score", tmp_path / "out", folder).code == 0
    assert run("report", tmp_path / "out", folder, "-o", tmp_path / "r.html").code in (0, 2)


def test_compare_writes_an_image(run: Run, rec: Path, tmp_path: Path) -> None:
    files = []
    for kind in ("none", "compress", "window"):
        files.append(tmp_path / f"{kind}.toml")
        files[-1].write_text(f'[pipeline]\nalign = "{kind}"\n', encoding="utf-8")
    done = run("compare", rec, "--config", *files, "-o", tmp_path / "side", "--json")
    assert done.code == 0, done.err
    rows = json.loads(done.out)["rows"]
    assert [row["align"] for row in rows] == ["none", "compress", "window"]
    assert all(row["gospa_rms_m"] > 0 and row["seconds"] > 0 for row in rows)
    assert (tmp_path / "side" / "compare.png").stat().st_size > 20_000
    assert json.loads((tmp_path / "side" / "compare.json").read_text(encoding="utf-8"))["rows"] == rows
    again = run("compare", rec, "--config", *files, "-o", tmp_path / "side")
    assert again.code == 2
    assert "--force" in again.err
    assert (
        run("compare", rec, "--config", *files, "-o", tmp_path / "side", "--force", "--sensors", "radar,ir").code == 0
    )
    assert run("compare", rec, "--config", *files, "--sensors", "raddar").code == 2
