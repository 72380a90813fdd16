"""A tracker's state as plain arrays: to copy it, to save it, to go on from it in another process."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boresight.errors import UserError
from boresight.kernels.tracker import Tracks
from boresight.kernels.tracker_copies import EACH, WHOLE, Copies
from boresight.kernels.tracker_looks import Looks
from boresight.kernels.tracker_rows import Clock
from boresight.kernels.tracker_window import Fates
from boresight.tracking.core import copy_tracks
from boresight.tracking.names import Names
from boresight.tracking.saved_check import check_arrays
from boresight.tracking.tracker import Tracker, TrackerState
from boresight.tracking.window import Window, held

Arrays = dict[str, NDArray[np.generic]]
FORMAT = 7


def snapshot(state: TrackerState) -> TrackerState:
    """Return an independent copy: `step` may consume the original."""
    w = held(state.window)
    window = replace(
        w,
        tracks=copy_tracks(w.tracks),
        copies=w.copies._replace(**{name: a.copy() for name, a in _there(w.copies).items()}),
        clock=Clock._make(a.copy() for a in w.clock),
    )
    return TrackerState(window, state.names.copy(), state.smoothed)


def arrays_of_state(state: TrackerState) -> Arrays:
    """Return the state as named arrays (versioned; see `state_of_arrays`)."""
    w, names = held(state.window), state.names
    out: Arrays = {
        "format": np.array([FORMAT]),
        "counts": np.array([w.arrivals, names.given], np.int64),
        "smoothed": np.array([state.smoothed]),
        "names.birth": names.birth,
        "names.number": names.number,
        "names.last": names.last,
    }
    n, c = int(w.tracks.live[0]), int(w.copies.used[0])
    room = {"t": c, "number": c, "first": c + 1} | dict.fromkeys(WHOLE, c) | dict.fromkeys(EACH, int(w.copies.first[c]))
    for name, array in _there(w.tracks).items():
        out[f"tracks.{name}"] = array[:n] if name in EACH else array
    for name, array in _there(w.copies).items():
        out[f"copies.{name}"] = array[: room[name]] if name in room else array
    for prefix, parts in (("looks", w.looks), ("fates", w.fates), ("clock", w.clock)):
        for name, array in parts._asdict().items():
            out[f"{prefix}.{name}"] = array
    return out


def state_of_arrays(arrays: Mapping[str, NDArray[np.generic]], tracker: Tracker) -> TrackerState:
    """Return the state that `arrays_of_state` took apart, for the same tracker.

    Raises UserError where the arrays are of another version, damaged (`saved_check`), or do not fit the tracker.
    """
    if "format" not in arrays or not np.array_equal(arrays["format"], [FORMAT]):
        raise UserError(f"saved tracker state: not of format {FORMAT}; save it again with this version")
    arrays = {name: np.asarray(array) for name, array in arrays.items()}
    lag = tracker.config.smoothing_lag
    check_arrays(arrays, tracker.plan.empty, tracker.length, np.inf if lag is None else None)
    tracks = Tracks(**_parts(arrays, "tracks"))
    window = Window(
        copy_tracks(tracks, max(64, 2 * len(tracks.birth))),
        Copies(**_parts(arrays, "copies")),
        Looks(**_parts(arrays, "looks")),
        Fates(**_parts(arrays, "fates")),
        Clock(**_parts(arrays, "clock")),
        np.arange(len(arrays["looks.t"])),
        len(arrays["looks.t"]),
        int(np.asarray(arrays["counts"])[0]),
    )
    names = Names(int(np.asarray(arrays["counts"])[1]), **_parts(arrays, "names"))
    return TrackerState(window, names, float(np.asarray(arrays["smoothed"], np.float64)[0]))


def _there(item: Tracks | Copies) -> dict[str, Any]:
    """Return the arrays that there are, by name."""
    return {name: array for name, array in item._asdict().items() if array is not None}


def _parts(arrays: Mapping[str, NDArray[np.generic]], prefix: str) -> dict[str, Any]:
    """Return copies of the arrays whose names begin with `prefix` and a dot, by the rest of their names."""
    start = len(prefix) + 1
    return {name[start:]: np.array(a) for name, a in arrays.items() if name.startswith(f"{prefix}.")}
