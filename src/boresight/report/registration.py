"""Constant errors of sensors and their 95 % bands, as an image."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any


def draw(path: Path, rows: Sequence[Mapping[str, Any]], reference: str) -> None:
    """Draw the rows of `boresight register`, one panel a parameter, against what was believed before (grey, 95 %)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    names = list(dict.fromkeys(row["parameter"] for row in rows))
    figure = Figure(figsize=(9.0, 1.6 + 1.5 * len(names)), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(f"relative to {reference}: estimate and 95 % band")
    for axes, name in zip(figure.subplots(len(names), 1, squeeze=False)[:, 0], names, strict=True):
        mine = [row for row in rows if row["parameter"] == name]
        for y, row in enumerate(mine):
            wide = 1.96 * row["declared_sigma"]
            axes.barh(y, 2 * wide, left=-wide, color="0.9", height=0.8)
            colour = {"observable": "tab:green", "weakly observable": "tab:orange"}.get(row["verdict"], "tab:red")
            axes.errorbar(row["value"], y, xerr=1.96 * row["sigma"], fmt="o", capsize=4, color=colour)
        axes.set_yticks(range(len(mine)), [f"{row['sensor']}: {row['verdict']}" for row in mine], fontsize=8)
        axes.axvline(0.0, color="0.4", linewidth=0.8)
        axes.set_ylim(len(mine) - 0.5, -0.5)
        axes.set_xlabel(name, fontsize=9)
    figure.savefig(path, dpi=110)
