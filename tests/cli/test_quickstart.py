"""The quick start of the README works as it is written."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_the_five_steps_work_as_written(tmp_path: Path) -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8").split("## Your own data, in five steps")[1]
    blocks = re.findall(r"^   ```sh\n(.*?)^   ```", text.split("\n## ")[0], re.S | re.M)
    assert len(blocks) == 5
    script = "set -e\n" + "\n".join(re.sub(r"^   ", "", block, flags=re.M) for block in blocks)
    (tmp_path / "bin").mkdir()
    command = tmp_path / "bin" / "boresight"
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -c "from boresight.cli import main; main()" "$@"\n')
    command.chmod(0o755)
    path = f"{tmp_path / 'bin'}:{os.environ['PATH']}"
    paths = os.pathsep.join([str(ROOT / "src"), os.environ.get("PYTHONPATH", "")])
    ran = subprocess.run(
        ["sh", "-c", script],
        cwd=tmp_path,
        env={**os.environ, "PATH": path, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    assert "radar" in ran.stdout
    assert (tmp_path / "my-tracks" / "report.html").stat().st_size > 10_000
    assert "<kml" in (tmp_path / "my-tracks.kml").read_text()
    assert re.search(r"wrote my-tracks: 1 tracks", ran.stdout)
