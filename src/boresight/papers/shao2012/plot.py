"""Errors over time, as a figure."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from boresight.papers.shao2012.table import QUANTITIES, SCALES, UNITS, over_time

SHOWN = ("corrected_angles_only", "corrected", "msc", "ekf", "ukf", "radar_only", "ir_only", "rts")


def plot(path: Path, name: str, runs: int, seed: int) -> None:
    """Write the RMS errors of set `name` over time, beside the bound, to an image file (its suffix says which kind)."""
    from matplotlib.figure import Figure

    t, curves = over_time(name, runs, seed, SHOWN)
    figure = Figure(figsize=(10.0, 7.0), layout="constrained")
    for i, axes in enumerate(figure.subplots(2, 2, sharex=True).ravel()):
        for method, values in curves.items():
            style = {"color": "black", "linestyle": "--", "linewidth": 2.0} if method == "bound" else {"linewidth": 1.0}
            axes.semilogy(t, SCALES[i] * values[i], label=method, **style)
        axes.set_title(f"{QUANTITIES[i]} ({UNITS[i].replace('_', '/')})")
        axes.grid(visible=True, which="both", alpha=0.3)
        axes.set_xlim(0.0, float(np.max(t)))
    figure.axes[0].legend(fontsize=7)
    figure.supxlabel("time (s)")
    figure.suptitle(f"shao2012 set {name}: RMS error over {runs} runs")
    figure.savefig(path)
