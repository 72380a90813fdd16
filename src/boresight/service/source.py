"""The live source: what arrives on all inputs, logged and decoded, in portions with a tick at the end of each.

One thread does all. Sockets are emptied at every turn into a queue that is bounded in lines, bytes and waiting time;
what is beyond goes, the oldest first, and is counted in lines and logged as dropped. So a flood costs data, never
memory and never the time of commands.
"""

from __future__ import annotations

import math
import selectors
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from boresight.engine.loop import Item, Tick
from boresight.io.livelog import Kind, LogReader, LogWriter
from boresight.service.sockets import Input, lines_in

POLL = 0.005  # s between looks at inputs that cannot be waited for
GATHER = 0.002  # s for which what arrives is gathered into one step
MOST_LINES, MOST_BYTES = 50_000, 64 << 20  # that wait
MOST_WAIT = 1.0  # s that raw data may wait
PER_STEP, STEP_BYTES = 400, 1 << 17  # lines, bytes taken in one step: so long are sockets and ticks left alone
IDLE = 0.5  # s without anything after which there is a tick all the same


class Decoder(Protocol):
    """Turns bytes into items; keeps its own state and counts."""

    def decode(self, data: bytes, now: float) -> Sequence[Item]:
        """Return the items in bytes that arrived at `now` (s)."""
        ...


@dataclass(slots=True)
class Waiting:
    """Raw data in order of arrival, bounded."""

    most_lines: int = MOST_LINES
    most_bytes: int = MOST_BYTES
    most_wait: float = MOST_WAIT
    data: deque[tuple[int, float, bytes, int]] = field(default_factory=deque)  # input, arrival, bytes, lines
    lines: int = 0
    size: int = 0  # bytes

    def add(self, source: int, t: float, data: bytes) -> None:
        """Put bytes behind what waits."""
        n = lines_in(data)
        self.data.append((source, t, data, n))
        self.lines += n
        self.size += len(data)

    def beyond(self, now: float) -> list[tuple[int, float, bytes, int]]:
        """Take out what is beyond the limits, the oldest first."""
        out = []
        while self.data and (
            self.lines > self.most_lines or self.size > self.most_bytes or now - self.data[0][1] > self.most_wait
        ):
            out.append(self.take())
        return out

    def take(self) -> tuple[int, float, bytes, int]:
        """Take out the oldest."""
        one = self.data.popleft()
        self.lines -= one[3]
        self.size -= len(one[2])
        return one


