"""Tracks for other programs: CSV, GeoJSON (RFC 7946) and KML (2.2 with gx:Track)."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from boresight.errors import UserError
from boresight.frames.local import geodetic_from_enu
from boresight.io.paths import GEODETIC
from boresight.types import COVARIANCE, ENU, STATUSES, VELOCITY, FloatArray, Site, TrackRows

FORMATS = ("csv", "geojson", "kml")


def site_of_summary(summary: dict[str, Any], where: str) -> Site:
    """Return the site that `write_results` put into summary.json; raises UserError when it is not there."""
    try:
        site = summary["recording"]["site"]
        numbers = [float(site[key]) for key in GEODETIC]
    except (KeyError, TypeError, ValueError):
        raise UserError(f"{where}: holds no site; name the recording after the results folder") from None
    return Site(math.radians(numbers[0]), math.radians(numbers[1]), numbers[2])


def export(rows: TrackRows, site: Site, form: str, name: str) -> str:
    """Return the text of the tracks in one of FORMATS; in two dimensions at the height of the site.

    Latitudes and longitudes are WGS84 degrees, heights above the ellipsoid. Raises UserError for an unknown format.
    """
    up = np.nan_to_num(rows.position[:, 2])
    latitude, longitude, height = geodetic_from_enu(
        np.ascontiguousarray(rows.position[:, 0]), np.ascontiguousarray(rows.position[:, 1]), up, site
    )
    places = np.stack([np.degrees(longitude), np.degrees(latitude), height], axis=1)
    if form == "csv":
        return _csv(rows, places)
    if form == "geojson":
        return _geojson(rows, places)
    if form == "kml":
        return _kml(rows, places, name)
    raise UserError(f"--to {form}: give one of {', '.join(FORMATS)}")


def _tracks(rows: TrackRows) -> Iterator[tuple[int, NDArray[np.int64]]]:
    for track in np.unique(rows.track_id).tolist():
        of = np.flatnonzero(rows.track_id == track)
        yield track, of[np.argsort(rows.t[of], kind="stable")]


def _csv(rows: TrackRows, places: FloatArray) -> str:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["t_s", "t_known_s", "track_id", "status", *ENU, *VELOCITY, *COVARIANCE, *GEODETIC])
    numbers = np.concatenate(
        [
            rows.position,
            rows.velocity,
            np.stack([rows.covariance[:, i, j] for i, j in COVARIANCE.values()], axis=1),
            places[:, [1, 0, 2]],
        ],
        axis=1,
    )
    for i, line in enumerate(numbers.tolist()):
        head = [repr(float(rows.t[i])), repr(float(rows.t_known[i])), int(rows.track_id[i]), STATUSES[rows.status[i]]]
        writer.writerow(head + ["" if math.isnan(v) else repr(v) for v in line])
    return out.getvalue()


def _geojson(rows: TrackRows, places: FloatArray) -> str:
    features = []
    for track, of in _tracks(rows):
        points = [[round(x, 8), round(y, 8), round(z, 3)] for x, y, z in places[of].tolist()]
        shape = {"type": "LineString", "coordinates": points} if len(points) > 1 else None
        properties = {
            "track_id": track,
            "start_s": float(rows.t[of[0]]),
            "end_s": float(rows.t[of[-1]]),
            "t_s": [round(t, 3) for t in rows.t[of].tolist()],
            "status": [str(STATUSES[s]) for s in rows.status[of]],
        }
        geometry = shape or {"type": "Point", "coordinates": points[0]}
        features.append({"type": "Feature", "id": track, "geometry": geometry, "properties": properties})
    return json.dumps({"type": "FeatureCollection", "features": features}, separators=(",", ":")) + "\n"


def _kml(rows: TrackRows, places: FloatArray, name: str) -> str:
    mode = "clampToGround" if np.isnan(rows.position[:, 2]).any() else "absolute"
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2">',
        f"<Document><name>{escape(name)}</name>",
    ]
    for track, of in _tracks(rows):
        lines.append(f"<Placemark><name>track {track}</name><gx:Track><altitudeMode>{mode}</altitudeMode>")
        lines += [f"<when>{_when(t)}</when>" for t in rows.t[of].tolist()]
        lines += [f"<gx:coord>{x:.8f} {y:.8f} {z:.3f}</gx:coord>" for x, y, z in places[of].tolist()]
        lines.append("</gx:Track></Placemark>")
    return "\n".join([*lines, "</Document></kml>"]) + "\n"


def _when(t: float) -> str:
    """KML's time of Unix seconds (times from another epoch count from 1970); raises UserError for what is no date."""
    try:
        return datetime.fromtimestamp(round(t, 3), UTC).strftime("%Y-%m-%dT%H:%M:%S.%fZ")
    except (ValueError, OverflowError, OSError):
        raise UserError(
            f"--to kml: t_s = {t:.10g} is no date in seconds since 1970 (milliseconds?); import the recording with "
            "--time-unit, or export csv or geojson"
        ) from None
