"""Other people's CSV files by a mapping: which column is what, in which unit; and a guess of one."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from boresight.errors import UserError, did_you_mean
from boresight.io.columns import (
    DAY_SECONDS,
    EXTRA,
    ISO,
    MSL,
    TABLES,
    TIME,
    UNITS,
    WEEK_SECONDS,
    Column,
    dimension,
    like_name,
    same_name,
    unit_named,
)
from boresight.io.declaration import DEG, Declaration
from boresight.io.files import read_text
from boresight.io.table import LIST, TEXT, WHOLE, Table, check_table
from boresight.io.toml import TableModel, convert, key, read_toml, write_toml
from boresight.types import FloatArray, Sensor

MOST_PROBLEMS = 8  # of one file that are told at once
EACH, STAMP, TURN, NORTH = "each row", "each stamp", "each turn", "north mark"
PLACE = ("latitude_deg", "longitude_deg", "height_m", MSL)
DATES = (9.4e8, 4.2e9)  # Unix seconds, 1999 to 2103
SCANS = (EACH, STAMP, TURN, NORTH)
REQUIRED = {
    "detections": ("t_s", "sensor"),
    "platform": ("t_s", "platform"),
    "truth": ("t_s", "target"),
    "ignore": ("t_s", "object"),
}
NAMED = {"detections": "sensor", "platform": "platform", "truth": "target", "ignore": "object"}


class FileMap(TableModel, frozen=True):
    """One `[[file]]` of a mapping."""

    path: str
    table: str = "detections"
    separator: str = ","
    decimal: str = "."
    columns: dict[str, str] = msgspec.field(default_factory=dict)
    units: dict[str, str] = msgspec.field(default_factory=dict)
    ignore: tuple[str, ...] = ()
    sensor: str | None = None
    platform: str | None = None
    target: str | None = None
    scan: str | None = None
    time_offset_s: float = 0.0
    geoid_height_m: float | None = None  # of the geoid above the ellipsoid: what heights above mean sea level need


class MapTable(TableModel, frozen=True):
    """The whole of a mapping."""

    file: tuple[FileMap, ...]


@dataclass(frozen=True, slots=True)
class Raw:
    """The cells of one CSV file as text, by column."""

    path: Path
    header: list[str]
    cells: list[list[str]]  # by column
    separator: str
    decimal: str

    def __len__(self) -> int:
        return len(self.cells[0]) if self.cells else 0


@dataclass(slots=True)
class Problems:
    """What is wrong with a file; told all at once."""

    path: Path
    found: list[str] = field(default_factory=list)

    def note(self, text: str) -> None:
        """Add one."""
        self.found.append(text)

    def raise_if_any(self) -> None:
        """Raise UserError that tells the first few of them and how many more there are."""
        if self.found:
            more = len(self.found) - MOST_PROBLEMS
            told = "; ".join(self.found[:MOST_PROBLEMS]) + (f"; and {more} more" if more > 0 else "")
            raise UserError(f"{self.path}: {told}")


def read_raw(path: Path | str, separator: str | None = None, decimal: str | None = None) -> Raw:
    """Read the cells of a CSV file with a header line; raises UserError.

    Columns are separated by comma, semicolon or tab: by what the header line holds. With semicolons or tabs a comma in
    a number is a decimal one.
    """
    path = Path(path)
    text = read_text(path)
    first = next(line for line in text.splitlines() if line.strip())
    if separator is None:
        separator = next((mark for mark in (";", "\t") if mark in first), ",")
    try:
        rows = list(csv.reader(io.StringIO(text), strict=True, delimiter=separator))
    except csv.Error as error:
        raise UserError(f"{path}: not a readable CSV file: {error}") from None
    while rows and not any(rows[-1]):
        rows.pop()
    header = [name.strip() for name in rows[0]]
    if "" in header:
        raise UserError(f"{path}: column {header.index('') + 1} of the header line has no name")
    for name in header:
        if header.count(name) > 1:
            raise UserError(f"{path}: column '{name}' stands twice")
    wrong = Problems(path)
    for number, row in enumerate(rows, start=1):
        if len(row) != len(header):
            wrong.note(f"line {number}: {len(row)} cells where the header has {len(header)} columns")
    wrong.raise_if_any()
    cells = [[row[i].strip() for row in rows[1:]] for i in range(len(header))]
    if decimal is None:
        decimal = "," if separator != "," and _has_decimal_commas(cells) else "."
    return Raw(path, header, cells, separator, decimal)


def _has_decimal_commas(cells: Sequence[Sequence[str]]) -> bool:
    some = [c for column in cells for c in column[:200] if c]
    return any("," in c and _is_number(c.replace(",", ".")) for c in some)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def plain_map(raw: Raw, table: str, ignore: Sequence[str] = (), time_unit: str | None = None) -> FileMap:
    """Return the mapping of a file with the format's own column names, perhaps in other units; raises UserError."""
    schema, columns, units = TABLES[table], {}, {}
    known = [*schema, *(EXTRA if table == "platform" else ())]
    wrong = Problems(raw.path)
    for name in raw.header:
        if name in ignore:
            continue
        column = same_name(name)
        if column is None or column.name not in known:
            missing = [k for k in known if k not in raw.header]
            wrong.note(f"unknown column '{name}'{did_you_mean(name, missing)}")
            continue
        columns[name], units[name] = column
    for name in ignore:
        if name not in raw.header:
            wrong.note(f"--ignore-columns: there is no column '{name}'{did_you_mean(name, raw.header)}")
    for name in REQUIRED[table] + (("scan",) if table == "detections" else ()):
        if name not in columns.values():
            wrong.note(f"column '{name}' is missing")
    if wrong.found and table == "detections":
        wrong.found[-1] += " (names, units and scan numbers of other files: boresight import csv --guess FILES)"
    wrong.raise_if_any()
    units = _time_units(raw, columns, units, time_unit)
    return FileMap(
        path=str(raw.path), table=table, separator=raw.separator, decimal=raw.decimal, columns=columns,
        units={k: u for k, u in units.items() if u}, ignore=tuple(n for n in raw.header if n in ignore),
    )  # fmt: skip


