"""Replays: what a frame shows, the terminal's plan, and files that image programs can read."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.report.film import check_film, film
from boresight.report.scene import Scene
from boresight.report.terminal import Plan, draw
from boresight.types import Recording
from tests.report.test_report import recording, results_of

__all__ = ["recording"]


def test_a_frame_holds_what_is_there_at_its_time(recording: Recording) -> None:
    scene = Scene(results_of(recording), recording)
    early, late = scene.at(scene.start + 5.0), scene.at(scene.start + 60.0)
    assert [p.name for p in early.truth] == ["pilot boat"]  # the dinghy is born at 10 s
    assert [p.name for p in late.truth] == ["pilot boat", "dinghy"]
    truth = recording.truth[1]
    i = int(np.searchsorted(truth.t, late.t, side="right")) - 1
    np.testing.assert_array_equal(late.truth[1].xy[-1], truth.position[i, :2])
    np.testing.assert_allclose(late.tracks[1].xy[-1] - late.truth[1].xy[-1], [2.0, 0.0], atol=2.0)
    assert late.tracks[0].xy.shape[1] == 2
    whole = Scene(results_of(recording), recording, np.inf).at(scene.end)
    assert len(whole.truth[0].xy) == len(recording.truth[0].t)


def test_dots_stand_where_the_positions_are() -> None:
    plan = Plan(10, 5, (0.0, 20.0, 0.0, 20.0))  # 20 × 20 dots, 1 m each
    plan.points(np.array([[0.0, 19.9], [19.0, 1.0]]), "red")
    lines = plan.text().plain.split("\n")
    assert lines[0][0] == "⠁"
    assert [len(line) for line in lines[:5]] == [10] * 5
    assert lines[4][9] == "⢀"
    plan.line(np.array([[0.0, 10.0], [19.0, 10.0]]), "")
    assert all(c != " " for c in plan.text().plain.split("\n")[2])


def test_the_terminal_frame_fits(recording: Recording) -> None:
    scene = Scene(results_of(recording), recording)
    text = draw(scene.at(scene.end), scene.start, scene.bounds(), 80, 24).plain
    lines = text.rstrip("\n").split("\n")
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80
    assert "2 tracks, 2 targets" in lines[0]
    assert "ferry" in text


def test_films_are_readable(recording: Recording, tmp_path: Path) -> None:
    from PIL import Image

    scene = Scene(results_of(recording), recording)
    times = [scene.start + 10.0, scene.start + 60.0, scene.end]
    (gif,) = film(scene, tmp_path / "x.gif", times, 5.0)
    with Image.open(gif) as image:
        assert image.n_frames == 3
        assert image.info["duration"] == 200
    files = film(scene, tmp_path / "x.png", times[:2], 5.0)
    assert [f.name for f in files] == ["x-0001.png", "x-0002.png"]
    pictures = []
    for f in files:
        with Image.open(f) as image:
            pictures.append(np.asarray(image))
    assert not np.array_equal(*pictures)
    with pytest.raises(UserError, match="--force"):
        check_film(tmp_path / "x.gif", False)
    with pytest.raises(UserError, match="ends in"):
        check_film(tmp_path / "x.avi", False)
    with pytest.raises(UserError, match="does not exist"):
        check_film(tmp_path / "no" / "x.gif", False)


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not installed")
def test_an_mp4_has_its_frames(recording: Recording, tmp_path: Path) -> None:
    scene = Scene(results_of(recording), recording)
    (film_path,) = film(scene, tmp_path / "x.mp4", [scene.start + 10.0, scene.end], 5.0)
    assert film_path.read_bytes()[4:8] == b"ftyp"


def test_mp4_without_ffmpeg_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(UserError, match=r"needs the program ffmpeg.*give a \.gif"):
        check_film(tmp_path / "x.mp4", False)


def test_nothing_at_all_can_be_played(recording: Recording) -> None:
    from dataclasses import replace

    from boresight.types import no_tracks

    scene = Scene(replace(results_of(recording), tracks=no_tracks()), None)
    assert scene.bounds() == (-100.0, 100.0, -100.0, 100.0)
    assert "0 tracks" in draw(scene.at(0.0), 0.0, scene.bounds(), 40, 12).plain
