"""Names and units of columns in other people's CSV files, and what they are called here."""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from boresight.io.detections import SCHEMA as DETECTIONS
from boresight.io.paths import IGNORE_SCHEMA, PLATFORM_SCHEMA, TRUTH_SCHEMA
from boresight.io.table import NUMBER

NMI, FOOT = 1852.0, 0.3048
LENGTH = {
    "m": 1.0,
    "km": 1e3,
    "cm": 1e-2,
    "mm": 1e-3,
    "ft": FOOT,
    "nmi": NMI,
    "yd": 0.9144,
    "mi": 1609.344,
    "fl": 100.0 * FOOT,
}
ANGLE = {
    "deg": 1.0,
    "rad": 180.0 / math.pi,
    "mrad": 0.18 / math.pi,
    "mil": 360.0 / 6400.0,
    "grad": 0.9,
    "e7": 1e-7,
    "cdeg": 1e-2,
}
SPEED = {
    "m_s": 1.0,
    "kn": NMI / 3600.0,
    "km_h": 1.0 / 3.6,
    "mph": 0.44704,
    "ft_s": FOOT,
    "ft_min": FOOT / 60.0,
    "cm_s": 1e-2,
}
ISO, DAY_SECONDS, WEEK_SECONDS = "iso8601", "s-of-day", "s-of-week"
TIME = {
    "s": 1.0,
    "ms": 1e-3,
    "us": 1e-6,
    "ns": 1e-9,
    "min": 60.0,
    "h": 3600.0,
    DAY_SECONDS: 1.0,
    WEEK_SECONDS: 1.0,
    ISO: 1.0,
}
# Other ways to write a unit.
SPELLINGS = {
    "metres": "m",
    "meters": "m",
    "meter": "m",
    "metre": "m",
    "feet": "ft",
    "foot": "ft",
    "nm": "nmi",
    "nautical_miles": "nmi",
    "yards": "yd",
    "degrees": "deg",
    "degree": "deg",
    "°": "deg",
    "radians": "rad",
    "mils": "mil",
    "mps": "m_s",
    "ms_1": "m_s",
    "m/s": "m_s",
    "knots": "kn",
    "knot": "kn",
    "kt": "kn",
    "kts": "kn",
    "kmh": "km_h",
    "kph": "km_h",
    "km/h": "km_h",
    "fpm": "ft_min",
    "ft/min": "ft_min",
    "ftmin": "ft_min",
    "ft/s": "ft_s",
    "fps": "ft_s",
    "sec": "s",
    "seconds": "s",
    "secs": "s",
    "msec": "ms",
    "millis": "ms",
    "milliseconds": "ms",
    "usec": "us",
    "micros": "us",
    "microseconds": "us",
    "nanos": "ns",
    "nsec": "ns",
    "nanoseconds": "ns",
    "iso": ISO,
    "utc": ISO,
    "minutes": "min",
    "hours": "h",
    "degE7": "e7",
}
UNITS = {"length": LENGTH, "angle": ANGLE, "speed": SPEED, "time": TIME}
SUFFIX = {"length": "_m", "angle": "_deg", "speed": "_m_s", "time": "_s"}
# Columns that become others: speed and course velocities, latitude and longitude of detections east and north.
MSL = "height_msl_m"  # above mean sea level
EXTRA = (MSL, "speed_m_s", "course_deg", "vd_m_s", "down_m", *("latitude_deg", "longitude_deg", "height_m"))
# What is written for each of our columns, without its unit.
SYNONYMS: dict[str, tuple[str, ...]] = {
    "t_s": (
        "time",
        "t",
        "timestamp",
        "stamp",
        "datetime",
        "date_time",
        "utc",
        "utc_time",
        "unix",
        "unix_time",
        "epoch",
        "tod",
        "gps_time",
        "time_utc",
        "timestamp_utc",
        "toa",
        "basedatetime",
        "base_date_time",
        "t_utc",
    ),
    "t_recv_s": ("t_recv", "recv", "received", "time_received", "arrival", "arrival_time", "recv_time", "rx_time"),
    "sensor": ("sensor", "sensor_id", "sensor_name", "source_name"),
    "scan": (
        "scan",
        "scan_no",
        "scan_number",
        "scan_id",
        "sweep",
        "turn",
        "revolution",
        "rotation",
        "frame",
        "frame_id",
    ),
    "range_m": ("range", "r", "rng", "dist", "distance", "slant_range", "rho", "range_slant"),
    "azimuth_deg": ("azimuth", "az", "azi", "bearing", "brg", "theta", "true_bearing"),
    "elevation_deg": ("elevation", "el", "elev", "elevation_angle", "elev_angle"),
    "range_rate_m_s": ("range_rate", "rr", "rdot", "doppler", "radial_velocity", "radial_speed", "vr", "v_radial"),
    "x_m": ("x",),
    "y_m": ("y",),
    "z_m": ("z",),
    "latitude_deg": ("latitude", "lat", "gps_lat", "lat_wgs84"),
    "longitude_deg": ("longitude", "lon", "lng", "long", "gps_lon", "lon_wgs84"),
    "height_m": (
        "height",
        "alt",
        "altitude",
        "hgt",
        "hae",
        "ellipsoidal_height",
        "geo_altitude",
        "geoaltitude",
        "gps_alt",
        "alt_wgs84",
    ),
    MSL: (
        "height_msl",
        "alt_msl",
        "altitude_msl",
        "msl",
        "amsl",
        "alt_amsl",
        "height_amsl",
        "orthometric_height",
        "elevation_msl",
        "msl_altitude",
        "gps_alt_msl",
    ),
    "yaw_deg": ("yaw", "heading", "hdg", "true_heading", "hdt", "psi"),
    "pitch_deg": ("pitch",),
    "roll_deg": ("roll",),
    "speed_m_s": ("speed", "sog", "gs", "ground_speed", "groundspeed", "speed_over_ground", "velocity"),
    "course_deg": ("course", "cog", "track_angle", "course_over_ground", "cmg"),
    "ve_m_s": ("ve", "vel_e", "v_e", "v_east", "velocity_east", "vx"),
    "vn_m_s": ("vn", "vel_n", "v_n", "v_north", "velocity_north", "vy"),
    "vu_m_s": ("vu", "vel_u", "v_u", "v_up", "velocity_up", "vertical_rate", "vz"),
    "vd_m_s": ("vd", "vel_d", "v_d", "v_down", "velocity_down"),
    "east_m": ("east", "e", "easting", "x_east"),
    "north_m": ("north", "n", "northing", "y_north"),
    "up_m": ("up", "u", "z_up"),
    "down_m": ("down", "d"),
    "platform": ("platform", "ship", "vessel", "vehicle", "own_ship"),
    "target": ("target", "target_id", "truth_id", "object_id"),
    "object": ("object",),
    "radius_m": ("radius",),
    "source_id": (
        "source_id",
        "mmsi",
        "icao",
        "icao24",
        "icao_address",
        "address",
        "track",
        "track_id",
        "track_number",
        "id",
        "mode_s",
        "callsign",
        "tail",
    ),
}
TABLES: dict[str, dict[str, str]] = {
    "detections": DETECTIONS,
    "platform": PLATFORM_SCHEMA,
    "truth": TRUTH_SCHEMA,
    "ignore": IGNORE_SCHEMA,
}
EVERY = {name: kind for schema in TABLES.values() for name, kind in schema.items()} | dict.fromkeys(EXTRA, NUMBER)
_BASES = {base: name for name, bases in SYNONYMS.items() for base in bases}


