"""Bytes from outside to reports of guide sources: JSON lines, each checked, all that is refused counted."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from boresight.frames.array_face import Pole, enu_from_face
from boresight.frames.local import ecef_from_enu
from boresight.io.arrivals import SourceHealth, restored
from boresight.io.jsonlines import UNKNOWN, Fix, Line, Measured, Refused, line_of, navigation, position, velocity
from boresight.kernels.guide import DIRECTION
from boresight.pointing.guide import GuideSource
from boresight.pointing.pointer import Pointer
from boresight.pointing.reports import Report, reports_of_look
from boresight.service.navigation import Navigation
from boresight.types import N_COMPONENTS, Axes, Component, Mount, Sensor, SensorKind, Site
from boresight.types.sensor import FloatArray

DEG = math.pi / 180.0
LEAST = 1e-12  # of a variance
_POLE = {Pole.IN_FACE: np.eye(3), Pole.ON_NORMAL: np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])}
_UNIT = np.eye(3)
_UNIT.flags.writeable = False


class Stand(NamedTuple):
    """Where a source of directions stands, what its azimuth and elevation count from, and its known delay."""

    axes: Axes = Axes.SITE_ENU
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m: east, north, up of the site
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m: forward, right, down on the platform
    latency: float = 0.0  # s


@dataclass(slots=True)
class Feed:
    """Parses lines for the sources of a pointer; `stands` says where each stands. Counts what came of them.

    `navigation` is that of the platform that carries the antenna, if it moves: lines with its name are its fixes, and
    angles of the face, and of sources on the platform, are turned by the platform's attitude at their time.
    """

    pointer: Pointer
    stands: Mapping[str, Stand]
    navigation: Navigation | None = None
    health: dict[str, SourceHealth] = field(default_factory=dict)
    index: dict[str, int] = field(init=False)
    _origin: dict[str, FloatArray] = field(init=False)
    _face: FloatArray = field(init=False)
    _sensor: dict[str, Sensor] = field(init=False)

    def __post_init__(self) -> None:
        site, p = self.pointer.site, self.pointer
        self.index = {s.id: i for i, s in enumerate(p.guide.sources)}
        self._origin = {name: _place(s.offset, site) for name, s in self.stands.items()}
        self._face = np.ascontiguousarray(enu_from_face(*p.face) @ _POLE[p.pole])
        self._sensor = {name: _sensor(name, s) for name, s in self.stands.items()}
        for name in (*self.index, *([] if self.navigation is None else [self.navigation.name])):
            self.health.setdefault(name, SourceHealth())

    @property
    def counts(self) -> Counter[str]:
        """Lines by what became of them, of all sources."""
        return sum((h.counts for h in self.health.values()), Counter())

    def decode(self, data: bytes, now: float) -> list[tuple[Report, ...]]:
        """Return the reports of each line in a datagram (one or more) that arrived at `now` (s); takes navigation."""
        out: list[tuple[Report, ...]] = []
        for line in data.split(b"\n"):
            if not line or line.isspace():
                continue
            name = UNKNOWN
            try:
                m = line_of(line)
                if m.t_s is None or (m.source is None and m.platform is None):
                    raise Refused("malformed", "a line needs t_s and source, or t_s and platform")
                if m.source is not None and m.source not in self.index:
                    raise Refused("unknown_source", f"no source '{m.source[:40]}' in the site file")
                if m.source is None and (self.navigation is None or m.platform != self.navigation.name):
                    raise Refused("unknown_platform", f"no platform '{str(m.platform)[:40]}' in the site file")
                name = m.source if m.source is not None else str(m.platform)
                reports = self._reports(m, name, now)
            except Refused as error:
                self.health.setdefault(name, SourceHealth()).count(error.reason, str(error))
                continue
            self.health[name].count("navigation" if m.source is None else "accepted")
            if reports:
                out.append(reports)
        return out

    def saved(self) -> dict[str, Any]:
        """Return plain values from which `restore` goes on as if nothing had been."""
        return {name: h.saved() for name, h in self.health.items()}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Take up what `saved` gave."""
        self.health.update({name: restored(h) for name, h in saved.items()})

    def _reports(self, m: Line, name: str, now: float) -> tuple[Report, ...]:
        assert m.t_s is not None
        health = self.health[name]
        health.arrived = now
        taken = health.admit(m.t_s, now)
        if isinstance(taken, str):
            raise Refused(taken, f"t_s = {m.t_s:.3f} lies {m.t_s - now:+.3f} s from its arrival")
        if m.source is None:
            assert self.navigation is not None
            row = navigation(m, self.pointer.site)
            if not self.navigation.take(Fix(name, taken, now, row)):
                raise Refused("late_navigation", f"t_s = {m.t_s:.3f} is not later than the stamp before")
            return ()
        source = self.index[name]
        guide = self.pointer.guide.sources[source]
        found = (m,) if m.detections is None else m.detections
        if guide.kind == DIRECTION:
            return self._directions(m, found, name, source, guide, taken - m.t_s, now)
        latency = self.stands[name].latency if name in self.stands else 0.0
        z, axes = placed(m, guide, self.pointer.site)
        return (Report(source, taken - latency, now, z, self._origin[name], axes),)

    def _directions(
        self, m: Line, found: tuple[Measured, ...], name: str, source: int, guide: GuideSource, shift: float, now: float
    ) -> tuple[Report, ...]:
        assert m.t_s is not None
        face = m.azimuth_deg is None and m.face_az_deg is not None and m.face_el_deg is not None
        z = np.full((len(found), N_COMPONENTS), np.nan)
        for i, d in enumerate(found):
            az, el = (m.face_az_deg, m.face_el_deg) if face else (d.azimuth_deg, d.elevation_deg)
            seen = [math.nan if v is None else v for v in (d.range_m, az, el)]
            far, az, el = seen
            if all(map(math.isnan, seen)) or abs(az) > 360.0 or abs(el) > 90.0 or far <= 0.0 or far > 1e12:
                raise Refused("bad_value", f"azimuth {az:g}, elevation {el:g} deg, range {far:g} m cannot be")
            z[i, : Component.ELEVATION + 1] = far, az * DEG, el * DEG
        sensor = _ANTENNA if face and self.navigation is not None else self._sensor[name]
        t = np.array([m.t_s if d.t_s is None else d.t_s for d in found]) + shift
        track = None if self.navigation is None else self.navigation.track()
        own = self._face if face else None
        reports = reports_of_look(
            source, guide, sensor, track, self.pointer.site, t, now, z, {}, guide.sigma_position, own
        )
        if reports is None:
            raise Refused("no_navigation", "its platform's navigation does not reach its time")
        if sensor.axes == Axes.SITE_ENU:
            reports = tuple(r._replace(origin=self._origin[name]) for r in reports)
        return reports


