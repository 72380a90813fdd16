"""The picture of a pointing run: where, how sure, and in which mode."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

COLOURS = {"fused": "tab:green", "own": "tab:blue", "coast": "tab:orange", "search": "tab:red"}


def pointing_picture(path: Path, rows: Mapping[str, Any]) -> None:
    """Draw columns of pointing.parquet (by name) to a file: angles, sigma and probability over time."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    t = np.asarray(rows["t_aim_s"]) - rows["t_s"][0]
    figure = Figure(figsize=(9, 7), layout="constrained")
    FigureCanvasAgg(figure)
    top, middle, bottom = figure.subplots(3, 1, sharex=True)
    top.plot(t, np.asarray(rows["az_deg"]), ".", markersize=2, label="azimuth")
    top.plot(t, np.asarray(rows["el_deg"]), ".", markersize=2, label="elevation")
    top.set_ylabel("deg")
    top.legend(loc="upper right")
    middle.semilogy(t, np.maximum(np.asarray(rows["sigma_deg"]), 1e-6))
    middle.set_ylabel("sigma (deg)")
    modes = np.asarray(rows["mode"])
    for mode, colour in COLOURS.items():
        here = modes == mode
        if here.any():
            bottom.plot(t[here], np.asarray(rows["p_in_beam"])[here], ".", markersize=3, color=colour, label=mode)
    bottom.set(xlabel="time (s)", ylabel="P(in beam)", ylim=(-0.02, 1.02))
    bottom.legend(loc="lower right")
    for axes in (top, middle, bottom):
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=110)
