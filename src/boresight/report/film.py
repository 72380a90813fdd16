"""A replay as pictures: GIF, MP4 (with ffmpeg) or a numbered sequence of PNG."""

from __future__ import annotations

import colorsys
import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from boresight.errors import UserError
from boresight.io.files import PART
from boresight.report.scene import Scene

SENSOR_COLOURS = ("#c4452f", "#2a7f9e", "#7a5195", "#3d8b37", "#b8860b", "#5c6b7a", "#a0527a", "#00796b")
FORMATS = (".gif", ".mp4", ".png")


def check_film(path: Path, force: bool) -> None:
    """Raise UserError when a film of this name cannot be made."""
    if path.suffix not in FORMATS:
        raise UserError(f"--to {path}: give a name that ends in {', '.join(FORMATS)}")
    if path.suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise UserError(f"--to {path}: MP4 needs the program ffmpeg, which is not installed; give a .gif")
    taken = path if path.suffix != ".png" else _numbered(path, 0)
    if taken.exists() and not force:
        raise UserError(f"{taken}: the file exists; give --force to replace it")
    if not path.absolute().parent.is_dir():
        raise UserError(f"{path}: the folder {path.absolute().parent} does not exist")


def film(
    scene: Scene, path: Path, times: Sequence[float], fps: float, tick: Callable[[], None] | None = None
) -> list[Path]:
    """Write frames at `times` (s) to `path`; returns the files. Raises UserError when it cannot be written."""
    pictures = _pictures(scene, times, tick)
    try:
        if path.suffix in (".gif", ".mp4"):  # whole or not there
            part = path.with_name(f".{path.stem}{PART}{path.suffix}")
            try:
                (_gif if path.suffix == ".gif" else _mp4)(pictures, part, fps)
                part.replace(path)
            finally:
                part.unlink(missing_ok=True)
            return [path]
        return [_png(picture, _numbered(path, i)) for i, picture in enumerate(pictures)]
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({(error.strerror or str(error)).lower()})") from None


def _numbered(path: Path, i: int) -> Path:
    return path.with_name(f"{path.stem}-{i + 1:04d}{path.suffix}")


def _pictures(scene: Scene, times: Sequence[float], tick: Callable[[], None] | None) -> Iterator[Any]:
    """Draw each frame; gives (height, width, 4) bytes."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    west, east, south, north = scene.bounds()
    wide = float(np.clip((east - west) / (north - south), 0.6, 1.8))
    figure: Any = Figure(figsize=(6.0 * wide**0.5, 6.0 / wide**0.5), dpi=100, layout="constrained")
    canvas: Any = FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for t in times:
        axes.clear()
        axes.set(xlim=(west, east), ylim=(south, north), aspect="equal", xlabel="east, m", ylabel="north, m")
        axes.grid(color="#e6ebf0")
        _draw(axes, scene, t, 2.0 * max(east - west, north - south))
        canvas.draw()
        yield np.asarray(canvas.buffer_rgba()).copy()
        if tick is not None:
            tick()


def _draw(axes: Any, scene: Scene, t: float, far: float) -> None:
    frame = scene.at(t)
    for i, (points, (origin, azimuth)) in enumerate(zip(frame.points, frame.rays, strict=True)):
        colour = SENSOR_COLOURS[i % len(SENSOR_COLOURS)]
        axes.plot(points[:, 0], points[:, 1], "s", ms=3, color=colour, alpha=0.7, label=scene.sensors[i])
        ends = origin + far * np.stack([np.sin(azimuth), np.cos(azimuth)], axis=1)
        for a, b in zip(origin, ends, strict=True):
            axes.plot([a[0], b[0]], [a[1], b[1]], color=colour, lw=0.5, alpha=0.35)
    for path in frame.platforms:
        axes.plot(*path.xy.T, color="#8a94a0", lw=1.5)
        axes.plot(*path.xy[-1], "^", color="#5b6875", ms=6)
    for path in frame.truth:
        axes.plot(*path.xy.T, "--", color="#111", lw=1.1)
    for path in frame.tracks:
        own = colorsys.hls_to_rgb((path.key * 137.508 % 360.0) / 360.0, 0.4, 0.68)
        axes.plot(*path.xy.T, color=own, lw=2, alpha=0.5 if path.coasting else 1.0)
        axes.plot(*path.xy[-1], "o", color=own, ms=5)
        axes.annotate(path.name, path.xy[-1], xytext=(5, 4), textcoords="offset points", color=own, clip_on=True)
    axes.set_title(f"{t - scene.start:.1f} s", loc="left", fontsize=10)
    if scene.sensors:
        axes.legend(loc="upper right", fontsize=8, framealpha=0.8)


def _gif(pictures: Iterator[Any], path: Path, fps: float) -> Path:
    from PIL import Image

    images = [Image.fromarray(p).convert("RGB").quantize(colors=128) for p in pictures]
    images[0].save(path, save_all=True, append_images=images[1:], duration=round(1000.0 / fps), loop=0)
    return path


def _png(picture: Any, path: Path) -> Path:
    from PIL import Image

    Image.fromarray(picture).convert("RGB").save(path)
    return path


def _mp4(pictures: Iterator[Any], path: Path, fps: float) -> Path:
    first = next(pictures)
    height, width = first.shape[0] // 2 * 2, first.shape[1] // 2 * 2
    command = ["ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgba", "-s", f"{width}x{height}"]
    command += ["-r", str(fps), "-i", "-", "-pix_fmt", "yuv420p", "-movflags", "+faststart", str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as ffmpeg:
        assert ffmpeg.stdin is not None
        assert ffmpeg.stderr is not None
        try:
            for picture in (first, *pictures):
                ffmpeg.stdin.write(np.ascontiguousarray(picture[:height, :width]).tobytes())
            ffmpeg.stdin.close()
        except BrokenPipeError:
            pass
        why = ffmpeg.stderr.read().decode(errors="replace").strip().split("\n")[-1]
        if ffmpeg.wait() != 0:
            raise UserError(f"{path}: ffmpeg failed ({why})")
    return path
