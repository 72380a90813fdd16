"""Whether a sensor reports whole looks or one target a message, from its reports; and where everything lies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from boresight.errors import UserError
from boresight.types import Component, FloatArray, Recording, Reporting, Sensor, Site

LOOKS = 20  # that are needed to say anything
FOLLOWED = 100  # looks of a camera that always see one thing in one place
SMOOTH = 6.0  # standard deviations between two looks of what a camera follows, in the median
SPEED = 1000.0  # m/s: what seems to move faster from message to message is another target
REACH = 5.0  # s for which the tracker takes navigation on beyond its ends
FAR = 1e6  # m from the site: no longer one place
SWAPPED = 0.1  # of the distance that is left if latitude and longitude change places


def guess_reporting(recording: Recording, declared: set[str]) -> tuple[Recording, list[str]]:
    """Return a recording whose sensors report single targets where their reports show it, and what was guessed.

    `declared` are the ids of sensors whose `reporting` is declared: they stay as they are.
    """
    sensors, said = list(recording.sensors), []
    for i, sensor in enumerate(recording.sensors):
        if sensor.id in declared:
            continue
        why = _single(recording, i)
        if why:
            sensors[i] = replace(sensor, reporting=Reporting.SINGLE)
            said.append(
                f'{sensor.id}: reporting = "single" (no miss by absence): {why}; declare reporting = "scan" if its '
                "looks show all that is there"
            )
    return replace(recording, sensors=tuple(sensors)), said


def _single(recording: Recording, i: int) -> str:
    """Why the messages of a sensor are of one target each; empty if they are not, or nothing says so."""
    d, sensor = recording.detections, recording.sensors[i]
    rows = np.flatnonzero((d.sensor == i) & recording.usable)
    if len(rows) < LOOKS or np.isnan(d.z[rows]).all(axis=1).any():
        return ""
    if len(np.unique(d.scan[rows])) < len(rows):
        return ""
    rows = rows[np.argsort(d.t_recv[rows], kind="stable")]
    ids = [] if d.source_id is None else [d.source_id[r] for r in rows.tolist()]
    known = {name for name in ids if name is not None}
    if len(known) >= 2:
        return f"each of its {len(rows)} messages is one row, of {len(known)} different source_id"
    if sensor.ranging:
        jumps = _jumps(d.z[rows], d.sigma[rows], d.t[rows])
        if jumps > 0.2:
            return f"each of its {len(rows)} messages is one row, {jumps:.0%} of them far from the one before"
        return ""
    return _followed(sensor, d.z[rows], d.t[rows])


def _jumps(z: FloatArray, sigma: FloatArray, t: FloatArray) -> float:
    """The share of reports that lie further from the one before than anything moves."""
    point = np.isfinite(z[:, Component.EAST])
    r, az = z[:, Component.RANGE], z[:, Component.AZIMUTH]
    el = np.nan_to_num(z[:, Component.ELEVATION])
    flat = np.stack([r * np.cos(el) * np.sin(az), r * np.cos(el) * np.cos(az)], axis=1)
    place = np.where(point[:, None], z[:, Component.EAST : Component.UP], flat)
    noise = np.where(
        point, sigma[:, Component.EAST], np.hypot(sigma[:, Component.RANGE], r * sigma[:, Component.AZIMUTH])
    )
    far = np.linalg.norm(np.diff(place, axis=0), axis=1)
    limit = SPEED * np.abs(np.diff(t)) + 10.0 * np.nan_to_num(noise[1:], nan=0.0)
    good = np.isfinite(far)
    return float((far[good] > limit[good]).mean()) if good.any() else 0.0


def _followed(sensor: Sensor, z: FloatArray, t: FloatArray) -> str:
    """Why a camera follows one target: every image holds one thing, and it is where it just was."""
    az, sigma = z[:, Component.AZIMUTH], float(sensor.sigma[Component.AZIMUTH])
    if len(t) < FOLLOWED or not np.isfinite(az).all() or not np.isfinite(sigma):
        return ""
    steps = np.abs((np.diff(az) + np.pi) % (2.0 * np.pi) - np.pi)
    expected = len(t) * min(sensor.clutter_per_scan + 1.0 - sensor.p_detection, 1.0)
    if (
        expected < 5.0
        or float(np.median(steps)) > SMOOTH * sigma
        or float(np.quantile(steps, 0.99)) > 10.0 * SMOOTH * sigma
    ):
        return ""
    return f"each of its {len(t)} images holds one direction, close to the one before: it follows one target"


def place_notes(recording: Recording, force: bool) -> list[str]:
    """Say how far platforms and fixed sensors are from the site, and which axes sensors on platforms have.

    Raises UserError, unless `force`, for what is further away than 1000 km, or near only with latitude and longitude
    the other way round.
    """
    said = []
    for sensor in recording.sensors:
        if sensor.platform is not None:
            where = {"platform_enu": "north-aligned", "body": "of its body", "mount": "of the mount on its body"}
            axes = str(sensor.axes)
            said.append(f"{sensor.id}: axes = \"{axes}\" ({where.get(axes, '')}, at platform '{sensor.platform}')")
    said += [f"{name}: {_span(np.linalg.norm(place, axis=1))} from the site" for name, place in places(recording)]
    for why in misplaced(recording):
        if not force:
            raise UserError(f"{why}; correct it or the [site], or give --far if it is right")
    return said


def misplaced(recording: Recording) -> list[str]:
    """Return, in words, which platforms and sensors are further from the site than one place can be (1000 km).

    So are those of more than 50 km that are near with latitude and longitude the other way round.
    """
    out = []
    for name, place in places(recording):
        far = np.linalg.norm(place, axis=1)
        if far.max() <= 5e4:
            continue
        swapped = _swapped(place[int(np.argmax(far))], recording.site)
        other = swapped < SWAPPED * float(far.max())
        if float(far.max()) > FAR or (other and float(far.min()) > 5e4):
            turned = f", {swapped / 1e3:.0f} km with latitude and longitude the other way round" if other else ""
            out.append(f"{name} lies {far.max() / 1e3:.0f} km from the site{turned}")
    return out


def coverage_notes(recording: Recording) -> list[str]:
    """Say how many reports of each sensor lie before or after the navigation of its platform."""
    d, by_id, said = recording.detections, {p.id: p for p in recording.platforms}, []
    for i, sensor in enumerate(recording.sensors):
        p = by_id.get(sensor.platform or "")
        if p is None or p.at_rest:
            continue
        t = d.t[(d.sensor == i) & recording.usable] - sensor.latency
        outside = int(((t < p.t[0] - REACH) | (t > p.t[-1] + REACH)).sum())
        if outside:
            said.append(
                f"{sensor.id}: {outside} of {len(t)} reports lie outside the navigation of platform '{p.id}' "
                f"({p.t[0]:.10g} … {p.t[-1]:.10g} s): they cannot be placed"
            )
    return said


def places(recording: Recording) -> list[tuple[str, FloatArray]]:
    """Return names and positions (n, 3) (site ENU, m) of platforms and of fixed sensors with a place of their own."""
    out = [(f"platform '{p.id}'", p.position) for p in recording.platforms]
    stations = [s for s in recording.sensors if s.station is not None]
    return out + [(f"sensor '{s.id}'", np.array([s.station.position])) for s in stations if s.station is not None]


def _span(far: NDArray[np.float64]) -> str:
    low, high = round(float(far.min())), round(float(far.max()))
    return f"{high / 1e3:.4g} km" if high - low < 10 else f"{low / 1e3:.4g} to {high / 1e3:.4g} km"


def _swapped(place: FloatArray, site: Site) -> float:
    """How far (m) a place would be from the site with its latitude and longitude the other way round."""
    from boresight.frames.local import enu_from_geodetic, geodetic_from_enu

    latitude, longitude, height = geodetic_from_enu(float(place[0]), float(place[1]), float(place[2]), site)
    if abs(float(longitude)) > np.pi / 2.0:
        return float("inf")
    east, north, _ = enu_from_geodetic(float(longitude), float(latitude), float(height), site)
    return float(np.hypot(east, north))
