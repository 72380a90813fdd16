"""A damaged or full kernel cache heals itself."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

CALL = """
import resource, sys
import numpy as np
from boresight.kernels.gaussian import sandwich
limit = int(sys.argv[1])
if limit:  # as a full disk: no file can grow beyond it
    import signal
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
print(sandwich(np.eye(2), np.eye(2), np.eye(2))[0, 0])
"""


def _call(cache: Path, limit: int = 0) -> str:
    done = subprocess.run(
        [sys.executable, "-c", CALL, str(limit)], env={**os.environ, "NUMBA_CACHE_DIR": str(cache)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout == "2.0\n"
    return done.stderr


@pytest.mark.parametrize("kind", ["nbi", "nbc"])
@pytest.mark.parametrize("left", [0, 10, 0.5])
def test_files_cut_short_are_made_anew(tmp_path: Path, kind: str, left: float) -> None:
    assert _call(tmp_path) == ""
    files = [f for f in tmp_path.rglob(f"*.{kind}") if f.name.startswith("gaussian.sandwich")]
    assert files
    whole = max(f.stat().st_size for f in files)
    for file in files:
        data = file.read_bytes()
        file.write_bytes(data[: int(left if left >= 1 else left * len(data))])
    assert _call(tmp_path) == ""
    files = [f for f in tmp_path.rglob(f"*.{kind}") if f.name.startswith("gaussian.sandwich")]
    assert max(f.stat().st_size for f in files) == whole


def test_a_full_disk_is_one_line(tmp_path: Path) -> None:
    told = _call(tmp_path, 200)
    assert "compiled kernels cannot be kept" in told
    assert told.count("\n") == 1
    assert _call(tmp_path) == ""
