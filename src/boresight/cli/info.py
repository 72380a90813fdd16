"""`boresight info`: what is in a recording."""

from __future__ import annotations

from math import degrees
from pathlib import Path
from typing import Any

import numpy as np

from boresight.cli.output import plain, print_json, print_notes, print_table
from boresight.io.inventory import inventory
from boresight.io.recording import read_recording
from boresight.io.reporting import coverage_notes
from boresight.types import Recording

SENSOR_COLUMNS = {
    "id": "sensor",
    "kind": "kind",
    "looks": "looks",
    "empty_looks": "empty",
    "detections": "detec-\ntions",
    "detections_per_look": "per\nlook",
    "median_period_s": "period\ns",
    "longest_gap_s": "gap\ns",
    "out_of_order": "out of\norder",
    "duplicates": "dupli-\ncates",
}
MEASURED_COLUMNS = {"sensor": "sensor", "column": "measured", "least": "least", "largest": "largest", "axes": "axes"}
PATH_COLUMNS = {
    "item": "path",
    "id": "id",
    "rows": "rows",
    "duration_s": "duration\ns",
    "median_period_s": "period\ns",
    "longest_gap_s": "gap\ns",
    "path_m": "length\nm",
    "farthest_m": "from site\nm",
    "attitude": "attitude",
}


def info(rec: Path, /, *, json: bool = False) -> None:
    """Say what is in a recording: sensors, rates, gaps, out-of-order stamps, detections per look, platforms, truth.

    Parameters
    ----------
    rec
        Folder of the recording.
    json
        Print one JSON object instead of tables.
    """
    recording = read_recording(rec)
    rows = inventory(recording)
    print_notes([*recording.notes, *coverage_notes(recording)])
    if json:
        print_json("info", {"recording": str(rec), **_about(recording)}, rows)
        return
    about = _about(recording)
    print(
        f"{plain(about['name'])}: {about['dimensions']}-D, {about['duration_s']:.1f} s, {about['rows']} rows\n"
        f"site {about['latitude_deg']:.6f}°, {about['longitude_deg']:.6f}°, {about['height_m']:.1f} m above the WGS84 "
        f"ellipsoid\nfirst stamp {about['start_s']:.3f} s\n"
        f"rows stamped before an earlier row: {about['out_of_order']}, by up to {about['longest_step_back_s']:.3g} s"
    )
    sensors = [r for r in rows if r["item"] == "sensor"]
    print_table(SENSOR_COLUMNS, sensors, digits=3)
    ranges = [
        {"sensor": r["id"], "column": name, "least": low, "largest": high, "axes": r["axes"]}
        for r in sensors
        for name, (low, high) in r["measured"].items()
    ]
    if ranges:
        print_table(MEASURED_COLUMNS, ranges, digits=6)
    for r in sensors:
        if r.get("farthest_m") is not None:
            print(f"{r['id']}: stands {r['farthest_m']:.0f} m from the site")
    late = [f"{r['id']} {r['latency_s']:g} s" for r in sensors if r["latency_s"]]
    print(f"declared latency: {', '.join(late) or 'none'}")
    paths = [r for r in rows if r["item"] != "sensor"]
    if paths:
        print_table(PATH_COLUMNS, paths)
    if not recording.truth:
        print("no truth: tracks can be made, not scored")


def _about(recording: Recording) -> dict[str, Any]:
    t, site = recording.detections.t[recording.usable], recording.site
    t = t if len(t) else recording.detections.t
    back = np.maximum.accumulate(t) - t
    return {
        "name": recording.name,
        "dimensions": recording.dimensions,
        "latitude_deg": degrees(site.latitude),
        "longitude_deg": degrees(site.longitude),
        "height_m": site.height,
        "height_above": "WGS84 ellipsoid",
        "rows": len(recording.detections),
        "refused": len(recording.refused),
        "notes": list(recording.notes),
        "start_s": float(t.min()),
        "end_s": float(t.max()),
        "duration_s": float(t.max() - t.min()),
        "out_of_order": int((back > 0).sum()),
        "longest_step_back_s": float(back.max()),
    }
