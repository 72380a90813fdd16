"""platform.parquet, truth.parquet and ignore.parquet: paths in time, one per name."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boresight.io.declaration import DEG
from boresight.io.table import NUMBER, TEXT, Table, in_unit, nullable
from boresight.types import ENU, VELOCITY, FloatArray, Ignore, PlatformTrack, Site, Truth

GEODETIC = ("latitude_deg", "longitude_deg", "height_m")
YPR = ("yaw_deg", "pitch_deg", "roll_deg")
PLATFORM_SCHEMA: dict[str, str] = {
    "t_s": NUMBER,
    "t_recv_s": NUMBER,
    "platform": TEXT,
    **dict.fromkeys((*GEODETIC, *ENU, *YPR, *VELOCITY, "sigma_position_m", "sigma_attitude_deg"), NUMBER),
}
TRUTH_SCHEMA: dict[str, str] = {
    "t_s": NUMBER,
    "target": TEXT,
    **dict.fromkeys((*ENU, *VELOCITY, "sigma_position_m"), NUMBER),
}
IGNORE_SCHEMA: dict[str, str] = {
    "t_s": NUMBER,
    "object": TEXT,
    **dict.fromkeys(("east_m", "north_m", "radius_m"), NUMBER),
}


def platforms_of(table: Table, site: Site, dimensions: int) -> tuple[PlatformTrack, ...]:
    """Return the platforms of a table, positions in the site's east/north/up; one of a single row is at rest there."""
    position = _platform_positions(table, site, dimensions)
    velocity = _columns(table, VELOCITY)
    ypr = _columns(table, YPR) * DEG
    sigma = table.checked("sigma_position_m")
    turn = table.checked("sigma_attitude_deg") * DEG
    arrived = table.numbers("t_recv_s")
    for name, values in (("sigma_position_m", sigma), ("sigma_attitude_deg", turn)):
        table.fail_where(values <= 0, f"{name} is not above zero; leave it null when not known")
    known = np.asarray(np.isfinite(position).all(axis=1))  # without a position the rest of a row is of no use
    out = []
    for name, every, stamps in _by_name(table, "platform"):
        rows, t = every[known[every]], stamps[known[every]]
        if len(rows) == 0:
            table.fail(None, f"no row of platform '{name}' has a position")
        if np.isnan(ypr[rows, 1:]).all():  # a heading alone: the platform is taken as level
            ypr[rows, 1:] = np.where(np.isnan(ypr[rows, :1]), np.nan, 0.0)
        columns = (position[rows], velocity[rows], ypr[rows], sigma[rows], turn[rows])
        came = None if np.isnan(arrived[rows]).all() else np.where(np.isnan(arrived[rows]), t, arrived[rows])
        at_rest = len(rows) == 1 and not np.nan_to_num(velocity[rows]).any()
        out.append(PlatformTrack(name, t, *columns, came, at_rest))
    return tuple(out)


def _platform_positions(table: Table, site: Site, dimensions: int) -> FloatArray:
    geodetic, enu = (any(n in table for n in names) for names in (GEODETIC, ENU))
    if geodetic == enu:
        which = "both kinds of position" if geodetic else "no position"
        table.fail(None, f"{which}; give either {', '.join(GEODETIC)} or {', '.join(ENU)}")
    if enu:
        return _positions(table, dimensions)
    for name in GEODETIC[:2]:
        if name not in table:
            table.fail(None, f"column '{name}' is missing")
    latitude, longitude = (table.checked(n, required=True) for n in GEODETIC[:2])
    flat = dimensions == 2
    if "height_m" not in table and not flat:
        table.fail(None, "column 'height_m' is missing")
    height = table.checked("height_m", required=not flat, default=site.height)
    from boresight.frames.local import enu_from_geodetic  # compiled code: loaded only where it is needed

    position = np.full((len(table), 3), np.nan)
    known = np.isfinite(latitude) & np.isfinite(longitude) & np.isfinite(height)
    lat, lon, up = latitude[known] * DEG, longitude[known] * DEG, height[known]
    position[known] = np.stack(enu_from_geodetic(lat, lon, up, site), axis=1)
    if flat:  # the plane of the tracks: neither antenna height nor the Earth's curvature is in it
        position[:, 2] = 0.0
    return position