def placed(m: Line, source: GuideSource, site: Site) -> tuple[FloatArray, FloatArray]:
    """Return `z` (3,) or (6,) and `axes` of a position or track (`GuideFilter.step`); raises Refused."""
    where = position(m, site)
    if where is None:
        raise Refused("bad_value", "no whole position: latitude_deg, longitude_deg, height_m, or x, y, z")
    at, R = where
    if m.covariance is None:
        if source.correlation is not None:
            raise Refused("bad_value", "a track needs its covariance")
        return at, _UNIT
    k = {6: 3, 21: 6}.get(len(m.covariance))
    v = velocity(m)
    if k is None or (k == 6 and (v is None or source.correlation is None)):
        raise Refused("bad_value", f"covariance of {len(m.covariance)} numbers: 6 of a position, 21 with a velocity")
    C, turn = np.zeros((k, k)), np.kron(np.eye(k // 3), R)
    C[np.triu_indices(k)] = m.covariance
    C += np.triu(C, 1).T
    if not (np.isfinite(C).all() and np.diag(C).min() > LEAST and np.diag(C).max() < 1e18):
        raise Refused("bad_value", "covariance with a variance that cannot be")
    try:
        axes = source.axes_of(turn @ C @ turn.T)
    except np.linalg.LinAlgError:
        raise Refused("bad_value", "covariance is not positive definite") from None
    z = at if k == 3 or v is None else np.concatenate([at, R @ v])
    if not (np.isfinite(z).all() and np.isfinite(axes).all()):
        raise Refused("bad_value", "a number that is not finite")
    return z, axes


def _place(enu: tuple[float, float, float], site: Site) -> FloatArray:
    return np.array(ecef_from_enu(float(enu[0]), float(enu[1]), float(enu[2]), site))


def _sensor(name: str, stand: Stand) -> Sensor:
    """A source as the sensor that `sensor_pose` knows."""
    platform = None if stand.axes == Axes.SITE_ENU else "platform"
    return Sensor(name, SensorKind.RADAR, platform, stand.axes, Mount(lever_arm=stand.lever_arm), latency=stand.latency)


_ANTENNA = _sensor("antenna", Stand(Axes.BODY))
