"""A results folder (tracks.parquet, decisions.parquet, summary.json) to and from `types.Results`."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from boresight.errors import UserError, did_you_mean
from boresight.io.files import read_text
from boresight.io.table import NUMBER, TEXT, WHOLE, Table, read_table, write_table
from boresight.types import (
    COVARIANCE,
    ENU,
    FATES,
    NO_TRACK,
    STATUSES,
    VELOCITY,
    DecisionRows,
    Recording,
    RegistrationRows,
    Results,
    TrackRows,
)

SMOOTHED = "smoothed.parquet"
REGISTRATION = "registration.parquet"
REGISTRATION_SCHEMA: dict[str, str] = {
    "t_s": NUMBER,
    "sensor": TEXT,
    "parameter": TEXT,
    "value": NUMBER,
    "sigma": NUMBER,
    "declared_sigma": NUMBER,
    "verdict": TEXT,
}
TRACK_SCHEMA: dict[str, str] = {
    "t_s": NUMBER,
    "t_known_s": NUMBER,
    "track_id": WHOLE,
    "status": TEXT,
    **dict.fromkeys((*ENU, *VELOCITY, *COVARIANCE), NUMBER),
}
DECISION_SCHEMA: dict[str, str] = {"row": WHOLE, "fate": TEXT, "track_id": WHOLE, "nis": NUMBER, "reason": TEXT}


def write_results(results: Results, recording: Recording, folder: Path) -> None:
    """Write the files of results into a folder that is there (see `files.output_folder`).

    summary.json gets the key `recording` (name, dimensions, site), so that results can be exported by themselves.
    """
    write_table(folder / "tracks.parquet", results.tracks.columns())
    if results.smoothed is not None:
        write_table(folder / SMOOTHED, results.smoothed.columns())
    if results.registration is not None:
        write_table(folder / REGISTRATION, _registration_columns(results.registration))
    write_table(folder / "decisions.parquet", results.decisions.columns())
    site = recording.site
    about = {
        "name": recording.name,
        "dimensions": recording.dimensions,
        "site": {
            "latitude_deg": math.degrees(site.latitude),
            "longitude_deg": math.degrees(site.longitude),
            "height_m": site.height,
        },
    }
    summary = finite({**results.summary, "recording": about})
    (folder / "summary.json").write_text(json.dumps(summary, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def read_results(path: Path | str) -> Results:
    """Read and check a results folder; raises UserError that names file, row and column."""
    folder = Path(path)
    if not folder.is_dir():
        what = "is a file, not a results folder" if folder.exists() else "no such results folder"
        raise UserError(f"{folder}: {what}")
    past, known = folder / SMOOTHED, folder / REGISTRATION
    return Results(
        _tracks(read_table(folder / "tracks.parquet", TRACK_SCHEMA, tuple(TRACK_SCHEMA)), causal=True),
        _decisions(read_table(folder / "decisions.parquet", DECISION_SCHEMA, tuple(DECISION_SCHEMA), others=True)),
        read_summary(folder / "summary.json"),
        _tracks(read_table(past, TRACK_SCHEMA, tuple(TRACK_SCHEMA)), causal=False) if past.is_file() else None,
        _registration(read_table(known, REGISTRATION_SCHEMA, tuple(REGISTRATION_SCHEMA))) if known.is_file() else None,
    )


def read_summary(path: Path) -> dict[str, Any]:
    """Read summary.json; raises UserError."""
    try:
        data = json.loads(read_text(path))
    except (json.JSONDecodeError, RecursionError) as error:
        raise UserError(f"{path}: not valid JSON (truncated or damaged): {error}") from None
    if not isinstance(data, dict):
        raise UserError(f"{path}: expected one JSON object")
    return data


def _tracks(table: Table, causal: bool) -> TrackRows:
    t, known = table.numbers("t_s", required=True), table.numbers("t_known_s", required=True)
    if causal:
        table.fail_where(known > t, "t_known_s = {} is later than t_s", known)
    covariance = np.full((len(table), 3, 3), np.nan)
    for name, (i, j) in COVARIANCE.items():
        covariance[:, i, j] = covariance[:, j, i] = table.numbers(name, required=2 not in (i, j))
    position = [table.numbers(n, required=n != "up_m") for n in ENU]
    velocity = [table.numbers(n, required=n != "vu_m_s") for n in VELOCITY]
    ids, status = table.whole("track_id"), _coded(table, "status", STATUSES)
    return TrackRows(t, known, ids, status, np.stack(position, 1), np.stack(velocity, 1), covariance)


def _registration(table: Table) -> RegistrationRows:
    words = {name: np.array(table.objects(name), dtype=object) for name in ("sensor", "parameter", "verdict")}
    numbers = {name: table.numbers(name, required=True) for name in ("t_s", "value", "sigma", "declared_sigma")}
    return RegistrationRows(
        numbers["t_s"],
        words["sensor"],
        words["parameter"],
        numbers["value"],
        numbers["sigma"],
        numbers["declared_sigma"],
        words["verdict"],
    )


def _registration_columns(rows: RegistrationRows) -> dict[str, Any]:
    return {
        "t_s": rows.t,
        "sensor": pa.array(rows.sensor.tolist(), pa.string()),
        "parameter": pa.array(rows.parameter.tolist(), pa.string()),
        "value": rows.value,
        "sigma": rows.sigma,
        "declared_sigma": rows.declared,
        "verdict": pa.array(rows.verdict.tolist(), pa.string()),
    }


def _decisions(table: Table) -> DecisionRows:
    track = table.numbers("track_id", default=float(NO_TRACK)).astype(np.int64)
    reason = np.empty(len(table), dtype=object)
    reason[:] = table.objects("reason") or [None] * len(table)
    extra = {
        name: table.data.column(name).to_numpy() for name in table.data.column_names if name not in DECISION_SCHEMA
    }
    return DecisionRows(table.whole("row"), _coded(table, "fate", FATES), track, table.numbers("nis"), reason, extra)


def _coded(table: Table, column: str, words: tuple[str, ...]) -> np.ndarray[Any, np.dtype[np.uint8]]:
    codes, found = table.codes(column)
    for i, word in enumerate(found):
        if word not in words:
            table.fail(int(np.argmax(codes == i)), f"{column} is '{word}', not known{did_you_mean(word, words)}")
    index = np.array([words.index(w) for w in found], dtype=np.uint8)
    return index[codes] if len(index) else np.zeros(0, dtype=np.uint8)


def finite(value: Any) -> Any:
    """Return plain JSON data: NumPy scalars and arrays as numbers and lists, what is not finite as None."""
    if isinstance(value, Mapping):
        return {str(k): finite(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return finite(value.tolist())
    if isinstance(value, list | tuple):
        return [finite(v) for v in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if value is None or isinstance(value, bool | int | float) else str(value)