@dataclass(slots=True)
class LiveSource:
    """Items of all inputs until `stop` says so or `duration` (s) has passed.

    `decoders` are by input. `rate` (Hz) asks for ticks (0: only after what has arrived, and when all is quiet).
    `recorded` gives the newest arrival that lines name themselves: then ticks go by that.
    """

    inputs: Sequence[Input]
    decoders: Sequence[Decoder]
    clock: Callable[[], float]
    rate: float = 0.0
    log: LogWriter | None = None
    flush: float = 0.2  # s between writes of the log
    duration: float | None = None
    stop: Callable[[], bool] = lambda: False
    recorded: Callable[[], float] | None = None
    housekeeping: Callable[[float], None] | None = None  # called every turn
    waiting: Waiting = field(default_factory=Waiting)
    dropped: Counter[str] = field(default_factory=Counter)  # lines, by input
    arrived: float = math.nan  # s, the arrival of the oldest data in the portion given last; NaN if there was none
    behind: bool = False  # whether the last portion left data waiting
    begun: float = math.nan

    def __iter__(self) -> Iterator[Sequence[Item]]:
        selector = selectors.DefaultSelector()
        asked = [i for i, source in enumerate(self.inputs) if not source.attach(selector)]
        number = {id(source): i for i, source in enumerate(self.inputs)}
        self.begun = begun = self.clock()
        tick = begun
        flushed = -math.inf
        quiet = begun
        try:
            while not self.stop():
                now = self.clock()
                if self.duration is not None and now - begun >= self.duration:
                    break
                wake = tick if self.rate else quiet + IDLE
                if not self.waiting.data:
                    self._wait(selector, number, asked, wake)
                else:
                    self._read(selector.select(0.0), number, asked)
                now = self.clock()
                for source, t, data, n in self.waiting.beyond(now):
                    self.dropped[self.inputs[source].name] += n
                    if self.log is not None:
                        self.log.append(Kind.DROPPED, source, t, data)
                items = self._taken()
                due = now >= tick if self.rate else now >= quiet + IDLE
                if items or due or not math.isnan(self.arrived):
                    at = now if self.recorded is None else self.recorded()
                    if math.isfinite(at):
                        items.append(Tick(at))
                        if self.log is not None:
                            self.log.append(Kind.TICK, 0, at)
                    quiet = now
                if self.rate and due:
                    tick = tick + 1.0 / self.rate if tick + 1.0 / self.rate > now else now + 1.0 / self.rate
                if self.log is not None and now - flushed >= self.flush:
                    flushed = now
                    self.log.flush(now)
                if items:
                    yield items
                if self.housekeeping is not None:
                    self.housekeeping(now)
            while self.waiting.data:  # what had arrived when it was stopped is taken
                items = self._taken()
                at = self.clock() if self.recorded is None else self.recorded()
                if math.isfinite(at):
                    items.append(Tick(at))
                    if self.log is not None:
                        self.log.append(Kind.TICK, 0, at)
                yield items
        finally:
            selector.close()

    def lost(self) -> dict[str, dict[str, int]]:
        """Return what was lost, by input and reason, in lines."""
        out = {}
        for source in self.inputs:
            found = dict(source.lost())
            if self.dropped[source.name]:
                found["overload"] = self.dropped[source.name]
            if found:
                out[source.name] = found
        return out

    def _wait(self, selector: selectors.BaseSelector, number: dict[int, int], asked: list[int], wake: float) -> None:
        """Sleep until something arrives or it is `wake` (s); what comes in the same moment is gathered with it."""
        longest = max(wake - self.clock(), 0.0)
        if asked:
            longest = min(longest, POLL)
        ready = selector.select(min(longest, IDLE))
        if not ready and not asked:
            return
        self._read(ready, number, asked)
        if self.waiting.data and wake - self.clock() > GATHER:
            time.sleep(GATHER)
            self._read(selector.select(0.0), number, asked)

    def _read(self, ready: list[Any], number: dict[int, int], asked: list[int]) -> None:
        files: dict[int, list[Any]] = {i: [] for i in asked}
        for key, _ in ready:
            files.setdefault(number[id(key.data)], []).append(key.fileobj)
        for i, some in files.items():
            for data in self.inputs[i].read(some):
                self.waiting.add(i, self.clock(), data)

    def _taken(self) -> list[Item]:
        """Decode the oldest of what waits, up to so many lines, and log it as taken."""
        out: list[Item] = []
        self.arrived = self.waiting.data[0][1] if self.waiting.data else math.nan
        lines = size = 0
        while self.waiting.data and lines < PER_STEP and size < STEP_BYTES:
            source, t, data, n = self.waiting.take()
            lines, size = lines + n, size + len(data)
            if self.log is not None:
                self.log.append(Kind.TAKEN, source, t, data)
            out += self.decoders[source].decode(data, t)
        self.behind = bool(self.waiting.data)
        return out


@dataclass(slots=True)
class LogSource:
    """The items of a log, as they were given when it was written."""

    reader: LogReader
    decoders: Sequence[Decoder]
    end: tuple[int, int] = (0, 0)
    last: float = -math.inf  # s, the newest arrival or tick

    def __iter__(self) -> Iterator[Sequence[Item]]:
        some: list[Item] = []
        for record in self.reader:
            self.end = record.segment, record.end
            if record.kind == Kind.NOTE or record.kind == Kind.DROPPED:
                continue
            self.last = max(self.last, record.t)
            if record.kind == Kind.TICK:
                yield [*some, Tick(record.t)]
                some = []
            elif record.input < len(self.decoders):
                some += self.decoders[record.input].decode(record.data, record.t)
        if some:
            yield some
