"""Joint probabilistic data association: the marginals of all ways to give reports to tracks, exact or by messages.

A joint event gives every track (row) one of its candidate reports (columns) or none, and no report to two tracks; its
probability is proportional to the product of the weights taken (`weight` of a pair, `miss` of a track left alone).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from boresight.kernels.jpda_exact import exact, plan, share
from boresight.kernels.options import PART
from boresight.types.sensor import FloatArray

IntArray = NDArray[np.int64]
ALONE, EXACT, LOOPY = 0, 1, 2  # how a row's marginals were found
SOLID = 1e-6
TOLERANCE, ROUNDS = 1e-10, 2000  # of the messages


@njit(cache=True)
def marginals(
    start: IntArray, column: IntArray, weight: FloatArray, miss: FloatArray, n_columns: int, most: float,
    p: FloatArray, p_miss: FloatArray, way: IntArray,
) -> None:  # fmt: skip
    """Fill the probability `p` (n_entries,) of every pair and `p_miss` (n_rows,) of every row to be left alone.

    Args:
        start: (n_rows + 1,) row i's candidates are entries start[i]:start[i + 1] of `column` and `weight`.
        weight, miss: (n_entries,), (n_rows,) >= 0, finite, of any scale. Where no joint event has any weight (more rows
            than columns, and none may miss), the rows are left alone.
        n_columns: number of columns.
        most: states that the exact way may visit in one cluster; a cluster that needs more goes by messages.
        way: (n_rows,) filled with ALONE, EXACT or LOOPY.

    Rows that share no column, directly or by others, are independent: each such cluster is worked out by itself, by
    rows or by columns, whichever needs fewer states (`kernels.jpda_exact`).
    """
    n = len(start) - 1
    root = _roots(start, column, n_columns)
    order = np.argsort(root)
    local = np.full(n_columns, -1, np.int64)
    first = 0
    while first < n:
        last = first + 1
        while last < n and root[order[last]] == root[order[first]]:
            last += 1
        _cluster(order[first:last], start, column, weight, miss, local, most, p, p_miss, way)
        first = last


@njit(**PART)
def _roots(start: IntArray, column: IntArray, n_columns: int) -> IntArray:
    """Return (n_rows,) one number for each cluster of rows: union–find over the columns."""
    n = len(start) - 1
    parent = np.arange(n)
    holder = np.full(n_columns, -1, np.int64)
    for i in range(n):
        for e in range(start[i], start[i + 1]):
            c = column[e]
            if holder[c] < 0:
                holder[c] = i
                continue
            a, b = i, holder[c]
            while parent[a] != a:
                parent[a] = parent[parent[a]]
                a = parent[a]
            while parent[b] != b:
                parent[b] = parent[parent[b]]
                b = parent[b]
            parent[max(a, b)] = min(a, b)
    for i in range(n):  # a parent never has a higher number
        parent[i] = parent[parent[i]]
    return parent


@njit(**PART)
def _cluster(
    rows: IntArray, start: IntArray, column: IntArray, weight: FloatArray, miss: FloatArray, local: IntArray,
    most: float, p: FloatArray, p_miss: FloatArray, way: IntArray,
) -> None:  # fmt: skip
    """Work out one cluster; `local` (n_columns,) is work space, -1 before and after.

    Weights are scaled so that the largest of a row is one. The columns' side counts from "left alone", which therefore
    must not be next to nothing.
    """
    n, entries = len(rows), 0
    for i in rows:
        entries += start[i + 1] - start[i]
    if entries == 0:
        for i in rows:
            p_miss[i], way[i] = 1.0, ALONE
        return
    begin, col, where = np.zeros(n + 1, np.int64), np.empty(entries, np.int64), np.empty(entries, np.int64)
    w, u = np.empty(entries), np.empty(n)
    m, k, solid = 0, 0, True
    for a in range(n):
        i = rows[a]
        top = miss[i] if miss[i] > 0.0 else 1e-300
        for e in range(start[i], start[i + 1]):
            top = max(top, weight[e])
            if local[column[e]] < 0:
                local[column[e]] = m
                m += 1
        for e in range(start[i], start[i + 1]):
            col[k], where[k], w[k] = local[column[e]], e, weight[e] / top
            k += 1
        begin[a + 1], u[a] = k, miss[i] / top
        solid = solid and u[a] > SOLID
    for e in range(entries):
        local[column[where[e]]] = -1
    q, q_miss = np.zeros(entries), np.zeros(n)
    turned, col_t, back = _turned(begin, col, m)
    by_rows, by_columns = np.empty(n, np.int64), np.empty(m, np.int64)
    states = plan(begin, col, m, most, by_rows)
    states_t = plan(turned, col_t, n, most, by_columns) if solid else math.inf
    if min(states, states_t) > most:
        _messages(begin, col, w, u, m, q, q_miss)
        found = LOOPY
    elif states <= states_t:
        exact(begin, col, w, u, m, by_rows, q, q_miss)
        found = EXACT
    else:
        _by_columns(turned, col_t, back, w, u, by_columns, q, q_miss, begin)
        found = EXACT
    for e in range(entries):
        p[where[e]] = q[e]
    for a in range(n):
        p_miss[rows[a]], way[rows[a]] = q_miss[a], found


@njit(**PART)
def _turned(begin: IntArray, col: IntArray, m: int) -> tuple[IntArray, IntArray, IntArray]:
    """Return the same pairs by columns: their beginnings (m + 1,), rows, and where each stands among the others."""
    turned = np.zeros(m + 1, np.int64)
    for c in col:
        turned[c + 1] += 1
    for c in range(m):
        turned[c + 1] += turned[c]
    at, rows, back = turned[:m].copy(), np.empty(len(col), np.int64), np.empty(len(col), np.int64)
    for i in range(len(begin) - 1):
        for e in range(begin[i], begin[i + 1]):
            k = at[col[e]]
            rows[k], back[k] = i, e
            at[col[e]] = k + 1
    return turned, rows, back


@njit(**PART)
def _by_columns(
    turned: IntArray, row: IntArray, back: IntArray, w: FloatArray, u: FloatArray, order: IntArray,
    q: FloatArray, q_miss: FloatArray, begin: IntArray,
) -> None:  # fmt: skip
    """Work out a cluster from the columns' side: with weights counted from `u`, rows and columns change places."""
    m = len(turned) - 1
    v, one = np.empty(len(back)), np.empty(m)
    for c in range(m):
        top = 1.0
        for k in range(turned[c], turned[c + 1]):
            v[k] = w[back[k]] / u[row[k]]
            top = max(top, v[k])
        for k in range(turned[c], turned[c + 1]):
            v[k] /= top
        one[c] = 1.0 / top
    found, alone = np.zeros(len(back)), np.zeros(m)
    exact(turned, row, v, one, len(u), order, found, alone)
    for k in range(len(back)):
        q[back[k]] = found[k]
    for i in range(len(u)):
        rest = 1.0
        for e in range(begin[i], begin[i + 1]):
            rest -= q[e]
        q_miss[i] = max(rest, 0.0)


