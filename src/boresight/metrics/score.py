"""How good tracks are: set distances, targets held, identities, honesty of the covariances."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist
from scipy.stats import chi2

from boresight.errors import UserError
from boresight.metrics.clock import STEP, Sampled, clock_of, interpolate, sample_ignored, sample_tracks, sample_truth
from boresight.metrics.sets import gospa, ospa
from boresight.types import (
    FATES,
    Component,
    DecisionRows,
    Fate,
    FloatArray,
    Recording,
    TrackRows,
    Truth,
    no_tracks,
)

CUT_OFF = 20.0  # m, of GOSPA, OSPA and of the matching, where sensors and reference are exact enough
ORDER, ALPHA = 2, 2  # p and alpha of GOSPA
SIGMAS = 5.0  # of the best sensor's or the reference's noise, that the cut-off spans at least
FAR = 20.0  # cut-offs: no track as near to any target says that places do not fit


@dataclass(slots=True, eq=False)
class TargetScore:
    """How one target was followed."""

    target: str
    present: int = 0  # clock times at which it was there
    held: int = 0  # … and had a track within the cut-off
    squared_error: list[float] = field(default_factory=list)  # m²
    nees: list[float] = field(default_factory=list)  # of every row of the tracks that are of it, however far
    nees_times: list[float] = field(default_factory=list)  # s
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
    """The whole score of one result; `rows` are what `boresight score --json` prints, `notes` what is to be known."""

    clock: FloatArray  # (n,) s
    gospa: FloatArray  # (n, 4) distance (m), then localisation, missed, false (m²)
    ospa: FloatArray  # (n,) m
    false_tracks: FloatArray  # (n,) number of tracks that follow nothing
    targets: list[TargetScore]
    rows: list[dict[str, Any]]
    cut_off: float = CUT_OFF  # m
    notes: tuple[str, ...] = ()


def default_cut_off(recording: Recording) -> float:
    """Return a cut-off (m) that a track as good as the best ranging sensor stays within.

    Five standard deviations per axis of that sensor (median of its detections, all sensors asked) or of the truth,
    rounded up to 1, 2 or 5 times a power of ten; at least 20 m.
    """
    d = recording.detections
    sigma = [float(np.median(known)) for t in recording.truth if t.sigma is not None and len(known := _known(t.sigma))]
    noise = [max(sigma)] if sigma else []
    best = []
    for i in range(len(recording.sensors)):
        mine = np.flatnonzero((d.sensor == i) & recording.usable)
        r, z = d.sigma[mine], d.z[mine]
        polar = np.sqrt(0.5 * (r[:, Component.RANGE] ** 2 + (z[:, Component.RANGE] * r[:, Component.AZIMUTH]) ** 2))
        each = _known(np.where(np.isfinite(r[:, Component.EAST]), r[:, Component.EAST], polar))
        if len(each):
            best.append(float(np.median(each)))
    wanted = SIGMAS * max([*noise, min(best, default=0.0)])
    if wanted <= CUT_OFF:
        return CUT_OFF
    scale = 10.0 ** math.floor(math.log10(wanted))
    return next(k * scale for k in (1.0, 2.0, 5.0, 10.0) if k * scale >= wanted * (1.0 - 1e-9))


def _known(values: FloatArray) -> FloatArray:
    return values[np.isfinite(values)]


def score(
    recording: Recording,
    tracks: TrackRows,
    decisions: DecisionRows | None = None,
    sensors: Any = None,
    cut_off: float | None = None,
) -> Score:
    """Score tracks against the truth of a recording on a 0.5 s clock, causally.

    `sensors` are the ids whose first and last detection span the clock (all). Unmatched tracks near objects of
    `ignore` are left out. `cut_off` (m) is that of GOSPA, OSPA and the matching (`default_cut_off`). Raises UserError
    for a recording without truth or without detections.
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
    c = default_cut_off(recording) if cut_off is None else cut_off
    if not 0.0 < c < math.inf:
        raise UserError(f"--cut-off-m: {c} m; give a distance above zero")
    ours = _walk(recording, truth, tracks, clock, c)
    empty = _walk(recording, truth, no_tracks(), clock, c)
    rows = [_row("tracks", ours, d), _row("empty tracker", empty, d)]
    rows += [_target_row(t, d) for t in ours.targets]
    if decisions is not None:
        rows += nis_rows(recording, decisions)
    notes = tuple(_overlap(recording, truth, sample_tracks(tracks, clock, d), clock, c))
    return Score(ours.clock, ours.gospa, ours.ospa, ours.false_tracks, ours.targets, rows, c, notes)


