"""`boresight export`: tracks to CSV, GeoJSON or KML."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from boresight.io.files import write_text
from boresight.io.recording import read_recording
from boresight.io.results import read_results


def export(
    out: Path,
    rec: Path | None = None,
    /,
    *,
    to: Literal["csv", "geojson", "kml"],
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    force: bool = False,
) -> None:
    """Write the tracks as CSV, GeoJSON or KML, with WGS84 positions; to standard output without -o.

    Parameters
    ----------
    out
        Folder of the results.
    rec
        Folder of the recording; needed only for results whose summary.json holds no site.
    to
        csv, geojson or kml.
    output
        The file to write.
    force
        Replace the file.
    """
    from boresight.io import export as form

    results = read_results(out)
    site = read_recording(rec).site if rec else form.site_of_summary(results.summary, str(out / "summary.json"))
    text = form.export(results.tracks, site, to, out.name)
    if output is None:
        sys.stdout.write(text)
    else:
        write_text(output, text, force)
        print(f"wrote {output}: {len(results.tracks)} rows")
