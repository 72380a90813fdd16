"""The exact sum over all joint events of a cluster, by dynamic programming over which reports are taken.

Rows are taken one after the other. What the rest needs to know of the past is only which of those columns are taken
that an earlier row could take and a later one still can: a set of bits. Events that agree in these bits are one state
(Horridge and Maskell 2006: efficient hypothesis management). The order keeps the open columns few.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from boresight.types.sensor import FloatArray

IntArray = NDArray[np.int64]
MOST_OPEN = 30  # columns


@njit(cache=True)
def plan(begin: IntArray, col: IntArray, m: int, most: float, order: IntArray) -> float:
    """Fill `order` (n,) with the rows so that few columns are open at a time; returns the states, inf beyond `most`.

    Greedily, next comes the row that leaves the fewest columns open.
    """
    n = len(begin) - 1
    left = np.zeros(m, np.int64)  # rows to come that have the column
    is_open, done = np.zeros(m, np.bool_), np.zeros(n, np.bool_)
    for c in col:
        left[c] += 1
    now, states = 0, 0.0
    for k in range(n):
        best, least = -1, 0
        for i in range(n):
            if done[i]:
                continue
            after = now
            for e in range(begin[i], begin[i + 1]):
                after += (0 if is_open[col[e]] else 1) - (1 if left[col[e]] == 1 else 0)
            if best < 0 or after < least:
                best, least = i, after
        order[k], done[best], now = best, True, least
        for e in range(begin[best], begin[best + 1]):
            is_open[col[e]] = True
            left[col[e]] -= 1
        states += 2.0**now
        if states > most or now > MOST_OPEN:
            return math.inf
    return states


@njit(cache=True)
def _slots(
    begin: IntArray, col: IntArray, m: int, order: IntArray, bit: IntArray, closing: IntArray, size: IntArray
) -> None:
    """Give every open column a bit, freed when it closes: `bit` (entries,), `closing` (n,) masks, `size` (n + 1,)."""
    left, slot, used = np.zeros(m, np.int64), np.full(m, -1, np.int64), 0
    for c in col:
        left[c] += 1
    size[0] = 1
    for k in range(len(order)):
        i = order[k]
        for e in range(begin[i], begin[i + 1]):
            c = col[e]
            if slot[c] < 0:
                s = 0
                while used >> s & 1:
                    s += 1
                slot[c] = s
                used |= 1 << s
            bit[e] = 1 << slot[c]
            left[c] -= 1
        closing[k] = 0
        for e in range(begin[i], begin[i + 1]):
            if left[col[e]] == 0:
                closing[k] |= bit[e]
        used &= ~closing[k]
        size[k + 1] = 1
        while size[k + 1] <= used:
            size[k + 1] *= 2


@njit(cache=True)
def exact(
    begin: IntArray, col: IntArray, w: FloatArray, u: FloatArray, m: int, order: IntArray, q: FloatArray,
    q_miss: FloatArray,
) -> None:  # fmt: skip
    """Fill the marginals `q` (entries,), `q_miss` (n,): weights of the past times weights of the rest, state by state.

    `w` (entries,), `u` (n,) are the weights of pairs and of rows left alone, the largest of each row at most one.
    """
    n = len(order)
    bit, closing, size = np.empty(len(col), np.int64), np.empty(n, np.int64), np.empty(n + 1, np.int64)
    _slots(begin, col, m, order, bit, closing, size)
    at = np.zeros(n + 2, np.int64)
    for k in range(n + 1):
        at[k + 1] = at[k] + size[k]
    past = np.zeros(at[n + 1])
    past[0] = 1.0
    for k in range(n):
        i, keep, here, there = order[k], ~closing[k], at[k], at[k + 1]
        for s in range(size[k]):
            f = past[here + s]
            if f == 0.0:
                continue
            past[there + (s & keep)] += f * u[i]
            for e in range(begin[i], begin[i + 1]):
                if s & bit[e] == 0:
                    past[there + ((s | bit[e]) & keep)] += f * w[e]
        _scale(past, there, at[k + 2])
    rest, before = np.ones(1), np.ones(1)
    for k in range(n - 1, -1, -1):
        i, keep, here = order[k], ~closing[k], at[k]
        before = np.zeros(size[k])
        for s in range(size[k]):
            f = past[here + s]
            if f == 0.0:
                continue
            alone = u[i] * rest[s & keep]
            total = alone
            q_miss[i] += f * alone
            for e in range(begin[i], begin[i + 1]):
                if s & bit[e] == 0:
                    taken = w[e] * rest[(s | bit[e]) & keep]
                    total += taken
                    q[e] += f * taken
            before[s] = total
        _scale(before, 0, size[k])
        share(q, q_miss, i, begin[i], begin[i + 1])
        rest = before


@njit(cache=True)
def _scale(a: FloatArray, first: int, last: int) -> None:
    """Divide a[first:last] by its sum."""
    total = 0.0
    for s in range(first, last):
        total += a[s]
    if total > 0.0:
        for s in range(first, last):
            a[s] /= total


@njit(cache=True)
def share(q: FloatArray, q_miss: FloatArray, i: int, first: int, last: int) -> None:
    """Make a row's marginals add up to one; where no joint event has any weight, the row is left alone."""
    total = q_miss[i]
    for e in range(first, last):
        total += q[e]
    if not total > 0.0:
        total = q_miss[i] = 1.0
    for e in range(first, last):
        q[e] /= total
    q_miss[i] /= total
