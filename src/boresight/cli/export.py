"""`boresight export`: tracks to CSV, GeoJSON or KML, the log of a live run to a recording."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from boresight.errors import UserError
from boresight.io.files import RECORDING, check_output, read_text, write_text
from boresight.io.livelog import SETTINGS, is_log
from boresight.io.recording import read_recording, write_recording
from boresight.io.results import read_results


def export(
    out: Path,
    rec: Path | None = None,
    /,
    *,
    to: Literal["csv", "geojson", "kml", "recording"],
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    force: bool = False,
) -> None:
    """Write the tracks as CSV, GeoJSON or KML, with WGS84 positions; or the log of a live run as a recording.

    Tracks go to standard output without -o.

    Parameters
    ----------
    out
        Folder of the results; with --to recording that of the log.
    rec
        Folder of the recording; needed only for results whose summary.json holds no site.
    to
        csv, geojson or kml; recording.
    output
        The file (or, of a recording, the folder) to write.
    force
        Replace the file.
    """
    if to == "recording":
        _recording(out, output, force)
        return
    from boresight.io import export as form

    results = read_results(out)
    site = read_recording(rec).site if rec else form.site_of_summary(results.summary, str(out / "summary.json"))
    text = form.export(results.tracks, site, to, out.name)
    if output is None:
        sys.stdout.write(text)
    else:
        write_text(output, text, force)
        print(f"wrote {output}: {len(results.tracks)} rows")


def _recording(log: Path, output: Path | None, force: bool) -> None:
    """Write a log as a recording, with the settings of its tracker beside."""
    if output is None:
        raise UserError("--to recording needs -o FOLDER")
    if not is_log(log):
        raise UserError(f"{log}: is not the log of a live run (boresight serve --log)")
    check_output(output, force, RECORDING, [log], [SETTINGS])
    recording = read_recording(log)
    write_recording(recording, output, force, extras={SETTINGS: read_text(log / SETTINGS)})
    print(f"wrote {output}: {len(recording.detections)} rows of {len(recording.sensors)} sensors")