@njit(**PART)
def _messages(
    begin: IntArray, col: IntArray, w: FloatArray, u: FloatArray, m: int, q: FloatArray, q_miss: FloatArray
) -> None:
    """Fill approximate marginals by belief propagation (Williams and Lau 2014).

    Row i tells column j mu = w / (u + Σ over its other columns of w nu), column j tells row i nu = 1 / (1 + Σ over its
    other rows of mu). It always converges; the marginals lean towards certainty where cycles are short.
    """
    n, entries = len(begin) - 1, len(col)
    mu, nu, heard = np.zeros(entries), np.ones(entries), np.zeros(m)
    for _ in range(ROUNDS):
        for i in range(n):
            total = u[i]
            for e in range(begin[i], begin[i + 1]):
                total += w[e] * nu[e]
            for e in range(begin[i], begin[i + 1]):
                mu[e] = w[e] / max(total - w[e] * nu[e], 1e-15 * total, 1e-300)
        heard[:] = 0.0
        for e in range(entries):
            heard[col[e]] += mu[e]
        moved = 0.0
        for e in range(entries):
            new = 1.0 / (1.0 + max(heard[col[e]] - mu[e], 0.0))
            moved = max(moved, abs(new - nu[e]))
            nu[e] = new
        if moved < TOLERANCE:
            break
    for i in range(n):
        for e in range(begin[i], begin[i + 1]):
            q[e] = w[e] * nu[e]
        q_miss[i] = u[i]
        share(q, q_miss, i, begin[i], begin[i + 1])
