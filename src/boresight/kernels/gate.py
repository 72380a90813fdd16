"""Which detections lie in which track's gate: a grid of cells over the detections, exact distances inside."""

# Numba caches by file and compiles kernels.gaussian and assignment into these: clear __pycache__ when those change.
from __future__ import annotations

import math

import numpy as np
from numba import njit, types

from boresight.kernels.assignment import assign_sparse
from boresight.kernels.gaussian import cholesky
from boresight.kernels.observation import IntArray
from boresight.kernels.options import PART
from boresight.kernels.signatures import MATRIX, STACK, VECTOR
from boresight.types.sensor import FloatArray

INTS = types.int64[::1]
NOT_FINITE = -(2**62)  # what `gate_grid` returns where a prediction or detection is NaN or infinite


@njit(**PART)
def cells(z: FloatArray, size: float, low: FloatArray, shape: IntArray) -> tuple[IntArray, IntArray]:
    """Sort detections `z` (m, d) into square cells of `size` over their first two components.

    Returns begin (cells + 1,) and order (m,): the detections of cell c are order[begin[c]:begin[c + 1]], ascending.
    """
    m = z.shape[0]
    begin = np.zeros(shape[0] * shape[1] + 1, np.int64)
    cell, order = np.empty(m, np.int64), np.empty(m, np.int64)
    for j in range(m):
        cell[j] = int((z[j, 0] - low[0]) / size) * shape[1] + int((z[j, 1] - low[1]) / size)
        begin[cell[j] + 1] += 1
    for c in range(len(begin) - 1):
        begin[c + 1] += begin[c]
    at = begin[:-1].copy()
    for j in range(m):
        order[at[cell[j]]] = j
        at[cell[j]] += 1
    return begin, order


@njit(**PART)
def place(at: float, low: float, size: float, cells: int) -> int:
    """Return the cell of a coordinate, that of the border for one beyond it."""
    return int(max(0.0, min((at - low) / size, cells - 1.0)))


@njit(**PART)
def distance2(x: FloatArray, L: FloatArray, z: FloatArray, w: FloatArray) -> float:
    """Return |L⁻¹(z - x)|²; `w` (d,) is scratch."""
    total = 0.0
    for i in range(x.shape[0]):
        s = z[i] - x[i]
        for k in range(i):
            s -= L[i, k] * w[k]
        w[i] = s / L[i, i]
        total += w[i] * w[i]
    return total


@njit(
    types.int64(MATRIX, STACK, MATRIX, types.float64, types.float64, INTS, INTS, VECTOR, VECTOR),
    cache=True,
)
def gate_grid(
    x: FloatArray,
    S: FloatArray,
    z: FloatArray,
    gate: float,
    gain: float,
    start: IntArray,
    column: IntArray,
    cost: FloatArray,
    d2: FloatArray,
) -> int:
    """List the pairs of tracks `x` (n, d) and detections `z` (m, d), d ≥ 2, with d² = (z - x)ᵀS⁻¹(z - x) < `gate`.

    S is (n, d, d). Track i's pairs fill entries start[i]:start[i + 1] of `column` (the detection, ascending within a
    cell), `cost` = ½(d² + ln|S|) - gain, and `d2`; pairs whose cost is not negative are left out. Returns the number of
    pairs, also where it is more than the arrays hold (those beyond are not written), or -1 - i where S[i] is not
    positive definite. The boxes looked through are those of the gates, so work grows with the number of pairs, not n·m.
    """
    n, d, m = x.shape[0], x.shape[1], z.shape[0]
    reach = math.sqrt(gate)
    low, high, half = np.full(2, np.inf), np.full(2, -np.inf), 0.0
    for j in range(m):
        for a in range(d):
            if not math.isfinite(z[j, a]):
                return NOT_FINITE
        for a in range(2):
            low[a], high[a] = min(low[a], z[j, a]), max(high[a], z[j, a])
    for i in range(n):
        for a in range(d):
            if not math.isfinite(x[i, a]):
                return NOT_FINITE
        half += reach * math.sqrt(max(S[i, 0, 0], S[i, 1, 1])) / n
    span = max(high[0] - low[0], high[1] - low[1], 1e-300) if m else 1.0
    size = max(half, span / math.sqrt(m + 1.0))  # about one detection a cell where they are spread evenly
    shape = np.array([int((high[a] - low[a]) / size) + 1 if m else 1 for a in range(2)])
    begin, order = cells(z, size, low, shape)
    L, w, found = np.empty((d, d)), np.empty(d), 0
    for i in range(n):
        start[i] = min(found, len(column))
        if not cholesky(S[i], L):
            return -1 - i
        log_det = 0.0
        for a in range(d):
            log_det += 2.0 * math.log(L[a, a])
        wide, tall = reach * math.sqrt(S[i, 0, 0]), reach * math.sqrt(S[i, 1, 1])
        west, east = place(x[i, 0] - wide, low[0], size, shape[0]), place(x[i, 0] + wide, low[0], size, shape[0])
        south, north = place(x[i, 1] - tall, low[1], size, shape[1]), place(x[i, 1] + tall, low[1], size, shape[1])
        for line in range(west, east + 1):
            for k in range(begin[line * shape[1] + south], begin[line * shape[1] + north + 1]):
                j = order[k]
                if abs(z[j, 0] - x[i, 0]) > wide or abs(z[j, 1] - x[i, 1]) > tall:
                    continue
                value = distance2(x[i], L, z[j], w)
                price = 0.5 * (value + log_det) - gain
                if value < gate and price < 0.0:
                    if found < len(column):
                        column[found], cost[found], d2[found] = j, price, value
                    found += 1
    start[n] = min(found, len(column))
    return found


@njit(
    types.Tuple((types.int64, types.float64))(
        MATRIX, STACK, MATRIX, types.float64, types.float64, INTS, INTS, VECTOR, VECTOR, INTS, VECTOR
    ),
    cache=True,
)  # fmt: skip
def assign_frame(
    x: FloatArray,
    S: FloatArray,
    z: FloatArray,
    gate: float,
    gain: float,
    start: IntArray,
    column: IntArray,
    cost: FloatArray,
    d2: FloatArray,
    chosen: IntArray,
    d2_chosen: FloatArray,
) -> tuple[int, float]:
    """`gate_grid`, then the least total cost: fills `chosen` (n,), -1 for none, and its d² (n,), NaN for none.

    Returns what `gate_grid` does and the total cost; where the pairs did not fit, nothing is assigned.
    """
    found = gate_grid(x, S, z, gate, gain, start, column, cost, d2)
    total = 0.0
    if found < 0 or found > len(column):
        return found, total
    assign_sparse(start, column[:found], cost[:found], z.shape[0], chosen)
    for i in range(x.shape[0]):
        d2_chosen[i] = np.nan
        for e in range(start[i], start[i + 1]):
            if column[e] == chosen[i]:
                total += cost[e]
                d2_chosen[i] = d2[e]
    return found, total