def _overlap(
    recording: Recording, truth: list[Sampled], tracks: list[Sampled], clock: FloatArray, c: float
) -> Iterator[str]:
    """Say where truth and detections, or truth and tracks, have nothing in common."""
    first, last = min(float(t.t[0]) for t in recording.truth), max(float(t.t[-1]) for t in recording.truth)
    if not any(t.present.any() for t in truth):
        yield (
            f"truth ({first:.10g} … {last:.10g} s) and detections ({clock[0]:.10g} … {clock[-1]:.10g} s) do not "
            "overlap in time: nothing can be scored; their stamps are to count from the same epoch"
        )
        return
    nearest = math.inf
    for track in tracks:
        for target in truth:
            both = track.present & target.present
            if both.any():
                off = np.linalg.norm(track.position[both] - target.position[both], axis=1)
                nearest = min(nearest, float(off.min()))
    if FAR * c < nearest < math.inf:
        yield (
            f"no track comes nearer to any target than {nearest:.4g} m: do truth and sensors have the same site, axes "
            "and sign of angles?"
        )
    covered = sum(int(t.present.sum()) for t in truth)
    possible = sum(max(float(t.t[-1] - t.t[0]), STEP) / STEP for t in recording.truth)
    if covered < 0.5 * possible:
        yield f"only {covered / possible:.0%} of the truth lies in the time of the detections; the rest is not scored"


def _every_nees(
    targets: list[TargetScore],
    truth: Sequence[Truth],
    rows: TrackRows,
    d: int,
    held: list[dict[str | int, int]],
    clock: FloatArray,
    reach: float,
) -> None:
    """Note the normalised error of every row of every track, against the target that it holds or else is of.

    A track is of the target that it is nearest to in the median, if within `reach` (m). A covariance that is too small
    is not excused by an error beyond the cut-off, nor by another track of the same target.
    """
    at = np.clip(np.searchsorted(clock, rows.t, side="right") - 1, 0, len(clock) - 1)
    for name in np.unique(rows.track_id).tolist():
        mine = np.flatnonzero(rows.track_id == name)
        t = rows.t[mine]
        errors = [rows.position[mine, :d] - interpolate(t, one.t, one.position[:, :d]) for one in truth]
        there = [(t >= one.t[0]) & (t <= one.t[-1]) for one in truth]
        off = [
            np.median(np.linalg.norm(e[k], axis=1)) if k.any() else np.inf for e, k in zip(errors, there, strict=True)
        ]
        own = int(np.argmin(off)) if min(off) <= reach else -1
        of = np.array([held[k].get(name, own) for k in at[mine].tolist()])
        for i, one in enumerate(truth):
            k = np.flatnonzero((of == i) & there[i])
            if not len(k):
                continue
            covariance = rows.covariance[mine[k], :d, :d]
            if one.sigma is not None:  # the reference has an error of its own
                sigma = np.nan_to_num(np.interp(t[k], one.t, one.sigma))
                covariance = covariance + np.eye(d) * sigma[:, None, None] ** 2
            error = errors[i][k]
            targets[i].nees += normalised(error, covariance).tolist()
            targets[i].nees_times += t[k].tolist()


