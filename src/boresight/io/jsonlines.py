"""JSON lines to looks of sensors and navigation of platforms: each checked, everything refused counted with a reason.

The values of a line become numbers as those of detections.parquet do, bit for bit: a live run and a replay of it are
the same run.
"""

from __future__ import annotations

import hashlib
import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from boresight.frames.local import ecef_from_enu, ecef_from_enu_rotation, enu_from_ecef, enu_from_geodetic
from boresight.io import limits
from boresight.io.arrivals import OLDEST, TOLERANCE, SourceHealth, restored
from boresight.io.declaration import DEG, SIGMA_KEYS
from boresight.io.detections import ENU_FROM_FRD, FRD_ORDER, MEASURED, UNITS, is_frd
from boresight.io.paths import YPR
from boresight.kernels.geodesy import ecef_from_geodetic
from boresight.types import N_COMPONENTS, VELOCITY, Axes, Component, FloatArray, Scan, Sensor, Site
from boresight.types.scan import address_code

LONGEST = 1 << 18  # bytes of one line; longer ones are counted and left out
LONGEST_SILENCE = 86_400.0  # s between two arrivals that lines give themselves
KEPT_ROWS = 1 << 20  # rows of which the sensor is remembered
UNKNOWN = "?"  # the source of lines that name none that is known
NAN = math.nan


class Measured(msgspec.Struct, frozen=True):
    """Columns of detections.parquet that a detection may hold."""

    t_s: float | None = None
    range_m: float | None = None
    azimuth_deg: float | None = None
    elevation_deg: float | None = None
    range_rate_m_s: float | None = None
    x_m: float | None = None
    y_m: float | None = None
    z_m: float | None = None
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    height_m: float | None = None
    sigma_range_m: float | None = None
    sigma_azimuth_deg: float | None = None
    sigma_elevation_deg: float | None = None
    sigma_range_rate_m_s: float | None = None
    sigma_position_m: float | None = None
    covariance: tuple[float, ...] | None = None
    source_id: str | None = None
    attributes: Any = None


class Line(Measured, frozen=True):
    """All that a line may hold: one look of a sensor, a report of a guide source, or navigation of a platform."""

    t_recv_s: float | None = None
    sensor: str | None = None
    source: str | None = None
    platform: str | None = None
    scan: int | None = None
    detections: tuple[Measured, ...] | None = None
    face_az_deg: float | None = None
    face_el_deg: float | None = None
    east_m: float | None = None
    north_m: float | None = None
    up_m: float | None = None
    vx_m_s: float | None = None
    vy_m_s: float | None = None
    vz_m_s: float | None = None
    ve_m_s: float | None = None
    vn_m_s: float | None = None
    vu_m_s: float | None = None
    yaw_deg: float | None = None
    pitch_deg: float | None = None
    roll_deg: float | None = None
    sigma_attitude_deg: float | None = None


MEASURED_NAMES = (*MEASURED, "latitude_deg", "longitude_deg", "height_m")
_SENTINELS = {name: frozenset(limits.NOT_AVAILABLE.get(name, ())) for name in (*MEASURED_NAMES, *YPR, *VELOCITY)}
_DECODER = msgspec.json.Decoder(Line)


class Fix(NamedTuple):
    """One stamp of a platform's navigation."""

    platform: str
    t: float  # s
    t_recv: float  # s
    row: FloatArray  # (9,) site ENU position (m), velocity (m/s), yaw, pitch, roll (rad); NaN where not given
    sigma_position: float = math.nan  # m, of this stamp
    sigma_attitude: float = math.nan  # rad


class Refused(ValueError):
    """A line that cannot be taken: the reason as counted, and words for a person."""

    def __init__(self, reason: str, text: str = "") -> None:
        super().__init__(text or reason)
        self.reason = reason


def line_of(data: bytes) -> Line:
    """Return a line's values; raises Refused ("oversized", "malformed")."""
    if len(data) > LONGEST:
        raise Refused("oversized", f"a line of {len(data)} bytes; at most {LONGEST} are taken")
    try:
        return _DECODER.decode(data)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise Refused("malformed", f"not a line of JSON that is known: {str(error)[:120]}") from None


