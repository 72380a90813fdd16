"""`boresight register`: time offsets and biases of sensors from targets of opportunity, off line, without truth."""

from __future__ import annotations

import dataclasses
import math
from json import dumps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from boresight.cli.output import print_json, print_table
from boresight.cli.track import BESIDE, sensor_ids, track_recording
from boresight.config.tracker import read_configuration
from boresight.errors import UserError, did_you_mean
from boresight.io.files import RECORDING, check_output
from boresight.io.recording import read_recording, write_recording
from boresight.io.results import finite
from boresight.tracking.config import SensorErrors, TrackerConfig
from boresight.types import FATES, NO_TRACK, Fate, Recording, SensorKind

if TYPE_CHECKING:
    from boresight.register.batch import Estimate

DEG = math.pi / 180.0
DEFAULT_Q, DEFAULT_SPEED = {2: 0.1, 3: 1.0}, {2: 8.0, 3: 150.0}  # m²/s³, m/s, as the tracker takes them
PRIOR = (2.0, 10.0, 0.02, 5.0 * DEG, 5.0 * DEG)  # s, m, 1, rad, rad: what a sensor may be off by, one sigma
EXTENT = 2.0  # m: a target has a size, and a camera beside it points anywhere on it; where the settings say nothing
TOLD = SensorErrors(offset_time=1.0, offset_range=5.0, offset_azimuth=2.0 * DEG)  # where a file is silent
SLOW = SensorErrors(bias_azimuth=0.5 * DEG, bias_time=20.0, decorrelation=1.0)  # of cameras, where a file is silent
PREFERRED = (SensorKind.POSITION, SensorKind.LIDAR, SensorKind.OPTICAL, SensorKind.INFRARED, SensorKind.RADAR)
WORDS = {
    "time_offset_s": ("time offset", "s"),
    "range_offset_m": ("range bias", "m"),
    "range_scale": ("range scale", ""),
    "azimuth_offset_deg": ("azimuth bias", "°"),
    "elevation_offset_deg": ("elevation bias", "°"),
}


def register(
    rec: Path,
    /,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    sensors: str | None = None,
    reference: str | None = None,
    config: Path | None = None,
    plot: Path | None = None,
    force: bool = False,
    json: bool = False,
) -> None:
    """Estimate every sensor's time offset and biases relative to a reference sensor, by batch least squares.

    The recording is tracked first, to know which report belongs to which target; truth is never read. Values are
    reported minus true, with one standard deviation; the verdict says what the geometry tells.

    Parameters
    ----------
    rec
        Folder of the recording.
    output
        Folder for a copy of the recording with the values taken out (all but those that are not observable).
    sensors
        Sensors to use, separated by commas (all).
    reference
        The sensor that counts as right (a position sensor, lidar or camera if there is one).
    config
        Tracker configuration (tracker.toml in the recording's folder if there is one, else defaults); a pipeline in it
        is left aside: registration needs the reports as they came.
    plot
        Image file (.svg, .png, .pdf) to write with the values and their bands.
    force
        Replace the output folder.
    json
        Print one JSON object instead of a table.
    """
    if output is not None:
        check_output(output, force, RECORDING, [rec, config], [BESIDE] if (rec / BESIDE).is_file() else [])
    recording = read_recording(rec)
    ids = sensor_ids(recording, sensors)
    known = [s.id for s in recording.sensors]
    used = [i for i, name in enumerate(known) if ids is None or name in ids]
    base = _reference(recording, used, reference)
    source = config if config is not None else (rec / BESIDE if (rec / BESIDE).is_file() else None)
    settings = TrackerConfig() if source is None else read_configuration(source, known)[0]
    settings = _told(recording, settings, used, base)
    found, tracks = fit(recording, settings, ids, base)
    rows = rows_of(recording, found)
    parameters: dict[str, Any] = {"recording": str(rec), "sensors": ids, "reference": known[base], "tracks": tracks}
    parameters["reports"] = {known[i]: int(n) for i, n in enumerate(found.reports) if i in used}
    if output is not None:
        _write_copy(recording, found, rows, rec, output, force, parameters)
    if plot is not None:
        from boresight.cli.paper import write_image
        from boresight.report.registration import draw

        write_image(plot, lambda part: draw(part, rows, known[base]))
    if json:
        print_json("register", parameters, rows)
        return
    columns = {"sensor": "sensor", "text": f"relative to {known[base]}"}
    print_table(columns, rows, f"{recording.name}: {tracks} tracks")
    if output is not None:
        print(f"wrote {output}")