def normalised(error: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return e' P^-1 e (n,) of errors (n, d) and covariances (n, d, d); infinite where a covariance is singular."""
    variance = np.linalg.eigvalsh(covariance)
    good = variance[:, 0] > 1e-14 * np.maximum(variance[:, -1], 1e-300)
    out = np.full(len(error), np.inf)
    turned = np.linalg.solve(covariance[good], error[good, :, None])[:, :, 0]
    out[good] = np.einsum("ki,ki->k", error[good], turned)
    return out


def _walk(recording: Recording, truth: list[Sampled], rows: TrackRows, clock: FloatArray, c: float) -> Score:
    n = len(clock)
    d = recording.dimensions
    tracks = sample_tracks(rows, clock, d)
    distances, ospas, false = np.zeros((n, 4)), np.zeros(n), np.zeros(n)
    targets = [TargetScore(str(t.name)) for t in truth]
    ignored = [sample_ignored(i, clock) for i in recording.ignore]
    held: list[dict[str | int, int]] = []
    for k in range(n):
        there = [t for t in truth if t.present[k]]
        live = [t for t in tracks if t.present[k]]
        x = np.array([t.position[k] for t in there]).reshape(-1, d)
        y = np.array([t.position[k] for t in live]).reshape(-1, d)
        g = gospa(x, y, c)
        matched = {j for _, j in g.pairs}
        keep = [j for j in range(len(live)) if j in matched or not _is_ignored(y[j], ignored, k)]
        if len(keep) < len(live):
            live, y = [live[j] for j in keep], y[keep]
            g = gospa(x, y, c)
        distances[k] = g.distance, g.localisation, g.missed, g.false
        ospas[k] = ospa(x, y, c, pairs=g.pairs)
        false[k] = len(live) - len(g.pairs)
        held.append(_hold(targets, truth, live, k, float(clock[k]), c))
    reach = max(c, default_cut_off(recording))
    _every_nees(targets, recording.truth, rows, d, held, clock, reach)
    return Score(clock, distances, ospas, false, targets, [], c)


def _is_ignored(position: FloatArray, ignored: list[tuple[Any, FloatArray, FloatArray]], k: int) -> bool:
    return any(
        bool(present[k]) and float(np.linalg.norm(position[:2] - path[k])) <= radius[k]
        for present, path, radius in ignored
    )


def _hold(
    targets: list[TargetScore], truth: list[Sampled], live: list[Sampled], k: int, time: float, c: float
) -> dict[str | int, int]:
    """Match stickily: a target keeps its track while that is within the cut-off, else takes the nearest free one.

    Returns the target that each matched track holds.
    """
    by_id = {t.name: t for t in live}
    kept: dict[int, Sampled] = {}
    for i, target in enumerate(truth):
        name = targets[i].track
        held = by_id.get(name) if name is not None and target.present[k] else None
        if held is not None and math.dist(target.position[k], held.position[k]) <= c:
            kept[i] = held
    used = {s.name for s in kept.values()}
    free = [t for t in live if t.name not in used]
    asking = [i for i, t in enumerate(truth) if t.present[k] and i not in kept]
    if asking and free:
        far = cdist([truth[i].position[k] for i in asking], [t.position[k] for t in free])
        near = np.argwhere(far <= c)
        taken: set[int] = set()
        for _, a, n in sorted((far[a, n], a, n) for a, n in near.tolist()):
            if asking[a] not in kept and n not in taken:
                kept[asking[a]] = free[n]
                taken.add(n)
    for i, target in enumerate(truth):
        if target.present[k]:
            _note(targets[i], target, kept.get(i), k, time)
    return {track.name: i for i, track in kept.items()}


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
    score.squared_error.append(float(error @ error))
    assert track.covariance is not None
    score.times.append(time)
    score.errors.append(error)
    score.sigmas.append(np.sqrt(np.diag(track.covariance[k])))


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
        "nees_rows": len(nees),
        "cut_off_m": s.cut_off,
        "gospa_order": ORDER,
        "gospa_alpha": ALPHA,
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
        "nees_median": float(np.median(nees)) if len(nees) else None,
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
