"""A user's own CSV files, with the column names of the recording format, to a Recording."""

from __future__ import annotations

from pathlib import Path

from boresight.io import detections as det
from boresight.io import paths
from boresight.io.declaration import read_declaration
from boresight.io.recording import assemble
from boresight.io.table import read_csv
from boresight.types import Recording


def import_csv(
    detections: Path, sensors: Path, platform: Path | None = None, truth: Path | None = None, ignore: Path | None = None
) -> Recording:
    """Return the recording of CSV files whose columns are named like those of the Parquet files; empty cell = null.

    `sensors` is a recording.toml. Raises UserError that names file, line and column.
    """
    declared = read_declaration(sensors)
    return assemble(
        declared,
        read_csv(detections, det.SCHEMA, det.REQUIRED),
        platform=read_csv(platform, paths.PLATFORM_SCHEMA, ("t_s", "platform")) if platform else None,
        truth=read_csv(truth, paths.TRUTH_SCHEMA, ("t_s", "target")) if truth else None,
        ignore=read_csv(ignore, paths.IGNORE_SCHEMA, tuple(paths.IGNORE_SCHEMA)) if ignore else None,
        where=str(sensors),
    )