def fit(recording: Recording, settings: TrackerConfig, ids: list[str] | None, base: int) -> tuple[Estimate, int]:
    """Track a recording and fit its sensors' constant errors relative to sensor `base`; also the number of tracks."""
    import numpy as np

    results = track_recording(recording, settings, ids)
    from boresight.register.batch import BatchConfig, Coloured, estimate
    from boresight.register.observe import observed_of
    from boresight.tracking.run import tracker_for

    tracker = tracker_for(recording, settings, ids)
    taken = np.isin(results.decisions.fate, [FATES.index(Fate.UPDATED), FATES.index(Fate.INITIATED)])
    track = np.where(taken, results.decisions.track_id, NO_TRACK)
    coloured, alike = {}, {}
    for i in tracker.used:
        e = settings.sensors.get(recording.sensors[i].id, SensorErrors())
        sigma = np.array([e.bias_range, e.bias_azimuth, e.bias_elevation, 0.0, *[e.bias_position] * 3])
        coloured[i], alike[i] = Coloured(sigma, e.bias_time), e.decorrelation
    observed = observed_of(recording, track, tracker.poses, tracker.used, alike)
    flat, d = recording.dimensions == 2, recording.dimensions
    speed = settings.speed_sigma or DEFAULT_SPEED[d]
    extent = settings.extent or EXTENT
    batch = BatchConfig(settings.q or DEFAULT_Q[d], np.array(PRIOR), coloured, speed_sigma=2.0 * speed, extent=extent)
    return estimate(observed, recording.sensors, batch, base, flat), observed.tracks


def rows_of(recording: Recording, found: Estimate) -> list[dict[str, Any]]:
    """Return one row for each constant: value, sigma and 95 % band in the parameter's unit, verdict and words."""
    from boresight.tracking.registration import NOT, PARAMETERS, verdict_of

    rows = []
    for k in range(len(found.value)):
        name, unit = PARAMETERS[int(found.parameter[k])]
        value, sigma = float(found.value[k]) / unit, math.sqrt(found.covariance[k, k]) / unit
        declared = float(found.prior[k]) / unit
        verdict = verdict_of(sigma, declared)
        title, symbol = WORDS[name]
        if verdict == NOT:
            text = f"{title}: not observable from this geometry"
        else:
            digits = max(0, 1 - math.floor(math.log10(sigma)))
            text = f"{title}: {value:.{digits}f} ± {sigma:.{digits}f} {symbol}".rstrip()
            text += "" if verdict == "observable" else f" ({verdict})"
        sensor = recording.sensors[int(found.sensor[k])]
        row: dict[str, Any] = {"sensor": sensor.id, "parameter": name, "value": value, "sigma": sigma}
        row |= {"low_95": value - 1.96 * sigma, "high_95": value + 1.96 * sigma, "declared_sigma": declared}
        row |= {"verdict": verdict, "text": text}
        if name == "time_offset_s":
            row["latency_s"] = sensor.latency + value
        rows.append(row)
    return rows


def _reference(recording: Recording, used: list[int], name: str | None) -> int:
    known = [recording.sensors[i].id for i in used]
    if name is not None:
        if name not in known:
            raise UserError(
                f"--reference: no sensor '{name}' in use{did_you_mean(name, known)}; {', '.join(known)} are"
            )
        return used[known.index(name)]
    if len(used) < 2:
        raise UserError("registration compares sensors: give two or more")
    return min(used, key=lambda i: PREFERRED.index(recording.sensors[i].kind))


def _told(recording: Recording, settings: TrackerConfig, used: list[int], base: int) -> TrackerConfig:
    """Tell the tracker what sensors of which the configuration says nothing may be off by: tracks need both."""
    sensors = dict(settings.sensors)
    for i in used:
        one = recording.sensors[i]
        if one.id in sensors:
            continue
        camera = not one.ranging
        told = SLOW if camera else SensorErrors()
        if i != base:
            told = dataclasses.replace(
                told,
                offset_time=TOLD.offset_time,
                offset_range=0.0 if camera else TOLD.offset_range,
                offset_azimuth=TOLD.offset_azimuth,
            )
        sensors[one.id] = told
    return dataclasses.replace(settings, sensors=sensors)


def _write_copy(
    recording: Recording,
    found: Estimate,
    rows: list[dict[str, Any]],
    rec: Path,
    output: Path,
    force: bool,
    about: dict[str, Any],
) -> None:
    """Write the recording with everything taken out that is observable at least weakly."""
    import numpy as np

    from boresight.register.apply import corrected
    from boresight.tracking.registration import NOT

    errors: dict[int, Any] = {}
    for k, row in enumerate(rows):
        row["written"] = row["verdict"] != NOT
        if row["written"]:
            errors.setdefault(int(found.sensor[k]), np.zeros(5))[int(found.parameter[k])] = found.value[k]
    extras = {"registration.json": dumps(finite({"parameters": about, "rows": rows}), indent=1) + "\n"}
    if (rec / BESIDE).is_file():
        extras[BESIDE] = (rec / BESIDE).read_text(encoding="utf-8")
    write_recording(corrected(recording, errors), output, force, extras)
