"""What a tracker gives back: rows of tracks, what became of every report, and a summary."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boresight.types.enums import Fate, TrackStatus
from boresight.types.sensor import FloatArray

ENU = ("east_m", "north_m", "up_m")
VELOCITY = ("ve_m_s", "vn_m_s", "vu_m_s")
COVARIANCE = {
    "cov_ee": (0, 0),
    "cov_en": (0, 1),
    "cov_nn": (1, 1),
    "cov_eu": (0, 2),
    "cov_nu": (1, 2),
    "cov_uu": (2, 2),
}
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

    def columns(self) -> dict[str, Any]:
        """Return the columns of tracks.parquet, null where there is no number."""
        out: dict[str, Any] = {
            "t_s": self.t,
            "t_known_s": self.t_known,
            "track_id": self.track_id.astype(np.int64),
            "status": _words(self.status, STATUSES),
        }
        out |= {n: _nullable(self.position[:, i]) for i, n in enumerate(ENU)}
        out |= {n: _nullable(self.velocity[:, i]) for i, n in enumerate(VELOCITY)}
        return out | {n: _nullable(self.covariance[:, i, j]) for n, (i, j) in COVARIANCE.items()}

    def to_arrow(self) -> Any:
        """Return tracks.parquet as a pyarrow.Table."""
        return _table(self.columns())

    def to_pandas(self) -> Any:
        """Return tracks.parquet as a pandas.DataFrame; needs pandas."""
        return self.to_arrow().to_pandas()


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

    def columns(self) -> dict[str, Any]:
        """Return the columns of decisions.parquet, null where there is no number."""
        import pyarrow as pa

        out: dict[str, Any] = {
            "row": self.row.astype(np.int64),
            "fate": _words(self.fate, FATES),
            "track_id": pa.array(self.track_id.astype(np.int64), mask=self.track_id == NO_TRACK),
            "nis": _nullable(self.nis),
            "reason": pa.array(self.reason.tolist(), pa.string()),
        }
        return out | {name: pa.array(values, from_pandas=True) for name, values in self.extra.items()}

    def to_arrow(self) -> Any:
        """Return decisions.parquet as a pyarrow.Table."""
        return _table(self.columns())

    def to_pandas(self) -> Any:
        """Return decisions.parquet as a pandas.DataFrame; needs pandas."""
        return self.to_arrow().to_pandas()


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


def _table(columns: dict[str, Any]) -> Any:
    import pyarrow as pa

    return pa.table({k: v if isinstance(v, pa.Array | pa.ChunkedArray) else pa.array(v) for k, v in columns.items()})


def _nullable(values: FloatArray) -> Any:
    import pyarrow as pa

    return pa.array(np.ascontiguousarray(values, dtype=np.float64), from_pandas=True)


def _words(codes: NDArray[np.uint8], words: tuple[Any, ...]) -> Any:
    import pyarrow as pa

    return pa.array(np.array([str(w) for w in words], dtype=object)[codes], pa.string())
