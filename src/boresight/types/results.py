"""What a tracker gives back: rows of tracks, what became of every report, and a summary."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boresight.types.enums import Fate, TrackStatus
from boresight.types.sensor import FloatArray

STATUSES: tuple[TrackStatus, ...] = tuple(TrackStatus)  # code -> status
FATES: tuple[Fate, ...] = tuple(Fate)  # code -> fate
NO_TRACK = -1


@dataclass(frozen=True, slots=True, eq=False)
class TrackRows:
    """Rows of `tracks.parquet` as columns: site ENU, SI; the up components are NaN in two dimensions."""

    t: FloatArray  # (n,) s, time of validity
    t_known: FloatArray  # (n,) s, arrival of the newest report used; at most t
    track_id: NDArray[np.int64]  # (n,)
    status: NDArray[np.uint8]  # (n,) index into STATUSES
    position: FloatArray  # (n, 3) m
    velocity: FloatArray  # (n, 3) m/s
    covariance: FloatArray  # (n, 3, 3) of the position, m²

    def __len__(self) -> int:
        return len(self.t)


@dataclass(frozen=True, slots=True, eq=False)
class DecisionRows:
    """Rows of `decisions.parquet` as columns: one per row of the detections, in file order."""

    row: NDArray[np.int64]  # (n,)
    fate: NDArray[np.uint8]  # (n,) index into FATES
    track_id: NDArray[np.int64]  # (n,) NO_TRACK where none
    nis: FloatArray  # (n,) NaN where none
    reason: NDArray[np.object_]  # (n,) str, or None
    extra: dict[str, NDArray[Any]] = field(default_factory=dict)  # further columns, each (n,)

    def __len__(self) -> int:
        return len(self.row)


@dataclass(frozen=True, slots=True, eq=False)
class RegistrationRows:
    """Rows of `registration.parquet` as columns: what is known of the sensors' constant errors, over time."""

    t: FloatArray  # (n,) s, arrival of the newest report used
    sensor: NDArray[np.object_]  # (n,) str
    parameter: NDArray[np.object_]  # (n,) str with the unit at its end; reported minus true
    value: FloatArray  # (n,)
    sigma: FloatArray  # (n,)
    declared: FloatArray  # (n,) standard deviation before any report
    verdict: NDArray[np.object_]  # (n,) str

    def __len__(self) -> int:
        return len(self.t)


@dataclass(frozen=True, slots=True, eq=False)
class Results:
    """Everything that `boresight track` writes, in memory."""

    tracks: TrackRows
    decisions: DecisionRows
    summary: dict[str, Any]
    smoothed: TrackRows | None = None  # of the past, each row with what came up to its t_known (later than its t)
    registration: RegistrationRows | None = None


def no_tracks() -> TrackRows:
    """Return the rows of a tracker that reported nothing."""
    empty = np.zeros(0)
    return TrackRows(
        empty,
        empty,
        np.zeros(0, dtype=np.int64),
        np.zeros(0, dtype=np.uint8),
        np.zeros((0, 3)),
        np.zeros((0, 3)),
        np.zeros((0, 3, 3)),
    )
