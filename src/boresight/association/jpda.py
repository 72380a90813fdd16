"""Joint probabilistic data association: every track's share in every report, and whether the track exists at all."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from boresight.errors import UserError
from boresight.kernels import jpda as kernel
from boresight.kernels.gate import gate_grid
from boresight.types.sensor import FloatArray

MOST_STATES = 300_000.0  # of one cluster that is worked out exactly: 14 tracks that all see 14 reports need 229,000


class Marginals(NamedTuple):
    """Association probabilities, each track's adding up to one."""

    p: FloatArray  # (n, m) of track i and report j
    p_miss: FloatArray  # (n,) of no report
    exact: NDArray[np.bool_]  # (n,) false where a large cluster went by belief propagation


class Associated(NamedTuple):
    """Association probabilities of n tracks, track i's being entries start[i]:start[i + 1]."""

    start: NDArray[np.int64]  # (n + 1,)
    report: NDArray[np.int64]  # (pairs,)
    p: FloatArray  # (pairs,)
    p_miss: FloatArray  # (n,)
    existence: FloatArray  # (n,) that the track exists, after the scan
    exact: NDArray[np.bool_]  # (n,)


def marginals(weight: ArrayLike, miss: ArrayLike, *, most_states: float = MOST_STATES) -> Marginals:
    """Return the marginals of all joint events of n tracks and m reports (Bar-Shalom and Li 1995, 6.2).

    `weight` (n, m) is that of a pair, zero outside the gate (p_D N(z) / clutter density); `miss` (n,) that of a track
    left alone (1 - p_D p_G). A cluster of tracks that share reports is summed exactly while it needs at most
    `most_states` states, else by belief propagation (Williams and Lau 2014). Raises UserError.
    """
    w, u = np.asarray(weight, dtype=float), np.asarray(miss, dtype=float)
    if w.ndim != 2 or u.shape != w.shape[:1]:
        raise UserError(f"give weights (n, m) and misses (n,), not {w.shape} and {u.shape}")
    if not (np.isfinite(w).all() and np.isfinite(u).all() and (w >= 0.0).all() and (u >= 0.0).all()):
        raise UserError("weights must be finite and not negative")
    if (w.sum(axis=1) + u == 0.0).any():
        raise UserError("a track has neither a report nor a weight to miss one")
    row, column = np.nonzero(w)
    start = np.searchsorted(row, np.arange(len(w) + 1)).astype(np.int64)
    p, p_miss, way = _solve(start, column.astype(np.int64), w[row, column], u, w.shape[1], most_states)
    out = np.zeros_like(w)
    out[row, column] = p
    return Marginals(out, p_miss, way != kernel.LOOPY)


def associate(
    x: FloatArray,
    S: FloatArray,
    z: FloatArray,
    *,
    gate: float,
    p_detection: ArrayLike = 0.9,
    clutter_density: float,
    existence: ArrayLike = 1.0,
    most_states: float = MOST_STATES,
) -> Associated:
    """Return the marginals of predicted measurements `x` (n, d) and reports `z` (m, d), and the tracks' existence.

    S (n, d, d) is each innovation's covariance, `gate` the largest d² (its probability p_G follows), `clutter_density`
    the mean number of false reports per unit of measurement space; `p_detection` and `existence` are scalars or (n,).
    With r the existence before the scan, a pair weighs r p_D N(z; x, S)/λ and no report 1 - r p_D p_G; afterwards

        r' = Σ_j p_j + p_miss · r (1 - p_D p_G) / (1 - r p_D p_G)

    (JIPDA, Mušicki and Evans 2004); with r = 1 this is JPDA. Components are Cartesian, two or more. Raises UserError.
    """
    from scipy.stats import chi2

    x, S, z = (np.require(a, dtype=float, requirements=("C", "W")) for a in (x, S, z))
    n, d = x.shape if x.ndim == 2 else (0, 0)
    if d < 2 or S.shape != (n, d, d) or z.shape[1:] != (d,):
        raise UserError("give predictions (n, d), covariances (n, d, d) and reports (m, d) with d of 2 or more")
    if not (np.isfinite(x).all() and np.isfinite(S).all() and np.isfinite(z).all()):
        raise UserError("predictions, covariances and reports must be finite")
    pd, r = np.broadcast_to(np.asarray(p_detection, float), n), np.broadcast_to(np.asarray(existence, float), n)
    if not (gate > 0.0 and clutter_density > 0.0 and ((pd > 0) & (pd <= 1)).all() and ((r >= 0) & (r <= 1)).all()):
        raise UserError("gate and clutter_density must be positive, p_detection and existence within 0 and 1")
    start, report, likelihood = _likelihoods(x, S, z, gate)
    found = float(chi2.cdf(gate, d)) * pd
    miss = 1.0 - r * found
    of = np.repeat(np.arange(n), np.diff(start))
    weight = r[of] * pd[of] * likelihood / clutter_density
    p, p_miss, way = _solve(start, report, weight, miss, len(z), most_states)
    seen = np.bincount(of, p, n)
    hidden = np.divide(r * (1.0 - found), miss, out=np.zeros(n), where=miss > 0.0)
    return Associated(start, report, p, p_miss, np.minimum(seen + p_miss * hidden, 1.0), way != kernel.LOOPY)


def _likelihoods(
    x: FloatArray, S: FloatArray, z: FloatArray, gate: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], FloatArray]:
    """Return the pairs inside the gate: start (n + 1,), report and likelihood N(z; x, S) (pairs,)."""
    n, d = x.shape
    sign, log_det = np.linalg.slogdet(S) if n else (np.ones(0), np.zeros(0))
    if not (sign > 0).all():
        raise UserError(f"the covariance of track {int(np.argmin(sign > 0))} is not positive definite")
    gain = 0.5 * (gate + float(np.max(log_det, initial=0.0))) + 1.0  # so that no pair inside the gate is left out
    start, room = np.empty(n + 1, dtype=np.int64), 4 * n + 64
    while True:
        report, cost, d2 = np.empty(room, dtype=np.int64), np.empty(room), np.empty(room)
        found = gate_grid(x, S, z, gate, gain, start, report, cost, d2)
        if found < 0:
            raise UserError(f"the covariance of track {-1 - found} is not positive definite")
        if found <= room:
            return start, report[:found], np.exp(-cost[:found] - gain - 0.5 * d * math.log(2.0 * math.pi))
        room = found


def _solve(
    start: NDArray[np.int64], column: NDArray[np.int64], weight: FloatArray, miss: FloatArray, m: int, most: float
) -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    n = len(start) - 1
    p, p_miss, way = np.zeros(len(column)), np.zeros(n), np.zeros(n, dtype=np.int64)
    kernel.marginals(start, column, weight, np.ascontiguousarray(miss), m, float(most), p, p_miss, way)
    return p, p_miss, way
