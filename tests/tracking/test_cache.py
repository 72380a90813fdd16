"""Compiling the tracker in a second process."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba import njit, typeof

from boresight.cli.track import loading
from boresight.kernels.tracker_window import advance
from boresight.tracking import cache
from boresight.tracking.config import TrackerConfig
from boresight.tracking.tracker import Tracker
from boresight.tracking.warm import warm, warm_poses, warm_tracker
from boresight.types import Scan, Sensor, SensorKind


def test_the_second_process_runs_both_trackers() -> None:
    """In plain Python: what is compiled is not the matter here, that it is called is."""
    done = subprocess.run(
        cache.warming(3, (0.0, 0.1)), env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_waits_for_the_second_process_unless_the_body_fails(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    said = tmp_path / "said"
    write = f"import pathlib, time; time.sleep(0.5); pathlib.Path({str(said)!r}).write_text('done')"
    monkeypatch.setattr(cache, "warming", lambda *_: [sys.executable, "-c", write])
    monkeypatch.setattr(cache, "compiled", lambda: False)
    with cache.compiling_beside(3) as compiles:
        assert compiles
        assert not said.exists()
    assert said.read_text() == "done"
    said.unlink()
    with pytest.raises(KeyboardInterrupt), cache.compiling_beside(3):
        raise KeyboardInterrupt
    time.sleep(1.0)
    assert not said.exists()  # it was stopped


def test_garbage_is_looked_for_seldom_while_something_compiles_and_then_as_before(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    before = gc.get_threshold()
    monkeypatch.setattr(cache, "compiled", lambda: False)
    monkeypatch.setattr(cache, "warming", lambda *_: [sys.executable, "-c", ""])
    monkeypatch.setattr(Tracker, "tick", lambda *_: found.append(gc.get_threshold()[0]))
    found: list[int] = []
    with cache.compiling_beside(3):
        found.append(gc.get_threshold()[0])
    with loading():
        found.append(gc.get_threshold()[0])
    warm(3)
    with pytest.raises(KeyboardInterrupt), cache.seldom_collected():
        raise KeyboardInterrupt
    assert found == [200_000] * 3
    assert gc.get_threshold() == before
    try:
        gc.set_threshold(0)  # never: as it was asked for
        with cache.seldom_collected():
            assert gc.get_threshold()[0] == 0
    finally:
        gc.set_threshold(*before)


@pytest.mark.parametrize(
    "config", [TrackerConfig(), TrackerConfig(blob_share=0.1), TrackerConfig(q=0.1, q_manoeuvre=5.0)]
)
def test_a_warmed_tracker_compiles_nothing_more(config: TrackerConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    """The kernel is called with arguments of the types that a look has, which is what it is compiled for."""
    called: list[tuple[Any, ...]] = []

    def watched(*arguments: Any) -> int:
        called.append(tuple(typeof(a) for a in arguments))
        return int(advance(*arguments))

    monkeypatch.setattr("boresight.tracking.window.advance", watched)
    sigma = np.array([1.0, 0.01, *[np.nan] * 5])
    tracker = Tracker(config, (Sensor("r", SensorKind.RADAR, sigma=sigma),), 2)
    look = Scan(0, 0.0, 0.0, np.zeros(1), sigma[None] * 100.0, np.diag(sigma**2)[None], np.zeros(1, np.int64))
    warm_tracker(tracker)
    warmed = set(called)
    called.clear()
    tracker.step(tracker.init(), look)
    assert called
    assert set(called) == warmed


def test_poses_are_warmed_by_the_first_look_of_each_sensor(monkeypatch: pytest.MonkeyPatch) -> None:
    sigma = np.array([1.0, 0.01, *[np.nan] * 5])
    tracker = Tracker(TrackerConfig(), tuple(Sensor(n, SensorKind.RADAR, sigma=sigma) for n in "ab"), 2)
    scans = [
        Scan(i, t, t, np.zeros(1), sigma[None], np.diag(sigma**2)[None], np.zeros(1, np.int64))
        for t, i in ((0.0, 1), (1.0, 0), (2.0, 1))
    ]
    placed = []
    monkeypatch.setattr(Tracker, "looks", lambda _, found: placed.append(found))
    warm_poses(tracker, [])
    warm_poses(tracker, scans)
    assert placed == [scans[:2]]


@pytest.mark.parametrize("compiles", [False, True])
def test_says_what_it_compiles_when_it_does(compiles: bool, capsys: pytest.CaptureFixture[str]) -> None:
    """Whatever else takes long; and once, not for each of the kernels that this one calls."""

    @njit
    def called(x: float) -> float:
        return 2.0 * x

    @njit
    def kernel(x: float) -> float:
        return float(called(x)) + 1.0

    if not compiles:
        kernel(1.0)
    with loading():
        time.sleep(0.2)
        assert kernel(1.0) == 3.0
    said = capsys.readouterr().err.splitlines()
    assert len(said) == (2 if compiles else 0)
    if compiles:
        assert said[0].startswith("boresight: compiling tests.tracking.test_cache.kernel, on the first run only")
        assert said[1].startswith("boresight: compiled in ")


def test_nothing_runs_where_the_kernels_are_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache, "compiled", lambda: True)
    monkeypatch.setattr(cache, "warming", lambda *_: pytest.fail("a second process"))
    with cache.compiling_beside(3) as compiles:
        assert not compiles
