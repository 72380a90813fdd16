"""`boresight tune`: noise from innovations, without truth."""

from __future__ import annotations

import dataclasses
import math
import sys
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from boresight.cli.output import print_json, print_table
from boresight.cli.track import BESIDE, sensor_ids, track_recording
from boresight.config.tracker import read_tracker_config
from boresight.errors import UserError
from boresight.io.recording import read_recording
from boresight.tracking.config import TrackerConfig
from boresight.types import Component, Recording

DEFAULT_Q = {2: 0.1, 3: 1.0}  # m²/s³, what the tracker takes where nothing is said
DEFAULT_SPEED = {2: 8.0, 3: 150.0}  # m/s
UNITS = {
    Component.RANGE: ("sigma_range_m", 1.0),
    Component.AZIMUTH: ("sigma_azimuth_deg", 180.0 / math.pi),
    Component.ELEVATION: ("sigma_elevation_deg", 180.0 / math.pi),
    Component.RANGE_RATE: ("sigma_range_rate_m_s", 1.0),
}
POSITION_KEY = "sigma_position_m"


def tune(
    rec: Path,
    /,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    sensors: str | None = None,
    config: Path | None = None,
    force: bool = False,
    json: bool = False,
) -> None:
    """Find process noise and every sensor's sigmas by the likelihood of a recording's innovations; reads no truth.

    The recording is tracked first, to know which report belongs to which target. Slow biases count as noise here: a
    sigma that comes out far above the declared one is a hint of a bias or a delay.

    Parameters
    ----------
    rec
        Folder of the recording.
    output
        TOML to write: a tracker configuration with the process noise, the sigmas beside it as comments.
    sensors
        Sensors to use, separated by commas (all).
    config
        Tracker configuration to begin from (tracker.toml in the recording's folder if there is one, else defaults).
    force
        Replace the output file.
    json
        Print one JSON object: the curve of the climb, one row a step.
    """
    if output is not None and output.exists() and (output.is_dir() or not force):
        raise UserError(
            f"{output}: exists; give --force to replace it" if not output.is_dir() else f"{output}: a folder"
        )
    recording = read_recording(rec)
    ids = sensor_ids(recording, sensors)
    known = [s.id for s in recording.sensors]
    source = config if config is not None else (rec / BESIDE if (rec / BESIDE).is_file() else None)
    settings = TrackerConfig() if source is None else read_tracker_config(source, known)
    rows, sigmas, consistency = climb(recording, settings, ids)
    q = rows[-1]["process_noise_m2_s3"]
    text = toml(rec, q, sigmas)
    if output is not None:
        _write(output, text)
    if json:
        parameters = {"recording": str(rec), "sensors": ids, "sigmas": sigmas, "nis_per_dof": consistency}
        print_json("tune", parameters, rows)
        return
    shown = {"step": "step", "process_noise_m2_s3": "q\nm²/s³", "log_likelihood": "log\nlikelihood"}
    shown["nis_per_dof"] = "NIS\n/dof"
    print_table(shown, rows, f"tune {rec}: the climb", digits=6)
    print_table({"sensor": "sensor", "key": "sigma", "declared": "declared", "tuned": "tuned"}, sigmas)
    print(", ".join(f"{name}: NIS/dof {value:.2f}" for name, value in consistency.items()))
    print(f"wrote {output}" if output is not None else text, end="\n" if output is not None else "")


def climb(
    recording: Recording, settings: TrackerConfig, ids: list[str] | None
) -> tuple[list[dict[str, Any]], list[dict[str, Any]], dict[str, float]]:
    """Return the curve (one row a step), the sigmas (declared and tuned), and NIS per degree of freedom by sensor."""
    from boresight.tracking.run import tracker_for
    from boresight.tracking.tuning import threads, tune

    q = settings.q or DEFAULT_Q[recording.dimensions]
    speed = settings.speed_sigma or DEFAULT_SPEED[recording.dimensions]
    results = track_recording(recording, dataclasses.replace(settings, q=q), ids)
    poses = tracker_for(recording, settings, ids).poses
    found = threads(recording, results.decisions, poses, speed)
    print(f"tuning on {len(found)} tracks, {sum(len(f.reports.t) for f in found)} reports …", file=sys.stderr)
    tuned = tune(found, recording.dimensions, q)
    rows = []
    for i, step in enumerate(tuned.curve):
        row: dict[str, Any] = {"step": i, "process_noise_m2_s3": step.q, "log_likelihood": step.log_likelihood}
        row["nis_per_dof"] = step.nis_per_dof
        for (s, c), factor in step.factors.items():
            name = "position" if c == Component.EAST else Component(c).name.lower()
            row[f"{recording.sensors[s].id}_{name}_factor"] = factor
        rows.append(row)
    sigmas = []
    for (s, c), factor in tuned.curve[-1].factors.items():
        key, unit = UNITS.get(Component(c), (POSITION_KEY, 1.0))
        declared = float(recording.sensors[s].sigma[c])
        sigma = declared * unit if math.isfinite(declared) else None
        sigmas.append(
            {
                "sensor": recording.sensors[s].id,
                "key": key,
                "component": "position" if c == Component.EAST else Component(c).name.lower(),
                "declared": sigma,
                "tuned": None if sigma is None else sigma * factor,
                "factor": factor,
            }
        )
    return rows, sigmas, {recording.sensors[s].id: nis for s, (nis, _) in tuned.nis_by_sensor.items()}


def toml(rec: Path, q: float, sigmas: list[dict[str, Any]]) -> str:
    """Return a tracker configuration with the process noise, and the sigmas as comments for recording.toml."""
    lines = [f"# boresight tune {rec}", "[tracker]", f"process_noise_m2_s3 = {q:.4g}", ""]
    lines.append("# sigmas that fit, for recording.toml:")
    for row in sigmas:
        if row["tuned"] is None:
            lines.append(f"# {row['sensor']}: {row['component']}, {row['factor']:.3g} times what each row declares")
        else:
            lines.append(f"# {row['sensor']}: {row['key']} = {row['tuned']:.4g}  # declared {row['declared']:.4g}")
    return "\n".join(lines) + "\n"


def _write(path: Path, text: str) -> None:
    """Write under a temporary name, then rename."""
    part = path.with_name(path.name + ".part")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    except OSError as error:
        raise UserError(f"{path}: cannot write: {error.strerror}") from None
