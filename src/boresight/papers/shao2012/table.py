"""The table: every method's errors, their ratio to the Cramér-Rao bound, consistency and time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from boresight.bounds import trajectory_bound
from boresight.kernels.msc import inverse_jacobian
from boresight.papers.montecarlo import Estimates, finite, polar, rms, wrapped
from boresight.papers.shao2012.methods import METHODS
from boresight.papers.shao2012.scenario import DURATION, SETS, Data, Setup, simulate
from boresight.types.sensor import FloatArray
from boresight.types.state import GaussianState

QUANTITIES = ("az", "el", "range", "velocity")
UNITS = ("mrad", "mrad", "m", "m_s")
SCALES = (1e3, 1e3, 1.0, 1.0)
BOUND_RUNS = 100  # the bound hardly differs from run to run


def bound(setup: Setup, data: Data, lag: float | None = 0.0) -> FloatArray:
    """Return the bounds (4, e) (az, el, range, velocity; rad, m, m/s): Riccati on true paths, covariances averaged."""
    at = data.scored()
    squares = []
    for run in range(min(BOUND_RUNS, len(data.z))):
        prior = GaussianState(0.0, data.start[run], setup.prior.P)
        P = trajectory_bound(prior, setup.motion, data.reports(run), data.truth[run], lag)[at]
        one = []
        for k, i in enumerate(at):
            y = data.truth[run, i] - data.own[i]
            r = np.linalg.norm(y[:3])
            y[3:] = 0.0
            to_polar = inverse_jacobian(_still(y))
            az, el, b = (to_polar[row] @ P[k] @ to_polar[row] for row in (2, 0, 5))
            one.append([az, el, b * r**4, np.trace(P[k, 3:, 3:])])
        squares.append(one)
    return np.asarray(np.sqrt(np.mean(squares, axis=0)).T)


def _still(relative: FloatArray) -> FloatArray:
    r, azimuth, elevation = polar(relative)
    return np.array([elevation, 0.0, azimuth, 0.0, 0.0, 1.0 / r])


def errors(data: Data, estimates: Estimates) -> FloatArray:
    """Return errors (4, runs, e) in azimuth, elevation (rad), range (m) and speed of the velocity error (m/s)."""
    at = data.scored()
    truth, own = data.truth[:, at], data.own[at]
    true, seen = polar(truth - own), polar(estimates.x - own)
    velocity = np.linalg.norm(estimates.x[..., 3:6] - truth[..., 3:], axis=-1)
    return np.array(
        [wrapped(seen[..., 1] - true[..., 1]), seen[..., 2] - true[..., 2], seen[..., 0] - true[..., 0], velocity]
    )


def row(method: str, figures: FloatArray, limits: FloatArray, anees: float, us: float) -> dict[str, Any]:
    """Return one row of the table."""
    out: dict[str, Any] = {"method": method}
    for name, unit, scale, value in zip(QUANTITIES, UNITS, SCALES, figures):
        out[f"{name}_{unit}"] = finite(scale * value)
    for name, value in zip(QUANTITIES, figures / limits):
        out[f"{name}_ratio"] = finite(value)
    return out | {"anees_per_dim": finite(anees), "us_per_update": finite(us)}


def table(
    name: str,
    runs: int,
    seed: int,
    progress: Callable[[str], None] = lambda method: None,
    methods: tuple[str, ...] = tuple(METHODS),
) -> list[dict[str, Any]]:
    """Return the rows of set `name` (A, P, B, C, M) over `runs` runs; ratios are to the filtering bound."""
    setup = SETS[name]
    data = simulate(setup, runs, np.random.default_rng(seed))
    limits = _over_epochs(bound(setup, data))
    rows = []
    for method in methods:
        progress(method)
        with np.errstate(all="ignore"):
            got = METHODS[method](setup, data)
            figures = np.array([rms(e) for e in errors(data, got)])
            rows.append(row(method, figures, limits, float(np.mean(got.nees)) / got.dimension, got.us_per_update))
    rows.append(row("bound", limits, limits, 1.0, np.nan))
    rows.append(row("bound_smoothing", _over_epochs(bound(setup, data, None)), limits, 1.0, np.nan))
    return rows


def _over_epochs(values: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(values**2, axis=1)))


def over_time(
    name: str, runs: int, seed: int, methods: tuple[str, ...] = tuple(METHODS)
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return the radar's times (e,) from first to last and, per method and for `bound`, RMS errors (4, e) in SI."""
    setup = SETS[name]
    data = simulate(setup, runs, np.random.default_rng(seed))._replace(window=(0.0, DURATION))
    curves = {}
    with np.errstate(all="ignore"):
        for method in methods:
            e = errors(data, METHODS[method](setup, data))
            curves[method] = np.sqrt(np.mean(e**2, axis=1))
    curves["bound"] = bound(setup, data)
    return data.t[data.scored()], curves
