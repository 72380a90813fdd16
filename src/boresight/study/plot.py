"""The figure of a study: error over bound and NEES, cell by cell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from boresight.study.plan import Study

MOST_LABELS = 40


def plot(path: Path, study: Study, rows: Sequence[Mapping[str, Any]], dimensions: int) -> None:
    """Write RMSE/bound and NEES per cell to an image: against the first parameter, one line per setting of the others.

    A parameter of words, or a grid of none, is spread evenly.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 7.0), layout="constrained")
    ratio, nees = figure.subplots(2, 1, sharex=True)
    groups: dict[tuple[Any, ...], list[Mapping[str, Any]]] = {}
    for row, values in zip(rows, study.cells):
        groups.setdefault(values[1:], []).append(row)
    first = [values[0] if values else "all runs" for values in study.cells]
    numbers = [float(v) for v in first if isinstance(v, int | float) and not isinstance(v, bool)]
    words = len(numbers) < len(first)
    places = {v: i for i, v in enumerate(dict.fromkeys(first))}
    for i, (others, members) in enumerate(groups.items()):
        label = ", ".join(f"{short(k)} = {v}" for k, v in zip(study.keys[1:], others))
        x = np.array([float(places[first[r["cell"]]]) if words else numbers[r["cell"]] for r in members])
        order, style = np.argsort(x), {"marker": "o", "markersize": 4, "linewidth": 1.2, "color": f"C{i % 10}"}
        shown = {k: np.array([_number(r[k]) for r in members])[order] for k in ("rmse_over_bound", "nees_mean")}
        error = 1.96 * np.nan_to_num([_number(r["nees_standard_error"]) for r in members])[order]
        ratio.plot(x[order], shown["rmse_over_bound"], label=label, **style)
        nees.errorbar(x[order], shown["nees_mean"], yerr=error, capsize=3, label=label, **style)
    ratio.axhline(1.0, color="black", linestyle="--", linewidth=1.0)
    nees.axhline(dimensions, color="black", linestyle="--", linewidth=1.0)
    ratio.set_ylabel("position RMSE / Cramér–Rao bound")
    nees.set_ylabel(f"NEES (consistent: {dimensions}; bars 95 %)")
    if words:
        nees.set_xticks(range(len(places)), [str(v) for v in places])
    elif min(numbers) > 0 and max(numbers) >= 20 * min(numbers):
        nees.set_xscale("log")
    nees.set_xlabel(short(study.keys[0]) if study.keys else "")
    for axes in (ratio, nees):
        axes.grid(visible=True, alpha=0.3)
    if len(groups) > 1 and len(groups) <= MOST_LABELS:
        ratio.legend(fontsize=7)
    figure.suptitle(f"{study.name}: {study.runs} runs a cell")
    part = path.with_name(f".{path.name}")
    figure.savefig(part, dpi=130, format="png")
    part.replace(path)


def short(key: str) -> str:
    """Return a key without its root."""
    return key.split(".", 1)[1]


def _number(value: float | None) -> float:
    return np.nan if value is None else value
