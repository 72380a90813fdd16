"""The tracker as a whole: finds what is there, is honest about it, accounts for every report, is causal."""

from __future__ import annotations

import dataclasses
import io
import itertools
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from boresight.engine.track import run
from boresight.errors import UserError
from boresight.io.scans import iter_scans
from boresight.metrics.score import score
from boresight.tracking.config import SensorErrors, TrackerConfig
from boresight.tracking.run import decision_rows, track_rows, tracker_for
from boresight.tracking.saved import arrays_of_state, snapshot, state_of_arrays
from boresight.types import FATES, Detections, Fate, Recording, Sensor, SensorKind, Site, TrackRows
from tests.tracking.conftest import make_recording

CONFIG = TrackerConfig(q=0.01)


def tracked(recording: Recording, sensors: list[str] | None = None, config: TrackerConfig = CONFIG) -> TrackRows:
    _, rows, _ = run(tracker_for(recording, config, sensors), iter_scans(recording, sensors))
    return track_rows(rows)


def same(a: TrackRows, b: TrackRows) -> None:
    for field in dataclasses.fields(TrackRows):
        np.testing.assert_array_equal(getattr(a, field.name), getattr(b, field.name), err_msg=field.name)


def where(rows: TrackRows, keep: np.ndarray) -> TrackRows:
    return TrackRows(**{f.name: getattr(rows, f.name)[keep] for f in dataclasses.fields(TrackRows)})


def test_finds_both_boats_and_nothing_else(harbour: Recording) -> None:
    result = score(harbour, tracked(harbour)).rows[0]
    assert result["tracked_fraction"] > 0.85  # confirmation takes a few radar looks of 1.5 s
    assert result["false_track_s"] <= 5.0
    assert result["identity_switches"] == 0
    assert result["position_rmse_m"] < 4.0


def test_covariance_is_honest_over_many_runs() -> None:
    nees = []
    for seed in range(12):
        recording = make_recording(seed, duration=40.0)
        result = score(recording, tracked(recording))
        nees += [np.mean(t.nees) for t in result.targets if t.nees]
    # 24 target runs; NEES has mean 2 and, correlated over time, about 5 independent values a run: sigma of the mean
    # is 2 / sqrt(24 * 5) = 0.18; four of these
    assert 2.0 - 0.73 < np.mean(nees) < 2.0 + 0.73


def test_declared_latency_costs_no_lag() -> None:
    errors = []
    for latency in (0.0, 2.0):
        per_run = []
        for seed in range(6):
            recording = make_recording(seed, latency=latency)
            rows = tracked(recording, ["radar"])
            for target in score(recording, rows).targets:
                if target.errors:
                    v = np.array([3.0, -2.0]) if target.target == "boat-0" else np.array([4.0, 1.0])
                    along = np.array(target.errors) @ (v / np.linalg.norm(v))
                    per_run.append(np.mean(along))
        errors.append(np.mean(per_run))
    # an uncorrected delay of 2 s would be a lag of 7 to 8 m; the mean of 12 runs is good to about 0.5 m
    assert abs(errors[0]) < 1.5
    assert abs(errors[1]) < 1.5


def test_every_report_has_one_fate(harbour: Recording) -> None:
    d = harbour.detections
    names = ("t", "t_recv", "sensor", "scan", "z", "sigma")
    last = np.flatnonzero(d.sensor == 0)[-3:]
    more = Detections(*(np.concatenate([getattr(d, n), getattr(d, n)[last]]) for n in names), {})
    again = np.arange(len(more)) >= len(d)
    twice = dataclasses.replace(harbour, detections=more, duplicates=again)
    tracker = tracker_for(twice, CONFIG, ["radar"])
    state, _, decisions = run(tracker, iter_scans(twice, ["radar"]))
    rows = decision_rows(twice, tracker, decisions, state.names)
    assert len(rows) == len(d) + 3
    np.testing.assert_array_equal(rows.row, np.arange(len(rows)))
    named = [FATES[c] for c in rows.fate]
    radar = twice.detections.sensor == 0
    assert all(f == Fate.NOT_SELECTED for f, r in zip(named, radar, strict=True) if not r)
    empty = np.isnan(twice.detections.z).all(axis=1) & radar & ~twice.duplicates
    assert all((f == Fate.NO_DETECTION) == e for f, e, r in zip(named, empty, radar, strict=True) if r)
    assert [f == Fate.DUPLICATE for f in named] == again.tolist()
    hit = np.array([f == Fate.UPDATED for f in named])
    assert np.isfinite(rows.nis[hit]).all()
    assert hit.sum() > 50


