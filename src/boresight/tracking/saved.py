"""A tracker's state as plain arrays: to copy it, to save it, to go on from it in another process."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from boresight.errors import UserError
from boresight.kernels.tracker import Look, Tracks
from boresight.tracking.core import PER_TRACK, copy_tracks
from boresight.tracking.output import Clock
from boresight.tracking.tracker import Tracker, TrackerState
from boresight.tracking.window import Entry, Window

Arrays = dict[str, NDArray[np.generic]]
FORMAT = 2


def snapshot(state: TrackerState) -> TrackerState:
    """Return an independent copy: `step` may consume the original."""
    window, clock = state.window, state.clock
    return TrackerState(
        Window(
            copy_tracks(window.tracks),
            window.arrivals,
            # looks and past results are never written to: they can be shared
            [Entry(e.key, e.sensor, e.look, e.fate, e.owner, e.nis) for e in window.entries],
            list(window.copies),
        ),
        Clock(clock.arrival, clock.emitted, dict(clock.last), {k: list(v) for k, v in clock.gaps.items()}),
        state.pending,
        state.numbered,
        dict(state.names),
        dict(state.last_row),
        state.smoothed,
    )


def arrays_of_state(state: TrackerState) -> Arrays:
    """Return the state as named arrays (versioned; see `state_of_arrays`)."""
    window, clock = state.window, state.clock
    out: Arrays = {
        "format": np.array([FORMAT]),
        "scalars": np.array(
            [window.arrivals, len(window.entries), len(window.copies), state.pending, state.numbered], np.int64
        ),
        "clock": np.array([clock.arrival, clock.emitted, state.smoothed]),
        "last": np.array(list(clock.last.items()), np.float64).reshape(-1, 2),
        "names": np.array(list(state.names.items()), np.int64).reshape(-1, 2),
        "last_row": np.array(list(state.last_row.values()), np.float64),
        "copy_keys": np.array([key for key, _ in window.copies], np.float64).reshape(-1, 2),
        "entry_keys": np.array([(*e.key, e.sensor) for e in window.entries], np.float64).reshape(-1, 3),
    }
    for sensor, gaps in clock.gaps.items():
        out[f"gaps.{sensor}"] = np.array(gaps)
    _put_tracks(out, "tracks", window.tracks)
    for i, (_, tracks) in enumerate(window.copies):
        _put_tracks(out, f"copy.{i}", tracks)
    for i, entry in enumerate(window.entries):
        for name, value in entry.look._asdict().items():
            out[f"entry.{i}.{name}"] = np.asarray(value)
        out[f"entry.{i}.fate"], out[f"entry.{i}.owner"], out[f"entry.{i}.nis"] = entry.fate, entry.owner, entry.nis
    return out


def state_of_arrays(arrays: Mapping[str, NDArray[np.generic]], tracker: Tracker) -> TrackerState:
    """Return the state that `arrays_of_state` took apart, for the same tracker.

    Raises UserError where the arrays are of another version or do not fit the tracker's sensors and settings.
    """
    if "format" not in arrays or int(arrays["format"][0]) != FORMAT:
        raise UserError(f"saved tracker state: not of format {FORMAT}; save it again with this version")
    if arrays["tracks.x"].shape[1] != tracker.plan.n_states or len(arrays["tracks.last_look"]) != len(tracker.sensors):
        raise UserError("saved tracker state: made with other sensors or settings; use the same recording and --config")
    arrivals, n_entries, n_copies, pending, numbered = (int(v) for v in np.asarray(arrays["scalars"], np.int64))
    arrival, emitted, smoothed = (float(v) for v in np.asarray(arrays["clock"], np.float64))
    clock = Clock(arrival, emitted)
    clock.last = {int(s): float(t) for s, t in np.asarray(arrays["last"], np.float64)}
    for name, gaps in arrays.items():
        if name.startswith("gaps."):
            clock.gaps[int(name[5:])] = np.asarray(gaps, np.float64).tolist()
    copies = [
        ((float(key[0]), int(key[1])), _take_tracks(arrays, f"copy.{i}"))
        for i, key in zip(range(n_copies), np.asarray(arrays["copy_keys"], np.float64), strict=True)
    ]
    entries = [
        _take_entry(arrays, i, key)
        for i, key in zip(range(n_entries), np.asarray(arrays["entry_keys"], np.float64), strict=True)
    ]
    names = {int(birth): int(name) for birth, name in np.asarray(arrays["names"], np.int64)}
    last_row = dict(zip(names, np.asarray(arrays["last_row"], np.float64).tolist(), strict=True))
    window = Window(_take_tracks(arrays, "tracks"), arrivals, entries, copies)
    return TrackerState(window, clock, bool(pending), numbered, names, last_row, smoothed)


def _put_tracks(out: Arrays, prefix: str, tracks: Tracks) -> None:
    n = int(tracks.live[0])
    for name, array in tracks._asdict().items():
        out[f"{prefix}.{name}"] = array[:n] if name in PER_TRACK else array


def _take_tracks(arrays: Mapping[str, NDArray[np.generic]], prefix: str) -> Tracks:
    parts = {name: np.array(arrays[f"{prefix}.{name}"]) for name in Tracks._fields}
    return copy_tracks(Tracks(**parts), max(64, 2 * len(parts["birth"])))


def _take_entry(arrays: Mapping[str, NDArray[np.generic]], i: int, key: NDArray[np.float64]) -> Entry:
    parts = {name: np.ascontiguousarray(arrays[f"entry.{i}.{name}"]) for name in Look._fields if name != "t"}
    look = Look(t=float(np.asarray(arrays[f"entry.{i}.t"], np.float64)), **parts)
    fate, owner, nis = (np.array(arrays[f"entry.{i}.{name}"]) for name in ("fate", "owner", "nis"))
    return Entry((float(key[0]), int(key[1])), int(key[2]), look, fate, owner, nis)
