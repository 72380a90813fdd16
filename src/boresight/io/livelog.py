"""The log of a live run: what arrived, byte for byte, with its arrival time; and what it is as a recording.

A folder: log.toml, the site file (site.toml), tracker.toml, and segments. A record is a header (length and CRC-32 of
what follows, kind, input, time of arrival) and the bytes. Whatever is cut off the end, the records before it are
whole: reading stops at the first one that is not, and says so.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import NamedTuple

import msgspec

from boresight._version import __version__
from boresight.errors import UserError
from boresight.io.arrivals import OLDEST, TOLERANCE
from boresight.io.files import read_text, reason
from boresight.io.toml import TableModel, convert, read_toml, write_toml

MARKER, SITE, SETTINGS = "log.toml", "site.toml", "tracker.toml"
SEGMENT = 64 << 20  # bytes after which a new segment begins
MAGIC = b"BSLOG\x00\x01\n"
HEADER = struct.Struct("<IIBBHd")  # length of the bytes, CRC-32 of the rest of the header and them, kind, 0, input, s
MOST_BYTES = 1 << 24  # of one record
RETRY = 1.0  # s between attempts to write after one has failed
MOST_WAITING = 16 << 20  # bytes that wait for the disk; beyond, the oldest are given up and counted


class Kind(IntEnum):
    """What a record is."""

    NOTE = 0  # text about the run itself: begun, restarted
    TAKEN = 1  # bytes that arrived and were taken
    DROPPED = 2  # bytes that arrived and were given up: more came than could be taken
    TICK = 3  # a moment at which the estimators were asked


class Record(NamedTuple):
    """One record."""

    kind: Kind
    input: int
    t: float  # s, arrival
    data: bytes
    segment: int
    end: int  # where in the segment the next record begins


class PlatformTable(TableModel, frozen=True):
    """One `[[platform]]`: the errors of its navigation (one stamp); platforms of sensors need none."""

    id: str
    sigma_position_m: float | None = None
    sigma_attitude_deg: float | None = None


class LogTable(TableModel, frozen=True):
    """log.toml: how the lines of a run become reports."""

    format: int = 1
    kind: str = "live log"
    version: str = ""
    recorded_arrivals: bool = False  # lines carry their own arrival
    oldest_s: float = OLDEST
    clock_tolerance_s: float = TOLERANCE
    platform: tuple[PlatformTable, ...] = ()


def is_log(path: Path) -> bool:
    """Return whether a folder is the log of a live run."""
    return (path / MARKER).is_file()


def is_point_log(path: Path) -> bool:
    """Return whether a log is of `boresight point`: of guide sources, not of sensors."""
    return "sensor" not in read_toml(path / SITE)


@dataclass(slots=True)
class LogWriter:
    """Appends records; nothing that the disk does is raised once it is open.

    `flush` hands what waits to the operating system, which keeps it however this process ends; `sync` waits until it
    is on the disk. What cannot be written waits, up to a limit, and is tried again every second.
    """

    folder: Path
    segment: int
    lost: int = 0  # records given up
    errors: int = 0
    error: str = ""  # what the disk said last, empty when all is well
    written: int = 0  # bytes in this segment
    _file: int = -1
    _waiting: list[bytes] = field(default_factory=list)
    _size: int = 0
    _tried: float = -float("inf")

    def append(self, kind: Kind, input_: int, t: float, data: bytes = b"") -> None:
        """Add one record."""
        rest = HEADER.pack(len(data), 0, kind, 0, input_, t)[8:] + data
        self._waiting.append(struct.pack("<II", len(data), zlib.crc32(rest)) + rest)
        self._size += len(rest) + 8
        while self._size > MOST_WAITING and len(self._waiting) > 1:
            self._size -= len(self._waiting.pop(0))
            self.lost += 1

    def flush(self, now: float) -> None:
        """Write what waits (`now` in s, of any clock)."""
        if not self._waiting or (self.error and now - self._tried < RETRY):
            return
        self._tried = now
        data = b"".join(self._waiting)
        try:
            if self._file < 0 or self.written > SEGMENT:
                self._open()
            start = self.written
            view = memoryview(data)
            while view:
                n = os.write(self._file, view)
                self.written += n
                view = view[n:]
        except OSError as error:
            self.errors += 1
            self.error = reason(error)
            if self._file >= 0:  # no half records: what was begun goes
                try:
                    os.ftruncate(self._file, start)
                    os.lseek(self._file, start, os.SEEK_SET)
                    self.written = start
                except OSError:
                    os.close(self._file)
                    self._file = -1
            return
        self.error = ""
        self._waiting.clear()
        self._size = 0

    def sync(self) -> None:
        """Wait until what was flushed is on the disk."""
        if self._file >= 0:
            try:
                os.fsync(self._file)
            except OSError as error:
                self.errors += 1
                self.error = reason(error)

    @property
    def place(self) -> tuple[int, int]:
        """Where the next record begins once all is flushed: segment, and offset in it."""
        return self.segment, self.written

    def close(self, now: float) -> None:
        """Write what waits, and close."""
        self._tried = -float("inf")
        self.flush(now)
        self.lost += len(self._waiting)
        if self._file >= 0:
            self.sync()
            os.close(self._file)
        self._file = -1

    def _open(self) -> None:
        if self._file >= 0:
            os.close(self._file)
            self._file = -1
            self.segment += 1
        path = self.folder / segment_name(self.segment)
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        self.written = 0
        self.written += os.write(self._file, MAGIC)


def segment_name(number: int) -> str:
    """Return the file name of a segment."""
    return f"{number:08d}.bslog"


def segments_of(folder: Path) -> list[int]:
    """Return the numbers of the segments that are there, in order."""
    return sorted(int(p.stem) for p in folder.glob("*.bslog") if p.stem.isdigit())


def create_log(folder: Path, site: str, settings: str, about: LogTable) -> LogWriter:
    """Make a log folder with the texts that a replay needs; raises UserError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / SITE).write_text(site, encoding="utf-8")
        (folder / SETTINGS).write_text(settings if settings.strip() else "[tracker]\n", encoding="utf-8")
        told = msgspec.to_builtins(about) | {"format": about.format, "kind": about.kind, "version": __version__}
        told["platform"] = [{k: v for k, v in p.items() if v is not None} for p in told.get("platform", [])]
        (folder / MARKER).write_text(write_toml({k: v for k, v in told.items() if v != []}), encoding="utf-8")
    except OSError as error:
        raise UserError(f"{folder}: the log cannot be made ({reason(error)})") from None
    return LogWriter(folder, 1)