@pytest.mark.parametrize("sensors", [["radar"], ["radar", "ir"]])
def test_a_cut_recording_gives_the_same_rows(harbour: Recording, sensors: list[str]) -> None:
    # the ferry weaves and gives no velocity: what was known of it at a cut is not what is known a stamp later
    straight = harbour.platforms[0]
    weave = np.column_stack([0.0 * straight.t, np.sin(2.0 * straight.t), 0.0 * straight.t])
    weaving = dataclasses.replace(
        straight, position=straight.position + weave, velocity=np.full_like(straight.velocity, np.nan)
    )
    harbour = dataclasses.replace(harbour, platforms=(weaving,))
    full = tracked(harbour, sensors)
    assert len(full) > 100
    d = harbour.detections
    # 7.26 and 33.06 lie between an image and the next navigation stamp, which the full run must not have used
    for cut in (7.26, 7.3, 19.501, 33.06, 47.77):
        keep = d.t_recv <= cut
        part = Detections(d.t[keep], d.t_recv[keep], d.sensor[keep], d.scan[keep], d.z[keep], d.sigma[keep], {})
        navigation = harbour.platforms[0]
        known = navigation.t <= cut
        columns = {f.name: getattr(navigation, f.name) for f in dataclasses.fields(navigation)}
        platform = dataclasses.replace(
            navigation, **{name: column[known] for name, column in columns.items() if isinstance(column, np.ndarray)}
        )
        short = dataclasses.replace(
            harbour, detections=part, platforms=(platform,), duplicates=harbour.duplicates[keep]
        )
        same(tracked(short, sensors), where(full, full.t_known <= cut))


def test_rows_are_causal_and_close_in_time(harbour: Recording) -> None:
    for sensors in (["radar"], ["radar", "ir"], ["ir", "radar"]):
        rows = tracked(harbour, sensors)
        assert (rows.t_known <= rows.t).all()
        for name in np.unique(rows.track_id):
            t = np.sort(rows.t[rows.track_id == name])
            assert np.diff(t).max() <= 0.5 + 1e-9


def test_arrival_order_within_the_window_does_not_matter(harbour: Recording) -> None:
    """The radar's looks are a second older than they arrive: the last state is that of in-order processing."""
    tracker = tracker_for(harbour, dataclasses.replace(CONFIG, window=5.0))
    scans = list(iter_scans(harbour))
    late, _, _ = run(tracker, scans)
    order = sorted(scans, key=lambda s: (s.t_look - harbour.sensors[s.sensor].latency, s.t_recv))
    came = np.maximum.accumulate([s.t_recv for s in order])  # as if none had been late
    straight, _, _ = run(tracker, [dataclasses.replace(s, t_recv=t) for s, t in zip(order, came, strict=True)])
    n = int(straight.window.tracks.live[0])
    assert n == int(late.window.tracks.live[0])
    np.testing.assert_array_equal(straight.window.tracks.birth[:n], late.window.tracks.birth[:n])
    np.testing.assert_allclose(straight.window.tracks.x[:n], late.window.tracks.x[:n], rtol=0, atol=1e-9)
    np.testing.assert_allclose(straight.window.tracks.P[:n], late.window.tracks.P[:n], rtol=0, atol=1e-9)


def test_reports_older_than_the_window_are_counted(harbour: Recording) -> None:
    tracker = tracker_for(harbour, dataclasses.replace(CONFIG, window=0.3))
    state, _, decisions = run(tracker, iter_scans(harbour))
    rows = decision_rows(harbour, tracker, decisions, state.names)
    late = rows.fate == FATES.index(Fate.LATE)
    assert late.sum() > 0  # the radar comes a second late
    assert (harbour.detections.sensor[late] == 0).all()


def test_stepping_a_snapshot_equals_stepping_the_original(harbour: Recording) -> None:
    tracker = tracker_for(harbour, CONFIG)
    scans = list(iter_scans(harbour))
    state, before, _ = run(tracker, scans[:150], finish=False)
    copy = snapshot(state)
    _, a, _ = run(tracker, scans[150:], state)
    _, b, _ = run(tracker, scans[150:], copy)
    same(track_rows(before + a), track_rows(before + b))
    same(track_rows(before + a), tracked(harbour))


def test_a_snapshot_and_the_original_stepped_in_turn(harbour: Recording) -> None:
    """Neither writes to what the other holds, in the middle of the window either."""
    tracker = tracker_for(harbour, CONFIG)
    scans = list(iter_scans(harbour))
    state, before, _ = run(tracker, scans[:150], finish=False)
    copy = snapshot(state)
    a, b = list(before), list(before)
    for scan, other in itertools.pairwise(scans[150:]):  # the copy misses one look: what it writes differs
        state, out = tracker.step(state, scan)
        a += out.rows
        copy, out = tracker.step(copy, other)
        b += out.rows
    alone, rows, _ = run(tracker, scans[:150], finish=False)
    for scan in scans[151:]:
        alone, out = tracker.step(alone, scan)
        rows += out.rows
    same(track_rows(b), track_rows(rows))
    _, rows, _ = run(tracker, scans[:-1], finish=False)
    same(track_rows(a), track_rows(rows))


RESUME = """
import io, sys
import numpy as np
from boresight.io.scans import iter_scans
from boresight.engine.track import run
from boresight.tracking.run import track_rows, tracker_for
from boresight.tracking.saved import state_of_arrays
from tests.tracking.conftest import make_recording
from tests.tracking.test_tracker import CONFIG

recording = make_recording()
tracker = tracker_for(recording, CONFIG)
with np.load(sys.argv[1], allow_pickle=False) as saved:
    state = state_of_arrays(saved, tracker)
state, rows, _ = run(tracker, list(iter_scans(recording))[150:], state)
t = track_rows(rows)
np.savez(sys.argv[2], t=t.t, track_id=t.track_id, position=t.position, covariance=t.covariance)
"""