class Column(NamedTuple):
    """What a column of a file is here: its name, and the unit of its values (empty for text)."""

    name: str
    unit: str


def dimension(name: str) -> str:
    """Return what a column of ours measures: length, angle, speed, time, or an empty string."""
    if EVERY.get(name) != NUMBER:
        return ""
    return next((d for d in ("speed", "angle", "length", "time") if name.endswith(SUFFIX[d])), "")


def unit_named(word: str, of: str) -> str | None:
    """Return the unit of a dimension that a word spells, None for none."""
    word = word.strip().lower()
    word = SPELLINGS.get(word, word)
    return word if word in UNITS[of] else None


def split_unit(header: str) -> tuple[str, str]:
    """Return a heading's name without its unit, in lower case with underscores, and the unit as it is spelt.

    >>> split_unit("Range [km]"), split_unit("alt_ft"), split_unit("sog_kn"), split_unit("azimuth")
    (('range', 'km'), ('alt', 'ft'), ('sog', 'kn'), ('azimuth', ''))
    """
    text = header.strip()
    found = re.fullmatch(r"(.*?)[\s_]*[\[(<]\s*(.+?)\s*[\])>]", text)
    if found:
        return _plain(found[1]), found[2].strip().lower()
    plain = _plain(text)
    known = sorted(
        {u for units in UNITS.values() for u in units} | {_plain(s) for s in SPELLINGS}, key=len, reverse=True
    )
    for unit in known:
        if unit and plain.endswith("_" + unit) and len(plain) > len(unit) + 1:
            return plain[: -len(unit) - 1], unit
    return plain, ""


def _plain(text: str) -> str:
    return re.sub(r"[^a-z0-9°]+", "_", text.strip().lower()).strip("_")


def same_name(header: str) -> Column | None:
    """Return the column of ours that a heading names, perhaps with another unit (`range_km`, `azimuth_rad`)."""
    if header in EVERY:
        d = dimension(header)
        return Column(header, {"length": "m", "angle": "deg", "speed": "m_s", "time": "s", "": ""}[d])
    base, word = split_unit(header)
    for of, suffix in SUFFIX.items():
        name, unit = base + suffix, unit_named(word, of) if word else None
        if unit is not None and name in EVERY and dimension(name) == of:
            return Column(name, unit)
    return None


def like_name(header: str) -> Column | None:
    """Return the column of ours that a heading probably means (`lat`, `sog_kn`), None where none is known."""
    exact = same_name(header)
    if exact is not None:
        return exact
    base, word = split_unit(header)
    name = _BASES.get(base) or _BASES.get(_plain(header))
    if name is None:
        return None
    of = dimension(name)
    if not of:
        return Column(name, "")
    usual = {"length": "m", "angle": "deg", "speed": "m_s", "time": "s"}[of]
    unit = unit_named(word, of) if word else usual
    return None if unit is None else Column(name, unit)
