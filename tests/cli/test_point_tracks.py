"""`boresight point --replay` guided by another tracker's tracks.parquet, or by positions with full covariances."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tests.cli.conftest import Run
from tests.cli.test_point import SCENARIO, SITE

SOURCE = '[[source]]\nid = "other"\ncorrelation_s = 4.0\ntracks = "tracks"\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("tracks")


@pytest.fixture
def files(run: Run, folder: Path) -> Path:
    if not (folder / "tracks").exists():
        (folder / "scenario.toml").write_text(SCENARIO, encoding="utf-8")
        assert run("simulate", folder / "scenario.toml", "-o", folder / "rec", "--seed", 3).code == 0
        assert run("track", folder / "rec", "-o", folder / "tracks").code == 0
        assert run("simulate", folder / "scenario.toml", "-o", folder / "silent", "--seed", 3).code == 0
        path = folder / "silent" / "detections.parquet"
        table = pq.read_table(path)
        pq.write_table(table.filter(np.asarray(table["t_recv_s"]) <= 3.0), path)
    return folder


def errors(folder: Path, out: Path, after: float) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    d = {k: np.array(v) for k, v in pq.read_table(out / "pointing.parquet").to_pydict().items()}
    truth = pq.read_table(folder / "rec" / "truth.parquet").to_pydict()
    p = np.stack([np.interp(d["t_aim_s"], truth["t_s"], truth[k]) for k in ("east_m", "north_m", "up_m")])
    az, el = np.arctan2(p[0], p[1]), np.arctan2(p[2], np.hypot(p[0], p[1]))
    off = np.hypot((d["az_deg"] - np.degrees(az)) * np.cos(el), d["el_deg"] - np.degrees(el))
    late = (d["t_s"] > after) & (d["t_aim_s"] < 59.0)
    return off[late], {k: v[late] for k, v in d.items()}


def test_the_beam_follows_another_trackers_track(run: Run, files: Path, tmp_path: Path) -> None:
    """The recording falls silent after 3 s; what is left is the other tracker's track, at its own word or worse."""
    ids = pq.read_table(files / "tracks" / "tracks.parquet")["track_id"].to_pylist()
    track = max(set(ids), key=ids.count)
    (files / "site.toml").write_text(SITE + SOURCE + f"track_id = {track}\n", encoding="utf-8")
    done = run("point", files / "site.toml", "--replay", files / "silent", "-o", tmp_path / "out")
    assert done.code == 0, done.err
    off, d = errors(files, tmp_path / "out", 15.0)
    assert len(off) > 300
    assert set(d["mode"]) == {"fused"}
    assert np.sqrt(np.mean((off / d["sigma_deg"]) ** 2)) < 1.3
    assert np.median(off) < 0.3


@pytest.mark.parametrize(
    ("source", "says"),
    [
        (SOURCE + "track_id = 999\n", "no track 999"),
        (SOURCE.replace('"tracks"', '"trax"'), "no such results folder"),
        (SOURCE.replace("correlation_s = 4.0\n", "sigma_position_m = 4.0\n"), "tracks go with correlation_s"),
        (SOURCE.replace("4.0", "-4.0"), "must not be negative"),
        ('[[source]]\nid = "radar"\n', "or the correlation time"),
    ],
)
def test_mistakes_end_with_one_line(run: Run, files: Path, tmp_path: Path, source: str, says: str) -> None:
    (files / "bad.toml").write_text(SITE + source, encoding="utf-8")
    done = run("point", files / "bad.toml", "--replay", files / "silent", "-o", tmp_path / "out")
    assert done.code == 2
    assert says in done.err
    assert done.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_positions_of_a_recording_count_by_their_full_covariance(run: Run, files: Path, tmp_path: Path) -> None:
    """The same ellipse along the line of sight and across it: only across does it count for the beam."""
    text = (files / "rec" / "recording.toml").read_text(encoding="utf-8")
    rec = tmp_path / "rec"
    rec.mkdir()
    head = text.split("[[sensor]]")[0]
    (rec / "recording.toml").write_text(
        head + '[[sensor]]\nid = "gps"\nkind = "position"\naxes = "site_enu"\nsigma_position_m = 50.0\n',
        encoding="utf-8",
    )
    t = np.arange(0.0, 20.0, 1.0)
    place = np.array([3000.0, 4000.0, 0.0])
    along, across = place / 5000.0, np.array([0.8, -0.6, 0.0])
    found = {}
    for name, big, small in (("along", along, across), ("across", across, along)):
        C = 200.0**2 * np.outer(big, big) + 5.0**2 * np.outer(small, small) + 5.0**2 * np.diag([0.0, 0.0, 1.0])
        rows = {
            "t_s": t, "sensor": ["gps"] * len(t), "scan": np.arange(len(t)), "x_m": np.full(len(t), place[0]),
            "y_m": np.full(len(t), place[1]), "z_m": np.full(len(t), 800.0),
            "covariance": [C[np.triu_indices(3)].tolist()] * len(t),
        }  # fmt: skip
        pq.write_table(pa.table(rows), rec / "detections.parquet")
        (tmp_path / "site.toml").write_text(SITE + "[dynamics]\nq = 1e-9\n", encoding="utf-8")
        done = run("point", tmp_path / "site.toml", "--replay", rec, "-o", tmp_path / name)
        assert done.code == 0, done.err
        found[name] = pq.read_table(tmp_path / name / "pointing.parquet")["sigma_deg"].to_pylist()[-1]
    assert found["across"] > 5.0 * found["along"]
