"""Which report follows which, where a sensor sees several objects: nearest first, one each, within reach."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from boresight.types import FloatArray


def pair(distance: FloatArray, limit: FloatArray) -> NDArray[np.int64]:
    """Return for each row of `distance` (n, k) the column it takes, -1 for none: greedily, nearest in limits first.

    A pair is possible where distance <= limit (n, k); each column is taken once.
    """
    n, k = distance.shape
    out = np.full(n, -1, np.int64)
    if n == 0 or k == 0:
        return out
    ratio = np.where(distance <= limit, distance / np.maximum(limit, 1e-300), np.inf)
    taken = np.zeros(k, dtype=bool)
    for flat in np.argsort(ratio, axis=None, kind="stable"):
        i, j = divmod(int(flat), k)
        if not np.isfinite(ratio[i, j]):
            break
        if out[i] < 0 and not taken[j]:
            out[i] = j
            taken[j] = True
    return out


def distances(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the distances (n, k) between points (n, 3) and (k, 3)."""
    out: FloatArray = np.linalg.norm(a[:, None, :] - b[None, :, :], axis=2)
    return out
