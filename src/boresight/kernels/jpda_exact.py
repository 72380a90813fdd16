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

from boresight.kernels.options import PART
from boresight.types.sensor import FloatArray

IntArray = NDArray[np.int64]
MOST_OPEN = 30  # columns


@njit(**PART)
def plan(begin: IntArray, col: IntArray, m: int, most: float, order: IntArray) -> float:
    """Fill `order` (n,) with the rows so that few columns are open at a time; returns the states, inf beyond `most`.

    Greedily, next comes the row that leaves the fewest columns open. A column that only one row can take is never open.
    """
    n = len(begin) - 1
    left = np.zeros(m, np.int64)  # rows to come that have the column
    is_open, done = np.zeros(m, np.bool_), np.zeros(n, np.bool_)
    for c in col:
        left[c] += 1
    now, states = 0, 0.0
    for k in range(n):
        best, least, fresh = -1, 0, 0
        for i in range(n):
            if done[i]:
                continue
            new, old = 0, 0
            for e in range(begin[i], begin[i + 1]):
                new += not is_open[col[e]] and left[col[e]] > 1
                old += is_open[col[e]] and left[col[e]] == 1
            if best < 0 or new - old < least:
                best, least, fresh = i, new - old, new
        states += 2.0 ** (now + fresh)
        if states > most or now + fresh > MOST_OPEN:
            return math.inf
        order[k], done[best], now = best, True, now + least
        for e in range(begin[best], begin[best + 1]):
            left[col[e]] -= 1
            is_open[col[e]] = left[col[e]] > 0
    return states


@njit(**PART)
def _slots(
    begin: IntArray, col: IntArray, m: int, order: IntArray, bit: IntArray, keep: IntArray, size: IntArray,
    moves: IntArray,
) -> None:  # fmt: skip
    """Give every open column a bit, and the bits of closed ones to others, so that the open ones are the lowest.

    Fills `bit` (entries,) at its row's time (0 for a column that no other row can take), the bits to `keep` after each
    row (n,), the states `size` (n + 1,) before each row, and `moves` (m + 1, 3): row, bit from, bit to, ended by -1.
    """
    left, slot, used, moved = np.zeros(m, np.int64), np.full(m, -1, np.int64), 0, 0
    holder = np.full(MOST_OPEN + 1, -1, np.int64)
    for c in col:
        left[c] += 1
    size[0] = 1
    for k in range(len(order)):
        first, last = begin[order[k]], begin[order[k] + 1]
        for e in range(first, last):
            c = col[e]
            left[c] -= 1
            if slot[c] < 0 and left[c] > 0:
                holder[used], slot[c] = c, used
                used += 1
            bit[e] = 1 << slot[c] if slot[c] >= 0 else 0
        keep[k] = (1 << used) - 1
        for e in range(first, last):
            if slot[col[e]] >= 0 and left[col[e]] == 0:
                keep[k] &= ~bit[e]
                holder[slot[col[e]]] = -1
        low = 0
        while low < used:
            if holder[used - 1] < 0:
                used -= 1
            elif holder[low] >= 0:
                low += 1
            else:
                used -= 1
                moves[moved, 0], moves[moved, 1], moves[moved, 2] = k, 1 << used, 1 << low
                holder[low], holder[used] = holder[used], -1
                slot[holder[low]] = low
                moved += 1
        size[k + 1] = 1 << used
    moves[moved, 0] = -1


@njit(**PART)
def _narrowed(k: int, room: int, keep: int, moves: IntArray, move: int, to: IntArray) -> int:
    """Fill `to` (room,) with what each state while row k is taken becomes after it; return the next first move."""
    for s in range(room):
        to[s] = s & keep
    while moves[move, 0] == k:
        high, low = moves[move, 1], moves[move, 2]
        for s in range(room):
            if to[s] & high:
                to[s] ^= high | low
        move += 1
    return move