def _time_units(raw: Raw, columns: Mapping[str, str], units: Mapping[str, str], given: str | None) -> dict[str, str]:
    """The units with those of stamps as the user says, or as their cells say (ISO 8601)."""
    out = dict(units)
    for name, ours in columns.items():
        if ours not in ("t_s", "t_recv_s"):
            continue
        cell = next((c for c in raw.cells[raw.header.index(name)] if c), "0")
        if given is not None and _may_be(cell.replace(raw.decimal, "."), given):
            out[name] = given
        if not _is_number(cell.replace(raw.decimal, ".")):
            out[name] = ISO
    return out


def _may_be(cell: str, unit: str) -> bool:
    """Whether a stamp may be in a unit: a date in seconds, as truth may have, is not in milliseconds or of the day."""
    value = abs(float(cell)) if _is_number(cell) else 0.0
    longest = {DAY_SECONDS: 86400.0, WEEK_SECONDS: 604800.0}.get(unit)
    if longest is not None:
        return value <= longest
    return not (TIME[unit] < 1.0 and DATES[0] <= value <= DATES[1])


def converted(raw: Raw, of: FileMap, declared: Declaration) -> Table:
    """Return a file as a table with the format's columns and units; raises UserError that tells all that is wrong."""
    wrong = Problems(raw.path)
    out: dict[str, Any] = {}
    notes: list[str] = []
    for name, ours in of.columns.items():
        if name not in raw.header:
            wrong.note(f"there is no column '{name}'{did_you_mean(name, raw.header)}")
            continue
        kind = {**TABLES[of.table], **dict.fromkeys(EXTRA, "a number")}.get(ours)
        if kind is None:
            wrong.note(f"column '{name}': '{ours}' is no column of {of.table}{did_you_mean(ours, TABLES[of.table])}")
            continue
        cells = raw.cells[raw.header.index(name)]
        unit = of.units.get(name, "")
        if ours in ("t_s", "t_recv_s"):
            out[ours] = _times(cells, unit or "s", raw, name, wrong, notes)
        elif kind == TEXT:
            out[ours] = pa.array([c or None for c in cells], pa.string())
        elif kind == LIST:
            out[ours] = _lists(cells, raw, name, wrong)
        else:
            out[ours] = _numbers(cells, kind, raw, name, wrong)
            d = dimension(ours)
            if d and unit:
                spelt = unit_named(unit, d)
                if spelt is None:
                    wrong.note(f"column '{name}': unit '{unit}' is not known; give one of {', '.join(UNITS[d])}")
                elif UNITS[d][spelt] != 1.0:
                    values = out[ours].to_numpy(zero_copy_only=False)
                    out[ours] = pa.array(values * UNITS[d][spelt], from_pandas=True)
    wrong.raise_if_any()
    for name in ("sensor", "platform", "target"):
        value = getattr(of, name)
        if value is not None and name in TABLES[of.table]:
            out[name] = pa.array([value] * len(raw), pa.string())
    for name in REQUIRED[of.table]:
        if name not in out:
            wrong.note(f"column '{name}' is missing")
    wrong.raise_if_any()
    if of.time_offset_s:
        out["t_s"] = pa.array(out["t_s"].to_numpy(zero_copy_only=False) + of.time_offset_s, from_pandas=True)
    _heights(out, of, wrong)
    wrong.raise_if_any()
    _velocities(out)
    keep = np.ones(len(raw), dtype=bool)
    if of.table == "detections":
        keep = _places(out, declared, raw, notes)
        if of.scan is not None:
            out["scan"] = pa.array(_scan_numbers(out, of, declared, wrong))
    wrong.raise_if_any()
    data = pa.table({name: values for name, values in out.items() if name in TABLES[of.table]})
    table = Table(raw.path, data, csv_lines=True, notes=notes)
    if not keep.all():
        lines = [(raw.path, i + 2) for i in np.flatnonzero(keep).tolist()]
        table = Table(raw.path, data.filter(pa.array(keep)), True, notes, lines)
    return check_table(table, TABLES[of.table], REQUIRED[of.table])


