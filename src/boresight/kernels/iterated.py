"""The iterated EKF's update: Gauss-Newton on the posterior, with step control."""

# Numba caches by file and compiles kernels.gaussian into these: clear __pycache__ (make clean) when that changes.
from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from boresight.kernels.gaussian import cholesky, joseph_update, solve_lower
from boresight.kernels.options import PART
from boresight.types.sensor import FloatArray


@njit(**PART)
def mahalanobis(L: FloatArray, a: FloatArray) -> float:
    """Return |L⁻¹a|² for a lower Cholesky factor L."""
    b = a.copy()
    solve_lower(L, b)
    s = 0.0
    for value in b:
        s += value * value
    return s


@njit(**PART)
def iterated_update(
    observe: Any, x: FloatArray, P: FloatArray, z: FloatArray, context: FloatArray, iterations: int
) -> tuple[FloatArray, FloatArray, FloatArray, float, float]:
    """Condition (x, P) on `z`, linearising again at each new mean (Bell and Cathey 1993); at most `iterations` steps.

    The cost is V(ξ) = |z - h(ξ)|²_R + |ξ - x|²_P. Each Gauss-Newton step is halved until V falls, so the mean cannot
    run away; it stops when V falls by less than 1e-9. Returns as `joseph_update`, innovation and S at the prior.
    """
    n = x.shape[0]
    y, H, R = np.empty(7), np.empty((7, n)), np.empty((7, 7))
    m = observe(x, z, context, y, H, R)
    first = joseph_update(x, P, y[:m].copy(), H[:m].copy(), R[:m, :m].copy(), n)
    LP, LR = np.empty((n, n)), np.empty((m, m))
    if np.isnan(first[3]) or not cholesky(P, LP) or not cholesky(R[:m, :m].copy(), LR):
        return first
    here = x.copy()
    cost = mahalanobis(LR, y[:m].copy())
    for _ in range(iterations):
        at_here = y[:m].copy()
        for a in range(m):
            for j in range(n):
                at_here[a] += H[a, j] * (here[j] - x[j])
        aim = joseph_update(x, P, at_here, H[:m].copy(), R[:m, :m].copy(), n)[0]
        step, lower, trial_cost, trial = 1.0, False, cost, here
        for _ in range(8):
            trial = here + step * (aim - here)
            if observe(trial, z, context, y, H, R) == m:
                trial_cost = mahalanobis(LR, y[:m].copy()) + mahalanobis(LP, trial - x)
                lower = trial_cost <= cost
            if lower:
                break
            step *= 0.5
        if not lower:
            break
        gain = cost - trial_cost
        here, cost = trial, trial_cost
        if gain < 1e-9:
            break
    observe(here, z, context, y, H, R)
    P_new = joseph_update(x, P, y[:m].copy(), H[:m].copy(), R[:m, :m].copy(), n)[1]
    return here, P_new, first[2], first[3], first[4]
