"""Normalised errors against time with the band in which 95 % of their means should lie."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from boresight.metrics.score import Score, degrees_of_freedom
from boresight.types import FATES, DecisionRows, Fate, FloatArray, Recording

BINS = 60


def binned(t: FloatArray, value: FloatArray, dof: NDArray[np.int64], first: float, last: float) -> dict[str, Any]:
    """Return means of value/dof in even bins of time, and the 95 % band of each mean (chi-square, independent)."""
    bins = int(np.clip(len(np.unique(t)) // 2, 4, BINS))
    width = max(last - first, 1e-9) / bins
    index = np.clip(((t - first) / width).astype(np.int64), 0, bins - 1)
    total = np.bincount(index, dof, minlength=bins)
    summed = np.bincount(index, value, minlength=bins)
    have = total > 0
    n = total[have]
    low, high = chi2.ppf([[0.025], [0.975]], n) / n if len(n) else (np.zeros(0), np.zeros(0))
    centre = (np.flatnonzero(have) + 0.5) * width
    return {
        "w": round(width, 3),
        "t": np.round(centre, 3).tolist(),
        "v": _short(summed[have] / n),
        "lo": _short(low),
        "hi": _short(high),
    }


def nis_of(recording: Recording, decisions: DecisionRows, first: float, last: float) -> list[dict[str, Any]]:
    """Return one binned series of normalised innovations per sensor."""
    dof = degrees_of_freedom(recording)
    hit = (decisions.fate == FATES.index(Fate.UPDATED)) & np.isfinite(decisions.nis) & (dof > 0)
    d = recording.detections
    out = []
    for i, sensor in enumerate(recording.sensors):
        mine = hit & (d.sensor == i)
        out.append({"id": sensor.id, **binned(d.t[mine], decisions.nis[mine], dof[mine], first, last)})
    return out


def nees_of(score: Score, dimensions: int, first: float, last: float) -> dict[str, Any]:
    """Return the binned normalised errors of all targets."""
    t = np.array([v for target in score.targets for v in target.nees_times])
    nees = np.array([v for target in score.targets for v in target.nees])
    return binned(t, nees, np.full(len(t), dimensions), first, last)


def _short(values: FloatArray) -> list[float]:
    return [float(f"{v:.4g}") for v in values]
