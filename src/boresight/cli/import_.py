"""`boresight import`: other formats to a recording."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from boresight.cli.output import print_notes
from boresight.errors import UserError
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

    check_output(output, force, RECORDING, [detections, truth, ignore], ["tracker.toml"])
    _finish(import_autoferry(detections, truth, ignore), output, force, {"tracker.toml": TRACKER_TOML})


@app.command
def csv(
    *detections: Path,
    sensors: Path | None = None,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    platform: Path | None = None,
    truth: Path | None = None,
    ignore: Path | None = None,
    guess: bool = False,
    mapping: Path | None = None,
    time_unit: str | None = None,
    time_offset: Annotated[list[str] | None, Parameter(name="--time-offset")] = None,
    ignore_columns: str | None = None,
    geoid_height_m: float | None = None,
    far: bool = False,
    force: bool = False,
) -> None:
    """Import your own CSV files, their columns named like those of detections.parquet; an empty cell is "not measured".

    Columns may have other units (range_km, azimuth_rad, t_ms), stamps may be ISO 8601, columns may be separated by
    semicolons with decimal commas. With --guess other names are understood (lat, heading, sog_kn), files may hold
    detections, a platform's path or truth, and looks are numbered; the mapping is printed without -o, and written to
    REC/mapping.toml with it.

    Parameters
    ----------
    detections
        One line per detection: t_s, sensor, scan, and what was measured (range_m, azimuth_deg, x_m …).
    sensors
        A recording.toml that declares site and sensors; --guess alone proposes one.
    output
        Folder of the recording.
    platform
        CSV of moving platforms: t_s, platform, positions, attitude.
    truth
        CSV of true paths: t_s, target, east_m, north_m, up_m.
    ignore
        CSV of real objects without truth: t_s, object, east_m, north_m, radius_m.
    guess
        Guess names, units, whose rows they are and the numbers of the looks, and say so.
    mapping
        TOML that says all this, as --guess proposes it; its paths are relative to it.
    time_unit
        Of the stamps: s, ms, us, ns, s-of-day, s-of-week, iso8601 (s; ISO 8601 is recognised).
    time_offset
        SENSOR=SECONDS to add to the stamps of a sensor or platform; may be given several times.
    ignore_columns
        Columns to leave out, separated by commas.
    geoid_height_m
        Height of the geoid (mean sea level) above the WGS84 ellipsoid, for columns like alt_msl.
    far
        Take platforms and sensors more than 1000 km from the site, which are else refused as a mistake.
    force
        Replace the output folder.
    """
    from boresight.io.declaration import read_declaration
    from boresight.io.mapping import write_map
    from boresight.io.proposal import propose
    from boresight.io.user_csv import Options, file_maps, import_csv, with_offsets

    ignored = [c.strip() for c in ignore_columns.split(",") if c.strip()] if ignore_columns else []
    options = Options(guess, mapping, time_unit, _offsets(time_offset or []), ignored, geoid_height_m, far)
    if output is None:
        if not guess:
            raise UserError("import csv: give -o REC, the folder of the recording (or --guess alone to see a mapping)")
        notes: list[str] = []
        if sensors is None:
            text, declared = propose(detections, time_unit)
            print(text)
        else:
            declared = read_declaration(sensors)
        maps = file_maps(detections, declared, options, notes)
        print_notes(notes)
        print(write_map(with_offsets(maps, options)), end="")
        return
    if sensors is None:
        raise UserError("import csv: give --sensors RECORDING.toml (boresight import csv --guess FILES proposes one)")
    check_output(output, force, RECORDING, [*detections, sensors, platform, truth, ignore, mapping])
    recording, read = import_csv(detections, sensors, platform, truth, ignore, options)
    extras = {"mapping.toml": write_map(with_offsets(read, options), output.absolute())} if guess or mapping else None
    _finish(recording, output, force, extras)


def _offsets(given: list[str]) -> dict[str, float]:
    out = {}
    for one in given:
        name, _, value = one.rpartition("=")
        try:
            out[name] = float(value)
        except ValueError:
            name = ""
        if not name or not math.isfinite(out.get(name, math.nan)):
            raise UserError(f"--time-offset {one}: give SENSOR=SECONDS")
    return out


def _finish(recording: Recording, output: Path, force: bool, extras: dict[str, str] | None = None) -> None:
    write_recording(recording, output, force, extras)
    print_notes(recording.notes)
    n, twins = len(recording.detections), int(recording.duplicates.sum())
    refused = f", {len(recording.refused)} refused" if recording.refused else ""
    print(f"wrote {output}: {n} rows of {len(recording.sensors)} sensors ({twins} duplicates{refused})")
