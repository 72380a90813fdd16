"""Damaged files never give a traceback: every command works, or says one line and exits with 2."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from tests.cli.conftest import Run
from tests.cli.test_io_commands import out, rec

__all__ = ["out", "rec"]

HOW = ("empty", "binary", "half", "flipped", "flipped more", "text", "tail", "missing")


def damage(path: Path, how: str, dice: random.Random) -> None:
    data = path.read_bytes()
    if how == "missing":
        path.unlink()
        return
    flipped = bytearray(data)
    for _ in range(3 if how == "flipped" else 30):
        flipped[dice.randrange(len(flipped))] = dice.randrange(256)
    path.write_bytes(
        {
            "empty": b"",
            "binary": dice.randbytes(500),
            "half": data[: len(data) // 2],
            "text": b"hello, world\n",
            "tail": data[:-3],
        }.get(how, bytes(flipped))
    )


@pytest.mark.parametrize("how", HOW)
@pytest.mark.parametrize("name", ["recording.toml", "detections.parquet"])
def test_damaged_recordings(name: str, how: str, run: Run, rec: Path, out: Path, tmp_path: Path) -> None:
    damage(rec / name, how, random.Random(f"{name} {how}"))
    for words in (("info", rec), ("play", out, rec), ("track", rec, "-o", tmp_path / "new"), ("score", out, rec)):
        ran = run(*words)
        assert ran.code in (0, 2), words
        if ran.code == 2:
            assert ran.err.count("\n") == 1
            assert ran.err.startswith("boresight: ")
            assert not (tmp_path / "new").exists() or words[0] != "track"


@pytest.mark.parametrize("how", HOW)
@pytest.mark.parametrize("name", ["tracks.parquet", "decisions.parquet", "summary.json"])
def test_damaged_results(name: str, how: str, run: Run, rec: Path, out: Path, tmp_path: Path) -> None:
    damage(out / name, how, random.Random(f"{name} {how}"))
    for words in (("play", out, rec), ("export", out, "--to", "kml"), ("report", out, "-o", tmp_path / "x.html")):
        ran = run(*words)
        assert ran.code in (0, 2), words
        if ran.code == 2:
            assert ran.err.count("\n") == 1
            assert ran.err.startswith("boresight: ")
