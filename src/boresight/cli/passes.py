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
    "set": "set\n(UTC)",
    "top": "top\n°",
    "from": "from\n°",
    "to": "to\n°",
    "behind": "behind\n°",
    "follows": "follows",
    "age": "age\nd",
}
OLDEST = 30.0  # days
MOST = 20_000  # points of a pass that the mount is followed at
NAMED = 8  # satellites in one line of the table's foot


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
    max_age_days: float = OLDEST,
    force: bool = False,
    json: bool = False,
) -> None:
    """List the passes of satellites over a site, with their highest elevation and whether the mount can follow.

    A pass that is in progress when the window begins or ends, and a satellite that never sets, say so.

    Parameters
    ----------
    tle
        File of two-line elements, or of OMM messages (JSON, XML, CSV, KVN). A set that cannot be used is left out with
        its reason.
    site
        Latitude, longitude (deg), height (m).
    start
        Begin: ISO time (UTC) or Unix seconds; each satellite's own epoch if left out.
    hours
        How long from there.
    min_elevation_deg
        Elevation that counts as risen, without refraction; where the mount's horizon_deg is higher, that counts.
    mount
        A site file with [mount]; the default mount if left out.
    beam_width_deg
        The mount follows if it stays within half of this.
    dut1_s
        UT1 minus UTC.
    max_age_days
        Elements are not used further than this from their epoch.
    force
        Use them however old they are.
    json
        Print one JSON object.
    """
    from boresight.config.site import read_site
    from boresight.io.files import read_text
    from boresight.pointing.elements import read_elements
    from boresight.pointing.mount import Mount
    from boresight.pointing.satellite import find_passes
    from boresight.types import Site

    if not hours > 0 or hours > 24 * 366:
        raise UserError(f"--hours {hours:g} must lie between 0 and a year")
    if not (abs(site[0]) <= 90 and all(map(math.isfinite, site))):
        raise UserError(f"--site: latitude {site[0]:g} must lie between -90 and 90")
    for name, value, low, high in (
        ("--min-elevation-deg", min_elevation_deg, -90.0, 90.0), ("--beam-width-deg", beam_width_deg, 0.0, 180.0),
        ("--dut1-s", dut1_s, -1.0, 1.0), ("--max-age-days", max_age_days, 0.0, math.inf),
    ):  # fmt: skip
        if not low <= value <= high:
            raise UserError(f"{name} {value:g} must lie between {low:g} and {high:g}")
    place = Site(math.radians(site[0]), math.radians(site[1]), site[2])
    machine = read_site(mount).mount if mount else Mount()
    begin = None if start is None else _time(start)
    notes: list[str] = []
    refused: list[str] = []
    try:
        satellites = _newest(read_elements(read_text(tle), str(tle), refused), begin, notes)
    except UserError:
        _tell([f"left out: {reason}" for reason in refused])
        if refused:
            raise UserError(f"{tle}: none of its {len(refused)} sets of elements can be used") from None
        raise
    rows: list[dict[str, Any]] = []
    never: list[str] = []
    limit = math.inf if force else 86400.0 * max_age_days
    for one in satellites:
        first = one.epoch if begin is None else begin
        window = (max(first, one.epoch - limit), min(first + 3600.0 * hours, one.epoch + limit))
        if not window[0] < window[1]:
            away = abs(first - one.epoch) / 86400.0
            refused.append(f"{one.name}: its elements are {away:.0f} days from the window's begin, more than "
                           f"{max_age_days:g}: --max-age-days or --force to use them")  # fmt: skip
            continue
        if window != (first, first + 3600.0 * hours):
            notes.append(f"{one.name}: searched from {_iso(window[0])} to {_iso(window[1])} only, for beyond that its "
                         f"elements are more than {max_age_days:g} days old: --force to use them")  # fmt: skip
        found = find_passes(one, place, *window, math.radians(min_elevation_deg), dut1_s, machine.mask)
        if found.fails is not None:
            after = f"from {_iso(found.fails[0])} to {_iso(found.fails[1])}"
            (notes if found.highest == found.highest else refused).append(
                f"{one.name}: its elements fail {after}: {found.reason} (decayed, or too far from their epoch)"
            )
        rows += [_row(one, p, place, machine, beam_width_deg, dut1_s) for p in found.passes]
        if not found.passes and found.highest == found.highest:
            never.append(f"{one.name} (highest {math.degrees(found.highest):.1f}°)")
    _tell([f"left out: {reason}" for reason in refused] + notes)
    if refused and not rows and not never:
        raise UserError(f"{tle}: none of its sets of elements can be used in this window")
    rows.sort(key=lambda r: r["begin_s"])
    level = f"{min_elevation_deg:g}°" + (" and the horizon" if machine.mask else "")
    if json:
        parameters = {
            "tle": str(tle), "site": list(site), "start": start, "hours": hours,
            "min_elevation_deg": min_elevation_deg, "dut1_s": dut1_s, "max_age_days": max_age_days, "force": force,
        }  # fmt: skip
        told = [f"left out: {reason}" for reason in refused] + notes
        told += [f"never above {level} in the window: {name}" for name in never]
        print_json("passes", parameters, rows, told)
        return
    if rows:
        title = f"passes over {site[0]:g}°, {site[1]:g}° from {_iso(rows[0]['begin_s'])} UTC"
        print_table(COLUMNS, [_shown(row) for row in rows], title, digits=4)
    for k in range(0, len(never), NAMED):
        print(f"never above {level} in these {hours:g} h: {', '.join(never[k : k + NAMED])}")


