"""Results out and back in."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from boresight.errors import UserError
from boresight.io import read_recording, read_results, write_results
from boresight.types import FATES, NO_TRACK, DecisionRows, Fate, Results, TrackRows, no_tracks
from tests.io.conftest import Write


def some_results() -> Results:
    rng = np.random.default_rng(1)
    a = rng.normal(size=(4, 3, 3))
    cov = a @ a.transpose(0, 2, 1)
    cov[2:, 2] = cov[2:, :, 2] = np.nan  # the last two rows are flat
    position = rng.normal(size=(4, 3))
    position[2:, 2] = np.nan
    tracks = TrackRows(
        np.arange(4.0),
        np.arange(4.0) - 0.1,
        np.array([1, 1, 2, 2]),
        np.array([0, 1, 1, 2], dtype=np.uint8),
        position,
        position / 2,
        cov,
    )
    decisions = DecisionRows(
        np.arange(3),
        np.array([FATES.index(f) for f in (Fate.UPDATED, Fate.LATE, Fate.NO_DETECTION)], dtype=np.uint8),
        np.array([1, NO_TRACK, NO_TRACK]),
        np.array([0.5, np.nan, np.nan]),
        np.array([None, "too old", None], dtype=object),
        {"log_likelihood": np.array([-1.0, np.nan, np.nan])},
    )
    return Results(tracks, decisions, {"counts": {"updated": 1}, "worst": float("nan")})


def test_results_come_back_as_they_were(write: Write, tmp_path: Path) -> None:
    rec, out = read_recording(write()), tmp_path / "out"
    out.mkdir()
    one = some_results()
    write_results(one, rec, out)
    two = read_results(out)
    for name in ("t", "t_known", "track_id", "status", "position", "velocity", "covariance"):
        np.testing.assert_array_equal(getattr(two.tracks, name), getattr(one.tracks, name))
    for name in ("row", "fate", "track_id", "nis", "reason"):
        np.testing.assert_array_equal(getattr(two.decisions, name), getattr(one.decisions, name))
    np.testing.assert_array_equal(two.decisions.extra["log_likelihood"], one.decisions.extra["log_likelihood"])
    assert two.summary["worst"] is None
    assert two.summary["recording"]["site"]["latitude_deg"] == pytest.approx(63.4389029083, abs=1e-12)
    columns = pq.read_table(out / "tracks.parquet").column_names
    assert columns == [
        *("t_s", "t_known_s", "track_id", "status", "east_m", "north_m", "up_m", "ve_m_s", "vn_m_s", "vu_m_s"),
        *("cov_ee", "cov_en", "cov_nn", "cov_eu", "cov_nu", "cov_uu"),
    ]
    raw = pq.read_table(out / "decisions.parquet")
    assert raw["track_id"].to_pylist() == [1, None, None]
    assert raw["nis"].to_pylist() == [0.5, None, None]


def test_an_empty_result_comes_back_empty(write: Write, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    write_results(Results(no_tracks(), some_results().decisions, {}), read_recording(write()), out)
    assert len(read_results(out).tracks) == 0


def spoil(out: Path, file: str, column: str, values: list[object] | None) -> None:
    table = pq.read_table(out / file)
    i = table.column_names.index(column)
    table = table.remove_column(i) if values is None else table.set_column(i, column, pa.array(values))
    pq.write_table(table, out / file)


BAD = [
    ("tracks.parquet", "cov_en", None, "column 'cov_en' is missing"),
    ("tracks.parquet", "status", ["confirmed", "x", "x", "x"], "row 1: status is 'x', not known"),
    ("tracks.parquet", "t_known_s", [0.0, 9.0, 0.0, 0.0], "row 1: t_known_s = 9.0 is later than t_s"),
    ("tracks.parquet", "east_m", [0.0, None, 0.0, 0.0], "row 1: east_m is null"),
    ("decisions.parquet", "fate", ["updated", "updatd", "late"], r"row 1: fate is 'updatd', not known \(did you mean"),
]


@pytest.mark.parametrize(("file", "column", "values", "message"), BAD, ids=[b[3][:30] for b in BAD])
def test_bad_results_are_refused(file, column, values, message, write: Write, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    write_results(some_results(), read_recording(write()), out)
    spoil(out, file, column, values)
    with pytest.raises(UserError, match=message):
        read_results(out)


def test_a_damaged_summary_is_refused(write: Write, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    write_results(some_results(), read_recording(write()), out)
    text = (out / "summary.json").read_text()
    assert json.loads(text)["counts"] == {"updated": 1}
    (out / "summary.json").write_text(text[: len(text) // 2])
    with pytest.raises(UserError, match=r"summary\.json: not valid JSON"):
        read_results(out)
    with pytest.raises(UserError, match="no such results folder"):
        read_results(tmp_path / "none")
