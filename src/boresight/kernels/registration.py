"""Registration inside the tracker: constant errors of a sensor, estimated by every track and pooled over tracks.

A sensor whose time stamps, angles or ranges may be off by constants carries them as states of each track. Two tracks
see the same constants, so what a track has learned beyond what it was told when it began (information, the inverse of
covariance) is added up; a new track begins with the sum. What is not known inflates each track's covariance by itself.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from boresight.kernels.options import PART, SMALL
from boresight.kernels.write import write_matrix
from boresight.types.sensor import FloatArray

TIME, RANGE, SCALE, AZIMUTH, ELEVATION = 0, 1, 2, 3, 4
N_PARAMETERS = 5


@njit(**SMALL)
def sensitivity(z: FloatArray, h6: FloatArray, closing: FloatArray, S: FloatArray) -> None:
    """Fill `S` (7, 5): how the components of a measurement `z` (7,) change with the sensor's constant errors.

    `h6` (7, 6) is the measurement's Jacobian, `closing` (3,) the target's velocity relative to the sensor (m/s, world).
    Errors are what is reported minus what is true: time offset (s, a stamp that is late by it shows where the target
    was), range (m), range scale (1), azimuth and elevation (rad).
    """
    flat = math.hypot(z[4], z[5])
    r = max(z[0], 1e-9)
    S[:, :] = 0.0
    for c in range(7):
        for a in range(3):
            S[c, TIME] -= h6[c, a] * closing[a]
    S[0, RANGE] = 1.0
    S[0, SCALE] = z[0]
    S[1, AZIMUTH] = 1.0
    S[2, ELEVATION] = 1.0
    for c in range(4, 7):
        S[c, RANGE] = z[c] / r
        S[c, SCALE] = z[c]
    S[4, AZIMUTH], S[5, AZIMUTH] = z[5], -z[4]
    if flat > 0.0:
        S[4, ELEVATION], S[5, ELEVATION] = -z[6] * z[4] / flat, -z[6] * z[5] / flat
    S[6, ELEVATION] = flat


@njit(**PART)
def learned(x: FloatArray, P: FloatArray, first: int, info: FloatArray, vector: FloatArray) -> None:
    """Fill the information matrix (k, k) and vector (k,) that a track's states from `first` on hold."""
    inverse = np.linalg.inv(np.ascontiguousarray(P[first:, first:]))
    k = len(vector)
    for a in range(k):
        vector[a] = 0.0
        for b in range(k):
            info[a, b] = 0.5 * (inverse[a, b] + inverse[b, a])
            vector[a] += info[a, b] * x[first + b]


@njit(**PART)
def pool(
    x: FloatArray,
    P: FloatArray,
    counts: FloatArray,
    prior: FloatArray,
    bank: FloatArray,
    sigma: FloatArray,
    pooled: FloatArray,
) -> None:
    """Fill `pooled` (k, k + 1), information matrix beside information vector, of all tracks together.

    Args:
        x, P: (n, m), (n, m, m) states, the last k of them the constants.
        counts: (n,) > 0 where a track may teach.
        prior: (n, k, k + 1) what each track was told when it began.
        bank: (k, k + 1) what tracks that have ended had learned.
        sigma: (k,) what is declared.
    """
    k = len(sigma)
    first = x.shape[1] - k
    write_matrix(pooled, bank)
    for a in range(k):
        pooled[a, a] += 1.0 / sigma[a] ** 2
    info = np.empty((k, k))
    vector = np.empty(k)
    for i in range(len(counts)):
        if counts[i] <= 0.0:
            continue
        learned(x[i], P[i], first, info, vector)
        for a in range(k):
            for b in range(k):
                pooled[a, b] += info[a, b] - prior[i, a, b]
            pooled[a, k] += vector[a] - prior[i, a, k]