def truths_of(table: Table, dimensions: int) -> tuple[Truth, ...]:
    """Return the true paths of a table."""
    position, velocity = _positions(table, dimensions), _columns(table, VELOCITY)
    sigma = table.checked("sigma_position_m") if "sigma_position_m" in table else None
    if sigma is not None:
        table.fail_where(sigma < 0, "sigma_position_m is {}; a standard deviation is not negative", sigma)
    return tuple(
        Truth(name, t, position[rows], velocity[rows], None if sigma is None else sigma[rows])
        for name, rows, t in _by_name(table, "target")
    )


def ignored_of(table: Table) -> tuple[Ignore, ...]:
    """Return the paths of real objects without truth."""
    position = np.stack([table.numbers(n, required=True) for n in ENU[:2]], axis=1)
    radius = table.numbers("radius_m", required=True)
    table.fail_where(radius <= 0, "radius_m is {}; a radius is above zero", radius)
    return tuple(Ignore(name, t, position[rows], radius[rows]) for name, rows, t in _by_name(table, "object"))


def _positions(table: Table, dimensions: int) -> FloatArray:
    """(n, 3) site ENU; in two dimensions a missing up is zero."""
    for name in ENU[:dimensions]:
        if name not in table:
            table.fail(None, f"column '{name}' is missing")
    flat = [table.numbers(n, required=True) for n in ENU[:2]]
    up = table.numbers("up_m", required=dimensions == 3, default=0.0)
    return np.stack([*flat, up], axis=1)


def _columns(table: Table, names: Sequence[str]) -> FloatArray:
    return np.stack([table.checked(n) for n in names], axis=1)


def _by_name(table: Table, column: str) -> list[tuple[str, NDArray[np.int64], FloatArray]]:
    """Split a table by name, in order of appearance; raises UserError where a name's times do not ascend."""
    t = table.numbers("t_s", required=True)
    codes, words = table.codes(column)
    out = []
    for code, word in enumerate(words):
        rows = np.flatnonzero(codes == code)
        back = np.flatnonzero(np.diff(t[rows]) <= 0)
        if len(back):
            row, before = int(rows[back[0] + 1]), t[rows[back[0]]]
            table.fail(row, f"t_s = {t[row]} of {column} '{word}' does not come after {before}; sort its rows by t_s")
        out.append((word, rows, t[rows]))
    return out


def platform_columns(platforms: Sequence[PlatformTrack]) -> dict[str, Any]:
    """Return the columns of platform.parquet (east/north/up)."""
    out: dict[str, Any] = {
        "t_s": np.concatenate([p.t for p in platforms]),
        "platform": [p.id for p in platforms for _ in p.t],
    }
    if any(p.t_recv is not None for p in platforms):
        out["t_recv_s"] = np.concatenate([p.t if p.t_recv is None else p.t_recv for p in platforms])
    out |= _split(ENU, np.concatenate([p.position for p in platforms]), always=True)
    out |= _split(YPR, in_unit(np.concatenate([p.ypr for p in platforms]), DEG))
    out |= _split(VELOCITY, np.concatenate([p.velocity for p in platforms]))
    out |= _split(("sigma_position_m",), np.concatenate([p.sigma_position for p in platforms])[:, None])
    out |= _split(("sigma_attitude_deg",), in_unit(np.concatenate([p.sigma_attitude for p in platforms])[:, None], DEG))
    return out


def truth_columns(truth: Sequence[Truth]) -> dict[str, Any]:
    """Return the columns of truth.parquet."""
    out: dict[str, Any] = {
        "t_s": np.concatenate([p.t for p in truth]),
        "target": [p.target for p in truth for _ in p.t],
    }
    out |= _split(ENU, np.concatenate([p.position for p in truth]), always=True)
    sigma = np.concatenate([np.full(len(p.t), np.nan) if p.sigma is None else p.sigma for p in truth])
    out |= _split(("sigma_position_m",), sigma[:, None])
    return out | _split(VELOCITY, np.concatenate([p.velocity for p in truth]))


def ignore_columns(ignore: Sequence[Ignore]) -> dict[str, Any]:
    """Return the columns of ignore.parquet."""
    out: dict[str, Any] = {
        "t_s": np.concatenate([p.t for p in ignore]),
        "object": [p.object for p in ignore for _ in p.t],
    }
    out |= _split(ENU[:2], np.concatenate([p.position for p in ignore]), always=True)
    return out | {"radius_m": np.concatenate([p.radius for p in ignore])}


def _split(names: Sequence[str], values: FloatArray, always: bool = False) -> dict[str, Any]:
    return {n: nullable(values[:, i]) for i, n in enumerate(names) if always or not np.isnan(values[:, i]).all()}
