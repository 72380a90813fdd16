"""Compiling the tracker in a second process."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from boresight.tracking import cache


def test_the_second_process_runs_both_trackers() -> None:
    """In plain Python: what is compiled is not the matter here, that it is called is."""
    done = subprocess.run(
        cache.warming(3, blobs=True), env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, capture_output=True, text=True
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


def test_nothing_runs_where_the_kernels_are_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache, "compiled", lambda: True)
    monkeypatch.setattr(cache, "warming", lambda *_: pytest.fail("a second process"))
    with cache.compiling_beside(3) as compiles:
        assert not compiles
