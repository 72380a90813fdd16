"""Several results of one recording side by side, as an image."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from boresight.metrics.score import score
from boresight.types import Recording, Results

ACROSS = 3  # maps in a row
BARS = {
    "gospa_rms_m": "GOSPA RMS (m)",
    "position_rmse_m": "position RMSE (m)",
    "false_track_s": "false tracks (s)",
    "seconds": "run time (s)",
}


def draw(path: Path, recording: Recording, results: Sequence[Results], rows: Sequence[Mapping[str, Any]]) -> None:
    """Write a map of the tracks of each of `results`, their GOSPA over time, and bars of the scores in `rows`."""
    names = [Path(str(row["config"])).stem for row in rows]
    maps = -(-len(rows) // ACROSS)
    figure = plt.figure(figsize=(13.0, 4.2 * maps + 6.0), layout="constrained")
    halves: Any = figure.subfigures(2, 1, height_ratios=[4.2 * maps, 6.0])
    above, below = halves
    first = None
    for i, (name, one) in enumerate(zip(names, results, strict=True)):
        axes = above.add_subplot(maps, min(ACROSS, len(rows)), i + 1, sharex=first, sharey=first)
        first = first or axes
        _map(axes, recording, one)
        axes.set_title(name)
    line, bars = below.subfigures(2, 1, height_ratios=[1.0, 0.9])
    if recording.truth:
        _over_time(line.add_subplot(), recording, results, names)
    shown = {key: title for key, title in BARS.items() if all(row.get(key) is not None for row in rows)}
    for i, (key, title) in enumerate(shown.items()):
        axes = bars.add_subplot(1, len(shown), i + 1)
        y = np.arange(len(names))
        axes.barh(y, [row[key] for row in rows], color=[f"C{k % 10}" for k in y])
        axes.set_yticks(y, names if i == 0 else [""] * len(names))
        axes.invert_yaxis()
        axes.set_title(title, fontsize=10)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _map(axes: Axes, recording: Recording, results: Results) -> None:
    for truth in recording.truth:
        axes.plot(truth.position[:, 0], truth.position[:, 1], color="0.75", linewidth=4.0, zorder=1)
    for platform in recording.platforms:
        axes.plot(platform.position[:, 0], platform.position[:, 1], color="0.5", linestyle=":", linewidth=1.0)
    tracks = results.tracks
    for number in np.unique(tracks.track_id):
        mine = tracks.track_id == number
        axes.plot(tracks.position[mine, 0], tracks.position[mine, 1], linewidth=1.2, zorder=2)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlabel("east (m)")
    axes.set_ylabel("north (m)")


def _over_time(axes: Axes, recording: Recording, results: Sequence[Results], names: Sequence[str]) -> None:
    for name, one in zip(names, results, strict=True):
        scored = score(recording, one.tracks, None, one.summary["sensors"])
        axes.plot(scored.clock - scored.clock[0], scored.gospa[:, 0], label=name, linewidth=1.1)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("GOSPA (m)")
    axes.legend(ncols=6, fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False)
