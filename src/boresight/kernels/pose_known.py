"""Poses as they were known at a time: from the stamps that had arrived by then alone."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from boresight.kernels.options import PART
from boresight.kernels.pose import first_uncovered, interpolate_attitude, interpolate_position, segment, slopes
from boresight.kernels.write import write_matrix, write_vector
from boresight.types.sensor import FloatArray

Flags = NDArray[np.bool_]
IntArray = NDArray[np.int64]


@njit(**PART)
def stamps_for(
    times: FloatArray, nodes: FloatArray, arrived: FloatArray, known: float, limits: tuple[float, float]
) -> int:
    """Return how many stamps had arrived by `known` (s), 0 where a pose at one of the `times` cannot come of them."""
    n = int(np.searchsorted(arrived, known, side="right"))
    return n if n > 0 and first_uncovered(nodes[:n], times, limits[0], limits[1])[0] < 0 else 0


@njit(cache=True)
def known_positions(
    nodes: FloatArray,
    arrived: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    measured: Flags,
    hermite: Flags,
    limits: tuple[float, float],
    window: float,
    t: FloatArray,
    first: IntArray,
    known: FloatArray,
) -> tuple[Flags, FloatArray, FloatArray]:
    """Return whether each group of times is covered (k,), positions and velocities (n, 3).

    Args:
        nodes, arrived: stamps and when each had arrived (s), both ascending.
        position, velocity, measured, hermite: what `frames.pose.PoseTrack` holds of them.
        limits: longest gap, farthest extrapolation (s).
        window: to either side over which a velocity that was not measured is fitted (s), from known stamps.
        t: (n,) times (s); those of group i are `first[i]` to `first[i + 1]`, and until `known[i]` stamps are known.
    """
    good = np.zeros(len(known), np.bool_)
    p, v = np.zeros((len(t), 3)), np.zeros((len(t), 3))
    for i in range(len(known)):
        times = t[first[i] : first[i + 1]]
        n = stamps_for(times, nodes, arrived, known[i], limits)
        good[i] = n > 0
        if n == 0 or len(times) == 0:
            continue
        base = max(segment(nodes[:n], times.min()) - 1, 0)
        recent = np.searchsorted(nodes, nodes[n - 1] - window)  # a fit there would use stamps still to come
        fitted = velocity[base:n]
        if n < len(nodes) and not measured[recent:n].all():
            start = max(min(np.searchsorted(nodes, nodes[n - 1] - 3.0 * window), recent - 1), 0)
            begin = max(recent, base)
            slope = slopes(nodes[start:n], position[start:n], window, begin - start)
            fitted = fitted.copy()
            for j in range(begin, n):
                if not measured[j]:
                    write_vector(fitted[j - base], slope[j - begin])
        found = interpolate_position(nodes[base:n], position[base:n], fitted, hermite[base : max(n - 1, base)], times)
        write_matrix(p[first[i] :], found[0])
        write_matrix(v[first[i] :], found[1])
    return good, p, v


@njit(cache=True)
def known_attitudes(
    nodes: FloatArray,
    arrived: FloatArray,
    quaternion: FloatArray,
    steps: FloatArray,
    limits: tuple[float, float],
    t: FloatArray,
    first: IntArray,
    known: FloatArray,
) -> tuple[Flags, FloatArray, FloatArray]:
    """Return whether each group of times is covered (k,), rotations enu_from_body (n, 3, 3) and body rates (n, 3).

    Arguments as for `known_positions`; `quaternion` and `steps` as `frames.pose.PoseTrack` holds them.
    """
    good = np.zeros(len(known), np.bool_)
    R, rate = np.zeros((len(t), 3, 3)), np.zeros((len(t), 3))
    for i in range(len(known)):
        times = t[first[i] : first[i + 1]]
        n = stamps_for(times, nodes, arrived, known[i], limits)
        good[i] = n > 0
        if n == 0 or len(times) == 0:
            continue
        base = max(min(segment(nodes[:n], times.min()), n - 4), 0)
        found = interpolate_attitude(nodes[base:n], quaternion[base:n], steps[base : max(n - 1, base)], times)
        for k in range(len(times)):
            write_matrix(R[first[i] + k], found[0][k])
        write_matrix(rate[first[i] :], found[1])
    return good, R, rate
