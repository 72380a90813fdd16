"""`boresight passes`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.conftest import Run
from tests.pointing.test_satellite import tle


def test_passes_are_listed(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "sat.tle"
    path.write_text("CBERS 2\n" + "\n".join(tle("28057")) + "\n", encoding="utf-8")
    done = run("passes", "--tle", path, "--site", 47.45, 8.56, 430, "--hours", 24, "--json")
    assert done.code == 0, done.err
    rows = json.loads(done.out)["rows"]
    assert len(rows) >= 3
    assert all(r["satellite"] == "CBERS 2" and r["rise_s"] < r["culmination_s"] < r["set_s"] for r in rows)
    assert all(isinstance(r["can_follow"], bool) and 0 < r["max_elevation_deg"] <= 90 for r in rows)
    assert run("passes", "--tle", path, "--site", 47.45, 8.56, 430).code == 0


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--tle", "none.tle", "--site", 47, 8, 0), "none.tle"),
        (("--tle", "sat.tle", "--site", 97, 8, 0), "between -90 and 90"),
        (("--tle", "sat.tle", "--site", 47, 8, 0, "--start", "soon"), "ISO time"),
    ],
)
def test_mistakes(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[object, ...], says: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("sat.tle").write_text("\n".join(tle("28057")), encoding="utf-8")
    done = run("passes", *words)
    assert done.code == 2
    assert says in done.err


def test_a_damaged_satellite_does_not_take_the_others_with_it(run: Run, tmp_path: Path) -> None:
    one, two = tle("28057")
    bad = one[:20] + ("1" if one[20] != "1" else "2") + one[21:]
    path = tmp_path / "sat.tle"
    path.write_text(f"BAD\n{bad}\n{two}\nGOOD\n{one}\n{two}\n", encoding="utf-8")
    done = run("passes", "--tle", path, "--site", 47.45, 8.56, 430, "--hours", 12, "--json")
    assert done.code == 0
    assert {r["satellite"] for r in json.loads(done.out)["rows"]} == {"GOOD"}
    assert "left out" in done.err
    assert "line 2: the checksum" in done.err
