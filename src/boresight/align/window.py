"""A polynomial over a window of a fast sensor's reports, weighted, read off at one time (mao2015 (3)–(8))."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from boresight.errors import UserError
from boresight.types.sensor import FloatArray

ORDERS = (1, 2, 3)


class Fitted(NamedTuple):
    """A value read off a window. Values of windows that overlap are correlated: never count them as independent."""

    value: FloatArray  # (...,)
    variance: float  # Σ wᵢ²σᵢ², whatever the weights were chosen for
    order: int
    weights: FloatArray  # (n,), value = weights @ samples


@dataclass(frozen=True, slots=True)
class PolynomialWindow:
    """Weighted least squares over the reports around one time.

    Weights are 1/σ², divided by the distance in samples from that time if `time_distance` is set (mao2015 (4)–(6);
    the report at the time itself counts as distance 1). `order` is 1 to 3, or None: chosen by the smallest Bayesian
    information criterion. `printed` squares the weights, which is what mao2015 (7) does when it scales the rows.
    """

    order: int | None = 2
    time_distance: bool = False
    printed: bool = False

    def __post_init__(self) -> None:
        if self.order is not None and self.order not in ORDERS:
            raise UserError(f"a polynomial window's order is 1, 2 or 3, or chosen (None), not {self.order}")

    def weights(self, times: ArrayLike, sigma: ArrayLike, at: float, order: int | None = None) -> FloatArray:
        """Return the row (n,) that gives the value at `at` from samples at `times` (n,) (s) of deviations `sigma` (n,).

        Time is centred on `at` and scaled. Raises UserError for too few times or a deviation that is not positive.
        """
        degree = order or self.order
        if degree is None:
            raise UserError("say which order: it is chosen from the samples, which weights do not see")
        t, s = np.asarray(times, dtype=np.float64) - at, np.asarray(sigma, dtype=np.float64)
        if not (s > 0).all():
            raise UserError("a polynomial window needs positive standard deviations")
        if len(np.unique(t)) <= degree:
            raise UserError(f"a polynomial of order {degree} needs {degree + 1} different times")
        root = np.sqrt(self._alpha(t, s))
        if self.printed:
            root = root**2
        V = (t / float(np.abs(t).max()))[:, None] ** np.arange(degree + 1)
        out: FloatArray = np.linalg.pinv(V * root[:, None])[0] * root
        return out

    def fit(self, times: ArrayLike, values: ArrayLike, sigma: ArrayLike, at: float) -> Fitted:
        """Return the value at `at` (s) of samples `values` (n, ...), unwrapped angles or directions, and its variance.

        Raises UserError as `weights`.
        """
        t, y = np.asarray(times, dtype=np.float64), np.asarray(values, dtype=np.float64)
        s = np.broadcast_to(np.asarray(sigma, dtype=np.float64), t.shape)
        order = self.order or choose_order(t, y, s)
        w = self.weights(t, s, at, order)
        return Fitted(np.tensordot(w, y, axes=1), float(w**2 @ s**2), order, w)

    def _alpha(self, t: FloatArray, sigma: FloatArray) -> FloatArray:
        alpha: FloatArray = 1.0 / sigma**2
        if not self.time_distance:
            return alpha
        ordered = np.unique(t)
        step = float(np.median(np.diff(ordered))) if len(ordered) > 1 else 1.0
        return np.asarray(alpha / np.maximum(np.abs(t) / step, 1.0))


def choose_order(times: FloatArray, values: FloatArray, sigma: FloatArray) -> int:
    """Return the order of 1 to 3 with the smallest χ² + parameters · ln n (Schwarz 1978) of samples (n, ...).

    Raises UserError for fewer than two different times.
    """
    t = times - times.mean()
    y = values.reshape(len(t), -1) / sigma[:, None]
    different = len(np.unique(t))
    if different < 2:
        raise UserError("a polynomial of order 1 needs 2 different times")
    best, chosen = math.inf, 1
    for order in ORDERS:
        if different <= order:
            break
        V = (t / float(np.abs(t).max()))[:, None] ** np.arange(order + 1) / sigma[:, None]
        residual = y - V @ (np.linalg.pinv(V) @ y)
        criterion = float((residual**2).sum()) + y.shape[1] * (order + 1) * math.log(len(t))
        if criterion < best:
            best, chosen = criterion, order
    return chosen
