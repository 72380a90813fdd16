"""A saved state that is damaged is refused in one line, whatever is wrong with it."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from boresight.engine.track import run
from boresight.errors import UserError
from boresight.io.scans import iter_scans
from boresight.service.restart import NAME, load_state
from boresight.tracking.config import SensorErrors, TrackerConfig
from boresight.tracking.run import tracker_for
from boresight.tracking.saved import Arrays, arrays_of_state, state_of_arrays
from boresight.tracking.tracker import Tracker
from boresight.types import Recording

CONFIG = TrackerConfig()
ANY_INTEGER = ("heard", "beside", "format")  # bits, and the name of a track that may be gone


@pytest.fixture(scope="module")
def saved() -> tuple[Tracker, Arrays]:
    from tests.tracking.conftest import make_recording

    recording = make_recording()
    tracker = tracker_for(recording, CONFIG)
    state, _, _ = run(tracker, list(iter_scans(recording))[:150], finish=False)
    return tracker, arrays_of_state(state)


def _refused(tracker: Tracker, arrays: Arrays) -> None:
    with pytest.raises(UserError, match="saved tracker state: ") as told:
        state_of_arrays(arrays, tracker)
    assert "\n" not in str(told.value)


def _told(call: Callable[[], object]) -> str:
    """Return the error that a call gives its user, empty for none."""
    try:
        call()
    except UserError as error:
        return str(error)
    return ""


def _each(arrays: Arrays, change: Callable[[np.ndarray], np.ndarray | None]) -> list[Arrays]:
    out = []
    for name, array in arrays.items():
        changed = change(array)
        if changed is not None:
            out.append({**arrays, name: changed})
    return out


def _last(array: np.ndarray, value: float) -> np.ndarray:
    out = array.copy()
    out.flat[-1] = value
    return out


def test_every_array_must_have_its_shape_and_type(saved: tuple[Tracker, Arrays]) -> None:
    tracker, arrays = saved
    state_of_arrays(arrays, tracker)
    short = _each(arrays, lambda a: a[..., :-1] if a.size else None)
    long = _each(arrays, lambda a: np.concatenate([a, a[-1:]]) if a.size else None)
    kind = _each(arrays, lambda a: a.astype(np.float32 if a.dtype.kind == "f" else np.int32))
    text = _each(arrays, lambda a: a.astype("U8"))
    deep = _each(arrays, lambda a: a[None])
    flat = _each(arrays, lambda a: np.array(0.0))
    gone = [{k: v for k, v in arrays.items() if k != name} for name in arrays]
    for one in (*short, *long, *kind[1:], *text, *deep, *flat, *gone, {**arrays, "tracks.other": np.zeros(1)}):
        _refused(tracker, one)


def test_every_number_must_be_possible(saved: tuple[Tracker, Arrays]) -> None:
    tracker, arrays = saved
    may_be_nan = ("looks.z", "looks.R", "fates.nis")
    for name, array in arrays.items():
        if not array.size:
            continue
        if array.dtype.kind == "f" and name not in may_be_nan:
            _refused(tracker, {**arrays, name: _last(array, np.nan)})
        if array.dtype.kind == "i" and name.partition(".")[2] not in ANY_INTEGER:
            for value in (2**60, -5):
                _refused(tracker, {**arrays, name: _last(array, value)})
    for name in ("tracks.P", "copies.P", "tracks.anchor_P", "looks.axes", "tracks.x", "tracks.weight", "copies.t"):
        _refused(tracker, {**arrays, name: _last(arrays[name], np.inf)})
    for name in ("tracks.P", "copies.P", "tracks.weight"):
        _refused(tracker, {**arrays, name: -arrays[name]})
    askew = arrays["tracks.P"].copy()
    askew[0, 0, 1] += 0.1 * askew[0, 0, 0]
    _refused(tracker, {**arrays, "tracks.P": askew})
    _refused(tracker, {**arrays, "clock.now": np.array([arrays["clock.now"][0], -1e300, 1.0])})
    _refused(tracker, {**arrays, "looks.first": arrays["looks.first"][::-1].copy()})
    _refused(tracker, {**arrays, "copies.number": arrays["copies.number"] - 1})


def test_states_of_every_age_are_taken(harbour: Recording) -> None:
    scans = list(iter_scans(harbour))
    blob = TrackerConfig(q_manoeuvre=1.0, sensors={"radar": SensorErrors(bias_azimuth=0.01)})
    for config in (CONFIG, TrackerConfig(smoothing_lag=4.0), blob):
        tracker = tracker_for(harbour, config)
        state = tracker.init()
        for k in range(0, 200, 8):
            arrays = arrays_of_state(state)
            again = arrays_of_state(state_of_arrays(arrays, tracker))
            for name, array in arrays.items():
                np.testing.assert_array_equal(again[name], array)
            state, _ = tracker.steps(state, scans[k : k + 8])


def test_any_damage_to_the_file_is_one_line(saved: tuple[Tracker, Arrays], tmp_path: Path) -> None:
    tracker, arrays = saved
    buffer = io.BytesIO()
    np.savez(buffer, about=np.array('{"place": [0, 17]}'), **arrays)  # type: ignore[arg-type]
    whole = buffer.getvalue()
    (tmp_path / NAME).write_bytes(whole)
    loaded = load_state(tmp_path, tracker)
    assert loaded is not None
    assert loaded[1] == (0, 17)
    rng = np.random.default_rng(1)
    for _ in range(300):
        data = bytearray(whole)
        for at in rng.integers(0, len(data), rng.integers(1, 20)):
            data[at] = rng.integers(256)
        if rng.random() < 0.3:
            del data[rng.integers(len(data)) :]
        (tmp_path / NAME).write_bytes(bytes(data))
        told = _told(lambda: load_state(tmp_path, tracker))
        assert "\n" not in told
        assert not told or NAME in told
