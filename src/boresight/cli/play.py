"""`boresight play`: a replay in the terminal, or as GIF, MP4 or PNG."""

from __future__ import annotations

import math
import sys
import time
from pathlib import Path

from boresight.cli.report import recording_of
from boresight.errors import UserError
from boresight.io.results import read_results
from boresight.report.scene import Scene

REFRESH = 12.0  # frames a second in the terminal
MOST_FRAMES = 5000


def play(
    out: Path,
    rec: Path | None = None,
    /,
    *,
    to: Path | None = None,
    speed: float = 10.0,
    fps: float = 10.0,
    force: bool = False,
) -> None:
    """Replay tracks on a plan view with trails: in the terminal, or to a file.

    Parameters
    ----------
    out
        Folder of the results.
    rec
        Folder of the recording; the one that was tracked if it is still where it was.
    to
        File to write: .gif, .mp4 (needs ffmpeg), or .png for a numbered sequence.
    speed
        How many times faster than it happened.
    fps
        Frames a second of a file.
    force
        Replace existing files.
    """
    if not 0.0 < speed < 1e6 or not 0.0 < fps <= 120.0:
        raise UserError("--speed must be above zero and --fps in (0, 120]")
    if to is not None:
        from boresight.report.film import check_film

        check_film(to, force)
    results = read_results(out)
    recording = recording_of(results, rec)

    if to is not None:
        _film(Scene(results, recording), to, speed, fps)
    else:  # piped, the whole is shown at once
        _terminal(Scene(results, recording, None if sys.stdout.isatty() else math.inf), speed)


def _film(scene: Scene, to: Path, speed: float, fps: float) -> None:
    import numpy as np
    from rich.console import Console
    from rich.progress import Progress

    from boresight.report.film import film

    step = speed / fps
    n = int((scene.end - scene.start) / step) + 1
    if n > MOST_FRAMES:
        raise UserError(f"{n} frames are too many; give a higher --speed or a lower --fps")
    times = (scene.start + step * np.arange(1, n + 1)).tolist()
    with Progress(console=Console(stderr=True), transient=True, disable=not sys.stderr.isatty()) as progress:
        task = progress.add_task("drawing", total=n)
        files = film(scene, to, times, fps, lambda: progress.advance(task))
    print(f"wrote {files[0]}" + (f" … {files[-1].name}" if len(files) > 1 else "") + f" ({n} frames)")


def _terminal(scene: Scene, speed: float) -> None:
    """Play in a terminal; piped, only the last frame is printed."""
    from rich.console import Console
    from rich.live import Live

    from boresight.report.terminal import draw

    console = Console(highlight=False)
    columns, lines = console.width, min(max(console.height - 2, 12), 60)
    bounds = scene.bounds()
    if not console.is_terminal:
        console.print(draw(scene.at(scene.end), scene.start, bounds, columns, lines), end="")
        return
    began = time.monotonic()
    with Live(console=console, auto_refresh=False, transient=False) as live:
        t = scene.start
        while t < scene.end:
            t = min(scene.start + (time.monotonic() - began) * speed, scene.end)
            live.update(draw(scene.at(t), scene.start, bounds, columns, lines), refresh=True)
            time.sleep(1.0 / REFRESH)
