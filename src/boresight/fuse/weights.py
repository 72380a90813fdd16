"""How much each of several sources of one quantity counts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from boresight.errors import UserError
from boresight.types.sensor import FloatArray


def inverse_variance(variance: ArrayLike) -> FloatArray:
    """Return weights (m,) that add to one, proportional to 1/variance (m,): (HᵀR⁻¹H)⁻¹HᵀR⁻¹ with H = ones.

    A source of infinite variance gets 0. Raises UserError if none is finite, or one is not positive.
    """
    v = np.asarray(variance, dtype=np.float64)
    if not (v > 0).all() or not np.isfinite(v).any():
        raise UserError("weights need positive variances, at least one of them finite")
    w = 1.0 / v
    out: FloatArray = w / w.sum()
    return out


def deviation_variance(values: ArrayLike) -> FloatArray:
    """Return the variance (m,) of each source's deviation from the mean of the sources, over rows (n, m).

    phased_array §2, as printed. One bad source spoils the mean and with it the rest, and a constant bias does not
    show: prefer `three_cornered_hat`.
    """
    a = np.asarray(values, dtype=np.float64)
    out: FloatArray = (a - a.mean(axis=1, keepdims=True)).var(axis=0)
    return out


def three_cornered_hat(mean_square: ArrayLike, floor: ArrayLike) -> FloatArray:
    """Return the mean square error (3,) of three sources from those of their differences (3, 3), at least `floor` (3,).

    σ_i² = (d_ij² + d_ik² − d_jk²)/2 for errors without correlation. With mean squares (not variances) a constant bias
    of one source counts as its error.
    """
    d = np.asarray(mean_square, dtype=np.float64)
    total = 0.5 * np.array([d[0, 1] + d[0, 2] - d[1, 2], d[0, 1] + d[1, 2] - d[0, 2], d[0, 2] + d[1, 2] - d[0, 1]])
    out: FloatArray = np.maximum(total, np.asarray(floor, dtype=np.float64))
    return out


def residual_variance(residuals: ArrayLike, reference: ArrayLike, floor: ArrayLike) -> FloatArray:
    """Return mean square errors (m,) of sources by `residuals` (n, m) to a fused prediction, at least `floor` (m,).

    `reference` is the prediction's own variance, which is taken off: the prediction rests on reports before, so its
    error and the new reports' are independent. One bad source does not spoil the others, and a constant bias counts.
    Splits two good sources with far fewer samples than `three_cornered_hat`, which has only the bad one to do it by.
    """
    r = np.asarray(residuals, dtype=np.float64)
    out: FloatArray = np.maximum((r**2).mean(axis=0) - reference, np.asarray(floor, dtype=np.float64))
    return out


class ResidualVariance(NamedTuple):
    """How a source's residuals compare with what its declared noise and the reference's explain, as they come."""

    excess: float = 0.0  # residual² less the reference's share, summed with forgetting
    declared: float = 0.0  # declared variance, likewise
    prior: float = 10.0  # residuals' worth of trust in the declared noise

    @property
    def ratio(self) -> float:
        """The source's variance over the declared one."""
        return max((self.excess + self.prior) / (self.declared + self.prior), 0.0)

    def after(
        self, y: FloatArray, reference: FloatArray, declared: FloatArray, memory: float = 100.0
    ) -> ResidualVariance:
        """Return the state after a residual `y` (m,) to a value of covariance `reference` (m, m), noise `declared`."""
        keep = 1.0 - 1.0 / memory
        inverse = np.linalg.inv(declared)
        more = float(y @ inverse @ y - np.trace(inverse @ reference)) / len(y)
        return self._replace(excess=keep * self.excess + more, declared=keep * self.declared + 1.0)
