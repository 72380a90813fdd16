"""phased_array's table: the beam's error one second ahead, per scenario and mode."""

from __future__ import annotations

from typing import Any

import numpy as np

from boresight.frames.tangent import separation
from boresight.papers.phased_array.modes import beams
from boresight.papers.phased_array.scenario import SCENARIOS, SKIPPED, simulate
from boresight.types import FloatArray


def table(scenarios: tuple[str, ...], runs: int, seed: int) -> list[dict[str, Any]]:
    """Return one row per scenario and mode: errors as angles on the sphere (deg) over all nodes after the first 20.

    `available` is the share of these nodes with a beam; `reduction_vs_self` is 1 − RMSE / own tracking's.
    """
    rows: list[dict[str, Any]] = []
    for name in scenarios:
        errors: dict[str, list[FloatArray]] = {}
        streams = np.random.default_rng([seed, list(SCENARIOS).index(name)]).spawn(runs)
        for rng in streams:
            one = simulate(SCENARIOS[name], rng)
            for mode, beam in beams(one).items():
                errors.setdefault(mode, []).append(_errors(beam, one.direction))
        own = _rmse(np.concatenate(errors["self"]))
        for mode, parts in errors.items():
            e = np.concatenate(parts)
            rows.append(_row(name, mode, e, own))
    return rows


def _errors(beam: FloatArray, truth: FloatArray) -> FloatArray:
    out = np.full(len(truth), np.nan)
    known = np.isfinite(beam).all(axis=1)
    out[known] = np.degrees(separation(beam[known], truth[known]))
    return out[SKIPPED:]


def _rmse(e: FloatArray) -> float:
    return float(np.sqrt(np.nanmean(e**2)))


def _row(scenario: str, mode: str, e: FloatArray, own: float) -> dict[str, Any]:
    known = e[np.isfinite(e)]
    return {
        "scenario": scenario,
        "mode": mode,
        "rmse_deg": _rmse(e),
        "median_deg": float(np.median(known)),
        "p95_deg": float(np.percentile(known, 95)),
        "above_1deg": float(np.mean(known > 1.0)),
        "available": float(np.isfinite(e).mean()),
        "reduction_vs_self": 1.0 - _rmse(e) / own,
    }
