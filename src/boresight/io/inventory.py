"""What is in a recording: rates, gaps, out-of-order stamps, duplicates, detections per look."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from boresight.io.detections import MEASURED, UNITS, turned
from boresight.io.scans import iter_scans
from boresight.io.table import in_unit
from boresight.types import FloatArray, Recording


def inventory(recording: Recording) -> list[dict[str, Any]]:
    """Return one row per sensor, platform, target and ignored object (`item` says which), units in the keys."""
    rows = _sensors(recording)
    for track in recording.platforms:
        attitude = not np.isnan(track.ypr[:, 0]).all()
        row = {"item": "platform", "id": track.id, **_path(track.t, track.position), "attitude": attitude}
        rows.append(row | _distance(track.position) | {"at_rest": track.at_rest})
    for truth in recording.truth:
        rows.append({"item": "target", "id": truth.target, **_path(truth.t, truth.position)})
    for other in recording.ignore:
        rows.append({"item": "ignored", "id": other.object, **_path(other.t, other.position)})
    return rows


def _sensors(recording: Recording) -> list[dict[str, Any]]:
    d = recording.detections
    looks: list[list[float]] = [[] for _ in recording.sensors]
    hits: list[list[int]] = [[] for _ in recording.sensors]
    for scan in iter_scans(recording):
        looks[scan.sensor].append(scan.t_look)
        hits[scan.sensor].append(len(scan.t))
    rows: list[dict[str, Any]] = []
    for i, sensor in enumerate(recording.sensors):
        own = (d.sensor == i) & recording.usable
        t = np.array(looks[i])
        steps = np.diff(np.sort(t))
        n = np.array(hits[i], dtype=np.int64)
        rows.append(
            {
                "item": "sensor",
                "id": sensor.id,
                "kind": str(sensor.kind),
                "platform": sensor.platform,
                "rows": int(own.sum()),
                "looks": len(t),
                "empty_looks": int((n == 0).sum()),
                "detections": int(n.sum()),
                "detections_per_look": float(n.mean()) if len(n) else None,
                "start_s": float(d.t[own].min()) if own.any() else None,
                "end_s": float(d.t[own].max()) if own.any() else None,
                "duration_s": float(np.ptp(d.t[own])) if own.any() else None,
                "median_period_s": float(np.median(steps)) if len(steps) else None,
                "declared_period_s": sensor.period,
                "reporting": str(sensor.reporting),
                "axes": str(sensor.axes),
                "refused": int(((d.sensor == i) & ~recording.usable).sum()),
                "measured": measured(recording, own),
                **({} if sensor.station is None else _distance(np.array([sensor.station.position]))),
                "longest_gap_s": float(steps.max()) if len(steps) else None,
                "out_of_order": int((np.diff(t) < 0).sum()),
                "duplicates": int((recording.duplicates & own).sum()),
                "latency_s": sensor.latency,
                "mean_arrival_delay_s": float((d.t_recv - d.t)[own].mean()) if own.any() else None,
            }
        )
    return rows


def measured(recording: Recording, rows: NDArray[np.bool_]) -> dict[str, list[float]]:
    """Return least and largest value of each column that the given rows (n,) measure, as their file has them."""
    d = recording.detections
    z = in_unit(turned(d.z[rows].copy(), recording.sensors, d.sensor[rows]), UNITS)
    return {
        name: [float(np.nanmin(z[:, k])), float(np.nanmax(z[:, k]))]
        for k, name in enumerate(MEASURED)
        if np.isfinite(z[:, k]).any()
    }


def _distance(position: FloatArray) -> dict[str, float]:
    """How near to the site and how far from it positions (n, 3) lie, along the ground (m)."""
    far = np.linalg.norm(position[:, :2], axis=1)
    return {"nearest_m": float(far.min()), "farthest_m": float(far.max())}


def _path(t: FloatArray, position: FloatArray) -> dict[str, Any]:
    steps = np.diff(t)
    return {
        "rows": len(t),
        "start_s": float(t[0]),
        "end_s": float(t[-1]),
        "duration_s": float(t[-1] - t[0]),
        "median_period_s": float(np.median(steps)) if len(steps) else None,
        "longest_gap_s": float(steps.max()) if len(steps) else None,
        "path_m": float(np.linalg.norm(np.diff(position, axis=0), axis=1).sum()),
    }
