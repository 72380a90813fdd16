"""What a tracker gives: rows of tracks and decisions on reports, as columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.kernels.tracker import GATED, INITIATED, OUTSIDE, UNASSOCIATED, UPDATED
from boresight.kernels.tracker_rows import RowTable
from boresight.kernels.tracker_window import LATE, NO_POSE
from boresight.tracking.window import Left
from boresight.types import FATES, Fate, FloatArray

_OF_CODE = np.zeros(5, np.uint8)
for _code, _fate in (
    (UNASSOCIATED, Fate.UNASSOCIATED),
    (UPDATED, Fate.UPDATED),
    (INITIATED, Fate.INITIATED),
    (OUTSIDE, Fate.OUT_OF_COVERAGE),
    (GATED, Fate.GATED),
):
    _OF_CODE[_code] = FATES.index(_fate)


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Rows of tracks.parquet as columns; `birth` is the detection that began the track."""

    t: FloatArray
    t_known: FloatArray
    track_id: NDArray[np.int64]
    birth: NDArray[np.int64]
    coasting: NDArray[np.bool_]
    position: FloatArray  # (n, d)
    velocity: FloatArray  # (n, d)
    covariance: FloatArray  # (n, d, d)


class Decisions(NamedTuple):
    """What became of rows of the detections, as columns; `birth` names a track by the row that began it (-1: none)."""

    row: NDArray[np.int64]
    fate: NDArray[np.uint8]  # place in FATES
    birth: NDArray[np.int64]
    nis: FloatArray


def rows_of(table: RowTable, track_id: NDArray[np.int64]) -> Rows:
    """Return the rows that the kernel made, with their tracks' numbers (n,)."""
    n = len(track_id)
    return Rows(
        table.t[:n], table.t_known[:n], track_id, table.birth[:n], table.coasting[:n], table.position[:n],
        table.velocity[:n], table.covariance[:n],
    )  # fmt: skip


def decisions_of(left: Left) -> Decisions:
    """Return what became of the detections of looks that have left the window."""
    fate = _OF_CODE[left.code]
    fate[left.outcome == LATE] = FATES.index(Fate.LATE)
    fate[left.outcome == NO_POSE] = FATES.index(Fate.SCREENED)
    return Decisions(left.row, fate, left.owner, left.nis)


def unseen(rows: Sequence[int]) -> Decisions:
    """Return the decisions on rows that say that a look saw nothing."""
    n = len(rows)
    fate = np.full(n, FATES.index(Fate.NO_DETECTION), np.uint8)
    return Decisions(np.array(rows, np.int64), fate, np.full(n, -1, np.int64), np.full(n, np.nan))
