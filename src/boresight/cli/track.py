"""`boresight track`: a recording to tracks."""

from __future__ import annotations

import contextlib
import shlex
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from boresight.cli.output import print_json, print_notes
from boresight.config.tracker import read_configuration
from boresight.errors import UserError
from boresight.io.files import check_output, output_folder
from boresight.io.recording import read_recording
from boresight.io.results import write_results
from boresight.io.scans import selected
from boresight.metrics.losses import loss_lines
from boresight.tracking.config import TrackerConfig
from boresight.types import Recording, Results, Scan

if TYPE_CHECKING:
    pass

LONGEST_LAG = 600.0  # s
TRACKER_KERNEL = "kernels.tracker_window.advance"  # by far the longest to compile
BESIDE = "tracker.toml"  # a configuration that lies in the recording's folder is used unless --config names another


def track(
    rec: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    sensors: str | None = None,
    config: Path | None = None,
    lag: Annotated[float | None, Parameter(name="--lag")] = None,
    force: bool = False,
    report: Annotated[bool, Parameter(negative="--no-report")] = True,
    json: bool = False,
) -> None:
    """Track the targets of a recording; writes tracks.parquet, decisions.parquet, summary.json and report.html.

    Parameters
    ----------
    rec
        Folder of the recording.
    output
        Folder for the results.
    sensors
        Sensors to use, separated by commas (all).
    config
        TOML with the tracker's settings (tracker.toml in the recording's folder if there is one, else defaults).
    lag
        Also write smoothed.parquet: the tracks of so many seconds ago, smoothed with all reports since.
    force
        Replace the output folder.
    report
        Write report.html too (--no-report leaves it out).
    json
        Print one JSON object instead of a line.
    """
    check_output(output, force, inputs=[rec, config])
    recording = read_recording(rec)
    print_notes(recording.notes)
    ids = sensor_ids(recording, sensors)
    source = config if config is not None else (rec / BESIDE if (rec / BESIDE).is_file() else None)
    known = [s.id for s in recording.sensors]
    chosen: list[str] = []
    if source is None:
        with loading():
            from boresight.engine.defaults import defaults_for

            settings, chosen = defaults_for(recording, ids)
        stages: dict[str, Any] = {}
    else:
        settings, stages = read_configuration(source, known)
    if lag is not None:
        if not 0.0 <= lag <= LONGEST_LAG:
            raise UserError(f"--lag: {lag} s; give 0 to {LONGEST_LAG:g} s")
        settings = replace(settings, smoothing_lag=lag)
    results = track_recording(recording, settings, ids, stages, str(source))
    command = ["boresight", "track", str(rec), "-o", str(output)]
    command += ["--sensors", ",".join(ids)] if ids else []
    command += ["--config", str(config)] if config else []
    command += ["--lag", f"{lag:g}"] if lag is not None else []
    results.summary["command"] = shlex.join(command)
    results.summary["recording_folder"] = str(rec)
    results.summary["config_file"] = None if source is None else str(source)
    results.summary["settings_from_the_recording"] = chosen
    heights, refuted = _told_of(recording, results, ids)
    results.summary["heights_not_observed"], results.summary["covariances_refuted"] = heights, refuted
    with output_folder(output, force) as folder:
        write_results(results, recording, folder)
    failed = _report(output, results, recording) if report else ""  # once the results are safe
    print_notes([*loss_lines(recording, results.decisions), *heights, *refuted])
    counts = results.summary["counts"]
    row = {"output": str(output), **counts, "seconds": results.summary["seconds"]}
    if json:
        print_json("track", {"recording": str(rec), "sensors": ids}, [row])
    else:
        print(
            f"wrote {output}: {counts['tracks']} tracks, {counts['rows']} rows, from {counts['reports']} reports "
            f"in {results.summary['seconds']:.2f} s"
        )
        for line in chosen:
            print(line)
        for c in results.summary.get("registration", []):
            print(f"{c['sensor']}: {c['parameter']} {c['value']:.3g} ± {c['sigma']:.2g} (1σ): {c['verdict']}")
    if failed:
        print(f"boresight: {failed}", file=sys.stderr)
        sys.exit(1)


def _report(output: Path, results: Results, recording: Recording) -> str:
    """Write the report; returns in words why it could not be written, empty if it was."""
    try:
        from boresight.report.html import write_report

        write_report(output / "report.html", results, recording)
    except Exception as error:  # whatever it is, the tracks are there
        words = str(error) if isinstance(error, UserError) else f"{type(error).__name__}: {error}"
        return f"no report ({' '.join(words.split())}); the tracks are in {output}"
    return ""


def _told_of(recording: Recording, results: Results, ids: list[str] | None) -> tuple[list[str], list[str]]:
    """Return what there is to say of heights that no sensor measured, and of sensors whose NIS refutes the tracks."""
    from boresight.engine.defaults import consistency
    from boresight.tracking.heights import told_of_heights

    return told_of_heights(recording, results.tracks, ids), consistency(recording, results.decisions)


def sensor_ids(recording: Recording, sensors: str | None) -> list[str] | None:
    """Return the ids that --sensors names, None for all; raises UserError for none or one that is unknown."""
    ids = [s.strip() for s in sensors.split(",") if s.strip()] if sensors is not None else None
    if ids == []:
        raise UserError("--sensors names no sensor; give ids separated by commas")
    selected(recording, ids)
    return ids


def track_recording(
    recording: Recording,
    config: TrackerConfig,
    sensors: list[str] | None = None,
    stages: Mapping[str, Any] | None = None,
    where: str = "",
) -> Results:
    """Track a recording in memory as `boresight.track` does, with a progress bar where standard error is a terminal.

    `stages` is the pipeline before the tracker, as `config.pipeline.take_pipeline` gives it (none); `where` its file.
    """
    with loading():
        from boresight.door import prepare

        prepared = prepare(recording, config, sensors, stages, where)
    with _progress(len(prepared.scans)) as tick:
        results = prepared.run(tick)
    for words in results.summary.get("warnings", []):
        print(f"boresight: {words}", file=sys.stderr)
    return results


@contextlib.contextmanager
def loading() -> Iterator[None]:
    """Say which kernel is compiled, which the first run does, once one is; nothing where they are only loaded."""
    from boresight.tracking.cache import seldom_collected, told_of_compiling

    first: list[str] = []
    started = time.perf_counter()

    def say(kernel: str) -> None:
        if not first:
            first.append(kernel)
            whole = "about a minute" if kernel == TRACKER_KERNEL else "some seconds"
            print(f"boresight: compiling {kernel}, on the first run only ({whole}) …", file=sys.stderr, flush=True)
        elif kernel == TRACKER_KERNEL and kernel not in first:
            first.append(kernel)
            print(f"boresight: compiling {kernel} (about a minute) …", file=sys.stderr, flush=True)

    with seldom_collected(), told_of_compiling(say):
        yield
    if first:
        print(f"boresight: compiled in {time.perf_counter() - started:.0f} s", file=sys.stderr, flush=True)


@contextlib.contextmanager
def _progress(total: int) -> Iterator[Callable[[Scan], None] | None]:
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("tracking"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]} scans/s"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("tracking", total=total, rate="…")
        done = 0
        started = time.perf_counter()

        def tick(_: Scan) -> None:
            nonlocal done
            done += 1
            if done % 50 == 0 or done == total:
                rate = done / max(time.perf_counter() - started, 1e-9)
                progress.update(task, completed=done, rate=f"{rate:,.0f}")

        yield tick
