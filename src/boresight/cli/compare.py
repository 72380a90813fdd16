"""`boresight compare`: several tracker configurations on one recording, side by side."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from boresight.cli.output import print_json, print_table
from boresight.config.tracker import read_tracker_config
from boresight.errors import UserError
from boresight.io.recording import read_recording
from boresight.tracking.config import TrackerConfig
from boresight.types import Recording

SCORES = (
    "gospa_rms_m",
    "tracked_fraction",
    "position_rmse_m",
    "identity_switches",
    "breaks",
    "false_track_s",
    "nees_mean",
)
COLUMNS = {
    "config": "configuration",
    "seconds": "run\ntime s",
    "tracks": "tracks",
    "gospa_rms_m": "GOSPA\nRMS m",
    "tracked_fraction": "tracked",
    "position_rmse_m": "RMSE\nm",
    "identity_switches": "swit-\nches",
    "false_track_s": "false\ns",
    "nees_mean": "NEES",
}


def compare(
    rec: Path, /, *, config: Annotated[list[Path], Parameter(consume_multiple=True)], json: bool = False
) -> None:
    """Track one recording with several configurations and print scores (where it has truth) and run time.

    Parameters
    ----------
    rec
        Folder of the recording.
    config
        TOML files with the tracker's settings, two or more.
    json
        Print one JSON object instead of a table.
    """
    if len(config) < 2:
        raise UserError("--config needs two or more files to compare")
    recording = read_recording(rec)
    known = [s.id for s in recording.sensors]
    settings = [read_tracker_config(path, known) for path in config]  # all read before the first one runs
    rows = [_row(recording, path, one) for path, one in zip(config, settings)]
    if json:
        print_json("compare", {"recording": str(rec), "config": [str(path) for path in config]}, rows)
        return
    print_table(COLUMNS, rows, f"{recording.name}: one recording, {len(rows)} configurations", digits=3)


def _row(recording: Recording, path: Path, settings: TrackerConfig) -> dict[str, Any]:
    from boresight.cli.score import score_rows
    from boresight.cli.track import track_recording

    results = track_recording(recording, settings)
    row: dict[str, Any] = {"config": str(path), "seconds": results.summary["seconds"]}
    row["tracks"] = results.summary["counts"]["tracks"]
    scored: dict[str, Any] = {}
    if recording.truth:
        scored = next(r for r in score_rows(recording, results) if r["item"] == "tracks")
    return row | {key: scored.get(key) for key in SCORES}
