"""Any kind of place or direction to any other, through east/north/up at a site: what `boresight convert` does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from boresight.errors import UserError
from boresight.frames import azel, geodetic, local, refraction
from boresight.frames._columns import Values
from boresight.frames.attitude import enu_from_body, ned_from_body
from boresight.frames.bearing import Bearing, Noise, bearing_from_direction, bearing_from_pixel, turns_from_ypr
from boresight.frames.camera import Camera, pixel_from_direction
from boresight.frames.geolocate import Ellipse, error_ellipse, place_at_height, place_from_range
from boresight.types import Site
from boresight.types.sensor import FloatArray


class Kind(StrEnum):
    """What three (or two) numbers mean."""

    PIXEL = "pixel"
    AZEL = "azel"
    ENU = "enu"
    NED = "ned"
    ECEF = "ecef"
    GEODETIC = "geodetic"


class Air(StrEnum):
    """How rays bend between the site and the target."""

    NONE = "none"
    RADAR = "radar"  # 4/3 Earth
    OPTICAL = "optical"  # 1/(1 - 0.13) Earth


FACTOR = {Air.NONE: 1.0, Air.RADAR: refraction.RADAR, Air.OPTICAL: refraction.OPTICAL}


@dataclass(frozen=True, slots=True)
class Setting:
    """All that a conversion may need besides its numbers (rad, m, px). None: not given.

    `ypr` is the body's attitude at the site, `mount` the camera's on the body. `range_m` and `height_m` (above the
    ellipsoid) end a line of sight that has no range of its own. The sigmas are one standard deviation each.
    """

    site: Site | None = None
    camera: Camera | None = None
    ypr: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)
    range_m: float | None = None
    height_m: float | None = None
    air: Air = Air.NONE
    sigma_pixel: float = 0.0
    sigma_attitude: float = 0.0
    sigma_mount: float = 0.0
    sigma_position: float = 0.0
    sigma_range: float = 0.0
    sigma_height: float = 0.0

    def __post_init__(self) -> None:
        for name in ("pixel", "attitude", "mount", "position", "range", "height"):
            if not 0.0 <= getattr(self, f"sigma_{name}") < np.inf:
                raise UserError(f"the sigma of {name} must be 0 or more and finite")
        if self.site is not None and not abs(self.site.latitude) <= np.pi / 2 + 1e-12:
            raise UserError(f"the site's latitude {np.degrees(self.site.latitude):g}° is beyond ±90°")


@dataclass(frozen=True, slots=True, eq=False)
class Converted:
    """Columns (n, m) of the kind asked for, and where they were worked out the bearing's covariance and the ellipse."""

    values: FloatArray
    bearing: Bearing | None = None
    ellipse: Ellipse | None = field(default=None)


def convert(values: FloatArray, source: Kind, target: Kind, setting: Setting) -> Converted:
    """Return `values` (n, 2 or 3) of one kind as another: rad and m; pixels as (px, py).

    A pixel, or an azimuth and elevation without range (two columns), is a direction: it converts to azel as such, and
    to a place with `range_m` or `height_m`. Raises UserError for what the way needs and the setting does not give.
    """
    upright = {Kind.AZEL: (1, "elevation"), Kind.GEODETIC: (0, "latitude")}
    if source in upright:
        column, name = upright[source]
        row = int(np.argmax(np.abs(values[:, column])))
        if abs(values[row, column]) > np.pi / 2 + 1e-12:
            raise UserError(f"row {row}: {name} {np.degrees(values[row, column]):g}° is beyond ±90°")
    if source in (Kind.PIXEL, Kind.AZEL) and values.shape[1] == 2:
        return _from_direction(values, source, target, setting)
    if {source, target} == {Kind.GEODETIC, Kind.ECEF}:
        forward = geodetic.ecef_from_geodetic if source == Kind.GEODETIC else geodetic.geodetic_from_ecef
        return Converted(np.stack(forward(*values.T), axis=-1))
    return Converted(_from_enu(_to_enu(values, source, setting), target, setting))


