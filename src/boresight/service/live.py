"""`boresight point`, live: reports of all inputs in, a command at every tick out; and the same from its log."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from boresight.config.site import Station
from boresight.engine.guide import GuideOutput, Guiding
from boresight.engine.loop import run
from boresight.errors import UserError
from boresight.io.livelog import LogReader, LogWriter
from boresight.kernels.guide import DIRECTION
from boresight.pointing.pointer import Pointer, PointerState, Pointing
from boresight.service.clock import Clock
from boresight.service.commands import Commands, status_line
from boresight.service.elements import Elements
from boresight.service.feed import Feed, Stand
from boresight.service.navigation import Navigation
from boresight.service.sockets import Input, Serial, Tcp, Udp
from boresight.service.source import LiveSource, LogSource
from boresight.types import Axes

SHOW = 0.1  # s between status lines


@dataclass(frozen=True, slots=True)
class Chain:
    """What a site file makes of lines: the decoder and the estimator, with the navigation that both use."""

    feed: Feed
    guiding: Guiding
    carrier: Navigation | None
    elements: Elements


def chain_for(station: Station, pointer: Pointer) -> Chain:
    """Return the decoder and estimator of a station, before the first line."""
    file = station.file
    stands = {s.id: Stand(Axes(s.axes), s.offset_enu_m, s.lever_arm_frd_m, s.latency_s) for s in file.source}
    carrier = None if file.platform is None else Navigation(file.platform, pointer, file.attitude_coast_s)
    elements = Elements(pointer, station.elements, {s.id: s.max_age_days for s in file.source})
    place = None if carrier is None else carrier.place
    guiding = Guiding(pointer, file.beam.rate_hz, place, elements.report)
    return Chain(Feed(pointer, stands, carrier), guiding, carrier, elements)


def run_live(
    station: Station,
    pointer: Pointer,
    duration: float | None,
    status: TextIO | None,
    clock: Callable[[], float] | None = None,
    stop: Callable[[], bool] = lambda: False,
    log: LogWriter | None = None,
    ready: Callable[[list[Input]], None] = lambda _: None,
) -> dict[str, Any]:
    """Point until `duration` (s) has passed, `stop` says so or the user interrupts; returns the counts.

    `ready` is called with the inputs once kernels are loaded and sockets are open. Raises UserError if the site file
    names no input, or one that cannot be opened.
    """
    clock = clock if clock is not None else Clock()
    inputs = inputs_of(station)
    chain = chain_for(station, pointer)
    if not inputs and not chain.elements.usable(clock()):
        raise UserError(f"no [input], and no elements to guide: {chain.elements.told(clock())}: see max_age_days")
    commands = Commands(station.file.output, station.mount, pointer, clock, chain.carrier)
    watch = _Watch(chain, commands, clock, status)
    source = LiveSource(
        inputs, [chain.feed] * len(inputs), clock, station.file.beam.rate_hz, log, duration=duration, stop=stop,
        housekeeping=watch.show,
    )  # fmt: skip
    watch.source = source
    warm(pointer)
    ready(inputs)
    busy = time.process_time()
    try:
        run(source, chain.guiding, [watch])
    except KeyboardInterrupt:
        pass
    finally:
        lost = source.lost()
        for one in inputs:
            one.close()
        commands.close()
        if log is not None:
            log.close(clock())
        if status is not None:
            status.write("\n")
    wall = max(clock() - source.begun, 1e-9)
    return {
        **watch.counts(),
        "core_share": (time.process_time() - busy) / wall,
        **chain.feed.counts,
        **chain.elements.counts,
        "elements": dict(chain.elements.faults),
        "overflow": sum(sum(one.values()) for one in lost.values()),
        "lost": lost,
        "sources": {name: h.words() for name, h in chain.feed.health.items() if h.words()},
        **({"log_lost_records": log.lost, "log_errors": log.errors} if log is not None else {}),
    }


def replay_log(station: Station, pointer: Pointer, reader: LogReader) -> Iterator[tuple[Pointing, PointerState]]:
    """Yield every command of a live run, from its log: the same bits."""
    chain = chain_for(station, pointer)
    source = LogSource(reader, [chain.feed] * 64)
    state = chain.guiding.init()
    for items in source:
        state, out = chain.guiding.step(state, items)
        for pointing in out.pointings:
            yield pointing, out.state


class _Watch:
    """A sink that sends commands on and notes how long they took after what they answer."""

    def __init__(self, chain: Chain, commands: Commands, clock: Callable[[], float], status: TextIO | None) -> None:
        self.chain, self.commands, self.clock, self.status = chain, commands, clock, status
        self.source: LiveSource | None = None
        self.waits = math.nan  # s, arrival of the oldest report that no command has answered
        self.longest = self.total = 0.0
        self.answers, self.shown = 0, -math.inf

    def take(self, output: GuideOutput) -> None:
        """Send the commands of one step."""
        if math.isnan(self.waits) and self.source is not None:
            self.waits = self.source.arrived
        first = self.commands.ticks == 0
        self.commands.take(output)
        if output.pointings:
            if not math.isnan(self.waits) and not first:
                took = self.clock() - self.waits
                self.longest, self.total, self.answers = max(self.longest, took), self.total + took, self.answers + 1
            self.waits = math.nan

    def show(self, now: float) -> None:
        """Write the status line, ten times a second at most; say when the wall clock has stepped."""
        words = self.clock.stepped() if isinstance(self.clock, Clock) else ""
        if self.status is None:
            return
        if words:
            self.status.write(f"\nboresight: {words}\n")
        last, state = self.commands.last, self.commands.state
        if last is None or state is None or now < self.shown + SHOW:
            return
        self.shown = now
        line = status_line(self.chain.guiding.pointer, state, last, self.commands.rotator, self.chain.carrier)
        clocks = "  ".join(f"{name}: {h.words()}" for name, h in self.chain.feed.health.items() if h.words())
        failing = "  ".join(f"{out.name}: {out.error}" for out in self.commands.outs if out.error)
        self.status.write("\r" + "  ".join(filter(None, (line, clocks, self.chain.elements.told(now), failing))))
        self.status.flush()

    def counts(self) -> dict[str, Any]:
        """Return ticks, latencies (s) and what the outputs did."""
        found = self.commands.counts()
        return {**found, "latency_mean_s": self.total / max(self.answers, 1), "latency_max_s": self.longest}


def inputs_of(station: Station) -> list[Input]:
    """Return the inputs of a site file, open; raises UserError."""
    wanted = station.file.input
    inputs: list[Input] = []
    if wanted.udp:
        inputs.append(Udp(wanted.udp))
    if wanted.tcp:
        inputs.append(Tcp(wanted.tcp))
    if wanted.serial:
        inputs.append(Serial(wanted.serial, wanted.baud))
    if not inputs and not station.elements:
        raise UserError("the site file has no [input]: give udp, tcp or serial, or use --replay")
    return inputs


def warm(pointer: Pointer) -> None:
    """Load (or compile) the kernels before the first report, on a filter that is thrown away."""
    scratch = pointer.init()
    here = np.array([7e6, 0.0, 0.0])
    for source, s in enumerate(pointer.guide.sources):
        z = np.array([0.1, 0.2, 1e5]) if s.kind == DIRECTION else here
        pointer.take(scratch, source, 0.0, z, 0.9 * here, np.eye(3))
        pointer.tick(scratch, 0.5)


def log_of(folder: Path) -> LogReader:
    """Return the reader of a log."""
    return LogReader(folder)
