"""A user's own CSV files to a Recording: with the format's column names, or by a mapping."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np

from boresight.errors import UserError, did_you_mean
from boresight.io import reporting
from boresight.io.columns import TABLES, TIME
from boresight.io.declaration import Declaration, read_declaration
from boresight.io.detections import reordered
from boresight.io.mapping import FileMap, converted, guess_map, joined, plain_map, read_map, read_raw
from boresight.io.recording import assemble
from boresight.io.table import Table
from boresight.io.toml import read_toml
from boresight.types import Recording


@dataclass(frozen=True, slots=True)
class Options:
    """How CSV files are to be read."""

    guess: bool = False  # names, units, scan numbers
    mapping: Path | None = None  # says all that instead
    time_unit: str | None = None  # of stamps that are numbers
    time_offset: Mapping[str, float] | None = None  # s, to add to the stamps of a sensor, or of "all"
    ignore_columns: Sequence[str] = ()
    geoid_height: float | None = None  # m above the ellipsoid, for files with heights above mean sea level
    far: bool = False  # platforms and sensors may lie any distance from the site


def import_csv(
    detections: Path | Sequence[Path],
    sensors: Path,
    platform: Path | None = None,
    truth: Path | None = None,
    ignore: Path | None = None,
    options: Options = Options(),
) -> tuple[Recording, tuple[FileMap, ...]]:
    """Return the recording of CSV files, and how each was read; an empty cell is null.

    `sensors` is a recording.toml. Files have the column names of the Parquet files, perhaps with other units
    (`range_km`), unless `options` has them guessed or names a mapping. Raises UserError that tells file, line, column.
    """
    declared = read_declaration(sensors)
    if options.time_unit is not None and options.time_unit not in TIME:
        near = did_you_mean(options.time_unit, TIME)
        raise UserError(f"--time-unit {options.time_unit}: not known{near}; give one of {', '.join(TIME)}")
    notes: list[str] = []
    maps = file_maps([detections] if isinstance(detections, Path) else detections, declared, options, notes)
    named = (("platform", platform), ("truth", truth), ("ignore", ignore))
    maps += [_map_of(path, table, declared, options, notes) for table, path in named if path is not None]
    tables: dict[str, list[Table]] = {name: [] for name in TABLES}
    if options.geoid_height is not None:
        maps = [msgspec.structs.replace(of, geoid_height_m=options.geoid_height) for of in maps]
    for of in maps:
        raw = read_raw(Path(of.path), of.separator, of.decimal)
        tables[of.table].append(_shifted(converted(raw, of, declared), of, options))
    if not tables["detections"]:
        raise UserError(f"{maps[0].path if maps else sensors}: no file holds detections")
    _check_offsets(options, declared)
    own_order = "t_recv_s" in tables["detections"][0] or len(tables["detections"]) == 1
    joint = {
        name: joined(some, declared, sort=name != "detections" or not own_order)
        for name, some in tables.items()
        if some
    }
    recording = assemble(
        declared,
        joint["detections"],
        platform=joint.get("platform"),
        truth=joint.get("truth"),
        ignore=joint.get("ignore"),
        where=str(sensors),
    )
    if (np.diff(recording.detections.t_recv) < 0.0).any():  # logs laid end to end: the file's order is to be arrival's
        recording = reordered(recording)
    said = [*reporting.place_notes(recording, options.far), *reporting.coverage_notes(recording)]
    recording, guessed = reporting.guess_reporting(recording, _says_reporting(sensors))
    return replace(recording, notes=(*notes, *said, *guessed, *recording.notes)), tuple(maps)


def _says_reporting(sensors: Path) -> set[str]:
    """Ids of the sensors whose `reporting` is declared."""
    tables = read_toml(sensors).get("sensor", [])
    return {str(one.get("id")) for one in tables if isinstance(one, dict) and "reporting" in one}


def file_maps(paths: Sequence[Path], declared: Declaration, options: Options, notes: list[str]) -> list[FileMap]:
    """Return how each of some files is read; `notes` gets what was guessed. Raises UserError."""
    if options.mapping is not None:
        return list(read_map(options.mapping))
    if not paths:
        raise UserError("import csv: name a CSV file with detections, or a --mapping")
    return [_map_of(path, None, declared, options, notes) for path in paths]


def _map_of(path: Path, table: str | None, declared: Declaration, options: Options, notes: list[str]) -> FileMap:
    """`table` is None for a file whose kind is to be guessed, else detections."""
    raw = read_raw(path)
    if not options.guess:
        ignored = [n for n in options.ignore_columns if table is None or n in raw.header]
        return plain_map(raw, table or "detections", ignored, options.time_unit)
    of, said = guess_map(raw, declared, options.time_unit, table, options.ignore_columns)
    notes.extend(said)
    return of


def _shifted(table: Table, of: FileMap, options: Options) -> Table:
    """Add the offsets that the user gave for sensors to their stamps."""
    offsets = options.time_offset or {}
    if not offsets or of.table not in ("detections", "platform"):
        return table
    import pyarrow as pa

    column = "sensor" if of.table == "detections" else "platform"
    names = np.array(table.data.column(column).to_pylist(), dtype=object)
    shift = np.array([offsets.get(n, 0.0) for n in names])
    at = table.data.column_names.index("t_s")
    t = pa.array(table.data.column("t_s").to_numpy() + shift, from_pandas=True)
    return Table(table.path, table.data.set_column(at, "t_s", t), table.csv_lines, table.notes, table.origin)


def _check_offsets(options: Options, declared: Declaration) -> None:
    known = [s.id for s in declared.sensors] + [s.platform for s in declared.sensors if s.platform is not None]
    for name in options.time_offset or {}:
        if name not in known:
            raise UserError(f"--time-offset {name}: no sensor or platform has this name{did_you_mean(name, known)}")


def with_offsets(maps: Sequence[FileMap], options: Options) -> tuple[FileMap, ...]:
    """Return mappings with the offsets that the user gave for their one sensor or platform."""
    offsets = options.time_offset or {}
    return tuple(
        msgspec.structs.replace(of, time_offset_s=of.time_offset_s + offsets.get(of.sensor or of.platform or "", 0.0))
        for of in maps
    )
