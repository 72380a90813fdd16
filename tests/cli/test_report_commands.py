"""report and demo from the outside."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.conftest import Run
from tests.cli.test_io_commands import refused


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A place that the tests of this module share."""
    return tmp_path_factory.mktemp("demo")


@pytest.mark.slow
def test_the_demo_meets_the_bound_and_writes_the_report(run: Run, folder: Path) -> None:
    ran = run("demo", "-o", folder / "demo", "--runs", "60", "--json")
    assert ran.code == 0
    data = json.loads(ran.out)
    assert [row["time_s"] for row in data["rows"]] == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]
    for row in data["rows"]:
        # the standard error of an RMSE over 60 runs is about 1/sqrt(2·60) = 9 % or less; 4 of them
        for name in ("radar", "ir", "both"):
            assert row[f"{name}_ratio"] == pytest.approx(1.0, abs=0.36)
        assert row["both_bound_m"] < min(row["radar_bound_m"], row["ir_bound_m"])
    assert "<html" in (folder / "demo" / "report.html").read_text()
    refused(run("demo", "-o", folder / "demo"), "--force")
    score = json.loads(run("score", folder / "demo", folder / "demo" / "recording", "--json").out)
    page = (folder / "demo" / "report.html").read_text()
    rms = score["rows"][0]["gospa_rms_m"]
    assert f'"gospa_rms_m":{json.dumps(rms)}' in page
    # the report is written anew from the folder alone: the summary knows the recording
    (folder / "demo" / "report.html").unlink()
    assert run("report", folder / "demo").code == 0
    assert f'"gospa_rms_m":{json.dumps(rms)}' in (folder / "demo" / "report.html").read_text()


def test_report_refuses_what_is_not_there(run: Run, tmp_path: Path) -> None:
    refused(run("report", tmp_path / "none"), "no such results folder")
    refused(run("demo", "--runs", "1"), "--runs")
    refused(run("demo", "--runs", "x"), "runs")