def _tell(lines: list[str]) -> None:
    for told in lines:
        print(f"boresight: {told}", file=sys.stderr)


def _newest(satellites: list[Satellite], begin: float | None, notes: list[str]) -> list[Satellite]:
    """Return one set of each satellite: of several, the last one before the window's begin, else the nearest."""
    sets: dict[str, list[Satellite]] = {}
    for one in satellites:
        sets.setdefault(one.number or f"name {one.name}", []).append(one)
    out = []
    for several in sets.values():
        at = several[-1].epoch if begin is None else begin
        past = [one for one in several if one.epoch <= at]
        chosen = max(past, key=lambda s: s.epoch) if past else min(several, key=lambda s: s.epoch)
        if len(several) > 1:
            notes.append(f"{chosen.name}: {len(several)} sets of elements; that of {_iso(chosen.epoch)} is used")
        out.append(chosen)
    return out


def _row(one: Satellite, p: Pass, site: Site, mount: Mount, beam: float, dut1: float) -> dict[str, Any]:
    import numpy as np

    from boresight.pointing.satellite import look

    t = np.linspace(p.rise, p.set, min(max(int(p.set - p.rise) + 1, 3), MOST))
    azimuth, elevation, _ = look(one, t, site, dut1)
    plan = mount.plan(t, azimuth, elevation)
    reachable = elevation >= mount.elevation[0] - 1e-9
    error = round(float(np.degrees(plan.error[reachable].max(initial=0.0))), 9)
    rate = np.abs(np.diff(np.unwrap(azimuth)) / np.diff(t)).max()
    within = np.degrees(plan.error) <= 0.5 * beam
    state = {(True, True): "pass", (False, True): "in progress at start", (True, False): "in progress at end"}
    rise, set_ = (_iso(at) if edge else None for at, edge in ((p.rise, p.rises), (p.set, p.sets)))
    return {
        "satellite": one.name,
        "catalogue_number": one.number,
        "state": state.get((p.rises, p.sets), "always above"),
        "rise_s": p.rise if p.rises else None,
        "rise": rise,
        "culmination_s": p.culmination,
        "set_s": p.set if p.sets else None,
        "set": set_,
        "begin_s": p.rise,
        "end_s": p.set,
        "duration_s": p.set - p.rise,
        "max_elevation_deg": math.degrees(p.max_elevation),
        "begin_elevation_deg": math.degrees(p.rise_elevation),
        "end_elevation_deg": math.degrees(p.set_elevation),
        "rise_az_deg": math.degrees(p.rise_azimuth),
        "set_az_deg": math.degrees(p.set_azimuth),
        "max_az_rate_deg_s": float(np.degrees(rate)),
        "keyhole_s": float(np.sum(plan.keyhole) * (t[1] - t[0])),
        "unwinds": not plan.wound,
        "way": str(plan.way),
        "max_error_deg": error,
        "followed_share": float(np.mean(within)),
        "can_follow": bool(reachable.any() and error <= 0.5 * beam and plan.wound),
        "epoch": _iso(one.epoch),
        "age_days": (p.culmination - one.epoch) / 86400.0,
    }


def _shown(row: dict[str, Any]) -> dict[str, Any]:
    """Return a row of the table: what is up at an edge of the window says how high."""
    edges = {False: f"up {row['begin_elevation_deg']:.1f}°", True: f"up {row['end_elevation_deg']:.1f}°"}
    always = row["state"] == "always above"
    follows = "no" if not row["can_follow"] else ("yes" if row["way"] == "upright" else "flip")
    return {
        "satellite": row["satellite"],
        "rise": row["rise"][5:] if row["rise"] else ("always above" if always else edges[False]),
        "set": row["set"][11:] if row["set"] else ("" if always else edges[True]),
        "top": round(row["max_elevation_deg"], 1),
        "from": round(row["rise_az_deg"], 1),
        "to": round(row["set_az_deg"], 1),
        "behind": round(row["max_error_deg"], 2),
        "follows": follows,
        "age": round(row["age_days"], 1),
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
