"""What a live run writes with -o: rows and decisions go to the disk as they come, and become tables at its end."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boresight.engine.track import TrackOutput
from boresight.io.files import reason
from boresight.tracking.output import Rows
from boresight.tracking.run import fates_of, track_rows
from boresight.tracking.tracker import TrackerState
from boresight.types import DecisionRows, TrackRows

_DECISION = np.dtype([("row", "<i8"), ("birth", "<i8"), ("nis", "<f8"), ("fate", "u1")])


class ResultFiles:
    """A sink: rows and decisions of a live run in files of fixed records; `tables` reads them again.

    A disk that refuses is counted and told, and never stops the run: then the tables are not whole.
    """

    def __init__(self, folder: Path, dimensions: int) -> None:
        d = dimensions
        self._row = np.dtype([
            ("t", "<f8"), ("t_known", "<f8"), ("track_id", "<i8"), ("birth", "<i8"), ("coasting", "?"),
            ("position", "<f8", (d,)), ("velocity", "<f8", (d,)), ("covariance", "<f8", (d, d)),
        ])  # fmt: skip
        self.folder = folder
        self.rows, self.decisions = folder / "rows.bin", folder / "decisions.bin"
        self.errors = 0
        self.error = ""

    def take(self, output: TrackOutput) -> None:
        """Write what a step gave."""
        for rows in output.rows:
            out = np.empty(len(rows.t), self._row)
            for name in self._row.names or ():
                out[name] = getattr(rows, name)
            self._append(self.rows, out)
        for some in output.decisions:
            one = np.empty(len(some.row), _DECISION)
            one["row"], one["birth"], one["nis"], one["fate"] = some.row, some.birth, some.nis, some.fate
            self._append(self.decisions, one)

    def tables(self, state: TrackerState, n: int, duplicates: list[int]) -> tuple[TrackRows, DecisionRows]:
        """Return the tables of a run of `n` detection rows; what was given after the last arrival is none of it."""
        kept = self._read(self.rows, self._row)
        kept = kept[kept["t_known"] <= state.arrival]
        rows = [Rows(*(kept[name] for name in self._row.names or ()))] if len(kept) else []
        found = self._read(self.decisions, _DECISION)
        fates = [(found["row"], found["fate"], found["birth"], found["nis"])] if len(found) else []
        twice = np.zeros(n, np.bool_)
        twice[duplicates] = True
        return track_rows(rows), fates_of(np.ones(n, np.bool_), twice, fates, state.names)  # type: ignore[arg-type]

    def _append(self, path: Path, values: NDArray[Any]) -> None:
        if not len(values):
            return
        try:
            with path.open("ab") as file:
                size = file.tell()
                try:
                    file.write(values.tobytes())
                    file.flush()
                except OSError:
                    file.truncate(size)
                    raise
        except OSError as error:
            self.errors += 1
            self.error = reason(error)

    def _read(self, path: Path, dtype: np.dtype[Any]) -> NDArray[Any]:
        return np.fromfile(path, dtype) if path.exists() else np.zeros(0, dtype)
