"""`boresight compare`: several pipelines on one recording, side by side."""

from __future__ import annotations

from json import dumps
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from boresight._version import __version__
from boresight.cli.output import print_json, print_table
from boresight.cli.track import sensor_ids
from boresight.config.tracker import read_configuration
from boresight.errors import UserError
from boresight.io.files import check_output, output_folder
from boresight.io.recording import read_recording
from boresight.io.results import finite
from boresight.tracking.config import TrackerConfig
from boresight.types import Recording, Results

MARKER = "compare.json"  # what tells that a folder is one of this command's, to be replaced

STAGES = ("screen", "smooth", "align", "fuse")
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
    rec: Path,
    /,
    *,
    config: Annotated[list[Path], Parameter(consume_multiple=True)],
    sensors: str | None = None,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    force: bool = False,
    json: bool = False,
) -> None:
    """Track one recording with several configurations and print scores (where it has truth) and run time.

    Parameters
    ----------
    rec
        Folder of the recording.
    config
        TOML files with the tracker's settings and pipelines, two or more.
    sensors
        Sensors to use, separated by commas (all).
    output
        Folder to write compare.png (tracks and scores side by side) and compare.json to.
    force
        Replace the output folder.
    json
        Print one JSON object instead of a table.
    """
    if len(config) < 2:
        raise UserError("--config needs two or more files to compare")
    if output is not None:
        check_output(output, force, MARKER, [rec, *config])
    recording = read_recording(rec)
    ids = sensor_ids(recording, sensors)
    known = [s.id for s in recording.sensors]
    settings = [read_configuration(path, known) for path in config]  # all read before the first one runs
    done = [_row(recording, path, *one, ids) for path, one in zip(config, settings, strict=True)]
    rows = [row for row, _ in done]
    parameters = {"recording": str(rec), "config": [str(path) for path in config], "sensors": ids}
    if output is not None:
        _write(output, force, recording, [results for _, results in done], rows, parameters)
    if json:
        print_json("compare", parameters, rows)
        return
    shown = [row | {"config": path.stem} for row, path in zip(rows, config, strict=True)]
    print_table(COLUMNS, shown, f"{recording.name}: one recording, {len(rows)} configurations", digits=3)
    if output is not None:
        print(f"wrote {output / 'compare.png'}")


def _row(
    recording: Recording, path: Path, settings: TrackerConfig, stages: dict[str, Any], ids: list[str] | None
) -> tuple[dict[str, Any], Results]:
    from boresight.cli.score import score_rows
    from boresight.cli.track import track_recording

    results = track_recording(recording, settings, ids, stages, str(path))
    row: dict[str, Any] = {"config": str(path), "seconds": results.summary["seconds"]}
    row["tracks"] = results.summary["counts"]["tracks"]
    row |= {name: stages[name]["kind"] if name in stages else "none" for name in STAGES}
    scored: dict[str, Any] = {}
    if recording.truth:
        scored = next(r for r in score_rows(recording, results) if r["item"] == "tracks")
    row |= {key: scored.get(key) for key in SCORES}
    return row | {f"reports_{fate}": n for fate, n in results.summary["counts"]["fates"].items()}, results


def _write(
    output: Path, force: bool, recording: Recording, results: list[Results], rows: list[dict[str, Any]], about: Any
) -> None:
    from boresight.report.compare import draw

    with output_folder(output, force, MARKER) as folder:
        draw(folder / "compare.png", recording, results, rows)
        data = {"command": "compare", "version": __version__, "parameters": about, "rows": rows}
        (folder / MARKER).write_text(dumps(finite(data), indent=1, allow_nan=False) + "\n", encoding="utf-8")
