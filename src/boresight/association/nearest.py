"""Global nearest neighbour: at most one detection for a track, at the least total cost, however many there are."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.errors import UserError
from boresight.kernels.gate import NOT_FINITE, assign_frame
from boresight.types.sensor import FloatArray


class Pairs(NamedTuple):
    """The candidates of n tracks, track i's being entries start[i]:start[i + 1]."""

    start: NDArray[np.int64]  # (n + 1,)
    detection: NDArray[np.int64]  # (pairs,)
    cost: FloatArray  # (pairs,) negative: log likelihood ratio of "alone and clutter" over "these two"
    d2: FloatArray  # (pairs,) squared Mahalanobis distance


class Assignment(NamedTuple):
    """What was assigned."""

    detection: NDArray[np.int64]  # (n,) of every track, -1 where it has none
    d2: FloatArray  # (n,) squared Mahalanobis distance to it, NaN where it has none
    cost: float  # the total, the least there is
    pairs: Pairs


def assign(
    x: FloatArray,
    S: FloatArray,
    z: FloatArray,
    *,
    gate: float,
    p_detection: float = 0.9,
    clutter_density: float,
) -> Assignment:
    """Assign detections `z` (m, d) to tracks with predicted measurements `x` (n, d) at the least total cost.

    S (n, d, d) is each innovation's covariance, `gate` the largest squared Mahalanobis distance d², `clutter_density`
    the mean number of false detections per unit of measurement space. A pair costs ½(d² + ln|2πS|) - ln(p_D / ((1 -
    p_D) λ)) (Blackman and Popoli 1999, 6.2), a track alone nothing. It is the optimum of the dense problem in which
    every pair outside the gate is forbidden. Components are Cartesian, two or more (angles that wrap must be unwrapped
    about the predictions). Raises UserError.
    """
    x, S, z = (np.require(a, dtype=float, requirements=("C", "W")) for a in (x, S, z))
    n, d = x.shape if x.ndim == 2 else (0, 0)
    if d < 2 or S.shape != (n, d, d) or z.shape[1:] != (d,):
        raise UserError("give predictions (n, d), covariances (n, d, d) and detections (m, d) with d of 2 or more")
    if not (gate > 0.0 and 0.0 < p_detection < 1.0 and clutter_density > 0.0):
        raise UserError("gate and clutter_density must be positive, p_detection between 0 and 1")
    gain = math.log(p_detection / (1.0 - p_detection) / clutter_density) - 0.5 * d * math.log(2.0 * math.pi)
    start, chosen, d2_chosen = np.empty(n + 1, dtype=np.int64), np.empty(n, dtype=np.int64), np.empty(n)
    room = 4 * n + 64
    while True:
        detection, cost, d2 = np.empty(room, dtype=np.int64), np.empty(room), np.empty(room)
        found, total = assign_frame(x, S, z, gate, gain, start, detection, cost, d2, chosen, d2_chosen)
        if found == NOT_FINITE:
            raise UserError("predictions and detections must be finite")
        if found < 0:
            raise UserError(f"the covariance of track {-1 - found} is not positive definite")
        if found <= room:
            return Assignment(chosen, d2_chosen, total, Pairs(start, detection[:found], cost[:found], d2[:found]))
        room = found