def _from_direction(values: FloatArray, source: Kind, target: Kind, setting: Setting) -> Converted:
    bearing = _bearing(values, source, setting)
    d = bearing.direction
    if setting.range_m is None and setting.height_m is None:
        if target == Kind.AZEL:
            return Converted(np.stack([bearing.azimuth, bearing.elevation], axis=-1), bearing)
        if target == Kind.PIXEL:
            return Converted(_pixels(d, setting))
        raise UserError(f"{source} is a direction: give --range-m or --height-m to convert it to {target}")
    site = setting.site or Site(0.0, 0.0, 0.0)
    if setting.height_m is not None:
        if setting.site is None:
            raise UserError("--height-m needs --site: the height is above the ellipsoid there")
        if setting.air != Air.NONE:
            raise UserError("--air bends a path of known length: give --range-m, not --height-m")
        place = place_at_height(
            np.zeros(3), d, setting.height_m, site, tangent_covariance=bearing.tangent_covariance,
            sigma_height=setting.sigma_height, position_covariance=np.eye(3) * setting.sigma_position**2,
        )  # fmt: skip
    else:
        d, r = _straight(d, np.full(len(d), setting.range_m), setting)
        place = place_from_range(
            np.zeros(3), d, r, site, tangent_covariance=bearing.tangent_covariance,
            sigma_range=setting.sigma_range, position_covariance=np.eye(3) * setting.sigma_position**2,
        )  # fmt: skip
    enu = place.range[:, None] * d
    return Converted(_from_enu(enu, target, setting), bearing, error_ellipse(place.covariance))


def _bearing(values: FloatArray, source: Kind, setting: Setting) -> Bearing:
    if source == Kind.AZEL:
        d = np.stack(azel.enu_from_azel(values[:, 0], values[:, 1], 1.0), axis=-1)
        return bearing_from_direction(d, np.eye(3) * setting.sigma_attitude**2)
    E = turns_from_ypr(*setting.ypr)
    noise = Noise(
        pixel=np.eye(2) * setting.sigma_pixel**2,
        attitude=E @ E.T * setting.sigma_attitude**2,
        mount=np.eye(3) * setting.sigma_mount**2,
    )
    R, M = enu_from_body(*setting.ypr), ned_from_body(*setting.mount)
    return bearing_from_pixel(_camera(setting), values[:, 0], values[:, 1], R, M, noise)


def _straight(d: FloatArray, r: FloatArray, setting: Setting) -> tuple[FloatArray, FloatArray]:
    """Return the straight line's direction and length for a bent path that leaves along `d`."""
    if setting.air == Air.NONE:
        return d, r
    azimuth, elevation, _ = azel.azel_from_enu(*d.T)
    height = setting.site.height if setting.site else 0.0
    true, straight = refraction.true_from_apparent(elevation, r, height, FACTOR[setting.air])
    return np.stack(azel.enu_from_azel(azimuth, true, 1.0), axis=-1), straight


def _to_enu(values: FloatArray, source: Kind, setting: Setting) -> FloatArray:
    if source == Kind.AZEL:
        d, r = _straight(np.stack(azel.enu_from_azel(values[:, 0], values[:, 1], 1.0), axis=-1), values[:, 2], setting)
        return d * r[:, None]
    if source == Kind.NED:
        return values @ local.ENU_FROM_NED.T
    if source == Kind.ENU:
        return values
    to_enu: Callable[..., Values] = local.enu_from_geodetic if source == Kind.GEODETIC else local.enu_from_ecef
    return np.stack(to_enu(*values.T, _site(setting, source)), axis=-1)


def _from_enu(enu: FloatArray, target: Kind, setting: Setting) -> FloatArray:
    if target == Kind.ENU:
        return enu
    if target == Kind.NED:
        return enu @ local.ENU_FROM_NED
    if target == Kind.PIXEL:
        return _pixels(enu, setting)
    if target == Kind.AZEL:
        azimuth, elevation, r = azel.azel_from_enu(*enu.T)
        if setting.air != Air.NONE:
            height = setting.site.height if setting.site else 0.0
            elevation, r = refraction.apparent_from_true(elevation, r, height, FACTOR[setting.air])
        return np.stack([azimuth, elevation, r], axis=-1)
    from_enu: Callable[..., Values] = local.geodetic_from_enu if target == Kind.GEODETIC else local.ecef_from_enu
    return np.stack(from_enu(*enu.T, _site(setting, target)), axis=-1)


def _pixels(direction: FloatArray, setting: Setting) -> FloatArray:
    enu_from_mount = enu_from_body(*setting.ypr) @ ned_from_body(*setting.mount)
    return pixel_from_direction(_camera(setting), direction @ enu_from_mount)


def _camera(setting: Setting) -> Camera:
    if setting.camera is None:
        raise UserError("pixels need a camera: give --size-px and --fov-deg or --focal-px")
    return setting.camera


def _site(setting: Setting, kind: Kind) -> Site:
    if setting.site is None:
        raise UserError(f"{kind} needs --site LATITUDE_DEG LONGITUDE_DEG HEIGHT_M, the origin of east/north/up")
    return setting.site
