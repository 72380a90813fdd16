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
from boresight.kernels.geodesy import ecef_from_geodetic
from boresight.kernels.guide import DIRECTION
from boresight.pointing.pointer import Pointer
from boresight.types import Site
from boresight.types.sensor import FloatArray

LONGEST = 2048  # bytes of one line; longer ones are counted and left out
PER_READ = 1000  # datagrams or lines taken at once; what is lost beyond it is counted
LINES = 64  # in one datagram
AHEAD = 5.0  # s that a stamp may lie in the future
BEHIND = 30.0  # s that it may lie in the past
DEG = math.pi / 180.0
_POLE = {Pole.IN_FACE: np.eye(3), Pole.ON_NORMAL: np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])}


class Report(NamedTuple):
    """One report as `Pointer.take` wants it."""

    source: int
    t: float  # s
    z: FloatArray  # (3,)
    origin: FloatArray  # (3,) ECEF m
    axes: FloatArray  # (3, 3)


class Line(msgspec.Struct, frozen=True):
    """What a line may hold; the rest of it is ignored."""

    source: str
    t_s: float
    azimuth_deg: float | None = None
    elevation_deg: float | None = None
    range_m: float | None = None
    face_az_deg: float | None = None
    face_el_deg: float | None = None
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    height_m: float | None = None
    x_m: float | None = None
    y_m: float | None = None
    z_m: float | None = None


_DECODER = msgspec.json.Decoder(Line)


@dataclass(slots=True)
class Feed:
    """Parses lines for the sources of a pointer; `offsets` (ECEF m) say where each stands. Counts what came of them."""

    pointer: Pointer
    offsets: Mapping[str, FloatArray]
    counts: Counter[str] = field(default_factory=Counter)
    index: dict[str, int] = field(init=False)
    _enu: FloatArray = field(init=False)
    _face: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        self.index = {s.id: i for i, s in enumerate(self.pointer.guide.sources)}
        self._enu = ecef_from_enu_rotation(self.pointer.site)
        self._face = np.ascontiguousarray(self._enu @ enu_from_face(*self.pointer.face) @ _POLE[self.pointer.pole])

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
        source = self.index.get(m.source)
        if source is None:
            return "unknown_source"
        if not now - BEHIND <= m.t_s <= now + AHEAD:
            return "bad_time"
        z, axes = self._value(m, self.pointer.guide.sources[source].kind)
        if z is None or not np.isfinite(z[:2]).all() or math.isinf(z[2]):
            return "bad_value"
        return Report(source, m.t_s, z, self.offsets[m.source], axes)

    def _value(self, m: Line, kind: int) -> tuple[FloatArray | None, FloatArray]:
        if kind == DIRECTION:
            far = math.nan if m.range_m is None else m.range_m
            for az, el, axes in (
                (m.azimuth_deg, m.elevation_deg, self._enu),
                (m.face_az_deg, m.face_el_deg, self._face),
            ):
                if az is not None and el is not None:
                    ok = abs(az) <= 720.0 and abs(el) <= 90.0 and not far <= 0.0 and not far > 1e12
                    return (np.array([az * DEG, el * DEG, far]) if ok else None), axes
            return None, self._enu
        if m.latitude_deg is not None and m.longitude_deg is not None and m.height_m is not None:
            ok = abs(m.latitude_deg) <= 90.0 and abs(m.longitude_deg) <= 720.0 and -1e5 <= m.height_m <= 1e9
            z = ecef_from_geodetic(m.latitude_deg * DEG, m.longitude_deg * DEG, m.height_m) if ok else (math.nan,) * 3
            return (np.array(z) if ok else None), self._enu
        if m.x_m is not None and m.y_m is not None and m.z_m is not None:
            z = (m.x_m, m.y_m, m.z_m)
            ok = 1e5 < math.hypot(*z) < 1e12
            return (np.array(z) if ok else None), self._enu
        return None, self._enu


def origins(site: Site, offsets: Mapping[str, tuple[float, float, float]]) -> dict[str, FloatArray]:
    """Return each source's place (3,) in ECEF, of its offset (east, north, up m) from the site."""
    return {name: np.array(ecef_from_enu(float(o[0]), float(o[1]), float(o[2]), site)) for name, o in offsets.items()}
