"""Tracks as JSON lines: one a track and update, and one now and then of tracks that nobody reports."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np

from boresight.engine.track import TrackOutput
from boresight.frames.local import geodetic_from_enu
from boresight.service.commands import LineOut
from boresight.tracking.output import Rows
from boresight.types import FATES, Fate, Site, TrackStatus

DEG = math.pi / 180.0
HIT = 1  # column of `Tracks.life`: when it was last reported (s)
IDS = 8  # identities told of one track, the newest first
_CODES = [FATES.index(f) for f in (Fate.UPDATED, Fate.INITIATED)]


class TrackLine(msgspec.Struct):
    """What one line says."""

    track_id: int
    t_s: float
    t_known_s: float
    status: str
    latitude_deg: float
    longitude_deg: float
    height_m: float | None
    east_m: float
    north_m: float
    up_m: float | None
    ve_m_s: float
    vn_m_s: float
    vu_m_s: float | None
    covariance: list[float]  # of the position, upper triangle, m²
    source_ids: list[str]


class TrackLines:
    """A sink that sends tracks on; `ids` gives the sources' own identities by row, and is emptied here."""

    def __init__(
        self, outs: list[LineOut], site: Site, every: float, clock: Callable[[], float], ids: dict[int, str]
    ) -> None:
        self.outs, self.site, self.every, self.clock, self.ids = outs, site, every, clock, ids
        self.ahead: list[Rows] = []
        self.sent: dict[int, tuple[float, float]] = {}  # by number: last hit told of, time of the last line (s)
        self.known: dict[int, dict[str, None]] = {}  # identities by the row that began the track
        self.lines = 0

    def take(self, output: TrackOutput) -> None:
        """Send the newest row of every track that was updated or has long been silent."""
        self._identities(output)
        if output.rows:
            self.ahead = output.rows
        now = self.clock()
        until = max(now, output.state.arrival)
        newest = max((float(t) for rows in self.ahead for t in rows.t[rows.t <= until][-1:]), default=-math.inf)
        ready = [_part(rows, rows.t == newest) for rows in self.ahead]
        self.ahead = [_part(rows, rows.t > newest) for rows in self.ahead if rows.t[-1] > newest]
        if newest == -math.inf or not self.outs:
            return
        lines = [line for rows in ready if len(rows.t) for line in self._lines(rows, output, now)]
        if lines:
            self.lines += len(lines)
            for out in self.outs:
                out.send(lines, now)

    def close(self) -> None:
        """Close all outputs."""
        for out in self.outs:
            out.close()

    def _identities(self, output: TrackOutput) -> None:
        if not self.ids:
            return
        for some in output.decisions:
            for row, fate, birth in zip(some.row.tolist(), some.fate.tolist(), some.birth.tolist(), strict=True):
                name = self.ids.pop(row, None)
                if name is not None and birth >= 0 and fate in _CODES:
                    found = self.known.setdefault(birth, {})
                    found.pop(name, None)
                    found[name] = None
                    if len(found) > IDS:
                        del found[next(iter(found))]

    def _lines(self, rows: Rows, output: TrackOutput, now: float) -> list[bytes]:
        tr = output.state.window.tracks
        n = int(tr.live[0])
        order = np.argsort(tr.birth[:n])
        if not n:
            return []
        at = np.minimum(np.searchsorted(tr.birth[:n], rows.birth, sorter=order), n - 1)
        hit = np.where(tr.birth[order[at]] == rows.birth, tr.life[order[at], HIT], -np.inf).tolist()
        d = rows.position.shape[1]
        up = rows.position[:, 2] if d == 3 else np.zeros(len(rows.t))
        latitude, longitude, height = geodetic_from_enu(rows.position[:, 0], rows.position[:, 1], up, self.site)
        upper = np.triu_indices(d)
        covariance = rows.covariance[:, upper[0], upper[1]].tolist()
        where, speed = rows.position.tolist(), rows.velocity.tolist()
        lat, lon, high = (np.asarray(latitude) / DEG).tolist(), (np.asarray(longitude) / DEG).tolist(), height.tolist()
        out = []
        for i, number in enumerate(rows.track_id.tolist()):
            last = self.sent.get(number)
            if last is not None and last[0] == hit[i] and now - last[1] < self.every:
                continue
            self.sent[number] = hit[i], now
            names = list(reversed(self.known.get(int(rows.birth[i]), {})))
            line = TrackLine(
                number, float(rows.t[i]), float(rows.t_known[i]),
                str(TrackStatus.COASTING if rows.coasting[i] else TrackStatus.CONFIRMED),
                lat[i], lon[i], high[i] if d == 3 else None, where[i][0], where[i][1], where[i][2] if d == 3 else None,
                speed[i][0], speed[i][1], speed[i][2] if d == 3 else None, covariance[i], names,
            )  # fmt: skip
            out.append(msgspec.json.encode(line) + b"\n")
        if len(self.sent) > 2 * len(rows.t) + 1000:
            self.sent = {k: v for k, v in self.sent.items() if now - v[1] < 60.0}
            alive = set(tr.birth[:n].tolist())
            self.known = {k: v for k, v in self.known.items() if k in alive}
        return out


def _part(rows: Rows, which: Any) -> Rows:
    return Rows(**{name: getattr(rows, name)[which] for name in Rows.__dataclass_fields__})
