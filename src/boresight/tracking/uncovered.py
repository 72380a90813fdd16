"""Why a report has no pose: what of its platform's navigation is missing at its time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from boresight.frames.pose import PoseTrack
from boresight.types import FloatArray, Recording


def why_uncovered(
    recording: Recording, poses: Mapping[str, PoseTrack], rows: NDArray[np.int64]
) -> list[tuple[int, str]]:
    """Return rows of the detections that were screened for want of a pose, with what is missing in words."""
    d = recording.detections
    out = []
    of_look: dict[tuple[int, int], str] = {}
    left = []
    for row in rows.tolist():
        sensor = recording.sensors[d.sensor[row]]
        track = poses.get(sensor.platform or "")
        if track is None:
            continue
        t, known = float(d.t[row]) - sensor.latency, float(d.t_recv[row])
        name = f"of platform '{track.id}'"
        why = _missing(track.t, track.arrived, t, known, track, f"the navigation {name}")
        if why is None and len(track.t_attitude):
            why = _missing(track.t_attitude, track.arrived_attitude, t, known, track, f"the attitude {name}")
        look = int(d.sensor[row]), int(d.scan[row])
        if why is None:  # the rest of its look has none
            left.append((row, look))
        else:
            of_look[look] = why
            out.append((row, why))
    return out + [(row, of_look[look]) for row, look in left if look in of_look]


def _missing(nodes: FloatArray, arrived: FloatArray, t: float, known: float, track: PoseTrack, what: str) -> str | None:
    n = int(np.searchsorted(arrived, known, side="right"))
    if n == 0 or t < nodes[0] - track.max_extrapolation:
        return f"{what} begins later, at {nodes[0]:.10g} s"
    last = float(nodes[n - 1])
    if t > last + track.max_extrapolation:
        if n == len(nodes):
            return f"{what} ends earlier, at {last:.10g} s (it is taken on for {track.max_extrapolation:g} s)"
        later = float(nodes[n]) - last
        return (
            f"{what} has a gap of {later:.4g} s after {last:.10g} s (it is taken on for {track.max_extrapolation:g} s)"
        )
    i = int(np.clip(np.searchsorted(nodes[:n], t, side="right") - 1, 0, max(n - 2, 0)))
    if n > 1 and nodes[i] < t < nodes[i + 1] and nodes[i + 1] - nodes[i] > track.max_gap:
        gap = float(nodes[i + 1] - nodes[i])
        return f"{what} has a gap of {gap:.4g} s after {nodes[i]:.10g} s (it is bridged up to {track.max_gap:g} s)"
    return None
