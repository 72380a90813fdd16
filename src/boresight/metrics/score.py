"""How good tracks are: set distances, targets held, identities, honesty of the covariances."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist
from scipy.stats import chi2

from boresight.errors import UserError
from boresight.metrics.clock import STEP, Sampled, clock_of, sample_ignored, sample_tracks, sample_truth
from boresight.metrics.sets import gospa, ospa
from boresight.types import (
    FATES,
    Component,
    DecisionRows,
    Fate,
    FloatArray,
    Recording,
    TrackRows,
    no_tracks,
)

CUT_OFF = 20.0  # m, of GOSPA, OSPA and of the matching


@dataclass(slots=True, eq=False)
class TargetScore:
    """How one target was followed."""

    target: str
    present: int = 0  # clock times at which it was there
    held: int = 0  # … and had a track within the cut-off
    squared_error: list[float] = field(default_factory=list)  # m²
    nees: list[float] = field(default_factory=list)
    times: list[float] = field(default_factory=list)  # s, of the errors
    errors: list[FloatArray] = field(default_factory=list)  # (d,) m, track minus truth
    sigmas: list[FloatArray] = field(default_factory=list)  # (d,) m
    track: int | None = None  # the one that holds it (sticky)
    tracks: list[int] = field(default_factory=list)  # all that held it, in order
    switches: int = 0
    breaks: int = 0
    was_held: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Score:
    """The whole score of one result; `rows` are what `boresight score --json` prints."""

    clock: FloatArray  # (n,) s
    gospa: FloatArray  # (n, 4) distance (m), then localisation, missed, false (m²)
    ospa: FloatArray  # (n,) m
    false_tracks: FloatArray  # (n,) number of tracks that follow nothing
    targets: list[TargetScore]
    rows: list[dict[str, Any]]


def score(recording: Recording, tracks: TrackRows, decisions: DecisionRows | None = None, sensors: Any = None) -> Score:
    """Score tracks against the truth of a recording on a 0.5 s clock, causally.

    `sensors` are the ids whose first and last detection span the clock (all). Unmatched tracks near objects of
    `ignore` are left out. Raises UserError for a recording without truth or without detections.
    """
    if not recording.truth:
        raise UserError(f"recording '{recording.name}' has no truth (truth.parquet): tracks cannot be scored")
    d = recording.dimensions
    used = [i for i, s in enumerate(recording.sensors) if sensors is None or s.id in sensors]
    stamps = recording.detections.t[np.isin(recording.detections.sensor, used) & recording.usable]
    if len(stamps) == 0:
        raise UserError(f"recording '{recording.name}' has no detections of these sensors: nothing to score")
    clock = clock_of(stamps)
    truth = [sample_truth(t, clock, d) for t in recording.truth]
    ours = _walk(recording, truth, sample_tracks(tracks, clock, d), clock)
    empty = _walk(recording, truth, sample_tracks(no_tracks(), clock, d), clock)
    rows = [_row("tracks", ours, d), _row("empty tracker", empty, d)]
    rows += [_target_row(t, d) for t in ours.targets]
    if decisions is not None:
        rows += nis_rows(recording, decisions)
    return Score(ours.clock, ours.gospa, ours.ospa, ours.false_tracks, ours.targets, rows)


def _walk(recording: Recording, truth: list[Sampled], tracks: list[Sampled], clock: FloatArray) -> Score:
    n = len(clock)
    d = recording.dimensions
    distances, ospas, false = np.zeros((n, 4)), np.zeros(n), np.zeros(n)
    targets = [TargetScore(str(t.name)) for t in truth]
    ignored = [sample_ignored(i, clock) for i in recording.ignore]
    for k in range(n):
        there = [t for t in truth if t.present[k]]
        live = [t for t in tracks if t.present[k]]
        x = np.array([t.position[k] for t in there]).reshape(-1, d)
        y = np.array([t.position[k] for t in live]).reshape(-1, d)
        g = gospa(x, y, CUT_OFF)
        matched = {j for _, j in g.pairs}
        keep = [j for j in range(len(live)) if j in matched or not _is_ignored(y[j], ignored, k)]
        if len(keep) < len(live):
            live, y = [live[j] for j in keep], y[keep]
            g = gospa(x, y, CUT_OFF)
        distances[k] = g.distance, g.localisation, g.missed, g.false
        ospas[k] = ospa(x, y, CUT_OFF, pairs=g.pairs)
        false[k] = len(live) - len(g.pairs)
        _hold(targets, truth, live, k, float(clock[k]))
    return Score(clock, distances, ospas, false, targets, [])


def _is_ignored(position: FloatArray, ignored: list[tuple[Any, FloatArray, FloatArray]], k: int) -> bool:
    return any(
        bool(present[k]) and float(np.linalg.norm(position[:2] - path[k])) <= radius[k]
        for present, path, radius in ignored
    )


def _hold(targets: list[TargetScore], truth: list[Sampled], live: list[Sampled], k: int, time: float) -> None:
    """Match stickily: a target keeps its track while that is within the cut-off, else takes the nearest free one."""
    by_id = {t.name: t for t in live}
    kept: dict[int, Sampled] = {}
    for i, target in enumerate(truth):
        name = targets[i].track
        held = by_id.get(name) if name is not None and target.present[k] else None
        if held is not None and math.dist(target.position[k], held.position[k]) <= CUT_OFF:
            kept[i] = held
    used = {s.name for s in kept.values()}
    free = [t for t in live if t.name not in used]
    asking = [i for i, t in enumerate(truth) if t.present[k] and i not in kept]
    if asking and free:
        far = cdist([truth[i].position[k] for i in asking], [t.position[k] for t in free])
        near = np.argwhere(far <= CUT_OFF)
        taken: set[int] = set()
        for _, a, n in sorted((far[a, n], a, n) for a, n in near.tolist()):
            if asking[a] not in kept and n not in taken:
                kept[asking[a]] = free[n]
                taken.add(n)
    for i, target in enumerate(truth):
        if target.present[k]:
            _note(targets[i], target, kept.get(i), k, time)


def _note(score: TargetScore, target: Sampled, track: Sampled | None, k: int, time: float) -> None:
    score.present += 1
    if track is None:
        score.was_held = False
        return
    name = int(track.name)
    if score.held and not score.was_held:
        score.breaks += 1
    if score.track is not None and score.track != name:
        score.switches += 1
    if name not in score.tracks:
        score.tracks.append(name)
    score.track, score.was_held = name, True
    score.held += 1
    error = track.position[k] - target.position[k]
    assert track.covariance is not None
    covariance = track.covariance[k]
    score.squared_error.append(float(error @ error))
    score.nees.append(float(error @ np.linalg.solve(covariance, error)))
    score.times.append(time)
    score.errors.append(error)
    score.sigmas.append(np.sqrt(np.diag(covariance)))


def _mean(values: Any) -> float | None:
    return float(np.mean(values)) if len(values) else None


def _row(item: str, s: Score, d: int) -> dict[str, Any]:
    nees = np.array([v for t in s.targets for v in t.nees])
    squared = [v for t in s.targets for v in t.squared_error]
    present = sum(t.present for t in s.targets)
    low, high = chi2.ppf([0.025, 0.975], d)
    parts = np.sqrt(s.gospa[:, 1:].mean(axis=0))
    return {
        "item": item,
        "gospa_mean_m": float(s.gospa[:, 0].mean()),
        "gospa_rms_m": float(np.sqrt((s.gospa[:, 0] ** 2).mean())),
        "gospa_localisation_m": float(parts[0]),
        "gospa_missed_m": float(parts[1]),
        "gospa_false_m": float(parts[2]),
        "ospa_mean_m": float(s.ospa.mean()),
        "ospa_rms_m": float(np.sqrt((s.ospa**2).mean())),
        "tracked_fraction": sum(t.held for t in s.targets) / present if present else None,
        "position_rmse_m": float(np.sqrt(np.mean(squared))) if squared else None,
        "identity_switches": sum(t.switches for t in s.targets),
        "breaks": sum(t.breaks for t in s.targets),
        "false_track_s": float(s.false_tracks.sum() * STEP),
        "nees_mean": _mean(nees),
        "nees_median": float(np.median(nees)) if len(nees) else None,
        "nees_in_band_95": _mean((nees >= low) & (nees <= high)),
        "nees_band_95_low": float(low),
        "nees_band_95_high": float(high),
        "clock_times": len(s.clock),
    }


def _target_row(t: TargetScore, d: int) -> dict[str, Any]:
    low, high = chi2.ppf([0.025, 0.975], d)
    nees = np.array(t.nees)
    return {
        "item": "target",
        "target": t.target,
        "tracked_fraction": t.held / t.present if t.present else None,
        "position_rmse_m": float(np.sqrt(np.mean(t.squared_error))) if t.held else None,
        "identity_switches": t.switches,
        "breaks": t.breaks,
        "track_ids": t.tracks,
        "nees_mean": _mean(nees),
        "nees_median": float(np.median(nees)) if t.held else None,
        "nees_in_band_95": _mean((nees >= low) & (nees <= high)),
    }


def degrees_of_freedom(recording: Recording) -> NDArray[np.int64]:
    """Return (n,) how many components of each row a track of the recording's dimensions can be compared with."""
    flat = [Component.ELEVATION, Component.UP] if recording.dimensions == 2 else []
    measured = np.isfinite(recording.detections.z)
    measured[:, flat] = False
    dof: NDArray[np.int64] = measured.sum(axis=1)
    return dof


def nis_rows(recording: Recording, decisions: DecisionRows) -> list[dict[str, Any]]:
    """Return per sensor how its normalised innovations compare with chi-square, and what became of its reports."""
    dof = degrees_of_freedom(recording)
    updated = decisions.fate == FATES.index(Fate.UPDATED)
    out = []
    for i, sensor in enumerate(recording.sensors):
        mine = recording.detections.sensor == i
        hit = mine & updated & np.isfinite(decisions.nis)
        nis, m = decisions.nis[hit], dof[hit]
        low, high = chi2.ppf([[0.025], [0.975]], np.maximum(m, 1)) if len(m) else (np.zeros(0), np.zeros(0))
        fates = {f"reports_{fate}": int((decisions.fate[mine] == c).sum()) for c, fate in enumerate(FATES)}
        out.append(
            {
                "item": "sensor",
                "sensor": sensor.id,
                "reports": int(mine.sum()),
                "nis_per_dof": _mean(nis / m) if len(m) else None,
                "nis_in_band_95": _mean((nis >= low) & (nis <= high)),
                **{k: v for k, v in fates.items() if v},
            }
        )
    return out
