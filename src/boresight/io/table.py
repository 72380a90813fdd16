"""Parquet and CSV tables with the columns that the format knows; every error names file, row and column."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from boresight.errors import UserError, did_you_mean
from boresight.io import limits
from boresight.io.files import read_bytes, read_text
from boresight.types import FloatArray

NUMBER, WHOLE, TEXT, LIST = "a number", "a whole number", "text", "a list of numbers"


@dataclass(frozen=True, slots=True)
class Table:
    """Columns of one file. `row_name` turns a row index into words for an error."""

    path: Path
    data: pa.Table
    csv_lines: bool = False
    notes: list[str] = field(default_factory=list)  # what a reader of the table is to know
    origin: list[tuple[Path, int]] | None = None  # file and line of each row, where they are not in order

    def __len__(self) -> int:
        return int(self.data.num_rows)

    def __contains__(self, name: str) -> bool:
        return name in self.data.column_names

    def fail(self, row: int | None, text: str) -> NoReturn:
        """Raise UserError for a row (counted from 0; of a CSV: its line) or for the whole file."""
        path = self.origin[row][0] if self.origin is not None and row is not None else self.path
        raise UserError(f"{path}:{'' if row is None else f' {self.place(row)}:'} {text}")

    def place(self, row: int) -> str:
        """Return a row (counted from 0) in words: of a CSV its line."""
        if self.origin is not None:
            return f"line {self.origin[row][1]}"
        return f"line {row + 2}" if self.csv_lines else f"row {row}"

    def fail_where(self, bad: NDArray[np.bool_], text: str, values: Any = None) -> None:
        """Raise UserError for the first row where `bad` holds; `{}` in `text` becomes its value."""
        if bad.any():
            row = int(np.argmax(bad))
            self.fail(row, text.format(values[row]) if values is not None else text)

    def numbers(self, name: str, required: bool = False, default: float = np.nan) -> FloatArray:
        """Return a column as (n,) float64, null and an absent column as `default`; NaN and inf are errors."""
        if name not in self:
            return np.full(len(self), default)
        column = self.data.column(name).combine_chunks()
        null = np.asarray(column.is_null())
        values = np.array(
            column.cast(pa.float64(), safe=False).fill_null(0.0).to_numpy(zero_copy_only=False), dtype=np.float64
        )
        word = "leave it empty" if self.csv_lines else "leave it null"
        self.fail_where(~np.isfinite(values), f"{name} is {{}}; {word} when not measured", values)
        if required:
            self.fail_where(null, f"{name} is null; every row needs it")
        values[null] = default
        return values

    def checked(self, name: str, required: bool = False, default: float = np.nan) -> FloatArray:
        """Return a column as `numbers` does, with NaN for "not available" (said in `notes`).

        Raises UserError for a value outside the column's range (`io.limits`).
        """
        values = self.numbers(name, required, default)
        missing = limits.absent(name, values)
        bad = limits.outside(name, values) & ~missing
        self.fail_where(bad, f"{name} is {{}}, outside {limits.span(name)}", values)
        if missing.any():
            row, n = int(np.argmax(missing)), int(missing.sum())
            word = f'{name} = {values[row]:.10g} says "not available" ({limits.source(name, float(values[row]))})'
            self.notes.append(
                f"{self.path}: {self.place(row)}: {word}: taken as not measured in {n} of {len(self)} rows"
            )
            values[missing] = np.nan
        return values

    def whole(self, name: str) -> NDArray[np.int64]:
        """Return a required column of whole numbers as (n,) int64."""
        column = self.data.column(name).combine_chunks()
        self.fail_where(np.asarray(column.is_null()), f"{name} is null; every row needs it")
        if pa.types.is_floating(column.type):
            values = column.to_numpy(zero_copy_only=False)
            self.fail_where(~np.isfinite(values) | (values != np.round(values)), f"{name} is {{}}, not whole", values)
        return np.array(column.cast(pa.int64()).to_numpy(zero_copy_only=False), dtype=np.int64)

    def words(self, name: str) -> list[str]:
        """Return a required column of text."""
        column = self.data.column(name)
        self.fail_where(np.asarray(column.combine_chunks().is_null()), f"{name} is null; every row needs it")
        return [str(v) for v in column.to_pylist()]

    def codes(self, name: str) -> tuple[NDArray[np.int64], list[str]]:
        """Return a required column of text as (n,) codes and the words they stand for, in order of appearance."""
        column = self.data.column(name).combine_chunks()
        self.fail_where(np.asarray(column.is_null()), f"{name} is null; every row needs it")
        encoded = column.cast(pa.string()).dictionary_encode()
        codes = np.array(encoded.indices.to_numpy(zero_copy_only=False), dtype=np.int64)
        return codes, [str(v) for v in encoded.dictionary.to_pylist()]

    def objects(self, name: str) -> list[Any] | None:
        """Return a nullable column as a list, or None when there is no such column or all of it is null."""
        if name not in self or self.data.column(name).null_count == len(self):
            return None
        return list(self.data.column(name).to_pylist())


def read_table(path: Path | str, schema: Mapping[str, str], required: Sequence[str], others: bool = False) -> Table:
    """Read a Parquet file whose columns are in `schema` (name -> kind of value).

    Raises UserError for a missing, empty or broken file, a missing or unknown column (`others` allows those) and a
    wrong type.
    """
    path = Path(path)
    read_bytes(path) if not path.is_file() or path.stat().st_size == 0 else None
    try:
        data = pq.ParquetFile(path).read()
    except PermissionError:
        raise UserError(f"{path}: cannot be read (permission denied)") from None
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError, OSError, ValueError) as error:
        why = str(error).split("\n")[0].split(". ")[0]
        raise UserError(f"{path}: not a readable Parquet file (binary, truncated or damaged): {why}") from None
    return check_table(Table(path, data), schema, required, others)


def read_csv(path: Path | str, schema: Mapping[str, str], required: Sequence[str]) -> Table:
    """Read a CSV file with a header line whose columns are in `schema`; an empty cell is null."""
    path = Path(path)
    rows = _csv_rows(path)
    header = [name.strip() for name in rows[0]]
    if "" in header:
        raise UserError(f"{path}: column {header.index('') + 1} of the header line has no name")
    _check_names(path, header, schema, required, False)
    columns: dict[str, pa.Array] = {}
    for i, name in enumerate(header):
        cells = [row[i].strip() for row in rows[1:]]
        columns[name] = _csv_column(path, name, cells, schema[name])
    return check_table(Table(path, pa.table(columns), csv_lines=True), schema, required)


def _csv_rows(path: Path) -> list[list[str]]:
    text = read_text(path)
    try:
        rows = list(csv.reader(io.StringIO(text), strict=True))
    except csv.Error as error:
        raise UserError(f"{path}: not a readable CSV file: {error}") from None
    while rows and not any(rows[-1]):
        rows.pop()
    for number, row in enumerate(rows, start=1):
        if len(row) != len(rows[0]):
            raise UserError(f"{path}: line {number}: {len(row)} cells where the header has {len(rows[0])} columns")
    return rows


def _csv_column(path: Path, name: str, cells: list[str], kind: str) -> pa.Array:
    if kind == TEXT:
        return pa.array([c or None for c in cells], pa.string())
    values: list[Any] = []
    for line, cell in enumerate(cells, start=2):
        try:
            if kind == LIST:
                values.append([float(v) for v in cell.strip("[]").replace(";", " ").split()] if cell else None)
            else:
                number = (int(cell) if kind == WHOLE else float(cell)) if cell else None
                values.append(number)
        except ValueError:
            raise UserError(f"{path}: line {line}: {name} is '{cell}', not {kind}") from None
    types = {WHOLE: pa.int64(), NUMBER: pa.float64(), LIST: pa.list_(pa.float64())}
    try:
        return pa.array(values, types[kind])
    except (OverflowError, pa.ArrowInvalid):
        raise UserError(f"{path}: {name} holds a number too large for 64 bits") from None


def _check_names(
    path: Path, names: Sequence[str], schema: Mapping[str, str], required: Sequence[str], others: bool
) -> None:
    if len(names) == 1 and any(mark in names[0] for mark in ";\t"):
        raise UserError(f"{path}: one column '{names[0][:40]}'; separate columns by commas")
    for name in names:
        if list(names).count(name) > 1:
            raise UserError(f"{path}: column '{name}' stands twice")
        if name not in schema and not others:
            missing = [k for k in schema if k not in names]
            raise UserError(f"{path}: unknown column '{name}'{did_you_mean(name, missing)}")
    for name in required:
        if name not in names:
            raise UserError(f"{path}: column '{name}' is missing")


def check_table(table: Table, schema: Mapping[str, str], required: Sequence[str], others: bool = False) -> Table:
    """Return `table` when its columns are known, the required ones there and their types right, else UserError."""
    _check_names(table.path, table.data.column_names, schema, required, others)
    for name in table.data.column_names:
        if name in schema and not _fits(table.data.column(name).type, schema[name]):
            kind = table.data.column(name).type
            raise UserError(f"{table.path}: column '{name}' holds {kind}, expected {schema[name]}")
    return table


def _fits(type_: pa.DataType, kind: str) -> bool:
    if pa.types.is_dictionary(type_):
        type_ = type_.value_type
    if pa.types.is_null(type_):
        return True
    if kind == TEXT:
        return bool(pa.types.is_string(type_) or pa.types.is_large_string(type_))
    if kind == LIST:
        return bool(
            (pa.types.is_list(type_) or pa.types.is_large_list(type_) or pa.types.is_fixed_size_list(type_))
            and (pa.types.is_floating(type_.value_type) or pa.types.is_integer(type_.value_type))
        )
    return bool(pa.types.is_integer(type_) or pa.types.is_floating(type_))


def nullable(values: NDArray[Any]) -> pa.Array:
    """Return a float column as Parquet data with null where it is NaN."""
    return pa.array(values, from_pandas=True)


def write_table(path: Path, columns: Mapping[str, Any]) -> None:
    """Write columns as one Parquet file."""
    arrays = {k: v if isinstance(v, pa.Array | pa.ChunkedArray) else pa.array(v) for k, v in columns.items()}
    pq.write_table(pa.table(arrays), path, compression="zstd")


def in_unit(values: FloatArray, unit: float | FloatArray) -> FloatArray:
    """Return SI values in a unit (SI per unit) such that multiplying by it again gives the same bits where any do."""
    out: FloatArray = values / unit
    for toward in (np.inf, -np.inf):
        near = np.nextafter(out, toward)
        out = np.where((out * unit != values) & (near * unit == values), near, out)
    return out