def test_a_saved_state_goes_on_in_a_new_process(harbour: Recording, tmp_path: Path) -> None:
    tracker = tracker_for(harbour, CONFIG)
    scans = list(iter_scans(harbour))
    state, before, _ = run(tracker, scans[:150], finish=False)
    np.savez(tmp_path / "state.npz", **arrays_of_state(state))
    subprocess.run(
        [sys.executable, "-c", RESUME, str(tmp_path / "state.npz"), str(tmp_path / "rows.npz")],
        check=True, cwd=Path(__file__).parents[2],
    )  # fmt: skip
    full = tracked(harbour)
    n = sum(len(r.t) for r in before)
    with np.load(tmp_path / "rows.npz") as rest:
        assert len(rest["t"]) + n == len(full)
        for name in ("t", "track_id", "position", "covariance"):
            np.testing.assert_array_equal(rest[name], getattr(full, name)[n:])


def test_a_saved_state_of_other_sensors_is_refused(harbour: Recording) -> None:
    state, _, _ = run(tracker_for(harbour, CONFIG), list(iter_scans(harbour))[:20], finish=False)
    buffer = io.BytesIO()
    np.savez(buffer, **arrays_of_state(state))
    buffer.seek(0)
    other = tracker_for(harbour, TrackerConfig(sensors={"ir": SensorErrors(bias_azimuth=0.01)}))
    with np.load(buffer) as saved, pytest.raises(UserError, match="other sensors or settings"):
        state_of_arrays(saved, other)


def test_empty_looks_count_only_where_the_sensor_could_have_seen_the_target(harbour: Recording) -> None:
    narrow = dataclasses.replace(harbour.sensors[0].coverage, azimuth=(-0.1, 0.1))
    blind = dataclasses.replace(harbour.sensors[0], coverage=narrow)
    d = harbour.detections
    after = ((d.t > 30.0) & (d.sensor == 0))[:, None]
    silent = dataclasses.replace(d, z=np.where(after, np.nan, d.z), sigma=np.where(after, np.nan, d.sigma))
    existence = []
    for later in (harbour.sensors[0], blind):
        cut = dataclasses.replace(harbour, detections=silent)
        scans = list(iter_scans(cut, ["radar"]))
        early = [s for s in scans if s.t_recv <= 30.0]
        state, _, _ = run(tracker_for(cut, CONFIG, ["radar"]), early, finish=False)
        then = dataclasses.replace(cut, sensors=(later, harbour.sensors[1]))
        state, _, _ = run(tracker_for(then, CONFIG, ["radar"]), scans[len(early) :], state)
        tracks = state.window.tracks
        target = tracks.weight[: tracks.live[0], :2].sum(axis=1)
        existence.append(float(target.max()) if len(target) else 0.0)
    assert existence[0] < 0.3  # thirty seconds of looks that saw nothing
    assert existence[1] > 0.7  # nobody looked there


def test_a_sensor_that_declares_no_range_still_tracks_in_three_dimensions() -> None:
    t = np.arange(40.0)
    sigma = np.full(7, np.nan)
    sigma[4:] = 5.0
    z = np.full((40, 7), np.nan)
    z[:, 4:] = np.column_stack([100 + 5 * t, 200 - 3 * t, 50 + t]) + np.random.default_rng(2).normal(0, 5.0, (40, 3))
    rows = Detections(t, t, np.zeros(40, np.int64), np.arange(40), z, np.where(np.isfinite(z), 5.0, np.nan), {})
    sensor = Sensor("gps", SensorKind.POSITION, sigma=sigma)
    recording = Recording("one", 3, Site(1.0, 0.1, 0.0), (sensor,), rows, duplicates=np.zeros(40, dtype=bool))
    found = tracked(recording, config=TrackerConfig())
    assert len(np.unique(found.track_id)) == 1
    assert found.t.min() < 12.0
    last = found.t == found.t.max()
    np.testing.assert_allclose(found.position[last][-1], [100 + 5 * 39, 200 - 3 * 39, 50 + 39], atol=15.0)


def test_tracks_fade_in_a_long_silence(harbour: Recording) -> None:
    d = harbour.detections
    after = d.t > 30.0
    late = dataclasses.replace(d, t=d.t + 3600.0 * after, t_recv=d.t_recv + 3600.0 * after)
    nav = harbour.platforms[0]
    silent = dataclasses.replace(
        harbour, detections=late, platforms=(dataclasses.replace(nav, t=nav.t + 3600.0 * (nav.t > 30.0)),)
    )
    rows = tracked(silent)
    in_gap = (rows.t > 31.0) & (rows.t < 3600.0)
    assert in_gap.sum() > 0  # predicted on for a while …
    assert rows.t[in_gap].max() < 300.0  # … and then given up: nobody knows after minutes
