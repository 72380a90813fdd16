"""What every Monte Carlo table needs: drawn paths, errors, consistency, time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from boresight.models.motion import KernelMotion
from boresight.types.sensor import FloatArray


class Estimates(NamedTuple):
    """What one method gave at the scored epochs of all runs; NaN from where a run broke down."""

    x: FloatArray  # (runs, e, ≥6) Cartesian, world ENU
    nees: FloatArray  # (runs, e) in the filter's own coordinates
    dimension: int  # of nees
    us_per_update: float


def draw_paths(
    motion: KernelMotion, x0: FloatArray, P0: FloatArray, t: FloatArray, runs: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Draw true paths of a linear motion model: starts (runs, n) from N(x0, P0) at time 0 and states (runs, k, n)."""
    n = len(x0)
    start = x0 + rng.normal(size=(runs, n)) @ np.linalg.cholesky(P0).T
    x, out, now = start, np.empty((runs, len(t), n)), 0.0
    for k, at in enumerate(t):
        if at > now:
            _, F, Q = motion.move(x0, at - now)
            x = x @ F.T + rng.normal(size=(runs, n)) @ np.linalg.cholesky(Q).T
        out[:, k] = x
        now = at
    return start, out


def polar(relative: FloatArray) -> FloatArray:
    """Return range, azimuth, elevation (..., 3) of relative positions (..., 3)."""
    e, n, u = np.moveaxis(relative[..., :3], -1, 0)
    rho = np.hypot(e, n)
    return np.stack([np.hypot(rho, u), np.arctan2(e, n), np.arctan2(u, rho)], axis=-1)


def wrapped(angle: FloatArray) -> FloatArray:
    """Wrap angles to [-π, π)."""
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)


def nees(error: FloatArray, P: FloatArray) -> FloatArray:
    """Return eᵀP⁻¹e over leading axes; NaN where P is singular or not finite."""
    with np.errstate(all="ignore"):
        good = np.asarray(np.isfinite(P).all(axis=(-2, -1)) & np.isfinite(error).all(axis=-1))
        safe = np.where(good[..., None, None], P, np.eye(P.shape[-1]))
        out = np.einsum("...i,...i", error, np.linalg.solve(safe, error[..., None])[..., 0])
    return np.where(good, out, np.nan)


def rms(values: FloatArray) -> float:
    """Return the root mean square over everything; NaN if any is NaN."""
    with np.errstate(over="ignore"):
        return float(np.sqrt(np.mean(np.square(values))))


def finite(value: float) -> float | None:
    """Return the number, or None (JSON null) where it is not finite."""
    return float(value) if np.isfinite(value) else None
