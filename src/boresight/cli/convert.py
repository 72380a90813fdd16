"""`boresight convert`: coordinates from one kind to another, given as arguments or as a CSV."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from boresight.cli.output import print_json, print_table
from boresight.errors import UserError, did_you_mean

if TYPE_CHECKING:
    from boresight.frames.camera import Camera
    from boresight.frames.convert import Converted, Setting

KINDS = Literal["pixel", "azel", "enu", "ned", "ecef", "geodetic"]
COLUMNS = {  # name at the edge; angles are degrees there
    "pixel": ("px", "py"),
    "azel": ("azimuth_deg", "elevation_deg", "range_m"),
    "enu": ("east_m", "north_m", "up_m"),
    "ned": ("north_m", "east_m", "down_m"),
    "ecef": ("x_m", "y_m", "z_m"),
    "geodetic": ("latitude_deg", "longitude_deg", "height_m"),
}


def convert(
    source: KINDS,
    /,
    *values: Annotated[float, Parameter(allow_leading_hyphen=True)],
    to: KINDS,
    csv_: Annotated[Path | None, Parameter(name="--csv")] = None,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    force: bool = False,
    site: tuple[float, float, float] | None = None,
    size_px: tuple[float, float] | None = None,
    fov_deg: float | None = None,
    focal_px: float | None = None,
    center_px: tuple[float, float] | None = None,
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0),
    attitude_deg: tuple[float, float, float] = (0.0, 0.0, 0.0),
    mount_deg: tuple[float, float, float] = (0.0, 0.0, 0.0),
    range_m: float | None = None,
    height_m: float | None = None,
    air: Literal["none", "radar", "optical"] = "none",
    sigma_pixel_px: float = 0.0,
    sigma_attitude_deg: float = 0.0,
    sigma_mount_deg: float = 0.0,
    sigma_position_m: float = 0.0,
    sigma_range_m: float = 0.0,
    sigma_height_m: float = 0.0,
    json: bool = False,
) -> None:
    """Convert a pixel, azimuth and elevation, ENU, NED, ECEF or geodetic coordinates to another kind.

    Angles are degrees, lengths metres: pixel px py · azel azimuth elevation [range] · enu east north up ·
    ned north east down · ecef x y z · geodetic latitude longitude height.

    Parameters
    ----------
    source
        Kind of the values.
    values
        The numbers of one row.
    to
        Kind to convert to.
    csv_
        Convert every row of this CSV instead; its columns are named as the output's (px, py, azimuth_deg, …).
    output
        Write a CSV: the input's columns and the new ones.
    force
        Replace the file.
    site
        Origin of east/north/up, and where the camera stands: latitude, longitude (deg), height (m).
    size_px
        Width and height of the picture.
    fov_deg
        Full horizontal field of view; pixels are square.
    focal_px
        Focal length, instead of a field of view.
    center_px
        Principal point; the middle of the picture if left out. The first pixel's centre is 0 0.
    distortion
        k1 k2 p1 p2 k3 (Brown–Conrady, OpenCV's order).
    attitude_deg
        Yaw, pitch, roll of the body (NED to forward-right-down).
    mount_deg
        Yaw, pitch, roll of the camera on the body.
    range_m
        Where a line of sight ends: at this range.
    height_m
        Where a line of sight ends: at this height above the ellipsoid.
    air
        Refraction between the site and the target: none, radar (4/3 Earth) or optical.
    sigma_pixel_px
        Standard deviation of each pixel coordinate.
    sigma_attitude_deg
        Of yaw, pitch and roll each; for azel, of the direction.
    sigma_mount_deg
        Of the mounting about each axis.
    sigma_position_m
        Of the site's place, per axis.
    sigma_range_m
        Of the range.
    sigma_height_m
        Of the height that the line of sight meets.
    json
        Print one JSON object.
    """
    import numpy as np

    from boresight.frames.convert import Air, Kind, Setting
    from boresight.frames.convert import convert as run
    from boresight.types import Site

    table, keep = _rows(source, values, csv_)
    kinds = Kind(source), Kind(to)
    setting = Setting(
        site=Site(math.radians(site[0]), math.radians(site[1]), site[2]) if site else None,
        camera=_camera(size_px, fov_deg, focal_px, center_px, distortion),
        ypr=_radians(attitude_deg),
        mount=_radians(mount_deg),
        range_m=range_m,
        height_m=height_m,
        air=Air(air),
        sigma_pixel=sigma_pixel_px,
        sigma_attitude=math.radians(sigma_attitude_deg),
        sigma_mount=math.radians(sigma_mount_deg),
        sigma_position=sigma_position_m,
        sigma_range=sigma_range_m,
        sigma_height=sigma_height_m,
    )
    names = COLUMNS[source][: table.shape[1]]
    scale = np.array([math.pi / 180 if name.endswith("_deg") else 1.0 for name in names])
    rows = _named(run(table * scale, *kinds, setting), to, setting)
    rows = [{**kept, **row} for kept, row in zip(keep, rows)]
    if output is not None:
        _write(output, rows, force)
    elif json:
        numbers = [{k: float(v) if k in names else v for k, v in row.items()} for row in rows]
        print_json("convert", {"from": source, "to": to}, numbers)
    elif len(rows) == 1:
        print_table({"what": "", "value": ""}, [{"what": k, "value": v} for k, v in rows[0].items()], digits=12)
    else:
        print_table({key: key.replace("_", "\n") for key in rows[0]}, rows, digits=10)


def _named(converted: Converted, to: str, setting: Setting) -> list[dict[str, Any]]:
    """Return the rows with units in their names; uncertainty only where a sigma was given."""
    import numpy as np

    columns: dict[str, Any] = {}
    for name, column in zip(COLUMNS[to], converted.values.T):
        columns[name] = np.degrees(column) if name.endswith("_deg") else column
    b, e = converted.bearing, converted.ellipse
    angular = setting.sigma_pixel or setting.sigma_attitude or setting.sigma_mount
    if b is not None and angular:
        sigma = np.sqrt(np.diagonal(b.covariance, axis1=-2, axis2=-1))
        columns["sigma_azimuth_deg"], columns["sigma_elevation_deg"] = np.degrees(sigma.T)
        with np.errstate(invalid="ignore"):
            columns["correlation"] = b.covariance[:, 0, 1] / (sigma[:, 0] * sigma[:, 1])
        across = np.sqrt(np.trace(b.tangent_covariance, axis1=-2, axis2=-1))
        columns["sigma_direction_deg"] = np.degrees(across)
    if e is not None and (angular or setting.sigma_range or setting.sigma_height or setting.sigma_position):
        columns["ellipse_major_m"], columns["ellipse_minor_m"] = e.semi_major, e.semi_minor
        columns["ellipse_azimuth_deg"] = np.degrees(e.azimuth)
    return [{name: float(c[i]) for name, c in columns.items()} for i in range(len(converted.values))]


def _rows(source: str, values: tuple[float, ...], path: Path | None) -> tuple[Any, list[dict[str, Any]]]:
    """Return the numbers (n, m) and, for a CSV, the columns to carry along."""
    import numpy as np

    names = COLUMNS[source]
    least = 2 if source == "azel" else len(names)
    if path is None:
        if not least <= len(values) <= len(names):
            raise UserError(f"{source} takes {len(names)} values ({' '.join(names)}), not {len(values)}")
        if not all(map(math.isfinite, values)):
            raise UserError(f"the values must be finite numbers, not {' '.join(map(str, values))}")
        return np.array([values], dtype=np.float64), [{}]
    if values:
        raise UserError("give either values or --csv, not both")
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file)
            header = list(reader.fieldnames or [])
            rows = list(reader)
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise UserError(f"{path}: not a CSV in UTF-8 ({error})") from None
    used = [n for n in names if n in header]
    for name in names[:least]:
        if name not in header:
            raise UserError(
                f"{path}: no column '{name}'{did_you_mean(name, header)}; {source} needs {', '.join(names)}"
            )
    if not rows:
        raise UserError(f"{path}: no rows")
    for line, row in enumerate(rows, 2):
        if None in row:
            raise UserError(f"{path}, line {line}: more cells than the header's {len(header)}")
    table = np.array([[_number(row[n], path, i + 2, n) for n in used] for i, row in enumerate(rows)])
    return table, [{str(k): v for k, v in row.items()} for row in rows]


def _number(text: str | None, path: Path, line: int, column: str) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise UserError(f"{path}, line {line}, column '{column}': '{text}' is not a number")
    return value


def _camera(
    size: tuple[float, float] | None,
    fov_deg: float | None,
    focal: float | None,
    center: tuple[float, float] | None,
    distortion: tuple[float, float, float, float, float],
) -> Camera | None:
    from boresight.frames.camera import Camera

    if size is None and fov_deg is None and focal is None:
        return None
    if size is None:
        raise UserError("a camera needs --size-px WIDTH HEIGHT")
    if (fov_deg is None) == (focal is None):
        raise UserError("a camera needs either --fov-deg or --focal-px")
    if focal is None:
        assert fov_deg is not None
        if not 0.0 < fov_deg < 180.0:
            raise UserError(f"--fov-deg {fov_deg:g} must lie between 0 and 180")
        focal = 0.5 * size[0] / math.tan(math.radians(0.5 * fov_deg))
    cx, cy = center or (0.5 * (size[0] - 1), 0.5 * (size[1] - 1))
    return Camera(*size, focal, focal, cx, cy, *distortion)


def _radians(angles: tuple[float, float, float]) -> tuple[float, float, float]:
    return math.radians(angles[0]), math.radians(angles[1]), math.radians(angles[2])


def _write(path: Path, rows: list[dict[str, Any]], force: bool) -> None:
    from boresight.io.files import write_text

    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_text(path, text.getvalue(), force)
    print(f"wrote {path}: {len(rows)} rows")
