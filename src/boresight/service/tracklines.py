"""Tracks as JSON lines: one a track and update, and one now and then of tracks that nobody reports."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from boresight.engine.track import TrackOutput
from boresight.frames.local import geodetic_from_enu
from boresight.service.commands import LineOut
from boresight.tracking.output import Rows
from boresight.types import FATES, Fate, FloatArray, Site, TrackStatus

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
        self.sent = Sent()
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
        """Return the lines of rows of one time, each of another track."""
        tr = output.state.window.tracks
        n = int(tr.live[0])
        if not n:
            return []
        order = np.argsort(tr.birth[:n])
        at = np.minimum(np.searchsorted(tr.birth[:n], rows.birth, sorter=order), n - 1)
        hit = np.where(tr.birth[order[at]] == rows.birth, tr.life[order[at], HIT], -np.inf)
        told, when = self.sent.of(rows.track_id)
        rows = _part(rows, which := (told != hit) | (now - when >= self.every))
        if not len(rows.t):
            return []
        self.sent.put(rows.track_id, hit[which], now)
        if len(self.known) > 2 * n + 1000:
            alive = set(tr.birth[:n].tolist())
            self.known = {k: v for k, v in self.known.items() if k in alive}
        d = rows.position.shape[1]
        up = rows.position[:, 2] if d == 3 else np.zeros(len(rows.t))
        latitude, longitude, height = geodetic_from_enu(rows.position[:, 0], rows.position[:, 1], up, self.site)
        upper = np.triu_indices(d)
        covariance = rows.covariance[:, upper[0], upper[1]].tolist()
        nothing = [None] * len(rows.t)
        places = [*rows.position.T.tolist(), nothing][:3]
        speeds = [*rows.velocity.T.tolist(), nothing][:3]
        columns = zip(
            rows.track_id.tolist(), rows.t.tolist(), rows.t_known.tolist(), rows.coasting.tolist(),
            (np.asarray(latitude) / DEG).tolist(), (np.asarray(longitude) / DEG).tolist(),
            np.asarray(height).tolist() if d == 3 else nothing, *places, *speeds, covariance, rows.birth.tolist(),
            strict=True,
        )  # fmt: skip
        encode, words = msgspec.json.Encoder().encode, (str(TrackStatus.CONFIRMED), str(TrackStatus.COASTING))
        line: Any = TrackLine
        out = []
        for number, t, t_known, coasts, *numbers, birth in columns:
            names = list(reversed(self.known[birth])) if birth in self.known else []
            out.append(encode(line(number, t, t_known, words[coasts], *numbers, names)) + b"\n")
        return out


class Sent:
    """What was told last of each track, by its number: its last report (s), and when (s)."""

    def __init__(self) -> None:
        self.number = np.zeros(0, np.int64)  # ascending
        self.hit = np.zeros(0)
        self.time = np.zeros(0)

    def of(self, number: NDArray[np.int64]) -> tuple[FloatArray, FloatArray]:
        """Return both for tracks (n,), NaN and -inf where nothing was told."""
        if not len(self.number):
            return np.full(len(number), np.nan), np.full(len(number), -np.inf)
        at = np.minimum(np.searchsorted(self.number, number), len(self.number) - 1)
        known = self.number[at] == number
        return np.where(known, self.hit[at], np.nan), np.where(known, self.time[at], -np.inf)

    def put(self, number: NDArray[np.int64], hit: FloatArray, now: float) -> None:
        """Note what is told of tracks (n,) at `now` (s); what is a minute old goes."""
        kept = ~np.isin(self.number, number) & (self.time > now - 60.0)
        everything = np.concatenate([self.number[kept], number])
        order = np.argsort(everything, kind="stable")
        self.number = everything[order]
        self.hit = np.concatenate([self.hit[kept], hit])[order]
        self.time = np.concatenate([self.time[kept], np.full(len(number), now)])[order]


def _part(rows: Rows, which: Any) -> Rows:
    return Rows(**{name: getattr(rows, name)[which] for name in Rows.__dataclass_fields__})
