"""Bytes from outside to reports: JSON lines, each checked, everything wrong counted and nothing raised."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import msgspec
import numpy as np

from boresight.frames.array_face import Pole, enu_from_face
from boresight.frames.local import ecef_from_enu, ecef_from_enu_rotation
from boresight.frames.pose import sensor_pose
from boresight.kernels.guide import DIRECTION
from boresight.pointing.pointer import Pointer
from boresight.service.lines import DEG, Line, navigation, placed
from boresight.service.navigation import Navigation
from boresight.types import Axes, Mount, Sensor, SensorKind, Site
from boresight.types.sensor import FloatArray

LONGEST = 2048  # bytes of one line; longer ones are counted and left out
PER_READ = 1000  # datagrams or lines taken at once; what is lost beyond it is counted
LINES = 64  # in one datagram
AHEAD = 5.0  # s that a stamp may lie in the future
BEHIND = 30.0  # s that it may lie in the past
_POLE = {Pole.IN_FACE: np.eye(3), Pole.ON_NORMAL: np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])}
_NO_TURN: FloatArray = np.eye(3)
_DECODER = msgspec.json.Decoder(Line)


class Report(NamedTuple):
    """One report as `Pointer.take` wants it."""

    source: int
    t: float  # s
    z: FloatArray  # (3,), or (6,) of a track with velocity
    origin: FloatArray  # (3,) ECEF m
    axes: FloatArray  # (3, 3) or (6, 6)


class Stand(NamedTuple):
    """Where a source of directions stands, and what its azimuth and elevation count from."""

    axes: Axes = Axes.SITE_ENU
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m: east, north, up of the site
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m: forward, right, down on the platform


@dataclass(slots=True)
class Feed:
    """Parses lines for the sources of a pointer; `stands` says where each stands. Counts what came of them.

    `navigation` is that of the platform that carries the antenna, if it moves: lines with its name go there, and
    angles of the face, and of sources on the platform, are turned by the platform's attitude at their time.
    """

    pointer: Pointer
    stands: Mapping[str, Stand]
    navigation: Navigation | None = None
    counts: Counter[str] = field(default_factory=Counter)
    index: dict[str, int] = field(init=False)
    _origin: dict[str, FloatArray] = field(init=False)
    _enu: FloatArray = field(init=False)
    _face: FloatArray = field(init=False)
    _on_board: dict[str, Sensor] = field(init=False)

    def __post_init__(self) -> None:
        site, p = self.pointer.site, self.pointer
        self.index = {s.id: i for i, s in enumerate(p.guide.sources)}
        self._origin = {name: _place(s.offset, site) for name, s in self.stands.items()}
        self._enu = ecef_from_enu_rotation(site)
        self._face = np.ascontiguousarray(enu_from_face(*p.face) @ _POLE[p.pole])
        self._on_board = {name: _sensor(name, s.axes, s.lever_arm) for name, s in self.stands.items()}

    def parse(self, data: bytes, now: float) -> list[Report]:
        """Return the reports in a datagram (one or more lines) that arrived at `now` (s)."""
        out = []
        lines = data.split(b"\n", LINES)
        if len(lines) > LINES and lines[LINES].strip():
            self.counts["overflow"] += 1 + lines[LINES].rstrip().count(b"\n")
        for line in lines[:LINES]:
            if not line.strip():
                continue
            report = self._line(line, now)
            if isinstance(report, str):
                self.counts[report] += 1
            else:
                self.counts["accepted"] += 1
                out.append(report)
        return out

    def _line(self, line: bytes, now: float) -> Report | str:
        if len(line) > LONGEST:
            return "oversized"
        try:
            m = _DECODER.decode(line)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            return "malformed"
        if m.source is None and m.platform is None:
            return "malformed"
        if not now - BEHIND <= m.t_s <= now + AHEAD:
            return "bad_time" if m.source is None or m.source in self.index else "unknown_source"
        if m.source is None:
            return self._navigation(m)
        source = self.index.get(m.source)
        if source is None:
            return "unknown_source"
        one = self.pointer.guide.sources[source]
        if one.kind == DIRECTION:
            return self._direction(m, m.source, source)
        value = placed(m, one, self.pointer.site)
        return "bad_value" if value is None else Report(source, m.t_s, value[0], self._origin[m.source], value[1])

    def _navigation(self, m: Line) -> str:
        if self.navigation is None or m.platform != self.navigation.name:
            return "unknown_platform"
        row = navigation(m, self.pointer.site)
        if row is None:
            return "bad_value"
        return "navigation" if self.navigation.take(m.t_s, row) else "late_navigation"

    def _direction(self, m: Line, name: str, source: int) -> Report | str:
        far = math.nan if m.range_m is None else m.range_m
        if m.azimuth_deg is not None and m.elevation_deg is not None:
            az, el, sensor, own = m.azimuth_deg, m.elevation_deg, self._on_board[name], _NO_TURN
        elif m.face_az_deg is not None and m.face_el_deg is not None:
            az, el, own = m.face_az_deg, m.face_el_deg, self._face
            sensor = self._on_board[name] if self.navigation is None else _ANTENNA
        else:
            return "bad_value"
        if not (abs(az) <= 720.0 and abs(el) <= 90.0 and not far <= 0.0 and not far > 1e12):
            return "bad_value"
        z = np.array([az * DEG, el * DEG, far])
        if sensor.axes == Axes.SITE_ENU:
            return Report(source, m.t_s, z, self._origin[name], self._enu @ own)
        known = None if self.navigation is None else self.navigation.track()
        needs = sensor.axes != Axes.PLATFORM_ENU or any(sensor.mount.lever_arm)
        if known is None or (needs and not known.has_attitude) or not known.usable(m.t_s, attitude=needs).all():
            return "no_navigation"
        origin, _, turn = sensor_pose(sensor, known, [m.t_s])
        e, n, u = (float(v) for v in origin[0])
        return Report(source, m.t_s, z, _place((e, n, u), self.pointer.site), self._enu @ turn[0] @ own)


def _place(enu: tuple[float, float, float], site: Site) -> FloatArray:
    return np.array(ecef_from_enu(float(enu[0]), float(enu[1]), float(enu[2]), site))


def _sensor(name: str, axes: Axes, arm: tuple[float, float, float]) -> Sensor:
    """A source as the sensor that `sensor_pose` knows."""
    platform = None if axes == Axes.SITE_ENU else "platform"
    return Sensor(name, SensorKind.RADAR, platform, axes, Mount(lever_arm=arm))


_ANTENNA = _sensor("antenna", Axes.BODY, (0.0, 0.0, 0.0))
