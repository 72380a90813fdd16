"""`boresight serve`: live reports in, tracks out."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from boresight.cli.output import print_json
from boresight.cli.track import loading
from boresight.errors import UserError
from boresight.io.files import check_output, output_folder, read_text


def serve(
    site: Path,
    /,
    *,
    log: Path | None = None,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    resume: bool = False,
    force: bool = False,
    duration_s: float | None = None,
    quiet: bool = False,
    json: bool = False,
) -> None:
    """Track what sensors report, live; send the tracks on; log everything.

    It says "listening on …" on standard error once it takes reports. SIGTERM and Ctrl-C end it: exit 0, and the counts.

    Parameters
    ----------
    site
        SITE.toml: a recording.toml with [input], [output], [log], [tracker], [pointing] (docs/live.md names every key).
    log
        Folder for everything that arrives, as it arrived; every command takes it where it takes a recording.
    output
        Folder for tracks.parquet, decisions.parquet and summary.json, written at the end.
    resume
        Go on with the tracks of the log that is there, and behind it; without one, begin.
    force
        Replace the log and the output folder.
    duration_s
        Stop after this time.
    quiet
        No status line.
    json
        Print one JSON object at the end.
    """
    from boresight.config.serve import read_service
    from boresight.io.livelog import is_log, resume_log
    from boresight.service.signals import until_signalled
    from boresight.service.writing import new_log, said_ready

    service = read_service(site)
    if resume and log is None:
        raise UserError("--resume goes with --log FOLDER, the log to go on with")
    if output is not None:
        check_output(output, force, inputs=[site])
        if log is not None and log.resolve() in (output.resolve(), *output.resolve().parents):
            raise UserError(f"{output}: lies in the log; choose another output folder")
    with loading():
        from boresight.service.serve import serve as run

    going_on = resume and log is not None and is_log(log)
    if going_on and log is not None:
        same = read_text(log / "site.toml") == service.text
        if not same:
            raise UserError(f"{log}: was made with another site file; give --force to begin anew, or another folder")
    writer = None
    if log is not None:
        writer = resume_log(log) if going_on else new_log(log, service.text, service.settings, force, service.logged)
    with tempfile.TemporaryDirectory(prefix="boresight-serve-") as work, until_signalled() as stop:
        counts, serving, state = run(
            service, log=writer, resume=going_on, results=None if output is None else Path(work),
            duration=duration_s, status=None if quiet else sys.stderr, stop=stop, ready=said_ready,
        )  # fmt: skip
        if output is not None:
            _write(output, force, serving, state, counts)
    if json:
        print_json("serve", {"site": str(site), "log": None if log is None else str(log)}, [counts])
    else:
        print(
            f"{counts['reports']} reports, {counts['tracks']} tracks, {counts['lines_out']} lines out, "
            f"{sum(sum(v.values()) for v in counts['lost'].values())} lines lost"
        )
        for name, row in counts["sources"].items():
            print(source_line(name, row))


def source_line(name: str, row: dict[str, Any]) -> str:
    """Return what became of one source's lines, in words."""
    words = [f"{name}: {row['counts'].get('accepted', 0)} lines taken"]
    for reason, n in row["counts"].items():
        if reason != "accepted":
            why = row.get("why", {}).get(reason)
            words.append(f"{reason} {n}" + (f" ({why})" if why else ""))
    return "; ".join(words + ([row["clock"]] if "clock" in row else []))


def _write(output: Path, force: bool, serving: Any, state: Any, counts: dict[str, Any]) -> None:
    """Write the results of a run, as `boresight track` does."""
    from boresight._version import __version__
    from boresight.config.tracker import parameters_of
    from boresight.door import counted, versions
    from boresight.io.results import write_results
    from boresight.types import Recording, Results

    d = serving.parts.service.declaration
    n = serving.parts.decoder.rows
    tracks, fates = serving.results.tables(state, n, serving.duplicates)
    summary = {
        "version": __version__,
        "sensors": [s.id for s in d.sensors],
        "counts": {"reports": n, "tracks": state.names.given, "rows": len(tracks), "fates": counted(fates)},
        "parameters": parameters_of(serving.parts.service.config),
        "live": counts,
        "versions": versions(),
    }
    about = Recording(d.name, d.dimensions, d.site, d.sensors, None)  # type: ignore[arg-type]
    with output_folder(output, force) as folder:
        write_results(Results(tracks, fates, summary), about, folder)
