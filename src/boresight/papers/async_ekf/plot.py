"""Errors over time, as a figure."""

from __future__ import annotations

from pathlib import Path

from boresight.papers.async_ekf.table import over_time


def plot(path: Path, name: str, runs: int, seed: int) -> None:
    """Write the RMS errors of scenario `name` over time to an image file (its suffix says which kind)."""
    from matplotlib.figure import Figure

    t, curves = over_time(name, runs, seed)
    figure = Figure(figsize=(10.0, 4.5), layout="constrained")
    for i, axes in enumerate(figure.subplots(1, 2)):
        for method, values in curves.items():
            axes.semilogy(t, values[i], label=method, linewidth=1.0)
        axes.set_title(("position (m)", "velocity (m/s)")[i])
        axes.set_xlabel("time (s)")
        axes.grid(visible=True, which="both", alpha=0.3)
    figure.axes[0].legend(fontsize=7)
    figure.suptitle(f"async_ekf {name}: RMS error over {runs} runs")
    figure.savefig(path)
