"""Everything that the report shows, as one compact JSON object. Numbers come from `score` and summary.json."""

from __future__ import annotations

from typing import Any

import numpy as np

from boresight._version import __version__
from boresight.errors import UserError
from boresight.io.inventory import inventory
from boresight.io.results import finite
from boresight.metrics.score import Score, score
from boresight.report.consistency import nees_of, nis_of
from boresight.report.places import places_of
from boresight.report.thin import every, strides, whole
from boresight.types import FATES, STATUSES, DecisionRows, Fate, Recording, RegistrationRows, Results, TrackRows

MAX_TRACK_POINTS = 60_000
MAX_DETECTIONS = 40_000
MAX_TRUTH_POINTS = 20_000
MAX_TARGET_CHARTS = 40
MAX_ERROR_POINTS = 20_000
MAX_REGISTRATION = 600  # points of one constant error
TIME, PLACE = 100.0, 10.0  # times in 10 ms, places in 0.1 m


def collect(results: Results, recording: Recording | None) -> dict[str, Any]:
    """Return the report's data; without a recording only what the results hold."""
    summary = results.summary
    about = summary.get("recording")
    about = about if isinstance(about, dict) else {}
    first, last = _span(results, recording)
    data: dict[str, Any] = {
        "version": summary.get("version", __version__),
        "command": summary.get("command", ""),
        "name": (recording.name if recording else about.get("name")) or "recording",
        "dimensions": recording.dimensions if recording else int(about.get("dimensions") or 2),
        "start_s": first,
        "duration_s": last - first,
        "statuses": [str(s) for s in STATUSES],
        "fates": [str(f) for f in FATES],
        "summary": summary,
    }
    data["tracks"], data["track_step"] = _tracks(results.tracks, first)
    data["track_rows"] = len(results.tracks)
    if results.registration is not None:
        data["registration"] = _registration(results.registration, first)
    data["notes"] = list(recording.notes) if recording is not None else summary.get("notes", [])
    data["outcome"] = _outcome(results.decisions, recording)
    if recording is not None:
        data |= _recorded(recording, results, first, last)
    out: dict[str, Any] = finite(data)
    return out


def _span(results: Results, recording: Recording | None) -> tuple[float, float]:
    if recording is not None:
        return recording.span
    t = results.tracks.t
    return (float(t.min()), float(t.max())) if len(t) else (0.0, 1.0)


def _tracks(rows: TrackRows, first: float) -> tuple[list[dict[str, Any]], int]:
    """One entry per track, thinned evenly so that all together stay small."""
    order = np.lexsort((rows.t, rows.track_id))
    ids, starts = np.unique(rows.track_id[order], return_index=True)
    ends = np.append(starts, len(order))[1:]
    step = strides((ends - starts).tolist(), MAX_TRACK_POINTS)
    changed = np.flatnonzero(np.diff(rows.status[order].astype(np.int64))) + 1  # rows where a status begins
    if len(changed) > MAX_TRACK_POINTS // 4:
        changed = changed[:0]
    out = []
    for track, begin, end in zip(ids.tolist(), starts.tolist(), ends.tolist(), strict=True):
        of = order[begin:end]
        mark = changed[np.searchsorted(changed, begin) : np.searchsorted(changed, end)] - begin
        keep = of[np.unique(np.concatenate([every(len(of), step), mark]))]
        entry = {"id": track, **_path(rows.t[keep] - first, rows.position[keep]), "s": rows.status[keep].tolist()}
        entry["v"] = whole(np.linalg.norm(np.nan_to_num(rows.velocity[keep]), axis=1), 10.0)
        out.append(entry)
    return out, step


def _path(t: Any, position: Any) -> dict[str, Any]:
    entry = {"t": whole(t, TIME), "x": whole(position[:, 0], PLACE), "y": whole(position[:, 1], PLACE)}
    if position.shape[1] > 2 and np.isfinite(position[:, 2]).all() and len(t):
        entry["z"] = whole(position[:, 2], PLACE)
    return entry


def _outcome(decisions: DecisionRows, recording: Recording | None) -> list[dict[str, Any]]:
    """How many rows of each sensor met which fate, and for what reason."""
    sensor = recording.detections.sensor if recording is not None else np.zeros(len(decisions), dtype=np.int64)
    names = [s.id for s in recording.sensors] if recording is not None else ["all"]
    if len(sensor) != len(decisions):
        raise UserError(
            f"the results hold {len(decisions)} decisions, the recording {len(sensor)} rows: not of one recording"
        )
    reasons = [r if isinstance(r, str) else "" for r in decisions.reason]
    words = {w: i for i, w in enumerate(dict.fromkeys(reasons))}
    keys = np.stack(
        [sensor, decisions.fate.astype(np.int64), np.array([words[r] for r in reasons], dtype=np.int64)], axis=1
    )
    found, counts = np.unique(keys, axis=0, return_counts=True)
    known = list(words)
    return [
        {"sensor": names[s], "fate": str(FATES[f]), "reason": known[w], "rows": n}
        for (s, f, w), n in zip(found.tolist(), counts.tolist(), strict=True)
    ]


