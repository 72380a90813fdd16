"""Fewer points and shorter numbers, so that a report of any recording stays small."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from boresight.types import FloatArray


def whole(values: FloatArray, scale: float) -> list[int | None]:
    """Return round(values * scale) as integers, None where not finite: tenths of a metre need one digit less."""
    out = np.round(np.asarray(values, dtype=np.float64) * scale)
    return [int(v) if np.isfinite(v) else None for v in out.tolist()]


def strides(lengths: Sequence[int], limit: int) -> int:
    """Return the smallest step that leaves at most about `limit` points of paths with these lengths."""
    total = sum(lengths)
    return max(1, -(-total // limit)) if total else 1


def every(n: int, step: int) -> NDArray[np.int64]:
    """Return the indices 0, step, 2·step … and always the last of n."""
    keep = np.arange(0, n, step)
    return keep if n == 0 or keep[-1] == n - 1 else np.append(keep, n - 1)
