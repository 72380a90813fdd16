"""Distances between the set of targets and the set of tracks at one time."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from boresight.types import FloatArray


class Gospa(NamedTuple):
    """GOSPA and its parts, to the power p: distance**p = localisation + missed + false (alpha = 2)."""

    distance: float  # m
    localisation: float  # m^p
    missed: float  # m^p
    false: float  # m^p
    pairs: list[tuple[int, int]]  # matched (target, track), each closer than the cut-off


def gospa(targets: FloatArray, tracks: FloatArray, c: float = 20.0, p: float = 2.0) -> Gospa:
    """Return the generalised OSPA distance (alpha = 2) of tracks (m, d) to targets (n, d) in metres.

    Every missed target and every false track costs c**p / 2 (Rahmathullah, García-Fernández, Svensson 2017, eq. 1).

    >>> two, one = np.array([[0.0, 0.0], [100.0, 0.0]]), np.array([[3.0, 4.0]])
    >>> gospa(two, one).missed, gospa(two, one).localisation
    (200.0, 25.0)
    """
    pairs = match(targets, tracks, c, p)
    localisation = float(sum(math.dist(targets[i], tracks[j]) ** p for i, j in pairs))
    missed = c**p / 2.0 * (len(targets) - len(pairs))
    false = c**p / 2.0 * (len(tracks) - len(pairs))
    return Gospa((localisation + missed + false) ** (1.0 / p), localisation, missed, false, pairs)


def match(targets: FloatArray, tracks: FloatArray, c: float, p: float = 2.0) -> list[tuple[int, int]]:
    """Return the pairs (target, track) closer than `c` in the assignment of least total min(distance, c)**p."""
    if len(targets) == 0 or len(tracks) == 0:
        return []
    distance: NDArray[np.float64] = cdist(targets, tracks)
    rows, columns = linear_sum_assignment(np.minimum(distance, c) ** p)
    return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if distance[i, j] < c]


def ospa(
    targets: FloatArray,
    tracks: FloatArray,
    c: float = 20.0,
    p: float = 2.0,
    pairs: list[tuple[int, int]] | None = None,
) -> float:
    """Return the OSPA distance of tracks (m, d) to targets (n, d) in metres (Schuhmacher, Vo, Vo 2008, eq. 3).

    `pairs` are those of `gospa` with the same `c` and `p`, where they are known.
    """
    n = max(len(targets), len(tracks))
    if n == 0:
        return 0.0
    pairs = match(targets, tracks, c, p) if pairs is None else pairs
    total = sum(math.dist(targets[i], tracks[j]) ** p for i, j in pairs) + c**p * (n - len(pairs))
    return float((total / n) ** (1.0 / p))
