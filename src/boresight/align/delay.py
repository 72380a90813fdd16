"""Bring a source's reports to one time by a straight line (phased_array (1))."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from boresight.errors import UserError
from boresight.types.sensor import FloatArray


class Aligned(NamedTuple):
    """A value at one time, and how much noise the line makes of that of one report."""

    value: FloatArray  # (...,)
    gain: float  # standard deviation against that of one report


def align_linear(t0: float, y0: ArrayLike, t1: float, y1: ArrayLike, t: float) -> Aligned:
    """Return the line through two reports at time `t` (s): inter- or extrapolation, phased_array (1).

    With τ the steps beyond the newer report the noise gain is √((1 + τ)² + τ²). Give positions (ECEF) or direction
    vectors, not azimuths. The values of neighbouring times share reports: they are correlated, and are not to be
    counted as independent. Raises UserError for two reports of one time.
    """
    if t1 == t0:
        raise UserError(f"two reports of the same time ({t0:.6f} s) make no line")
    s = (t - t0) / (t1 - t0)
    a, b = np.asarray(y0, dtype=np.float64), np.asarray(y1, dtype=np.float64)
    return Aligned((1.0 - s) * a + s * b, float(np.hypot(1.0 - s, s)))
