"""Another tracker's tracks.parquet as a guide source: its rows, in the order in which it gave them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from boresight.config.site import SourceTable
from boresight.errors import UserError
from boresight.frames.local import ecef_from_enu, ecef_from_enu_rotation
from boresight.io.results import read_results
from boresight.pointing.guide import GuideSource
from boresight.types import FloatArray, Results, Site

SHOWN = 8  # ids that an error message names


class TrackReports(NamedTuple):
    """The rows of one track."""

    t: FloatArray  # (n,) s, ascending: of validity, and when they were given
    z: FloatArray  # (n, 3) ECEF m
    axes: FloatArray  # (n, 3, 3) as `GuideSource.axes_of` makes them of the covariance


def read_track(folder: Path, table: SourceTable, source: GuideSource) -> TrackReports:
    """Read the track of a `[[source]]` with `tracks`; raises UserError that names the file and what is wrong with it.

    A row without height (a tracker in two dimensions) stands at the site's, give or take `sigma_up_m`.
    """
    results = read_results(folder)
    site, rows = _site(results, folder), results.tracks
    which = rows.track_id == _chosen(results, folder, table)
    order = np.flatnonzero(which)[np.argsort(rows.t[which], kind="stable")]
    up = np.nan_to_num(rows.position[order, 2], nan=0.0)
    C = rows.covariance[order].copy()
    C[:, 2, :] = np.where(np.isnan(C[:, 2, :]), [0.0, 0.0, table.sigma_up_m**2], C[:, 2, :])
    C[:, :, 2] = np.where(np.isnan(C[:, :, 2]), [0.0, 0.0, table.sigma_up_m**2], C[:, :, 2])
    R = ecef_from_enu_rotation(site)
    z = np.stack(ecef_from_enu(rows.position[order, 0], rows.position[order, 1], up, site), axis=-1)
    try:
        axes = np.stack([source.axes_of(R @ c @ R.T) for c in C])
    except np.linalg.LinAlgError:
        raise UserError(f"{folder}/tracks.parquet: a covariance of track {table.track_id} is not positive") from None
    return TrackReports(rows.t[order], z, axes)


def _chosen(results: Results, folder: Path, table: SourceTable) -> int:
    known = np.unique(results.tracks.track_id).tolist()
    told = ", ".join(str(k) for k in known[:SHOWN]) + (" …" if len(known) > SHOWN else "")
    if table.track_id is None:
        if len(known) == 1:
            return int(known[0])
        raise UserError(f"{folder}: {len(known)} tracks ({told or 'none'}): give source '{table.id}' a track_id")
    if table.track_id not in known:
        raise UserError(f"{folder}: no track {table.track_id}; there are {told or 'none'}")
    return table.track_id


def _site(results: Results, folder: Path) -> Site:
    place: Any = results.summary.get("recording", {}).get("site", {})
    values = [place.get(k) for k in ("latitude_deg", "longitude_deg", "height_m")]
    if not all(isinstance(v, int | float) for v in values):
        raise UserError(
            f"{folder}/summary.json: no recording.site: where the tracks' east, north, up begin is not known"
        )
    return Site(math.radians(values[0]), math.radians(values[1]), float(values[2]))
