"""Least-squares polynomials as rows of weights: smoothing, end rows and one-step predictors, at any sample times.

Weights are exact for polynomials up to their order; on unit variance the result has variance `sum(w**2)`. Values that
share samples are correlated: `weights @ weights.T` is their covariance per unit variance.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from boresight.errors import UserError
from boresight.types.sensor import FloatArray


def polynomial_weights(times: ArrayLike, at: ArrayLike, order: int) -> FloatArray:
    """Return weights (k, n) that give the least-squares polynomial of samples at `times` (n,) at `at` (k,) (s).

    Time is centred and scaled (mao2015's normal equations without it have a condition number of 6e5). Raises
    UserError for fewer samples than coefficients or times that coincide too often.
    """
    t = np.asarray(times, dtype=np.float64)
    centre = t.mean() if len(t) else 0.0
    scale = float(np.abs(t - centre).max(initial=0.0)) or 1.0
    if len(np.unique(t)) <= order:
        raise UserError(f"a polynomial of order {order} needs {order + 1} different times, not {len(np.unique(t))}")
    powers = np.arange(order + 1)
    V = ((t - centre) / scale)[:, None] ** powers
    A = ((np.atleast_1d(np.asarray(at, dtype=np.float64)) - centre) / scale)[:, None] ** powers
    out: FloatArray = A @ np.linalg.pinv(V)
    return out


@cache
def hat_matrix(n: int, order: int) -> FloatArray:
    """Return the (n, n) smoother of n even samples: Savitzky–Golay's rows, those of the ends included.

    phased_array (4) is n = 7, order 3, all seven rows.
    """
    out = polynomial_weights(np.arange(n), np.arange(n), order)
    out.flags.writeable = False
    return out


@cache
def one_step_predictor(n: int, order: int) -> FloatArray:
    """Return the weights (n,) of the value one step after n even samples.

    phased_array (3) is n = 5, order 1: (−4, −1, 2, 5, 8)/10. Order 2 over 7 is (18, −6, −18, −18, −6, 18, 54)/42.
    """
    out: FloatArray = polynomial_weights(np.arange(n), [float(n)], order)[0]
    out.flags.writeable = False
    return out


def weighted_differences(smoothed: FloatArray, eta: FloatArray) -> FloatArray:
    """Return phased_array (5): the newest of n smoothed rows (n, ...) plus their weighted differences, newest first.

    Kept as the paper prints it: it lags behind acceleration (by 1 to 2.7 times it), which `one_step_predictor` with
    order 2 does not.
    """
    steps = np.diff(smoothed, axis=0)[::-1]
    out: FloatArray = smoothed[-1] + np.tensordot(eta / eta.sum(), steps, axes=1)
    return out
