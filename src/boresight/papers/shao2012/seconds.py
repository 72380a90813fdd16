"""Error second by second against the Cramér–Rao bound: radar alone, infrared alone, both."""

from __future__ import annotations

from typing import Any

import numpy as np

from boresight.bounds.cramer_rao import trajectory_bound
from boresight.filters.stream import run
from boresight.papers.montecarlo import rms
from boresight.papers.shao2012.scenario import DURATION, Data, MaskArray, Setup, simulate
from boresight.types.sensor import FloatArray
from boresight.types.state import GaussianState


def per_second(setup: Setup, runs: int, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Return position RMSE and its bound (m, three-dimensional) at every whole second, over Monte Carlo runs.

    The filter is the EKF with every report at its own time, from the set's prior; the bound is the Riccati recursion
    with Jacobians on each run's true path, averaged. Both take the same model objects that drew the data.
    """
    data = simulate(setup, runs, rng)
    rows: list[dict[str, Any]] = [{"time_s": float(s)} for s in range(1, int(DURATION) + 1)]
    everything = np.ones(len(data.t), dtype=bool)
    for name, chosen in (("radar", data.is_radar), ("ir", ~data.is_radar), ("both", everything)):
        error, bound = _of(setup, data, chosen)
        at = np.searchsorted(data.t[chosen], [row["time_s"] + 1e-9 for row in rows]) - 1
        for row, k in zip(rows, at.tolist(), strict=True):
            row[f"{name}_rmse_m"] = rms(np.linalg.norm(error[:, k], axis=-1))
            row[f"{name}_bound_m"] = float(np.sqrt(bound[:, k].mean()))
            row[f"{name}_ratio"] = row[f"{name}_rmse_m"] / row[f"{name}_bound_m"]
    return rows


def _of(setup: Setup, data: Data, chosen: MaskArray) -> tuple[FloatArray, FloatArray]:
    """Return position errors (runs, k, 3) and the bound's position variance (runs, k)."""
    errors, bounds = [], []
    for i in range(len(data.z)):
        reports, truth = data.reports(i, chosen), data.truth[i][chosen]
        errors.append(run(setup.prior, setup.motion, reports).x[:, :3] - truth[:, :3])
        prior = GaussianState(setup.prior.t, data.start[i], setup.prior.P)
        P = trajectory_bound(prior, setup.motion, reports, truth)
        bounds.append(np.trace(P[:, :3, :3], axis1=1, axis2=2))
    return np.array(errors), np.array(bounds)
