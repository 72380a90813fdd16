"""`boresight passes`: when satellites pass a site, and whether the mount can follow."""

from __future__ import annotations

import math
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from boresight.cli.output import print_json, print_table
from boresight.errors import UserError

if TYPE_CHECKING:
    from boresight.pointing.mount import Mount
    from boresight.pointing.satellite import Pass, Satellite
    from boresight.types import Site

COLUMNS = {
    "satellite": "satellite",
    "rise": "rise\n(UTC)",
    "duration_s": "s",
    "max_elevation_deg": "highest\n°",
    "rise_az_deg": "from\n°",
    "set_az_deg": "to\n°",
    "max_az_rate_deg_s": "az rate\n°/s",
    "max_error_deg": "behind\n°",
    "can_follow": "follows",
}


def passes(
    *,
    tle: Path,
    site: tuple[float, float, float],
    start: str | None = None,
    hours: float = 24.0,
    min_elevation_deg: float = 0.0,
    mount: Path | None = None,
    beam_width_deg: float = 1.0,
    dut1_s: float = 0.0,
    json: bool = False,
) -> None:
    """List the passes of satellites over a site, with their highest elevation and whether the mount can follow.

    Parameters
    ----------
    tle
        File of two-line elements, or of OMM messages (JSON, CSV, XML).
    site
        Latitude, longitude (deg), height (m).
    start
        Begin: ISO time (UTC) or Unix seconds; the elements' own epoch if left out.
    hours
        How long from there.
    min_elevation_deg
        Elevation that counts as risen, without refraction.
    mount
        A site file with [mount]; the default mount if left out.
    beam_width_deg
        The mount follows if it stays within half of this.
    dut1_s
        UT1 minus UTC.
    json
        Print one JSON object.
    """
    from boresight.config.site import read_site
    from boresight.io.files import read_text
    from boresight.pointing import satellite as orbit
    from boresight.pointing.mount import Mount
    from boresight.types import Site

    if not hours > 0 or hours > 24 * 366:
        raise UserError(f"--hours {hours:g} must lie between 0 and a year")
    if not (abs(site[0]) <= 90 and all(map(math.isfinite, site))):
        raise UserError(f"--site: latitude {site[0]:g} must lie between -90 and 90")
    place = Site(math.radians(site[0]), math.radians(site[1]), site[2])
    machine = read_site(mount).mount if mount else Mount()
    rows: list[dict[str, Any]] = []
    skipped: list[str] = []
    satellites = orbit.read_elements(read_text(tle), str(tle), skipped)
    for one in satellites:
        begin = _time(start) if start else orbit.unix_of(one.record.jdsatepoch, one.record.jdsatepochF)
        try:
            found = orbit.passes(one, place, begin, begin + 3600 * hours, math.radians(min_elevation_deg), dut1_s)
            rows += [_row(one, p, place, machine, beam_width_deg, dut1_s) for p in found]
        except UserError as error:  # decayed, or elements that SGP4 cannot carry that far
            if len(satellites) == 1:
                raise
            skipped.append(str(error))
    for told in skipped:
        print(f"boresight: left out: {told}", file=sys.stderr)
    rows.sort(key=lambda r: r["rise_s"])
    if json:
        parameters = {
            "tle": str(tle), "site": list(site), "start": start, "hours": hours,
            "min_elevation_deg": min_elevation_deg, "dut1_s": dut1_s,
        }  # fmt: skip
        print_json("passes", parameters, rows)
    elif rows:
        print_table(COLUMNS, rows, f"passes over {site[0]:g}°, {site[1]:g}°", digits=4)
    else:
        print("no passes")


def _row(one: Satellite, p: Pass, site: Site, mount: Mount, beam: float, dut1: float) -> dict[str, Any]:
    import numpy as np

    from boresight.pointing.satellite import look

    t = np.linspace(p.rise, p.set, max(int(p.set - p.rise) + 1, 3))
    azimuth, elevation, _ = look(one, t, site, dut1)
    plan = mount.plan(t, azimuth, elevation)
    reachable = elevation >= mount.elevation[0]
    error = round(float(np.degrees(plan.error[reachable].max(initial=0.0))), 9)
    rate = np.abs(np.diff(np.unwrap(azimuth)) / np.diff(t)).max()
    return {
        "satellite": one.name,
        "rise_s": p.rise,
        "rise": _iso(p.rise),
        "culmination_s": p.culmination,
        "set_s": p.set,
        "set": _iso(p.set),
        "duration_s": p.set - p.rise,
        "max_elevation_deg": math.degrees(p.max_elevation),
        "rise_az_deg": math.degrees(p.rise_azimuth),
        "set_az_deg": math.degrees(p.set_azimuth),
        "max_az_rate_deg_s": float(np.degrees(rate)),
        "keyhole_s": float(np.sum(plan.keyhole) * (t[1] - t[0])),
        "unwinds": not plan.wound,
        "max_error_deg": error,
        "can_follow": bool(error <= 0.5 * beam and plan.wound),
    }


def _iso(t: float) -> str:
    return datetime.fromtimestamp(t, UTC).strftime("%Y-%m-%d %H:%M:%S")


def _time(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        pass
    try:
        when = datetime.fromisoformat(text.replace("Z", "+00:00"))
    except ValueError:
        raise UserError(f"--start '{text}': give an ISO time like 2026-01-31T12:00:00 or Unix seconds") from None
    return (when if when.tzinfo else when.replace(tzinfo=UTC)).timestamp()