def _registration(rows: RegistrationRows, first: float) -> list[dict[str, Any]]:
    """Each constant sensor error over time with its standard deviation, in the unit that its name ends with."""
    out = []
    keys = [f"{s} {p}" for s, p in zip(rows.sensor, rows.parameter, strict=True)]
    for key in dict.fromkeys(keys):
        k = np.flatnonzero(np.array(keys) == key)
        keep = k[every(len(k), strides([len(k)], MAX_REGISTRATION))]
        out.append(
            {
                "id": key,
                "verdict": str(rows.verdict[k[-1]]),
                "t": (rows.t[keep] - first).tolist(),
                "v": rows.value[keep].tolist(),
                "s": rows.sigma[keep].tolist(),
                "declared": float(rows.declared[k[-1]]),
            }
        )
    return out


def _recorded(recording: Recording, results: Results, first: float, last: float) -> dict[str, Any]:
    truth_step = strides([len(p.t) for p in recording.truth], MAX_TRUTH_POINTS)
    way_step = strides([len(p.t) for p in recording.platforms], 4000)
    contents = inventory(recording)
    data: dict[str, Any] = {
        "truth": [_thin(p.target, p.t - first, p.position, truth_step) for p in recording.truth],
        "platforms": [_thin(p.id, p.t - first, p.position, way_step) for p in recording.platforms],
        "ignore": [_thin(p.object, p.t - first, p.position, 1) for p in recording.ignore],
        "inventory": contents,
        "sensors": _detections(recording, results.decisions, first),
        "looks": _looks(recording, contents, first, last),
        "nis": nis_of(recording, results.decisions, first, last),
    }
    if recording.truth:
        try:
            scored = score(recording, results.tracks, results.decisions, results.summary.get("sensors"))
        except UserError as error:  # nothing that the tracker used can be scored: the rest is shown
            return data | {"notes": [*recording.notes, str(error)]}
        data |= _scored(scored, recording.dimensions, first, last)
        data["notes"] = [*recording.notes, *scored.notes]
    return data


def _thin(name: str, t: Any, position: Any, step: int) -> dict[str, Any]:
    keep = every(len(t), step)
    return {"id": name, **_path(t[keep], position[keep])}


def _detections(recording: Recording, decisions: DecisionRows, first: float) -> list[dict[str, Any]]:
    """Points and rays of each sensor, thinned evenly; `u` says whether a track used them."""
    used = np.isin(decisions.fate, [FATES.index(Fate.UPDATED), FATES.index(Fate.INITIATED)])
    step = strides([len(recording.detections)], MAX_DETECTIONS)
    out = []
    for i, sensor in enumerate(recording.sensors):
        places = places_of(recording, i)
        has_range = np.isfinite(places.point[:, 0])
        entry: dict[str, Any] = {"id": sensor.id, "kind": str(sensor.kind), "step": step}
        k = np.flatnonzero(has_range)[::step]
        point = places.point[k] if recording.dimensions == 3 else places.point[k, :2]
        entry["points"] = {**_path(places.t[k] - first, point), "u": used[places.row[k]].astype(int).tolist()}
        k = np.flatnonzero(~has_range)[::step]
        entry["rays"] = {
            **_path(places.t[k] - first, places.origin[k, :2]),
            "a": whole(np.degrees(places.azimuth[k]), 10.0),
            "u": used[places.row[k]].astype(int).tolist(),
        }
        out.append(entry)
    return out


def _looks(recording: Recording, rows: list[dict[str, Any]], first: float, last: float) -> list[dict[str, Any]]:
    """Rows per even bin of time for each sensor: shows rates and gaps. A bin holds two looks of the slowest sensor."""
    d = recording.detections
    slowest = max([row["median_period_s"] or 0.0 for row in rows if row["item"] == "sensor"], default=0.0)
    first, last = first - 0.5 * slowest, max(last, first) + 0.5 * slowest + 1e-9  # no look on an edge
    bins = int(np.clip((last - first) / max(2.0 * slowest, 1e-9), 20, 120))
    edges = np.linspace(first, last, bins + 1)
    return [
        {"id": s.id, "n": np.histogram(d.t[d.sensor == i], edges)[0].tolist()} for i, s in enumerate(recording.sensors)
    ]


def _scored(scored: Score, dimensions: int, first: float, last: float) -> dict[str, Any]:
    shown = [t for t in scored.targets if t.times][:MAX_TARGET_CHARTS]
    step = strides([len(t.times) * 2 * dimensions for t in shown], MAX_ERROR_POINTS)
    errors = []
    for target in shown:
        keep = every(len(target.times), step)
        e, s = np.array(target.errors)[keep], np.array(target.sigmas)[keep]
        errors.append(
            {
                "id": target.target,
                "t": whole(np.array(target.times)[keep] - first, TIME),
                "e": [whole(e[:, k], 100.0) for k in range(dimensions)],
                "s": [whole(s[:, k], 100.0) for k in range(dimensions)],
            }
        )
    held = [{"id": t.target, "tracks": t.tracks} for t in scored.targets]
    gospa = {"t": whole(scored.clock - first, TIME), "v": whole(scored.gospa[:, 0], 100.0)}
    return {
        "errors": errors,
        "held": held,
        "gospa": gospa,
        "scores": scored.rows,
        "nees": nees_of(scored, dimensions, first, last),
    }