def _numbers(cells: Sequence[str], kind: str, raw: Raw, name: str, wrong: Problems) -> pa.Array:
    values: list[Any] = []
    for line, cell in enumerate(cells, start=2):
        text = cell.replace(",", ".") if raw.decimal == "," else cell
        try:
            values.append((int(text) if kind == WHOLE else float(text)) if text else None)
        except ValueError:
            wrong.note(f"line {line}: {name} is '{cell}', not {kind}")
            values.append(None)
    try:
        return pa.array(values, pa.int64() if kind == WHOLE else pa.float64())
    except (OverflowError, pa.ArrowInvalid):
        wrong.note(f"{name} holds a number too large for 64 bits")
        return pa.nulls(len(cells), pa.float64())


def _lists(cells: Sequence[str], raw: Raw, name: str, wrong: Problems) -> pa.Array:
    values: list[list[float] | None] = []
    for line, cell in enumerate(cells, start=2):
        try:
            values.append([float(v) for v in cell.strip("[]").replace(";", " ").split()] if cell else None)
        except ValueError:
            wrong.note(f"line {line}: {name} is '{cell}', not {LIST}")
            values.append(None)
    return pa.array(values, pa.list_(pa.float64()))


def _times(cells: Sequence[str], unit: str, raw: Raw, name: str, wrong: Problems, notes: list[str]) -> pa.Array:
    if unit not in TIME:
        wrong.note(f"column '{name}': unit '{unit}' is not known; give one of {', '.join(TIME)}")
        return pa.nulls(len(cells), pa.float64())
    if unit != ISO:
        if TIME[unit] < 1.0 and all(c.lstrip("-").isdigit() for c in cells if c):  # whole numbers lose nothing
            per = round(1.0 / TIME[unit])
            return pa.array([None if not c else int(c) // per + int(c) % per / per for c in cells], pa.float64())
        numbers = _numbers(cells, "a number", raw, name, wrong)
        values = np.asarray(numbers.to_numpy(zero_copy_only=False), dtype=np.float64) * TIME[unit]
        if unit in (DAY_SECONDS, WEEK_SECONDS):
            values = _unwrapped(values, 86400.0 if unit == DAY_SECONDS else 604800.0)
        return pa.array(values, from_pandas=True)
    out: list[float | None] = []
    naive = 0
    for line, cell in enumerate(cells, start=2):
        try:
            when = datetime.fromisoformat(cell.replace(",", ".")) if cell else None
        except ValueError:
            wrong.note(f"line {line}: {name} is '{cell}', not a number and not a time of ISO 8601")
            when = None
        if when is not None and when.tzinfo is None:
            naive += 1
            when = when.replace(tzinfo=UTC)
        out.append(None if when is None else when.timestamp())
    if naive:
        notes.append(f"{raw.path}: column '{name}': {naive} of {len(cells)} times have no zone: taken as UTC")
    return pa.array(out, pa.float64())


def _unwrapped(t: FloatArray, span: float) -> FloatArray:
    """Seconds of the day or week, made to go on where they start anew."""
    steps = np.diff(t, prepend=t[:1])
    turns = np.cumsum(np.where(steps < -0.5 * span, 1.0, np.where(steps > 0.5 * span, -1.0, 0.0)))
    return np.asarray(t + span * turns)


def _values(out: Mapping[str, Any], name: str) -> FloatArray:
    return np.array(out[name].to_numpy(zero_copy_only=False), dtype=np.float64)


def _heights(out: dict[str, Any], of: FileMap, wrong: Problems) -> None:
    """Heights above mean sea level become heights above the ellipsoid."""
    if MSL not in out:
        return
    if "height_m" not in out:
        if of.geoid_height_m is None:
            wrong.note(
                "its heights are above mean sea level, those of recordings above the WGS84 ellipsoid: "
                "give --geoid-height-m, the height of the geoid above the ellipsoid there (41 m in Hamburg, "
                "-33 m in New York)"
            )
            return
        out["height_m"] = pa.array(_values(out, MSL) + of.geoid_height_m, from_pandas=True)
    out.pop(MSL)


def _velocities(out: dict[str, Any]) -> None:
    """Speed and course become east and north, down becomes up."""
    from boresight.io import limits

    if "speed_m_s" in out and "course_deg" in out and "ve_m_s" not in out:
        speed, course = _values(out, "speed_m_s"), _values(out, "course_deg")
        bad = (
            limits.absent("speed_m_s", speed)
            | limits.absent("course_deg", course)
            | limits.outside("course_deg", course)
        )
        speed[bad] = np.nan
        out["ve_m_s"] = pa.array(speed * np.sin(course * DEG), from_pandas=True)
        out["vn_m_s"] = pa.array(speed * np.cos(course * DEG), from_pandas=True)
    for down, up in (("vd_m_s", "vu_m_s"), ("down_m", "up_m")):
        if down in out and up not in out:
            out[up] = pa.array(-_values(out, down), from_pandas=True)
    for name in ("speed_m_s", "course_deg", "vd_m_s", "down_m"):
        out.pop(name, None)


def _places(out: dict[str, Any], declared: Declaration, raw: Raw, notes: list[str]) -> NDArray[np.bool_]:
    """Latitude and longitude of detections become east, north (and up) of the site; returns the rows (n,) to keep."""
    from boresight.frames.local import enu_from_geodetic
    from boresight.io import limits

    if "latitude_deg" not in out or "longitude_deg" not in out:
        return np.ones(len(raw), dtype=bool)
    lat, lon = _values(out, "latitude_deg"), _values(out, "longitude_deg")
    given = "height_m" in out
    up = _values(out, "height_m") if given else np.full(len(lat), declared.site.height)
    bad = np.zeros(len(lat), dtype=bool)
    for name, values in (("latitude_deg", lat), ("longitude_deg", lon), ("height_m", up)):
        wrong = limits.absent(name, values) | limits.outside(name, values)
        if wrong.any():
            row = int(np.argmax(wrong))
            why = limits.problem(name, float(values[row]))
            notes.append(f"{raw.path}: line {row + 2}: {why}: {int(wrong.sum())} of {len(lat)} rows have no place")
        bad |= wrong | np.isnan(values)
    place = np.full((3, len(lat)), np.nan)
    place[:, ~bad] = enu_from_geodetic(lat[~bad] * DEG, lon[~bad] * DEG, up[~bad], declared.site)
    out["x_m"], out["y_m"] = (pa.array(place[i], from_pandas=True) for i in (0, 1))
    if given and declared.dimensions == 3:
        out["z_m"] = pa.array(place[2], from_pandas=True)
    return ~bad


def _scan_numbers(out: Mapping[str, Any], of: FileMap, declared: Declaration, wrong: Problems) -> NDArray[np.int64]:
    """Number the looks of each sensor: by row, by stamp, by turns of the declared period, or by the north mark."""
    t = _values(out, "t_s")
    if of.scan not in SCANS:
        wrong.note(f"scan = '{of.scan}' is not known; give one of {', '.join(SCANS)}")
        return np.zeros(len(t), np.int64)
    names = np.array(out["sensor"].to_pylist(), dtype=object)
    scan = np.zeros(len(t), np.int64)
    for name in dict.fromkeys(names.tolist()):
        rows = np.flatnonzero(names == name)
        order = rows[np.argsort(t[rows], kind="stable")]
        if of.scan == EACH:
            scan[order] = np.arange(len(order))
        elif of.scan == STAMP:
            scan[order] = np.cumsum(np.r_[0, np.diff(t[order]) > 0.0])
        else:
            period = next((s.period for s in declared.sensors if s.id == name), None)
            if period is None:
                wrong.note(f"scan = '{of.scan}' needs period_s of [[sensor]] '{name}'")
                continue
            begin = float(t[order[0]])
            if of.scan == NORTH and "azimuth_deg" in out:
                begin = north_mark(t[order], _values(out, "azimuth_deg")[order], period)[0]
            turns = np.floor((t[order] - begin) / period).astype(np.int64)
            scan[order] = turns - turns[0]
    return scan


def north_mark(t: FloatArray, azimuth: FloatArray, period: float) -> tuple[float, float]:
    """Return when a rotating sensor passed north (s, before the first row), and how well its rows agree (0 .. 1).

    `azimuth` (n,) in degrees, clockwise. The agreement is the length of the mean of the rows' phases.
    """
    good = np.isfinite(azimuth) & np.isfinite(t)
    if not good.any():
        return float(t[0]), 0.0
    phase = np.exp(1j * (azimuth[good] * DEG - 2.0 * math.pi * (t[good] - t[0]) / period))
    mean = complex(np.mean(phase))
    lead = math.atan2(mean.imag, mean.real) / (2.0 * math.pi) % 1.0
    return float(t[0]) - lead * period, abs(mean)


def guess_map(
    raw: Raw,
    declared: Declaration,
    time_unit: str | None = None,
    table: str | None = None,
    ignore: Sequence[str] = (),
) -> tuple[FileMap, list[str]]:
    """Return the mapping that a file probably has, and what was guessed in words; raises UserError.

    `table` says what it holds where that is known, `ignore` names columns that are left out.
    """
    found: dict[str, Column] = {}
    for name in raw.header:
        column = like_name(name) if name not in ignore else None
        if column is not None and column.name not in [c.name for c in found.values()]:
            found[name] = column
    table = table or _table_of({c.name for c in found.values()}, raw)
    known = {*TABLES[table], *(PLACE if table == "detections" else EXTRA)}
    if table in ("truth", "ignore", "platform"):
        other = {"x_m": "east_m", "y_m": "north_m", "z_m": "up_m"}
        found = {k: Column(other.get(c.name, c.name), c.unit) for k, c in found.items()}
    if table == "truth" and "target" not in [c.name for c in found.values()]:
        found = {k: Column("target" if c.name == "source_id" else c.name, c.unit) for k, c in found.items()}
    found = {k: c for k, c in found.items() if c.name in known}
    columns = {k: c.name for k, c in found.items()}
    units = _time_units(raw, columns, {k: c.unit for k, c in found.items() if c.unit}, time_unit)
    if time_unit is None:
        _size_of_stamps(raw, columns, units)
    if "t_s" not in columns.values():
        raise UserError(f"{raw.path}: no column of times is known among {', '.join(raw.header)}; name it t_s")
    left = tuple(n for n in raw.header if n not in columns)
    said = [
        f"{raw.path}: taken as {table}: " + ", ".join(f"{k} = {c} [{units.get(k, 'text')}]" for k, c in columns.items())
    ]
    if left:
        said.append(f"{raw.path}: columns that are not used: {', '.join(left)}")
    of = FileMap(
        path=str(raw.path), table=table, separator=raw.separator, decimal=raw.decimal, columns=columns,
        units={k: u for k, u in units.items() if u}, ignore=left,
    )  # fmt: skip
    return _named(raw, of, declared, said)


def _size_of_stamps(raw: Raw, columns: Mapping[str, str], units: dict[str, str]) -> None:
    """Unix times in milliseconds and the like are known by their size, where the heading names no unit."""
    for name, ours in columns.items():
        if ours not in ("t_s", "t_recv_s") or units.get(name) != "s":
            continue
        cell = next((c for c in raw.cells[raw.header.index(name)] if c), "0").replace(raw.decimal, ".")
        for unit, size in (("ms", 1e3), ("us", 1e6), ("ns", 1e9)):
            if DATES[0] * size <= abs(float(cell)) <= DATES[1] * size:
                units[name] = unit


def _table_of(names: set[str], raw: Raw) -> str:
    if names & {"range_m", "azimuth_deg", "elevation_deg", "range_rate_m_s"} and "target" not in names:
        return "detections"
    if "radius_m" in names or "object" in names:
        return "ignore"
    placed = names & {"latitude_deg", "east_m", "x_m"}
    if "target" in names or ("truth" in raw.path.stem.lower() and placed):
        return "truth"
    if "sensor" in names or "source_id" in names or ("x_m" in names and "yaw_deg" not in names):
        return "detections"
    if placed:
        return "platform"
    raise UserError(
        f"{raw.path}: its columns ({', '.join(raw.header)}) are neither detections, nor a platform's path, nor truth; "
        "write a mapping: boresight import csv --guess of another file shows one"
    )


def _named(raw: Raw, of: FileMap, declared: Declaration, said: list[str]) -> tuple[FileMap, list[str]]:
    """Say whose rows they are where no column does, and how looks are numbered."""
    ours = list(of.columns.values())
    if of.table == "platform" and "platform" not in ours:
        names = list(dict.fromkeys(s.platform for s in declared.sensors if s.platform is not None))
        if len(names) != 1:
            names = [n for n in names if n.lower() in raw.path.stem.lower()] or names
        if len(names) != 1:
            told = f"one of {', '.join(names)}" if names else "declared at a sensor"
            raise UserError(f"{raw.path}: whose path is it? Give a column 'platform' or a name ({told})")
        of = msgspec.structs.replace(of, platform=names[0])
        said.append(f"{raw.path}: taken as the path of platform '{names[0]}'")
    if of.table == "truth" and "target" not in ours:
        of = msgspec.structs.replace(of, target=raw.path.stem)
    if of.table != "detections":
        return of, said
    if "sensor" not in ours:
        sensor = _sensor_of(raw, ours, declared)
        of = msgspec.structs.replace(of, sensor=sensor.id)
        said.append(f"{raw.path}: taken as the reports of sensor '{sensor.id}'")
    if "scan" not in ours:
        of, why = _guess_scans(raw, of, declared)
        said.append(f"{raw.path}: looks are numbered by {of.scan} ({why})")
    return of, said


def _sensor_of(raw: Raw, ours: Sequence[str], declared: Declaration) -> Sensor:
    stem = raw.path.stem.lower()
    near = [s for s in declared.sensors if s.id.lower() in stem or stem in s.id.lower()]
    near = near or [s for s in declared.sensors if str(s.kind) in stem]
    if not near:
        from boresight.types import Component

        key = (
            Component.RANGE
            if "range_m" in ours
            else Component.EAST
            if "x_m" in ours or "latitude_deg" in ours
            else None
        )
        near = [s for s in declared.sensors if key is not None and not math.isnan(s.sigma[key])]
    if len(near) != 1:
        known = ", ".join(s.id for s in declared.sensors)
        raise UserError(
            f"{raw.path}: which sensor's reports are these ({known})? Name the file after it, or give a column"
        )
    return near[0]


def _guess_scans(raw: Raw, of: FileMap, declared: Declaration) -> tuple[FileMap, str]:
    table = converted(raw, msgspec.structs.replace(of, scan=EACH), declared)
    t = table.numbers("t_s")
    names = table.words("sensor")
    sensor = next((s for s in declared.sensors if s.id == names[0]), None)
    period = sensor.period if sensor is not None else None
    steps = np.diff(np.sort(t[np.isfinite(t)]))
    if period is not None and "azimuth_deg" in table and "range_m" in table:
        _, agree = north_mark(t, table.numbers("azimuth_deg"), period)
        if agree > 0.8:
            return msgspec.structs.replace(
                of, scan=NORTH
            ), f"it turns once in {period:g} s: its azimuths follow its stamps"
    ids = [] if "source_id" not in table else (table.objects("source_id") or [])
    known = len({name for name in ids if name is not None})
    if known >= 2 and len(np.unique(t)) > 0 and len(t) / len(np.unique(t)) < 0.5 * known:
        return msgspec.structs.replace(of, scan=EACH), f"messages of {known} source_id, few at one stamp"
    if len(steps) and (steps == 0.0).mean() > 0.1:
        return msgspec.structs.replace(of, scan=STAMP), "several rows have the same stamp"
    if period is not None and len(steps) and float(np.median(steps)) < 0.5 * period:
        return msgspec.structs.replace(of, scan=TURN), f"several rows fall into its period of {period:g} s"
    return msgspec.structs.replace(of, scan=EACH), "rows come one by one"


def joined(tables: Sequence[Table], declared: Declaration, sort: bool) -> Table:
    """Return tables of one kind as one, by stamp if `sort`; notes say what was done."""
    notes = [note for t in tables for note in t.notes]
    if len(tables) == 1:
        data, origin = tables[0].data, tables[0].origin
    else:
        names = list(dict.fromkeys(n for t in tables for n in t.data.column_names))
        data = pa.concat_tables([_with(t.data, names) for t in tables], promote_options="permissive")
        sizes = [len(t) for t in tables]
        origin = [place for t in tables for place in (t.origin or [(t.path, i + 2) for i in range(len(t))])]
        notes.append(f"{', '.join(str(t.path) for t in tables)}: {' + '.join(map(str, sizes))} rows merged by stamp")
    out = Table(tables[0].path, data, csv_lines=True, notes=notes, origin=origin)
    if not sort:
        return out
    t = np.array(out.data.column("t_s").to_numpy(), dtype=np.float64)
    order = np.argsort(t, kind="stable")
    if len(tables) == 1 and (np.diff(order) > 0).all():
        return out
    places = origin if origin is not None else [(tables[0].path, i + 2) for i in range(len(out))]
    if len(tables) == 1:
        notes.append(f"{tables[0].path}: rows sorted by stamp")
    return Table(out.path, out.data.take(pa.array(order)), True, notes, [places[i] for i in order.tolist()])


def _with(data: pa.Table, names: Sequence[str]) -> pa.Table:
    columns = {n: data.column(n) if n in data.column_names else pa.nulls(len(data)) for n in names}
    return pa.table(columns)


def read_map(path: Path) -> tuple[FileMap, ...]:
    """Read a mapping; paths in it are relative to it. Raises UserError."""
    table = convert(read_toml(path), MapTable, str(path))
    out = []
    for of in table.file:
        if of.table not in TABLES:
            raise UserError(f"{path}: table = '{of.table}'{did_you_mean(of.table, TABLES)}; give {', '.join(TABLES)}")
        out.append(msgspec.structs.replace(of, path=str(path.parent / of.path)))
    if not out:
        raise UserError(f"{path}: no [[file]] table")
    return tuple(out)


def write_map(files: Iterable[FileMap], folder: Path | None = None) -> str:
    """Return a mapping as TOML; paths relative to `folder` where they lie below it."""
    head = (
        "# Which column of which file is what: `boresight import csv --mapping THIS --sensors RECORDING.toml -o REC`.\n"
    )
    tables = []
    for of in files:
        path = Path(of.path)
        if folder is not None and path.resolve().is_relative_to(folder.resolve()):
            path = path.resolve().relative_to(folder.resolve())
        elif folder is not None:
            path = path.resolve()
        one: dict[str, Any] = {"path": str(path), "table": of.table, "separator": of.separator, "decimal": of.decimal}
        one |= {k: v for k in ("sensor", "platform", "target", "scan") if (v := getattr(of, k)) is not None}
        one |= {"time_offset_s": of.time_offset_s} if of.time_offset_s else {}
        one |= {"geoid_height_m": of.geoid_height_m} if of.geoid_height_m is not None else {}
        one |= {"ignore": list(of.ignore)} if of.ignore else {}
        tables.append(write_toml({"file": [one]}).strip())
        tables[-1] += "\n\n[file.columns]\n" + "\n".join(f'{key(k)} = "{v}"' for k, v in of.columns.items())
        tables[-1] += "\n\n[file.units]\n" + "\n".join(f'{key(k)} = "{v}"' for k, v in of.units.items())
    return head + "\n" + "\n\n".join(tables) + "\n"
