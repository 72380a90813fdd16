"""Global-nearest-neighbour assignment on a sparse cost list, by shortest augmenting paths."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from boresight.kernels.options import PART
from boresight.types.sensor import FloatArray

IntArray = NDArray[np.int64]


@njit(**PART)
def _sift_up(heap_d: FloatArray, heap_c: IntArray, size: int, d: float, c: int) -> None:
    i = size
    while i > 0:
        parent = (i - 1) >> 1
        if heap_d[parent] <= d:
            break
        heap_d[i] = heap_d[parent]
        heap_c[i] = heap_c[parent]
        i = parent
    heap_d[i] = d
    heap_c[i] = c


@njit(**PART)
def _pop(heap_d: FloatArray, heap_c: IntArray, size: int) -> None:
    """Remove the top of a heap of `size` entries (the caller has read it)."""
    d = heap_d[size - 1]
    c = heap_c[size - 1]
    size -= 1
    i = 0
    while True:
        child = 2 * i + 1
        if child >= size:
            break
        if child + 1 < size and heap_d[child + 1] < heap_d[child]:
            child += 1
        if heap_d[child] >= d:
            break
        heap_d[i] = heap_d[child]
        heap_c[i] = heap_c[child]
        i = child
    heap_d[i] = d
    heap_c[i] = c


@njit(cache=True)
def assign_sparse(start: IntArray, column: IntArray, cost: FloatArray, n_columns: int, col_of_row: IntArray) -> None:
    """Assign rows to columns at the least total cost, where a row may also stay alone at cost zero.

    Args:
        start: (n_rows + 1,) row i's candidates are entries start[i]:start[i + 1].
        column, cost: (n_entries,) candidate columns and their costs; only negative costs can be worth taking.
        n_columns: number of columns.
        col_of_row: (n_rows,) filled with the assigned column, -1 where the row stays alone.

    Successive shortest augmenting paths with dual prices (Jonker and Volgenant 1987), on a heap. Every row owns a
    private column of cost zero that stands for "alone", so that a path always ends; the result equals the dense
    optimum. Work grows with the size of the connected groups of candidates, not with rows × columns.
    """
    n_rows = len(start) - 1
    n_entries = len(column)
    row_of_col = np.full(n_columns, -1, np.int64)
    price = np.zeros(n_columns)  # dual of a real column, ≤ 0; a private column's stays 0
    dist = np.full(n_columns, np.inf)
    came_from = np.full(n_columns, -1, np.int64)
    closed = np.zeros(n_columns, np.bool_)
    touched = np.empty(n_columns, np.int64)
    heap_d = np.empty(n_entries + 1)
    heap_c = np.empty(n_entries + 1, np.int64)
    for i in range(n_rows):
        col_of_row[i] = -1
    for first in range(n_rows):
        if start[first] == start[first + 1]:
            continue  # no candidates: alone
        n_touched = 0
        size = 0
        row = first
        base = 0.0  # length of the shortest path to `row`
        shortest = 0.0  # of the ends found so far: `first` stays alone
        alone = first
        end = -1
        while True:
            dual = _dual(row, col_of_row[row], start, column, cost, price)
            for e in range(start[row], start[row + 1]):
                c = column[e]
                d = base + cost[e] - price[c] - dual
                if not closed[c] and d < dist[c] and d < shortest:
                    if dist[c] == np.inf:
                        touched[n_touched] = c
                        n_touched += 1
                    dist[c] = d
                    came_from[c] = row
                    _sift_up(heap_d, heap_c, size, d, c)
                    size += 1
            c = -1
            while size > 0 and c < 0:
                c = heap_c[0] if not closed[heap_c[0]] and heap_d[0] == dist[heap_c[0]] else -1
                _pop(heap_d, heap_c, size)
                size -= 1
            if c < 0 or dist[c] >= shortest:
                break
            closed[c] = True
            base = dist[c]
            if row_of_col[c] < 0:
                end = c
                shortest = base
                break
            row = row_of_col[c]
            up = base - _dual(row, c, start, column, cost, price)  # it could give its column up and stay alone
            if up < shortest:
                shortest = up
                alone = row
                end = -1
        for k in range(n_touched):
            c = touched[k]
            if closed[c] and dist[c] < shortest:
                price[c] += dist[c] - shortest
            dist[c] = np.inf
            closed[c] = False
        _augment(first, end, alone, came_from, col_of_row, row_of_col)


@njit(**PART)
def _dual(row: int, held: int, start: IntArray, column: IntArray, cost: FloatArray, price: FloatArray) -> float:
    """Return a row's dual: the reduced cost of the column it holds, zero where it is alone."""
    for e in range(start[row], start[row + 1]):
        if column[e] == held:
            return float(cost[e] - price[held])
    return 0.0


@njit(**PART)
def _augment(first: int, end: int, alone: int, came_from: IntArray, col_of_row: IntArray, row_of_col: IntArray) -> None:
    """Move the assignment along the path back from the free column `end`, or from the row that stays `alone`."""
    c = end
    if end < 0:
        if alone == first:
            return
        c = col_of_row[alone]
        col_of_row[alone] = -1
        row_of_col[c] = -1
    while True:
        row = came_from[c]
        previous = col_of_row[row]
        col_of_row[row] = c
        row_of_col[c] = row
        if row == first:
            return
        c = previous
