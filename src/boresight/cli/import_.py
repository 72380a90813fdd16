"""`boresight import`: other formats to a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from boresight.cli.output import print_notes
from boresight.io.files import RECORDING, check_output
from boresight.io.recording import write_recording
from boresight.types import Recording

app = App(name="import", help="Turn other formats into a recording.", help_format="plaintext")

Output = Annotated[Path, Parameter(name=["--output", "-o"])]


@app.command
def autoferry(
    detections: Path, /, *, output: Output, truth: Path | None = None, ignore: Path | None = None, force: bool = False
) -> None:
    """Import one scenario of the Autoferry benchmark (JSON).

    Parameters
    ----------
    detections
        scenarioN_detections.json: radar, lidar, IR and EO looks.
    output
        Folder of the recording.
    truth
        scenarioN_groundTruth.json; entry i pairs with look i.
    ignore
        CSV (time, object, north, east): real objects without truth, which are not scored.
    force
        Replace the output folder.
    """
    from boresight.io.autoferry import TRACKER_TOML, import_autoferry

    check_output(output, force, RECORDING, [detections, truth, ignore])
    _finish(import_autoferry(detections, truth, ignore), output, force, {"tracker.toml": TRACKER_TOML})


@app.command
def csv(
    detections: Path,
    /,
    *,
    sensors: Path,
    output: Output,
    platform: Path | None = None,
    truth: Path | None = None,
    ignore: Path | None = None,
    force: bool = False,
) -> None:
    """Import your own CSV, its columns named like those of detections.parquet; an empty cell is "not measured".

    Parameters
    ----------
    detections
        One line per detection: t_s, sensor, scan, and what was measured (range_m, azimuth_deg, x_m …).
    sensors
        A recording.toml that declares site and sensors.
    output
        Folder of the recording.
    platform
        CSV of moving platforms: t_s, platform, positions, attitude.
    truth
        CSV of true paths: t_s, target, east_m, north_m, up_m.
    ignore
        CSV of real objects without truth: t_s, object, east_m, north_m, radius_m.
    force
        Replace the output folder.
    """
    from boresight.io.user_csv import import_csv

    check_output(output, force, RECORDING, [detections, sensors, platform, truth, ignore])
    _finish(import_csv(detections, sensors, platform, truth, ignore), output, force)


def _finish(recording: Recording, output: Path, force: bool, extras: dict[str, str] | None = None) -> None:
    write_recording(recording, output, force, extras)
    print_notes(recording.notes)
    n, twins = len(recording.detections), int(recording.duplicates.sum())
    refused = f", {len(recording.refused)} refused" if recording.refused else ""
    print(f"wrote {output}: {n} rows of {len(recording.sensors)} sensors ({twins} duplicates{refused})")
