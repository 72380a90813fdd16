"""From runs to cells: what a study found, one row a combination of parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from boresight.io.table import write_table
from boresight.study.plan import Study

MEANS = ("gospa_rms_m", "tracked_fraction", "false_track_s", "identity_switches", "breaks")


def ordered(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the runs by cell and number, however they came in."""
    return [dict(r) for r in sorted(rows, key=lambda r: (r["cell"], r["run"]))]


def cells(study: Study, rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return one row a cell: its parameters, pooled errors against the bound, NEES with its standard error, means."""
    out = []
    for cell, values in enumerate(study.cells):
        mine = [r for r in ordered(rows) if r["cell"] == cell]
        samples = sum(r["samples"] for r in mine)
        squared, bound = (math.fsum(r[key] for r in mine) for key in ("squared_error_m2", "bound_m2"))
        nees = [r["nees_sum"] / r["samples"] for r in mine if r["samples"]]
        row: dict[str, Any] = {"cell": cell, **dict(zip(study.keys, values)), "runs": len(mine), "samples": samples}
        row["position_rmse_m"] = math.sqrt(squared / samples) if samples else None
        row["bound_rmse_m"] = math.sqrt(bound / samples) if samples else None
        row["rmse_over_bound"] = math.sqrt(squared / bound) if samples else None
        row["nees_mean"] = float(np.mean(nees)) if nees else None
        row["nees_standard_error"] = float(np.std(nees, ddof=1) / math.sqrt(len(nees))) if len(nees) > 1 else None
        for key in MEANS:
            found = [r[key] for r in mine if r[key] is not None]
            row[key] = float(np.mean(found)) if found else None
        out.append(row)
    return out


def write_rows(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows as Parquet, at once: a temporary name, then the right one."""
    columns = {key: pa.array([r[key] for r in rows]) for key in rows[0]}
    part = path.with_name(f".{path.name}")
    write_table(part, columns)
    part.replace(path)
