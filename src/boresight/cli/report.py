"""`boresight report`: results as one page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from boresight.errors import UserError
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
        recording = read_recording(rec)
        check_belongs(results, recording, rec)
        return recording
    named = results.summary.get("recording_folder")
    if isinstance(named, str) and (Path(named) / "recording.toml").is_file():
        recording = read_recording(Path(named))
        check_belongs(results, recording, Path(named))
        return recording
    return None


def check_belongs(results: Results, recording: Recording, rec: Path) -> None:
    """Raise UserError when results were not made from a recording: another number of reports or dimensions."""
    made, has = len(results.decisions), len(recording.detections)
    about = results.summary.get("recording")
    about = about if isinstance(about, dict) else {}
    of = f" of '{about['name']}'" if isinstance(about.get("name"), str) else ""
    if made != has:
        raise UserError(f"{rec}: has {has} reports, the results{of} are of {made}: give the recording that was tracked")
    if about.get("dimensions", recording.dimensions) != recording.dimensions:
        raise UserError(
            f"{rec}: is {recording.dimensions}-D, the results{of} are {about['dimensions']}-D: give the recording that "
            "was tracked"
        )
