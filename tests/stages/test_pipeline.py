"""Whole recordings through stages and tracker: every report accounted for, causal, and nothing changed by no stage."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from boresight.cli.track import track_recording
from boresight.config.pipeline import take_pipeline
from boresight.engine.track import run
from boresight.io.scans import iter_scans
from boresight.metrics.score import score
from boresight.tracking.config import TrackerConfig
from boresight.tracking.run import track_rows, tracker_for
from boresight.types import FATES, Detections, Fate, Recording, TrackRows
from tests.tracking.conftest import make_recording

PIPELINES = {
    "interpolate": {"pipeline": {"align": "interpolate"}},
    "compress": {"pipeline": {"align": "compress", "screen": "prediction"}, "screen": {"sensors": ["radar"]}},
    "compress_innovations": {"pipeline": {"align": "compress_innovations"}},
    "window": {"pipeline": {"align": "window"}, "align": {"past": 8, "future": 3, "order": 0}},
    "fuse": {"pipeline": {"align": "compress", "fuse": "inverse_variance"}},
    "dynamic": {"pipeline": {"align": "window", "fuse": "dynamic"}, "align": {"future": 2}},
    "smooth": {"pipeline": {"smooth": "savitzky_golay", "screen": "hampel"}},
    "plausible": {"pipeline": {"screen": "plausible"}, "screen": {"range_m": [5.0, 400.0]}},
}


@pytest.fixture(scope="module")
def harbour() -> Recording:
    return make_recording(duration=45.0)


def tracked(recording: Recording, name: str):  # type: ignore[no-untyped-def]
    raw = {key: dict(value) for key, value in PIPELINES[name].items()}
    return track_recording(recording, TrackerConfig(), None, take_pipeline(raw, "x.toml"), "x.toml")


@pytest.mark.parametrize("name", list(PIPELINES))
def test_every_report_is_accounted_for_once(harbour: Recording, name: str) -> None:
    results = tracked(harbour, name)
    rows = results.decisions
    n = len(harbour.detections)
    assert len(rows) == n
    left_out = rows.fate == FATES.index(Fate.NOT_SELECTED)
    assert not left_out.any()  # what no stage and no tracker spoke of would look like that
    screened = rows.fate == FATES.index(Fate.SCREENED)
    assert all(isinstance(r, str) and ":" in r for r in rows.reason[screened])
    aligned = np.flatnonzero(rows.fate == FATES.index(Fate.ALIGNED))
    if name not in ("smooth", "plausible"):
        assert len(aligned) > 50
    value = rows.extra["value_row"][aligned].astype(int)
    assert (value != aligned).all()
    assert not (rows.fate[value] == FATES.index(Fate.ALIGNED)).any()  # it ends with a row that the tracker judged
    np.testing.assert_array_equal(rows.track_id[aligned], rows.track_id[value])
    counted = np.bincount(value, minlength=n)
    stands = np.flatnonzero(counted)
    np.testing.assert_array_equal(rows.extra["value_reports"][stands], counted[stands] + 1)
    got = next(r for r in score(harbour, results.tracks).rows if r["item"] == "tracks")
    assert got["tracked_fraction"] > 0.6
    assert got["gospa_rms_m"] < 14.0


def same(a: TrackRows, b: TrackRows) -> None:
    for field in dataclasses.fields(TrackRows):
        np.testing.assert_array_equal(getattr(a, field.name), getattr(b, field.name))


@pytest.mark.parametrize("name", ["window", "compress_innovations", "fuse", "compress"])
def test_a_cut_recording_gives_the_same_rows(harbour: Recording, name: str) -> None:
    full = tracked(harbour, name).tracks
    d = harbour.detections
    for cut in (12.31, 27.05, 38.449):
        keep = d.t_recv <= cut
        part = Detections(d.t[keep], d.t_recv[keep], d.sensor[keep], d.scan[keep], d.z[keep], d.sigma[keep], {})
        short = dataclasses.replace(harbour, detections=part, duplicates=harbour.duplicates[keep])
        known = full.t_known <= cut
        mask = {f.name: getattr(full, f.name)[known] for f in dataclasses.fields(TrackRows)}
        same(tracked(short, name).tracks, TrackRows(**mask))


def test_rows_stay_close_in_time_while_looks_are_held(harbour: Recording) -> None:
    rows = tracked(harbour, "window").tracks
    assert (rows.t_known <= rows.t).all()
    for name in np.unique(rows.track_id):
        assert np.diff(np.sort(rows.t[rows.track_id == name])).max() <= 0.5 + 1e-9


def test_without_stages_nothing_changes(harbour: Recording) -> None:
    plain = track_recording(harbour, TrackerConfig())
    tracker = tracker_for(harbour, TrackerConfig())
    _, rows, _ = run(tracker, iter_scans(harbour))
    same(plain.tracks, track_rows(rows))
    assert "value_row" not in plain.decisions.extra