@njit(**PART)
def exact(
    begin: IntArray, col: IntArray, w: FloatArray, u: FloatArray, m: int, order: IntArray, q: FloatArray,
    q_miss: FloatArray,
) -> None:  # fmt: skip
    """Fill the marginals `q` (entries,), `q_miss` (n,): weights of the past times weights of the rest, state by state.

    `w` (entries,), `u` (n,) are the weights of pairs and of rows left alone, the largest of each row at most one.
    """
    n = len(order)
    bit, keep, size = np.empty(len(col), np.int64), np.empty(n, np.int64), np.empty(n + 1, np.int64)
    moves, move_of = np.empty((m + 1, 3), np.int64), np.zeros(n + 1, np.int64)
    _slots(begin, col, m, order, bit, keep, size, moves)
    at, widest = np.zeros(n + 2, np.int64), 1
    for k in range(n + 1):
        at[k + 1] = at[k] + size[k]
    for e in range(len(col)):
        widest = max(widest, 2 * bit[e])
    past, wide, to = np.zeros(at[n + 1]), np.empty(widest), np.empty(widest, np.int64)
    past[0] = 1.0
    for k in range(n):
        first, last = begin[order[k]], begin[order[k] + 1]
        room, free = _room(size[k], bit, first, last), _free(u[order[k]], bit, w, first, last)
        wide[:room] = 0.0
        for s in range(size[k]):
            wide[s] = free * past[at[k] + s]
        for e in range(first, last):
            if bit[e]:
                _push(past, at[k], size[k], bit[e], w[e], wide)
        move_of[k + 1] = _narrowed(k, room, keep[k], moves, move_of[k], to)
        for s in range(room):
            past[at[k + 1] + to[s]] += wide[s]
        _scale(past, at[k + 1], at[k + 2])
    rest, before = np.ones(widest), np.empty(widest)
    for k in range(n - 1, -1, -1):
        i, first, last = order[k], begin[order[k]], begin[order[k] + 1]
        room, free = _room(size[k], bit, first, last), _free(u[i], bit, w, first, last)
        _narrowed(k, room, keep[k], moves, move_of[k], to)
        for s in range(room):
            wide[s] = rest[to[s]]
        alone = _weigh(past, at[k], size[k], free, wide, before)
        q_miss[i] = alone * u[i] / free if free > 0.0 else 0.0
        for e in range(first, last):
            if bit[e]:
                q[e] = _pull(past, at[k], size[k], bit[e], w[e], wide, before)
            else:
                q[e] = alone * w[e] / free if free > 0.0 else 0.0
        _scale(before, 0, size[k])
        share(q, q_miss, i, first, last)
        rest, before = before, rest


@njit(**PART)
def _free(u: float, bit: IntArray, w: FloatArray, first: int, last: int) -> float:
    """Return the weight of what a row can do without taking from others: be left alone, or take a column of its own."""
    for e in range(first, last):
        if bit[e] == 0:
            u += w[e]
    return u


@njit(**PART)
def _room(size: int, bit: IntArray, first: int, last: int) -> int:
    """Return how many states there are while a row is taken: its new reports have bits beyond `size`."""
    for e in range(first, last):
        size = max(size, 2 * bit[e])
    return size


@njit(cache=True, fastmath={"contract", "reassoc", "nsz"})
def _push(past: FloatArray, at: int, size: int, bit: int, w: float, wide: FloatArray) -> None:
    """Add w · past[s] to wide[s | bit] for every state s without the bit."""
    for high in range(0, size, 2 * bit):
        for s in range(high, min(high + bit, size)):
            wide[s + bit] += w * past[at + s]


@njit(cache=True, fastmath={"contract", "reassoc", "nsz"})
def _pull(past: FloatArray, at: int, size: int, bit: int, w: float, wide: FloatArray, before: FloatArray) -> float:
    """Add w · wide[s | bit] to before[s] for every state s without the bit; return the sum of past[s] times that."""
    total = 0.0
    for high in range(0, size, 2 * bit):
        for s in range(high, min(high + bit, size)):
            taken = w * wide[s + bit]
            before[s] += taken
            total += past[at + s] * taken
    return total


@njit(cache=True, fastmath={"contract", "reassoc", "nsz"})
def _weigh(past: FloatArray, at: int, size: int, u: float, wide: FloatArray, before: FloatArray) -> float:
    """Set before[s] to u · wide[s], of the row left alone; return the sum of past[s] times that."""
    total = 0.0
    for s in range(size):
        before[s] = u * wide[s]
        total += past[at + s] * before[s]
    return total


@njit(**PART)
def _scale(a: FloatArray, first: int, last: int) -> None:
    """Divide a[first:last] by its sum."""
    total = 0.0
    for s in range(first, last):
        total += a[s]
    if total > 0.0:
        for s in range(first, last):
            a[s] /= total


@njit(**PART)
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
