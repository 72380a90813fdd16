"""`boresight report`: results as one page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from boresight.io.recording import read_recording
from boresight.io.results import read_results
from boresight.types import Recording, Results


def report(
    out: Path,
    rec: Path | None = None,
    /,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
) -> None:
    """Write report.html: one page that works offline, with plan view, errors, identities, consistency and score.

    Parameters
    ----------
    out
        Folder of the results; report.html in it is written anew.
    rec
        Folder of the recording; the one that was tracked if it is still where it was.
    output
        Another file to write.
    """
    from boresight.io.files import write_text
    from boresight.report.data import collect
    from boresight.report.html import render

    results = read_results(out)
    recording = recording_of(results, rec)
    path = output or out / "report.html"
    write_text(path, render(collect(results, recording)), force=True)
    size = path.stat().st_size / 1e6
    print(f"wrote {path} ({size:.2f} MB)" + ("" if recording else "; without REC: no detections, truth and scores"))


def recording_of(results: Results, rec: Path | None) -> Recording | None:
    """Return the recording named, else the one that the summary names if it is still there, else None."""
    if rec is not None:
        return read_recording(rec)
    named = results.summary.get("recording_folder")
    if isinstance(named, str) and (Path(named) / "recording.toml").is_file():
        return read_recording(Path(named))
    return None