@dataclass(slots=True)
class LookDecoder:
    """Lines to looks and navigation of declared sensors and platforms.

    `recorded`: lines carry their own arrival, `t_recv_s` (without it their stamp counts), as in a recording that is
    sent again; else the time at which they came in. Rows of detections are numbered in order of arrival; a row that
    repeats one of the last `oldest` seconds (same sensor, stamp and content) is a duplicate and in no look.
    """

    sensors: tuple[Sensor, ...]
    site: Site
    dimensions: int
    platforms: frozenset[str] = frozenset()
    recorded: bool = False
    oldest: float = OLDEST
    tolerance: float = TOLERANCE
    rows: int = 0
    arrival: float = -math.inf  # s, newest
    health: dict[str, SourceHealth] = field(default_factory=dict)
    duplicates: list[tuple[int, int]] = field(default_factory=list)  # row, and which it repeats, since last emptied
    sensor_of: NDArray[np.int16] = field(default_factory=lambda: np.full(KEPT_ROWS, -1, np.int16))  # of row % KEPT_ROWS
    ids: dict[int, str] = field(default_factory=dict)  # sources' own identities by row, until they are taken out
    _index: dict[str, int] = field(init=False)
    _newest_fix: dict[str, float] = field(default_factory=dict)
    _seen: dict[bytes, int] = field(default_factory=dict)  # row by content
    _order: deque[tuple[float, bytes]] = field(default_factory=deque)
    _covariance: dict[tuple[int, bytes], FloatArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._index = {s.id: i for i, s in enumerate(self.sensors)}
        for name in (*self._index, *sorted(self.platforms)):
            self.health.setdefault(name, SourceHealth())

    def decode(self, data: bytes, arrival: float) -> list[Scan | Fix]:
        """Return what the lines in `data` hold that arrived at `arrival` (s)."""
        out: list[Scan | Fix] = []
        for line in data.split(b"\n"):
            if not line or line.isspace():
                continue
            name = UNKNOWN
            try:
                m = line_of(line)
                name, item = self._item(m, arrival)
            except Refused as error:
                self._refuse(name, error)
                continue
            if item is not None:
                out.append(item)
        return out

    def saved(self) -> dict[str, Any]:
        """Return plain values from which `restore` goes on as if nothing had been."""
        return {
            "rows": self.rows,
            "arrival": self.arrival,
            "health": {name: h.saved() for name, h in self.health.items()},
            "fixes": self._newest_fix,
            "seen": [[t, key.hex(), self._seen[key]] for t, key in self._order],
        }

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Take up what `saved` gave."""
        self.rows, self.arrival = int(saved["rows"]), float(saved["arrival"])
        self.health.update({name: restored(h) for name, h in saved["health"].items()})
        self._newest_fix.update(saved["fixes"])
        self._order = deque((float(t), bytes.fromhex(key)) for t, key, _ in saved["seen"])
        self._seen = {bytes.fromhex(key): int(row) for _, key, row in saved["seen"]}

    def _refuse(self, name: str, error: Refused) -> None:
        self.health.setdefault(name, SourceHealth()).count(error.reason, str(error))

    def _item(self, m: Line, arrival: float) -> tuple[str, Scan | Fix | None]:
        name = m.sensor if m.sensor is not None else m.platform
        if name is None or m.t_s is None:
            raise Refused("malformed", "a line needs t_s and sensor, or t_s and platform")
        known = m.sensor in self._index if m.sensor is not None else m.platform in self.platforms
        if not known:
            kind = "sensor" if m.sensor is not None else "platform"
            raise Refused(f"unknown_{kind}", f"no {kind} '{name[:40]}' in the site file")
        health = self.health[name]
        try:
            arrival = self._arrival(m, arrival)
            health.arrived = arrival
            if m.sensor is None:
                return name, self._fix(m, name, health, arrival)
            return name, self._scan(m, self._index[name], health, arrival)
        except Refused as error:
            self._refuse(name, error)
            return name, None

    def _arrival(self, m: Line, arrival: float) -> float:
        if self.recorded:
            given = m.t_recv_s if m.t_recv_s is not None else m.t_s
            if given is None or not abs(given) < 1e12 or LONGEST_SILENCE < given - self.arrival < math.inf:
                raise Refused("bad_time", f"t_recv_s = {given} is no time, or more than a day after the one before")
            arrival = given
        self.arrival = max(self.arrival, arrival)
        return self.arrival

    def _time(self, health: SourceHealth, t: float, arrival: float) -> float:
        if self.recorded:  # the arrival is not ours to judge by
            if not abs(t) < 1e12:
                raise Refused("bad_time", "t_s is not a time")
            health.stamped = max(health.stamped, t)
            health.delay += 0.1 * (arrival - t - health.delay)
            return t
        taken = health.admit(t, arrival, self.oldest, self.tolerance)
        if isinstance(taken, str):
            side = f"{abs(t - arrival):.3f} s {'after' if t > arrival else 'before'} it arrived"
            raise Refused(taken, f"t_s = {t:.3f} lies {side}; check the source's clock and the unit of t_s")
        return taken

    def _fix(self, m: Line, name: str, health: SourceHealth, arrival: float) -> Fix:
        assert m.t_s is not None
        row = navigation(m, self.site, flat=self.dimensions == 2)
        t = self._time(health, m.t_s, arrival)
        if not t > self._newest_fix.get(name, -math.inf):
            raise Refused("late_navigation", f"t_s = {t:.3f} is not later than the stamp before")
        self._newest_fix[name] = t
        health.count("accepted")
        return Fix(name, t, arrival, row, *(_sigma(m, key) for key in ("sigma_position_m", "sigma_attitude_deg")))

    def _scan(self, m: Line, sensor: int, health: SourceHealth, arrival: float) -> Scan | None:
        assert m.t_s is not None
        found: Sequence[Measured] = (m,) if m.detections is None else m.detections
        t = self._time(health, m.t_s, arrival)
        before = len(self.duplicates)
        scan = self.look(sensor, t, found, arrival, t - m.t_s)
        health.count("accepted")
        if len(self.duplicates) > before:
            health.count("duplicate_rows", n=len(self.duplicates) - before)
        return scan

    def look(
        self, sensor: int, t_look: float, found: Sequence[Measured], arrival: float, shift: float = 0.0
    ) -> Scan | None:
        """Return one look of a sensor (its index) at `t_look` (s), None if all its rows repeat earlier ones.

        Detections with a time of their own have it moved by `shift` (s). Raises Refused, before anything has changed,
        for what cannot be.
        """
        one = self.sensors[sensor]
        if not found:
            row = self._number(sensor, 1)
            nothing = np.full((1, 2 * N_COMPONENTS), NAN)
            if self._repeated(sensor, np.array([t_look]), nothing, [None], [None], row)[0]:
                return None
            return Scan(sensor, t_look, arrival, *NOTHING, (row,))
        z = self._values(found, one)
        t = np.array([t_look if d.t_s is None else d.t_s + shift for d in found])
        if not (np.abs(t - t_look) <= self.oldest).all():
            raise Refused("bad_time", "a detection's t_s is far from its line's")
        sigma = _sigmas(found, one, z)
        full = [_full(d, one, z[i], sigma[i]) if d.covariance is not None else None for i, d in enumerate(found)]
        bad = ~np.isnan(z) & np.isnan(sigma)
        if bad.any():
            key = Component(int(np.argmax(bad.any(axis=0)))).name.lower()
            raise Refused("bad_value", f"{key} has no noise: declare its sigma, or send one")
        R = self._covariances(sensor, z, sigma, full)
        first = self._number(sensor, len(found))
        twice = self._repeated(sensor, t, np.hstack([z, sigma]), full, [d.source_id for d in found], first)
        rows = first + np.arange(len(found))
        for i, d in enumerate(found):
            if d.source_id is not None and not twice[i]:
                self.ids[first + i] = d.source_id
        if any(twice):
            keep = np.flatnonzero(~np.array(twice))
            if not len(keep):
                return None
            z, t, R, rows = z[keep], t[keep], R[keep], rows[keep]
        middle = 0.5 * (float(t.min()) + float(t.max()))
        names = [found[i].source_id for i in (rows - first).tolist()]
        codes = None if not any(names) else np.array([address_code(name) for name in names], np.int64)
        return Scan(sensor, middle, arrival, t, z, R, rows, (), codes)

    def _values(self, found: Sequence[Measured], sensor: Sensor) -> FloatArray:
        for d in found:
            for name in MEASURED_NAMES:
                value = getattr(d, name)
                if value is not None and value in _SENTINELS[name]:
                    raise Refused("not_available", limits.problem(name, value) or name)
        z = np.array([[
            d.range_m, d.azimuth_deg, d.elevation_deg, d.range_rate_m_s, d.x_m, d.y_m, d.z_m,
        ] for d in found], dtype=np.float64)  # fmt: skip
        for i, d in enumerate(found):
            if d.latitude_deg is not None or d.longitude_deg is not None:
                z[i, Component.EAST :] = self._placed(d, sensor)
        if not (np.isfinite(z).any(axis=1)).all() or np.isinf(z).any():
            raise Refused("bad_value", "a detection without a measured number (a look without any has detections = [])")
        far, azimuth, elevation = z[:, Component.RANGE], z[:, Component.AZIMUTH], z[:, Component.ELEVATION]
        if (far < 0.0).any():
            raise Refused("bad_value", f"range_m = {np.nanmin(far):g} is negative")
        if (np.abs(elevation) > 90.0).any():
            raise Refused("bad_value", f"elevation_deg = {elevation[np.nanargmax(np.abs(elevation))]:g} is beyond ±90")
        if (np.abs(azimuth) > 360.0).any():
            raise Refused("bad_value", f"azimuth_deg = {azimuth[np.nanargmax(np.abs(azimuth))]:g} is beyond ±360")
        outside = (azimuth > 180.0) | (azimuth <= -180.0)
        azimuth[outside] = 180.0 - np.mod(180.0 - azimuth[outside], 360.0)
        z *= UNITS
        if is_frd(sensor):
            z[:, Component.EAST :] = z[:, [5, 4, 6]] * [1.0, 1.0, -1.0]
        return z

    def _placed(self, d: Measured, sensor: Sensor) -> tuple[float, float, float]:
        """Return a geodetic position in the site's ENU; without a height the third number is NaN."""
        if sensor.axes != Axes.SITE_ENU:
            raise Refused("bad_value", f'latitude and longitude go with axes = "site_enu", not "{sensor.axes}"')
        if d.latitude_deg is None or d.longitude_deg is None:
            raise Refused("bad_value", "latitude_deg and longitude_deg go together")
        check_geodetic(d.latitude_deg, d.longitude_deg, d.height_m)
        height = self.site.height if d.height_m is None else d.height_m
        e, n, u = enu_from_geodetic(d.latitude_deg * DEG, d.longitude_deg * DEG, float(height), self.site)
        return float(e), float(n), NAN if d.height_m is None or self.dimensions == 2 else float(u)

    def _covariances(self, sensor: int, z: FloatArray, sigma: FloatArray, full: list[FloatArray | None]) -> FloatArray:
        out = np.empty((len(z), N_COMPONENTS, N_COMPONENTS))
        for i in range(len(z)):
            given = full[i]
            if given is not None:
                out[i] = given
                continue
            key = (sensor, sigma[i].tobytes())
            known = self._covariance.get(key)
            if known is None:
                if len(self._covariance) > 1000:
                    self._covariance.clear()
                missing = np.isnan(sigma[i])
                known = np.diag(sigma[i] ** 2)
                known[missing[:, None] | missing] = NAN
                known[np.ix_(~missing, ~missing)] = np.diag(sigma[i][~missing] ** 2)
                self._covariance[key] = known
            out[i] = known
        return out

    def _number(self, sensor: int, n: int) -> int:
        """Return the number of the first of `n` new rows."""
        first = self.rows
        self.sensor_of[np.arange(first, first + n) % KEPT_ROWS] = sensor
        self.rows += n
        return first

    def _repeated(
        self,
        sensor: int,
        t: FloatArray,
        content: FloatArray,
        full: list[FloatArray | None],
        ids: list[str | None],
        first: int,
    ) -> list[bool]:
        """Return for each row whether one of the last seconds was the same; notes it in `duplicates`."""
        head = sensor.to_bytes(4, "little")
        out = []
        for i, row in enumerate(content + 0.0):
            h = hashlib.blake2b(head + np.float64(t[i]).tobytes() + row.tobytes(), digest_size=12)
            one = full[i]
            if one is not None:
                h.update((one + 0.0).tobytes())
            name = ids[i]
            if name is not None:
                h.update(name.encode("utf-8", "surrogatepass"))
            key = h.digest()
            before = self._seen.setdefault(key, first + i)
            twice = before != first + i
            if twice:
                self.duplicates.append((first + i, before))
            else:
                self._order.append((self.arrival, key))
            out.append(twice)
        while self._order and self._order[0][0] < self.arrival - 2.0 * self.oldest:
            del self._seen[self._order.popleft()[1]]
        return out


NOTHING = (  # t, z, covariance and row of a look that saw nothing

    np.zeros(0), np.zeros((0, N_COMPONENTS)), np.zeros((0, N_COMPONENTS, N_COMPONENTS)), np.zeros(0, np.int64),
)  # fmt: skip


def _sigmas(found: Sequence[Measured], sensor: Sensor, z: FloatArray) -> FloatArray:
    """The detection's own sigma where it has one, else the sensor's; NaN where not measured."""
    sigma = np.repeat(sensor.sigma[None], len(found), axis=0)
    for key, (components, unit) in SIGMA_KEYS.items():
        for i, d in enumerate(found):
            value = getattr(d, key)
            if value is None:
                continue
            if not 0.0 < value < math.inf:
                raise Refused("bad_value", f"{key} = {value:g}; a standard deviation is above zero")
            sigma[i, list(components)] = value * unit
    sigma[np.isnan(z)] = NAN
    return sigma


def _full(d: Measured, sensor: Sensor, z: FloatArray, sigma: FloatArray) -> FloatArray:
    """Return the full covariance (7, 7) of one detection, its sigmas put into `sigma` (7,)."""
    upper = d.covariance or ()
    filed = z[FRD_ORDER] if is_frd(sensor) else z
    index = np.flatnonzero(~np.isnan(filed))
    m = len(index)
    if len(upper) != m * (m + 1) // 2:
        raise Refused("bad_value", f"covariance has {len(upper)} numbers; {m} measured need {m * (m + 1) // 2}")
    block = np.zeros((m, m))
    block[np.triu_indices(m)] = upper
    block = np.triu(block) + np.triu(block, 1).T
    if not np.isfinite(block).all() or np.linalg.eigvalsh(block)[0] <= 0.0:
        raise Refused("bad_value", "covariance is not positive definite")
    full = np.zeros((N_COMPONENTS, N_COMPONENTS))
    full[np.ix_(index, index)] = block
    if is_frd(sensor):
        full = ENU_FROM_FRD @ full @ ENU_FROM_FRD.T
    missing = np.isnan(z)
    full[missing] = NAN
    full[:, missing] = NAN
    sigma[:] = np.sqrt(np.diag(full))
    return full


def known(name: str, value: float | None) -> float | None:
    """Return a value of a column, None where it is one that says "not available"."""
    return None if value is None or value in _SENTINELS[name] else value


def check_geodetic(latitude: float, longitude: float, height: float | None) -> None:
    """Raise Refused for a place that is none: latitude beyond ±90°, longitude beyond ±180° (degrees), height (m)."""
    if not abs(latitude) <= 90.0:
        raise Refused("bad_value", f"latitude_deg = {latitude:g} is beyond ±90 (91: not available)")
    if not abs(longitude) <= 180.0:
        raise Refused("bad_value", f"longitude_deg = {longitude:g} is beyond ±180 (181: not available)")
    if height is not None and not -1e5 <= height <= 1e9:
        raise Refused("bad_value", f"height_m = {height:g} cannot be")


def position(m: Line, site: Site, flat: bool = False) -> tuple[FloatArray, FloatArray] | None:
    """Return the position in ECEF (3,) (m) and the rotation (3, 3) to ECEF of the axes its velocity is given in.

    None if there is no position: the axes are the local level for latitude and longitude, ECEF itself for x, y, z, and
    the site's for east, north, up. `flat`: a height that is missing is the site's. Raises Refused for a position that
    cannot be.
    """
    height = site.height if flat and m.height_m is None else m.height_m
    if m.latitude_deg is not None and m.longitude_deg is not None and height is not None:
        check_geodetic(m.latitude_deg, m.longitude_deg, height)
        at = Site(m.latitude_deg * DEG, m.longitude_deg * DEG, float(height))
        return np.array(ecef_from_geodetic(at.latitude, at.longitude, at.height)), ecef_from_enu_rotation(at)
    if m.x_m is not None and m.y_m is not None and m.z_m is not None:
        xyz = (m.x_m, m.y_m, m.z_m)
        if not 1e5 < math.hypot(*xyz) < 1e12:
            raise Refused("bad_value", "x_m, y_m, z_m are Earth-centred; this place is inside the Earth or nowhere")
        return np.array(xyz), np.eye(3)
    up = 0.0 if flat and m.up_m is None else m.up_m
    if m.east_m is not None and m.north_m is not None and up is not None:
        if not math.hypot(m.east_m, m.north_m, up) < 1e12:
            raise Refused("bad_value", "east_m, north_m, up_m cannot be")
        return np.array(ecef_from_enu(float(m.east_m), float(m.north_m), float(up), site)), ecef_from_enu_rotation(site)
    return None


def velocity(m: Line) -> FloatArray | None:
    """Return the velocity (3,) (m/s) in the axes of `position`, None if there is none; raises Refused."""
    local, ecef = (m.ve_m_s, m.vn_m_s, m.vu_m_s), (m.vx_m_s, m.vy_m_s, m.vz_m_s)
    a, b, c = local if m.x_m is None or m.latitude_deg is not None else ecef
    a, b, c = (known(name, value) for name, value in zip(VELOCITY, (a, b, c), strict=True))
    if a is None or b is None:
        return None
    if c is None:
        if m.x_m is not None and m.latitude_deg is None:
            return None
        c = 0.0
    if not math.hypot(a, b, c) < 1e6:
        raise Refused("bad_value", "a velocity above 1e6 m/s")
    return np.array([a, b, c])


def navigation(m: Line, site: Site, flat: bool = False) -> FloatArray:
    """Return a row of navigation (9,): site ENU position (m), velocity (m/s), yaw, pitch, roll (rad), NaN if not given.

    A heading alone is that of a level platform. `flat`: the platform is in the plane up = 0. Raises Refused where it
    holds nothing of use, or something that cannot be.
    """
    row = np.full(9, math.nan)
    where = position(m, site, flat)
    if where is not None:
        row[:3] = _site_enu(m, where[0], site, flat)
        v = velocity(m)
        if v is not None:  # site ENU, as in platform.parquet
            row[3:6] = v if m.x_m is None or m.latitude_deg is not None else ecef_from_enu_rotation(site).T @ v
    yaw = known("yaw_deg", m.yaw_deg)
    if yaw is not None:
        pitch, roll = known("pitch_deg", m.pitch_deg) or 0.0, known("roll_deg", m.roll_deg) or 0.0
        if not (abs(yaw) <= 360.0 and abs(pitch) <= 90.0 and abs(roll) <= 180.0):
            raise Refused("bad_value", f"yaw {yaw:g}, pitch {pitch:g}, roll {roll:g} deg: beyond 360, 90 or 180")
        row[6:] = yaw * DEG, pitch * DEG, roll * DEG
    if not (np.isfinite(row[:3]).all() or np.isfinite(row[6:]).all()):
        raise Refused("bad_value", "navigation needs a position, or yaw_deg")
    return row


def _sigma(m: Line, key: str) -> float:
    """Return the declared error of a stamp (SI), NaN where there is none; raises Refused."""
    value = getattr(m, key)
    if value is None:
        return NAN
    if not 0.0 < value < math.inf:
        raise Refused("bad_value", f"{key} = {value:g}; a standard deviation is above zero")
    return float(value) * DEG if key.endswith("_deg") else float(value)


def _site_enu(m: Line, at: FloatArray, site: Site, flat: bool) -> FloatArray:
    """Return a position (3,) as the rows of platform.parquet become one, bit for bit; `at` is it in ECEF (m)."""
    if m.latitude_deg is not None and m.longitude_deg is not None:
        height = site.height if m.height_m is None else m.height_m
        lat, lon, up = (np.array([v], dtype=np.float64) for v in (m.latitude_deg * DEG, m.longitude_deg * DEG, height))
        out: FloatArray = np.stack(enu_from_geodetic(lat, lon, up, site), axis=1)[0]
    elif m.x_m is not None:
        out = np.array(enu_from_ecef(float(at[0]), float(at[1]), float(at[2]), site))
    else:
        out = np.array([m.east_m, m.north_m, m.up_m or 0.0], dtype=np.float64)
    if flat:
        out[2] = 0.0 if m.latitude_deg is not None or m.up_m is None else m.up_m
    return out