def resume_log(folder: Path) -> LogWriter:
    """Return a writer that goes on behind what is there, in a segment of its own."""
    return LogWriter(folder, max(segments_of(folder), default=0) + 1)


def read_about(folder: Path) -> LogTable:
    """Read log.toml; raises UserError."""
    about = convert(read_toml(folder / MARKER), LogTable, str(folder / MARKER))
    if about.format != 1:
        raise UserError(f"{folder / MARKER}: format = {about.format}; this version reads format = 1")
    return about


@dataclass(slots=True)
class LogReader:
    """The records of a log, from `begin` (segment, offset) on; `damage` says in words what could not be read."""

    folder: Path
    begin: tuple[int, int] = (0, 0)
    damage: list[str] = field(default_factory=list)
    records: int = 0

    def __iter__(self) -> Iterator[Record]:
        for number in segments_of(self.folder):
            if number < self.begin[0]:
                continue
            yield from self._segment(number, self.begin[1] if number == self.begin[0] else 0)

    def _segment(self, number: int, offset: int) -> Iterator[Record]:
        path = self.folder / segment_name(number)
        at = max(offset, len(MAGIC))
        try:
            size = path.stat().st_size
            with path.open("rb") as file:
                if file.read(len(MAGIC)) != MAGIC:
                    if size:
                        self.damage.append(f"{path.name}: not a segment of a log, or cut at its beginning")
                    return
                file.seek(at)
                while True:
                    head = file.read(HEADER.size)
                    if not head:
                        return
                    record = self._record(file.read, head, number, at)
                    if record is None:
                        break
                    at = record.end
                    self.records += 1
                    yield record
        except OSError as error:
            self.damage.append(f"{path.name}: cannot be read ({reason(error)})")
            return
        self.damage.append(f"{path.name}: cut or damaged at byte {at} of {size}; what follows there is lost")

    def _record(self, read: object, head: bytes, number: int, at: int) -> Record | None:
        if len(head) < HEADER.size:
            return None
        length, crc, kind, _, input_, t = HEADER.unpack(head)
        if length > MOST_BYTES or kind > max(Kind):
            return None
        data = read(length)  # type: ignore[operator]
        if len(data) < length or zlib.crc32(head[8:] + data) != crc:
            return None
        return Record(Kind(kind), input_, t, data, number, at + HEADER.size + length)


def site_text(folder: Path) -> str:
    """Return the site file that a log keeps; raises UserError."""
    return read_text(folder / SITE)
