"""Exports, read back by independent readers and turned back by pymap3d."""

from __future__ import annotations

import csv
import io
import json
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.io.export import export, site_of_summary
from boresight.types import Site
from tests.io.test_results import some_results

SITE = Site(np.radians(63.4389029083), np.radians(10.39908278), 39.923)


def enu_of(lat: object, lon: object, height: object) -> np.ndarray:
    pymap3d = pytest.importorskip("pymap3d")
    site = (np.degrees(SITE.latitude), np.degrees(SITE.longitude), SITE.height)
    return np.stack(pymap3d.geodetic2enu(lat, lon, height, *site), axis=-1)


def test_csv_holds_every_number() -> None:
    rows = some_results().tracks
    lines = list(csv.DictReader(io.StringIO(export(rows, SITE, "csv", "x"))))
    assert [int(v["track_id"]) for v in lines] == rows.track_id.tolist()
    assert [float(v["east_m"]) for v in lines] == rows.position[:, 0].tolist()
    assert [v["up_m"] == "" for v in lines] == np.isnan(rows.position[:, 2]).tolist()
    back = enu_of(*[np.array([float(v[k]) for v in lines]) for k in ("latitude_deg", "longitude_deg", "height_m")])
    np.testing.assert_allclose(back, np.nan_to_num(rows.position), atol=1e-6)


def test_geojson_has_one_line_per_track() -> None:
    rows = some_results().tracks
    data = json.loads(export(rows, SITE, "geojson", "x"))
    assert [f["id"] for f in data["features"]] == [1, 2]
    line = np.array(data["features"][0]["geometry"]["coordinates"])
    np.testing.assert_allclose(enu_of(line[:, 1], line[:, 0], line[:, 2]), rows.position[:2], atol=2e-3)
    assert data["features"][1]["properties"]["status"] == ["confirmed", "coasting"]


def test_kml_is_xml_with_as_many_times_as_places() -> None:
    rows = some_results().tracks
    root = ET.fromstring(export(rows, SITE, "kml", "a < b"))
    space = {"k": "http://www.opengis.net/kml/2.2", "gx": "http://www.google.com/kml/ext/2.2"}
    tracks = root.findall(".//gx:Track", space)
    assert len(tracks) == 2
    for track in tracks:
        assert len(track.findall("k:when", space)) == len(track.findall("gx:coord", space)) == 2
    assert root.findtext(".//k:name", namespaces=space) == "a < b"
    assert root.findtext(".//k:when", namespaces=space) == "1970-01-01T00:00:00.000000Z"


def test_results_without_a_site_ask_for_the_recording() -> None:
    with pytest.raises(UserError, match="name the recording"):
        site_of_summary({}, "out/summary.json")
    with pytest.raises(UserError, match="give one of csv"):
        export(some_results().tracks, SITE, "shp", "x")
