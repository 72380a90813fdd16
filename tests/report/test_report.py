"""The report: its numbers are those of `score` and of the summary, it is self-contained, small, and always comes."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from boresight.config.scenario import read_scenario
from boresight.errors import UserError
from boresight.metrics.score import score
from boresight.report.data import collect
from boresight.report.html import render
from boresight.report.places import places_of
from boresight.sim.scenario import simulate
from boresight.types import (
    FATES,
    NO_TRACK,
    STATUSES,
    DecisionRows,
    Fate,
    Recording,
    Results,
    TrackRows,
    TrackStatus,
    no_tracks,
)

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def recording() -> Recording:
    """The harbour, simulated."""
    scenario, seed = read_scenario(EXAMPLES / "harbour.toml")
    return simulate(scenario, np.random.default_rng(seed))


def results_of(recording: Recording, offset: float = 2.0) -> Results:
    """Tracks that follow the truth at a known offset to the east, and decisions that use every radar row."""
    t, ids, position, velocity = [], [], [], []
    for i, truth in enumerate(recording.truth):
        keep = slice(None, None, 5)
        t.append(truth.t[keep])
        ids.append(np.full(len(truth.t[keep]), i + 1))
        position.append(truth.position[keep] + [offset, 0.0, 0.0])
        velocity.append(truth.velocity[keep])
    n = sum(map(len, t))
    flat = np.full((n, 3, 3), np.nan)
    flat[:, :2, :2] = 4.0 * np.eye(2)
    place = np.concatenate(position)
    place[:, 2] = np.nan
    status = np.full(n, STATUSES.index(TrackStatus.CONFIRMED), dtype=np.uint8)
    order = np.argsort(np.concatenate(t), kind="stable")
    stamps = np.concatenate(t)[order]
    tracks = TrackRows(
        stamps, stamps, np.concatenate(ids)[order], status, place[order], np.concatenate(velocity)[order], flat
    )
    rows = len(recording.detections)
    fate = np.full(rows, FATES.index(Fate.UNASSOCIATED), dtype=np.uint8)
    used = (recording.detections.sensor == 0) & ~np.isnan(recording.detections.z[:, 0])
    fate[used] = FATES.index(Fate.UPDATED)
    nis = np.where(used, 2.0, np.nan)
    reason = np.full(rows, None, dtype=object)
    reason[~used] = "no track <took> it"
    decisions = DecisionRows(np.arange(rows), fate, np.where(used, 1, NO_TRACK), nis, reason)
    return Results(tracks, decisions, {"counts": {"reports": rows}, "command": "boresight track REC -o OUT"})


def embedded(page: str) -> dict[str, object]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)
    assert found
    data: dict[str, object] = json.loads(found[1])
    return data


def test_numbers_are_those_of_score(recording: Recording) -> None:
    results = results_of(recording)
    data = embedded(render(collect(results, recording)))
    rows = score(recording, results.tracks, results.decisions).rows
    assert data["scores"] == json.loads(json.dumps(rows))
    assert data["summary"] == results.summary
    first = data["errors"][0]
    np.testing.assert_allclose(np.array(first["e"][0]) / 100, 2.0, atol=0.02)  # the offset, to 1 cm
    np.testing.assert_allclose(np.array(first["s"][0]) / 100, 2.0, atol=0.005)
    nis = next(n for n in data["nis"] if n["id"] == "radar")
    np.testing.assert_allclose(nis["v"], 1.0)  # 2 per report of 2 components
    assert all(low < 1.0 < high for low, high in zip(nis["lo"], nis["hi"], strict=True))
    counted = sum(row["rows"] for row in data["outcome"])
    assert counted == len(recording.detections)


def test_the_page_is_self_contained(recording: Recording) -> None:
    page = render(collect(results_of(recording), recording))
    links = set(re.findall(r"""(?:src|href)\s*=\s*["']([^"']*)""", page))
    assert links == {"data:,"}
    assert set(re.findall(r"https?://[^\s\"'<]+", page)) == {"http://www.w3.org/2000/svg"}
    assert not re.search(r"@import|url\((?!#)", page.replace("`url(#${clip})`", ""))
    assert "@@" not in page
    assert "no track <took>" not in page  # nothing of the data can end the script


def test_empty_without_truth_and_without_a_recording(recording: Recording) -> None:
    full = results_of(recording)
    empty = replace(full, tracks=no_tracks())
    data = collect(empty, recording)
    assert data["tracks"] == []
    assert data["scores"][0]["tracked_fraction"] == 0.0
    assert "scores" not in collect(full, replace(recording, truth=()))
    alone = collect(full, None)
    assert len(alone["tracks"]) == 2
    assert "sensors" not in alone
    for d in (data, alone):
        assert embedded(render(d))["name"]


def test_results_of_another_recording_are_refused(recording: Recording) -> None:
    full = results_of(recording)
    d = full.decisions
    short = DecisionRows(d.row[:5], d.fate[:5], d.track_id[:5], d.nis[:5], d.reason[:5])
    with pytest.raises(UserError, match="not of one recording"):
        collect(replace(full, decisions=short), recording)


def test_two_thousand_tracks_stay_under_five_megabytes(recording: Recording) -> None:
    rng = np.random.default_rng(5)
    n, each = 2000, 150
    t = 1.7e9 + np.sort(rng.uniform(0.0, 100.0, n))[:, None] + 0.1 * np.arange(each)
    place = rng.uniform(-4000.0, 4000.0, (n, 1, 3)) + rng.normal(0.0, 10.0, (n, 1, 3)) * 0.1 * np.arange(each)[:, None]
    status = rng.integers(1, 3, n * each).astype(np.uint8)
    zero = np.zeros((n * each, 3, 3))
    ids = np.repeat(np.arange(n) + 1, each)
    many = TrackRows(t.ravel(), t.ravel(), ids, status, place.reshape(-1, 3), zero[:, 0], zero + np.eye(3))
    data = collect(replace(results_of(recording), tracks=many), replace(recording, truth=()))
    assert len(data["tracks"]) == n
    assert len(render(data).encode()) < 5e6
    kept = data["tracks"][0]
    first = np.flatnonzero(ids == kept["id"])
    assert kept["x"][0] == round(many.position[first[0], 0] * 10)
    assert kept["x"][-1] == round(many.position[first[-1], 0] * 10)


def test_detections_lie_where_the_targets_were(recording: Recording) -> None:
    truth = recording.truth[0]
    for i, limit in ((0, 30.0), (2, 5.0)):  # radar and lidar: 5 sigma at the range they have
        places = places_of(recording, i)
        want = np.stack([np.interp(places.t, truth.t, truth.position[:, k]) for k in range(2)], axis=1)
        far = np.linalg.norm(places.point[:, :2] - want, axis=1)
        if i == 0:
            assert (far < limit).sum() > 0.8 * 71  # about one detection of it a look, at p = 0.9
        else:
            others = recording.truth[1]
            other = np.stack([np.interp(places.t, others.t, others.position[:, k]) for k in range(2)], axis=1)
            near = np.minimum(far, np.linalg.norm(places.point[:, :2] - other, axis=1)) < limit
            assert near.mean() > 0.5  # the rest is clutter
    rays = places_of(recording, 1)
    line = np.stack([np.interp(rays.t, truth.t, truth.position[:, k]) for k in range(2)], axis=1) - rays.origin[:, :2]
    off = np.angle(np.exp(1j * (rays.azimuth - np.arctan2(line[:, 0], line[:, 1]))))
    assert (abs(off) < np.radians(1.5)).mean() > 0.3  # a third of the bearings are of this boat


def test_a_name_that_looks_like_a_mark_of_the_page_is_a_name() -> None:
    data = {"name": "@@SCRIPT@@ @@DATA@@", "summary": {}}
    page = render(data)
    assert "<title>@@SCRIPT@@ @@DATA@@" in page
    assert page.count("function make(tag") == 1
