"""A recording folder (RECORDING format, version 1) to and from `types.Recording`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from boresight.errors import UserError, did_you_mean
from boresight.io import detections as det
from boresight.io import paths
from boresight.io.declaration import Declaration, read_declaration, write_declaration
from boresight.io.files import RECORDING, output_folder
from boresight.io.livelog import is_log
from boresight.io.reporting import misplaced
from boresight.io.stamps import newest
from boresight.io.table import Table, read_table, write_table
from boresight.types import Axes, Detections, PlatformTrack, Recording, Sensor


def read_recording(path: Path | str) -> Recording:
    """Read and check a recording folder: SI, radians, the site's east/north/up; without a name it goes by its folder's.

    The log of a live run is read as the recording that gives the same tracks. Raises UserError with one line that names
    file, row or key, and what to do.
    """
    folder = Path(path)
    if not folder.is_dir():
        what = "is a file, not a recording folder" if folder.exists() else "no such recording folder"
        raise UserError(f"{folder}: {what}")
    if is_log(folder):
        from boresight.io.logged import recording_of_log  # compiled code: loaded only where it is needed

        return recording_of_log(folder)
    declared = read_declaration(folder / "recording.toml")
    declared = replace(declared, name=declared.name or folder.resolve().name)
    detections = read_table(folder / "detections.parquet", det.SCHEMA, det.REQUIRED)
    tables = {}
    for name, schema, key in (
        ("platform", paths.PLATFORM_SCHEMA, "platform"),
        ("truth", paths.TRUTH_SCHEMA, "target"),
        ("ignore", paths.IGNORE_SCHEMA, "object"),
    ):
        file = folder / f"{name}.parquet"
        required = ("t_s", key, "east_m", "north_m", "radius_m") if name == "ignore" else ("t_s", key)
        tables[name] = read_table(file, schema, required) if file.exists() else None
    return assemble(declared, detections, **tables, where=str(folder))


def assemble(
    declared: Declaration,
    detections: Table,
    platform: Table | None = None,
    truth: Table | None = None,
    ignore: Table | None = None,
    where: str = "",
) -> Recording:
    """Check tables against the declaration and return the recording; raises UserError."""
    platforms = paths.platforms_of(platform, declared.site, declared.dimensions) if platform is not None else ()
    true = paths.truths_of(truth, declared.dimensions) if truth is not None else ()
    others = [(f"platform '{p.id}'", float(p.t[0]), float(p.t[-1])) for p in platforms]
    others += [(f"target '{p.target}' of the truth", float(p.t[0]), float(p.t[-1])) for p in true]
    rows, duplicates, refused = det.detections_of(detections, declared.sensors, others)
    check_navigation(declared.sensors, rows, platforms, where)
    recording = Recording(
        name=declared.name,
        dimensions=declared.dimensions,
        site=declared.site,
        sensors=declared.sensors,
        detections=rows,
        platforms=platforms,
        truth=true,
        ignore=paths.ignored_of(ignore) if ignore is not None else (),
        duplicates=duplicates,
        refused=refused,
        notes=tuple(
            note for table in (detections, platform, truth, ignore) if table is not None for note in table.notes
        ),
    )
    return replace(recording, notes=(*recording.notes, *misplaced(recording)))


def check_navigation(
    sensors: tuple[Sensor, ...], detections: Detections, platforms: tuple[PlatformTrack, ...], where: str
) -> None:
    """Raise UserError when a sensor that reports rides on a platform without the navigation data it needs."""
    by_id = {p.id: p for p in platforms}
    for i, sensor in enumerate(sensors):
        if sensor.platform is None or not (detections.sensor == i).any():
            continue
        if sensor.platform not in by_id:
            near = did_you_mean(sensor.platform, by_id)
            raise UserError(
                f"{where}: sensor '{sensor.id}' rides on platform '{sensor.platform}', which has no navigation data"
                f"{near}; add its rows to platform.parquet"
            )
        turned = sensor.axes in (Axes.BODY, Axes.MOUNT) or any(sensor.mount.lever_arm)
        if turned and np.isnan(by_id[sensor.platform].ypr[:, 0]).all():
            raise UserError(
                f"{where}: platform '{sensor.platform}' has no row with yaw_deg, which sensor '{sensor.id}' needs "
                f"(axes = '{sensor.axes}', lever arm {list(sensor.mount.lever_arm)})"
            )


def write_recording(
    recording: Recording, path: Path | str, force: bool = False, extras: Mapping[str, str] | None = None
) -> None:
    """Write a recording folder at once or not at all; an existing one needs `force`. Raises UserError.

    `extras` are further text files by name, such as the tracker.toml that suits the recording's sensors.
    """
    with output_folder(path, force, RECORDING, beside=extras or ()) as folder:
        declared = Declaration(recording.name, recording.dimensions, recording.site, recording.sensors)
        (folder / "recording.toml").write_text(write_declaration(declared), encoding="utf-8")
        columns = det.columns_of(recording.detections, recording.sensors)
        if np.array_equal(recording.detections.t_recv, newest(recording.detections.t, recording.usable)):
            del columns["t_recv_s"]  # what a reader finds by itself is not written as if it had been recorded
        write_table(folder / "detections.parquet", columns)
        if recording.platforms:
            write_table(folder / "platform.parquet", paths.platform_columns(recording.platforms))
        if recording.truth:
            write_table(folder / "truth.parquet", paths.truth_columns(recording.truth))
        for name, text in (extras or {}).items():
            (folder / name).write_text(text, encoding="utf-8")
        if recording.ignore:
            write_table(folder / "ignore.parquet", paths.ignore_columns(recording.ignore))
