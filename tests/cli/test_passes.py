"""`boresight passes`."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path

import pytest
from benchmarks.passes import EPOCH, lines_of

from tests.cli.conftest import Run
from tests.pointing.test_elements import summed
from tests.pointing.test_passes import stationary
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


def listed(run: Run, path: Path, *words: object) -> tuple[list[dict], list[str], str]:
    done = run("passes", "--tle", path, "--json", *words)
    assert done.code == 0, done.err
    told = json.loads(done.out)
    return told["rows"], told["notes"], done.err


AT = datetime.fromtimestamp(EPOCH, UTC).isoformat()
LOW = lines_of(5, 15.2, 0.0005, 51.6, 10.0, 0.0, 20.0)


def test_what_never_sets_or_rises_is_said(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "geo.tle"
    lines = [*stationary(8.0), *(summed(line[:2] + "00078" + line[7:]) for line in stationary(190.0))]
    path.write_text("\n".join(["HIGH", *lines[:2], "FAR", *lines[2:]]), encoding="utf-8")
    rows, notes, _ = listed(run, path, "--site", 47, 8, 0, "--start", AT)
    (row,) = rows
    assert (row["satellite"], row["state"], row["rise"], row["set"]) == ("HIGH", "always above", None, None)
    assert any("never above 0°" in n and "FAR" in n and "-48." in n for n in notes)
    table = run("passes", "--tle", path, "--site", 47, 8, 0, "--start", AT).out
    assert "always above" in table
    assert "never above 0° in these 24 h: FAR (highest -48." in table


def test_a_pass_in_progress_is_said(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "low.tle"
    path.write_text("\n".join(["LOW", *LOW]), encoding="utf-8")
    where = ("--site", 47, 8, 0)
    (first, *_), _, _ = listed(run, path, *where, "--start", AT)
    middle = first["culmination_s"]
    (row,), _, _ = listed(run, path, *where, "--start", middle, "--hours", 0.2)
    assert row["state"] == "in progress at start"
    assert row["rise_s"] is None
    assert row["begin_elevation_deg"] == pytest.approx(first["max_elevation_deg"], abs=0.01)
    assert row["set_s"] == pytest.approx(first["set_s"], abs=0.01)
    (row,), _, _ = listed(run, path, *where, "--start", middle - 720, "--hours", 0.2)
    assert row["state"] == "in progress at end"
    assert row["set_s"] is None
    assert row["rise_s"] == pytest.approx(first["rise_s"], abs=0.01)
    assert "up " in run("passes", "--tle", path, *where, "--start", middle, "--hours", 0.2).out


MOUNT = """
[site]
latitude_deg = 47.0
longitude_deg = 8.0
[mount]
azimuth_deg = {azimuth}
elevation_deg = [0.0, {highest}]
azimuth_rate_deg_s = 3.0
elevation_rate_deg_s = 3.0
{horizon}
"""


def test_the_horizon_and_the_flip_count(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "low.tle"
    path.write_text("\n".join(["LOW", *LOW]), encoding="utf-8")
    words = ("--site", 47, 8, 0, "--start", AT, "--hours", 48)

    def of(azimuth: str, highest: float, horizon: str = "") -> list[dict]:
        (tmp_path / "m.toml").write_text(
            MOUNT.format(azimuth=azimuth, highest=highest, horizon=horizon), encoding="utf-8"
        )
        return listed(run, path, *words, "--mount", tmp_path / "m.toml")[0]

    free = of("[-270.0, 270.0]", 90.0)
    walled = of("[-270.0, 270.0]", 90.0, "horizon_deg = [[0, 30], [90, 30], [180, 30], [270, 30]]")
    assert len(walled) == sum(r["max_elevation_deg"] > 30.0 for r in free) > 0
    assert all(r["begin_elevation_deg"] == pytest.approx(30.0, abs=1e-3) for r in walled)
    upright, flips = of("[0.0, 360.0]", 90.0), of("[0.0, 360.0]", 180.0)
    lost = [k for k, r in enumerate(upright) if not r["can_follow"]]
    assert lost  # passes across north do not fit a full turn from north
    assert all(r["can_follow"] for r in flips)
    assert all(flips[k]["way"] != "upright" for k in lost)
    (tmp_path / "m.toml").write_text(MOUNT.format(azimuth="[0.0, 360.0]", highest=200.0, horizon=""), encoding="utf-8")
    done = run("passes", "--tle", path, *words, "--mount", tmp_path / "m.toml")
    assert done.code == 2
    assert "between -90° and 180°" in done.err


def test_old_elements_are_refused_unless_forced(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "low.tle"
    path.write_text("\n".join(["LOW", *LOW]), encoding="utf-8")
    where = ("--tle", path, "--site", 47, 8, 0)
    done = run("passes", *where, "--start", EPOCH + 60 * 86400.0)
    assert done.code == 2
    assert "60 days from the window's begin" in done.err
    assert "--force" in done.err
    rows, _, _ = listed(run, path, *where[2:], "--start", EPOCH + 60 * 86400.0, "--force")
    assert all(r["age_days"] == pytest.approx(60.5, abs=0.6) for r in rows)
    rows, notes, err = listed(run, path, *where[2:], "--start", EPOCH + 29.5 * 86400.0)
    assert rows
    assert all(r["age_days"] <= 30.0 for r in rows)
    assert "searched from" in notes[0]
    assert "more than 30 days old" in err
    rows, _, _ = listed(run, path, *where[2:], "--start", EPOCH + 29.5 * 86400.0, "--max-age-days", 31)
    assert max(r["age_days"] for r in rows) > 30.0


def test_all_refused_is_said_one_by_one(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "bad.tle"
    xp = summed(LOW[0][:62] + "4" + LOW[0][63:])
    path.write_text("\n".join(["NEW", xp, LOW[1], "CUT", LOW[0][:60], LOW[1]]), encoding="utf-8")
    done = run("passes", "--tle", path, "--site", 47, 8, 0)
    assert done.code == 2
    lines = done.err.strip().splitlines()
    assert "SGP4-XP" in lines[0]
    assert "NEW" in lines[0]
    assert "60 characters long" in lines[1]
    assert "none of its 2 sets" in lines[2]


def test_a_decaying_satellite_and_several_sets_of_one(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "sats.tle"
    decaying = lines_of(6, 16.41, 0.0001, 52.0, 17.0, 140.0, 131.0, 2e-3)
    later = [summed(LOW[0][:20] + "066.18750000" + LOW[0][32:]), LOW[1]]
    path.write_text("\n".join(["DOWN", *decaying, "LOW", *LOW, "LOW", *later]), encoding="utf-8")
    rows, notes, err = listed(run, path, "--site", 47.45, 8.56, 430, "--start", AT, "--hours", 48)
    assert {r["satellite"] for r in rows} == {"DOWN", "LOW"}
    assert "DOWN: its elements fail from" in err
    assert any("LOW: 2 sets of elements; that of 2024-03-05" in n for n in notes)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--min-elevation-deg", 91), "must lie between -90 and 90"),
        (("--min-elevation-deg", "nan"), "must lie between"),
        (("--dut1-s", 5), "must lie between -1 and 1"),
        (("--max-age-days", -1), "must lie between"),
        (("--hours", 0), "between 0 and a year"),
    ],
)
def test_numbers_that_cannot_be(run: Run, tmp_path: Path, words: tuple[object, ...], says: str) -> None:
    path = tmp_path / "low.tle"
    path.write_text("\n".join(LOW), encoding="utf-8")
    done = run("passes", "--tle", path, "--site", 47, 8, 0, *words)
    assert done.code == 2
    assert says in done.err
