"""`boresight serve`: sensors' reports of all inputs in, tracks (and pointing commands) out; logged, restarted, told."""

from __future__ import annotations

import contextlib
import math
import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TextIO

import msgspec
import numpy as np

from boresight.config.serve import InputTable, Service
from boresight.config.stages import make_pipeline
from boresight.engine.chain import Chain, ChainOutput, ChainState
from boresight.engine.guide import Guiding
from boresight.engine.loop import run
from boresight.engine.track import Tracking, TrackOutput, TrackState
from boresight.errors import UserError
from boresight.frames.local import enu_from_geodetic, geodetic_from_enu
from boresight.io.jsonlines import KEPT_ROWS, NOTHING, UNKNOWN, Fix, LookDecoder, line_of, navigation
from boresight.io.livelog import Kind, LogReader, LogWriter
from boresight.io.logged import decoder_of, sigmas_of
from boresight.service.clock import Clock
from boresight.service.commands import Commands, LineOut, outputs
from boresight.service.platforms import LivePoses
from boresight.service.restart import StateFile, load_state
from boresight.service.results import ResultFiles
from boresight.service.sockets import Broadcast, Input, Serial, Tcp, Udp, UdpOut
from boresight.service.source import LiveSource, LogSource, Waiting
from boresight.service.tracklines import TrackLines
from boresight.tracking.tracker import Tracker, TrackerState
from boresight.tracking.warm import warm_tracker
from boresight.types import FATES, Detections, Fate, Recording, Scan

TELL = 1.0  # s between status lines on a terminal
TELL_QUIETLY = 10.0  # s between them elsewhere
NOT_LEFT = (Fate.UPDATED, Fate.INITIATED, Fate.NO_DETECTION)
USED = [FATES.index(f) for f in (Fate.UPDATED, Fate.INITIATED)]


@dataclass(frozen=True, slots=True, eq=False)
class Parts:
    """What a site file makes: the decoder of lines, live navigation, and the estimators."""

    service: Service
    decoder: LookDecoder
    poses: LivePoses
    tracking: Tracking
    chain: Chain | None

    @property
    def tracker(self) -> Tracker:
        """The tracker."""
        return self.tracking.tracker


def parts_of(service: Service) -> Parts:
    """Build a service, its kernels not loaded yet; raises UserError for stages that do not fit."""
    d = service.declaration
    decoder = decoder_of(d, service.logged)
    poses = LivePoses(d.site, 0.0, sigmas_of(service.logged))
    tracker = Tracker(service.config, d.sensors, d.dimensions, poses, site_height=d.site.height)
    poses.kept = service.logged.oldest_s + tracker.length + 15.0
    empty = np.zeros(0)
    nothing = Detections(
        empty, empty, np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 7)), np.zeros((0, 7)), {}
    )
    recording = Recording(d.name, d.dimensions, d.site, d.sensors, nothing)
    pipeline = make_pipeline(service.stages, recording, poses, tracker.used, "[tracker]")
    tracking = Tracking(tracker, pipeline, poses)
    chain = None
    if service.pointing is not None:
        p = service.pointing
        chain = Chain(tracking, Guiding(p.pointer, p.rate), p.follow, p.sigma_up)
    return Parts(service, decoder, poses, tracking, chain)


@dataclass(slots=True)
class Serving:
    """A live run."""

    parts: Parts
    clock: Callable[[], float]
    log: LogWriter | None
    outs: list[LineOut]
    results: ResultFiles | None
    commands: Commands | None
    status: TextIO | None
    restarted: str = ""
    source: LiveSource = field(init=False)
    lines: TrackLines = field(init=False)
    stats: Stats = field(init=False)
    saver: StateFile | None = field(init=False)
    state: TrackState | None = field(init=False, default=None)
    duplicates: list[int] = field(default_factory=list)
    first_row: int = 0
    _saved: float = -math.inf
    _synced: float = -math.inf
    _told: float = -math.inf

    def __post_init__(self) -> None:
        p, decoder = self.parts, self.parts.decoder
        now = (lambda: decoder.arrival) if p.service.recorded else self.clock
        self.lines = TrackLines(self.outs, p.service.declaration.site, p.service.file.output.every_s, now, decoder.ids)
        self.stats = Stats(p)
        self.saver = None if self.log is None else StateFile(self.log.folder)

    def take(self, output: TrackOutput | ChainOutput) -> None:
        """Give one step's output to everything that wants it."""
        tracks = output.track if isinstance(output, ChainOutput) else output
        self.duplicates += [row for row, _ in self.parts.decoder.duplicates]
        self.parts.decoder.duplicates.clear()
        if self.results is not None:
            self.results.take(tracks)
        self.lines.take(tracks)
        self.stats.take(tracks)
        if isinstance(output, ChainOutput) and self.commands is not None:
            self.commands.take(output.guide)
        if not math.isnan(self.source.arrived):
            self.stats.latency(self.clock() - self.source.arrived)

    def every_turn(self, now: float) -> None:
        """Save the state, sync the log and tell how it goes, each in its time."""
        times = self.parts.service.file.log
        if self.log is not None and now - self._synced >= times.sync_s:
            self._synced = now
            self.stats.syncs.start(self.log.sync)
        if self.saver is not None and now - self._saved >= times.state_s and not self.saver.busy:
            if math.isfinite(self._saved):
                self.save(now)
            self._saved = now
        if isinstance(self.clock, Clock) and (words := self.clock.stepped()):
            self.stats.notes.append(words)
            self._say(words)
        terminal = self.status is not None and self.status.isatty()
        if self.status is not None and now - self._told >= (TELL if terminal else TELL_QUIETLY):
            if math.isfinite(self._told):
                text = self.stats.line(now, self.source, self.outs, self.log)
                self.status.write(f"\r{text}\x1b[K" if terminal else f"{text}\n")
                self.status.flush()
            self._told = now

    def save(self, now: float, wait: bool = False) -> None:
        """Save the state with its place in the log, which is written first."""
        if self.saver is None or self.log is None or self.stats.state is None:
            return
        self.log.flush(now)
        if self.log.error:  # the state would be ahead of what the log holds
            return
        others = {"decoder": self.parts.decoder.saved(), "poses": self.parts.poses.saved()}
        self.saver.save(self.stats.state, self.log.place, others, wait)

    def _say(self, text: str) -> None:
        if self.status is not None:
            self.status.write(f"\nboresight: {text}\n")
            self.status.flush()


class Stats:
    """What a live run tells of itself: per source, tracks, latency, processor, memory."""

    def __init__(self, parts: Parts) -> None:
        self.parts = parts
        n = len(parts.tracker.sensors)
        self.fates = np.zeros((n, len(FATES)), np.int64)
        self.nis = np.zeros((n, 2))  # sum, count
        self.state: TrackerState | None = None
        self.latencies: list[float] = []
        self.longest = 0.0
        self.histogram = np.zeros(2000, np.int64)  # of latencies, by ms
        self.notes: list[str] = []
        self.syncs = Beside()
        self.cpu, self.wall = time.process_time(), time.monotonic()
        self.begun = self.cpu, self.wall
        self.accepted: dict[str, int] = {}

    def take(self, output: TrackOutput) -> None:
        """Count decisions by sensor."""
        self.state = output.state
        for some in output.decisions:
            sensor = self.parts.decoder.sensor_of[some.row % KEPT_ROWS]
            known = sensor >= 0
            np.add.at(self.fates, (sensor[known], some.fate[known]), 1)
            judged = known & np.isfinite(some.nis) & np.isin(some.fate, USED)
            np.add.at(self.nis, sensor[judged], np.stack([some.nis[judged], np.ones(judged.sum())], axis=1))

    def latency(self, took: float) -> None:
        """Note how long a step's output came after the oldest arrival in it (s)."""
        self.longest = max(self.longest, took)
        self.histogram[min(int(1e3 * max(took, 0.0)), len(self.histogram) - 1)] += 1

    def percentile(self, share: float) -> float:
        """Return the latency (s) below which a share of the steps were, to the ms above."""
        total = np.cumsum(self.histogram)
        return 1e-3 * (int(np.searchsorted(total, share * total[-1])) + 1) if total[-1] else 0.0

    def sources(self, now: float, dt: float | None = None) -> dict[str, dict[str, Any]]:
        """Return what is known of every source; with `dt` (s) its rate since last asked."""
        out = {}
        index = {s.id: i for i, s in enumerate(self.parts.tracker.sensors)}
        for name, health in self.parts.decoder.health.items():
            row: dict[str, Any] = {"counts": dict(health.counts)}
            if dt is not None:
                row["rate_hz"] = (health.counts["accepted"] - self.accepted.get(name, 0)) / max(dt, 1e-9)
                self.accepted[name] = health.counts["accepted"]
            if math.isfinite(health.arrived):
                row |= {"age_s": now - health.arrived, "delay_s": health.delay}
            if health.words():
                row["clock"] = health.words()
            refused = {k: v for k, v in health.why.items() if health.counts[k]}
            if refused:
                row["why"] = refused
            if name in index:
                fates, (total, judged) = self.fates[index[name]], self.nis[index[name]]
                found = fates.sum() - fates[FATES.index(Fate.NO_DETECTION)]
                if found:
                    row["used_share"] = float(fates[USED].sum() / found)
                    row["fates"] = {str(FATES[i]): int(k) for i, k in enumerate(fates) if k}
                if judged:
                    row["nis_mean"] = float(total / judged)
            if health.counts or name != UNKNOWN:
                out[name] = row
        return out

    def tracks(self) -> tuple[int, int]:
        """Return how many tracks are shown, and how many are kept that are not."""
        if self.state is None:
            return 0, 0
        tr = self.state.window.tracks
        n = int(tr.live[0])
        shown = int((tr.life[:n, 2] > 0.0).sum())
        return shown, n - shown

    def line(self, now: float, source: LiveSource, outs: Sequence[LineOut], log: LogWriter | None) -> str:
        """Return the status line."""
        cpu, wall = time.process_time(), time.monotonic()
        dt = wall - self.wall
        share = (cpu - self.cpu) / max(dt, 1e-9)
        self.cpu, self.wall = cpu, wall
        shown, kept = self.tracks()
        words = []
        for name, row in self.sources(now, dt).items():
            one = f"{name} {row['rate_hz']:.1f}/s"
            one += f" {row['age_s']:.1f}s old" if "age_s" in row else " silent"
            if "delay_s" in row and abs(row["delay_s"]) >= 0.05:
                one += f" delay {row['delay_s']:.1f}s"
            if "used_share" in row:
                one += f" used {100 * row['used_share']:.0f}%"
                others = {k: v for k, v in row["fates"].items() if k not in NOT_LEFT}
                if others and row["used_share"] < 0.95:
                    most = max(others, key=lambda k: others[k])
                    one += f" ({most} {100 * others[most] / sum(row['fates'].values()):.0f}%)"
            if "nis_mean" in row:
                one += f" NIS {row['nis_mean']:.1f}"
            if "clock" in row:
                one += f" [{row['clock']}]"
            refused = {k: v for k, v in row["counts"].items() if k not in ("accepted", "duplicate_rows")}
            if refused:
                one += f" refused {sum(refused.values())} ({max(refused, key=lambda k: refused[k])})"
            words.append(one)
        failing = [f"{out.name}: {out.error}" for out in outs if out.error]
        if log is not None and log.error:
            failing.append(f"log: {log.error}")
        lost = sum(sum(one.values()) for one in source.lost().values())
        parts = [
            f"tracks {shown} (+{kept})", *words,
            f"latency 99% {1e3 * self.percentile(0.99):.0f} ms", f"cpu {100 * share:.0f}%", f"{memory():.0f} MB",
            *([f"lost {lost} lines"] if lost else []), *failing,
        ]  # fmt: skip
        return " | ".join(parts)


class Beside:
    """Runs one thing at a time in a thread of its own; asked again while it runs, it does nothing."""

    def __init__(self) -> None:
        self._running: Any = None

    def start(self, call: Callable[[], None]) -> None:
        """Run a function beside the loop."""
        import threading

        if self._running is None or not self._running.is_alive():
            self._running = threading.Thread(target=call, daemon=True)
            self._running.start()


def memory() -> float:
    """Return the resident memory of this process (MB), 0 where the system does not say."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    return 0.0


def serve(
    service: Service,
    *,
    log: LogWriter | None = None,
    resume: bool = False,
    results: Path | None = None,
    duration: float | None = None,
    status: TextIO | None = None,
    clock: Callable[[], float] | None = None,
    stop: Callable[[], bool] = lambda: False,
    ready: Callable[[list[Input]], None] = lambda _: None,
) -> tuple[dict[str, Any], Serving, TrackerState]:
    """Track what arrives until `duration` (s) has passed or `stop` says so; returns counts, the run, the last state.

    `resume` goes on from the state and the records in the log's folder. `results` is a folder for what `-o` writes at
    the end. Raises UserError for inputs that cannot be opened, and a saved state that does not fit.
    """
    clock = clock if clock is not None else Clock()
    parts = parts_of(service)
    warm(parts)
    restored = _restored(parts, log, status) if resume and log is not None else None
    inputs = inputs_of(service)
    outs = outs_of(service)
    commands = None
    if service.pointing is not None:
        commands = Commands(service.pointing.output, service.pointing.mount, service.pointing.pointer, clock, None)
    files = None if results is None else ResultFiles(results, service.declaration.dimensions)
    serving = Serving(parts, clock, log, outs, files, commands, status)
    serving.first_row = parts.decoder.rows
    limits = service.file.input[0] if service.file.input else InputTable()
    recorded = (lambda: parts.decoder.arrival) if service.recorded else None
    source = LiveSource(
        inputs, [parts.decoder] * len(inputs), clock, 0.0 if service.pointing is None else service.pointing.rate, log,
        service.file.log.flush_s, duration, stop, recorded, serving.every_turn,
        Waiting(limits.most_lines, most_wait=limits.most_wait_s),
    )  # fmt: skip
    serving.source = source
    estimator: Any = parts.tracking if parts.chain is None else parts.chain
    state: Any = estimator.init() if restored is None else restored
    if parts.chain is not None and restored is not None:
        state = ChainState(restored, parts.chain.guiding.init())
    serving.stats.state = state.track.tracker if isinstance(state, ChainState) else state.tracker
    if log is not None:
        log.append(Kind.NOTE, 0, clock(), b"resumed" if restored is not None else b"begun")
    ready(inputs)
    serving.stats.begun = time.process_time(), time.monotonic()
    state_of = _LastState()
    try:
        run(source, estimator, [serving, state_of], state)
    finally:
        with contextlib.suppress(KeyboardInterrupt):
            now = clock()
            lost = source.lost()
            if log is not None:
                log.flush(now)
            for one in inputs:
                one.close()
            serving.lines.close()
            if commands is not None:
                commands.close()
            if log is not None:
                log.close(now)
            if status is not None and status.isatty():
                status.write("\n")
    counts = counts_of(serving, lost, now)
    assert state_of.state is not None
    return counts, serving, state_of.state


class _LastState:
    """A sink that keeps the tracker's newest state."""

    def __init__(self) -> None:
        self.state: TrackerState | None = None

    def take(self, output: TrackOutput | ChainOutput) -> None:
        self.state = output.track.state if isinstance(output, ChainOutput) else output.state


def counts_of(serving: Serving, lost: dict[str, Any], now: float) -> dict[str, Any]:
    """Return what a run tells at its end."""
    stats, log = serving.stats, serving.log
    shown, kept = stats.tracks()
    cpu, wall = stats.begun
    found: dict[str, Any] = {
        "reports": serving.parts.decoder.rows - serving.first_row,
        "tracks": 0 if stats.state is None else stats.state.names.given,
        "tracks_shown": shown,
        "tracks_tentative": kept,
        "lines_out": serving.lines.lines,
        "latency_p50_s": stats.percentile(0.5),
        "latency_p99_s": stats.percentile(0.99),
        "latency_max_s": stats.longest,
        "core_share": (time.process_time() - cpu) / max(time.monotonic() - wall, 1e-9),
        "memory_mb": memory(),
        "sources": stats.sources(now),
        "lost": lost,
        "outputs": outputs(serving.outs),
        "notes": stats.notes,
    }
    if serving.commands is not None:
        found["pointing"] = serving.commands.counts()
    if log is not None:
        found["log"] = {"lost_records": log.lost, "errors": log.errors, "error": log.error or None}
        if serving.saver is not None:
            found["log"]["states_saved"] = serving.saver.saved
            found["log"]["state_error"] = serving.saver.error or None
    if serving.results is not None and serving.results.errors:
        found["results_error"] = serving.results.error
    return found


def _restored(parts: Parts, log: LogWriter, status: TextIO | None) -> TrackState | None:
    """Return the state at the end of a log: the saved one, and what was logged after it taken again."""
    saved = load_state(log.folder, parts.tracker)
    state = parts.tracking.init()
    place = (0, 0)
    if saved is not None:
        tracker, place, about = saved
        state = TrackState(tracker, parts.tracking.pipeline.init())
        try:
            parts.decoder.restore(about["decoder"])
            parts.poses.restore(about["poses"])
        except (KeyError, TypeError, ValueError, IndexError, AttributeError):
            raise UserError(f"{log.folder}: the saved state is damaged; remove its state.npz") from None
    reader = LogReader(log.folder, place)
    source = LogSource(reader, [parts.decoder] * 64)
    for items in source:
        state, _ = parts.tracking.step(state, items)
        parts.decoder.duplicates.clear()
    if not math.isfinite(state.tracker.arrival):
        return None
    for words in reader.damage:
        _tell(status, f"{log.folder}: {words}")
    gap = time.time() - state.tracker.arrival if not parts.service.recorded else math.nan
    shown = int((state.tracker.window.tracks.life[: int(state.tracker.window.tracks.live[0]), 2] > 0.0).sum())
    _tell(
        status,
        f"goes on from {log.folder} with {shown} tracks"
        + (f", after {gap:.1f} s without data" if math.isfinite(gap) else ""),
    )
    return state


def warm(parts: Parts) -> None:
    """Load (or compile) all that the first reports would call, with a decoder and poses that are thrown away."""
    d, about = parts.service.declaration, parts.service.logged
    tracker = parts.tracker
    warm_tracker(tracker)
    poses = LivePoses(d.site, 60.0, sigmas_of(about))
    for name in {s.platform for s in d.sensors if s.platform is not None}:
        for t in (0.0, 0.1, 0.2):
            line = {"platform": name, "t_s": t, "east_m": t, "north_m": 0.0, "up_m": 0.0, "yaw_deg": 1.0}
            m = line_of(msgspec.json.encode(line))
            poses.take(Fix(name, t, t, navigation(m, d.site, d.dimensions == 2)))
    scratch = replace(tracker, poses=poses)
    scratch.looks([Scan(i, 0.1, 0.2, *NOTHING) for i in range(len(d.sensors))])
    one = np.zeros(1)
    geodetic_from_enu(*enu_from_geodetic(one + d.site.latitude, one + d.site.longitude, one, d.site), d.site)
    if parts.chain is not None:
        pointer = parts.chain.guiding.pointer
        state = pointer.init()
        state.guide.track, state.guide.t, state.guide.x = 0, 0.0, np.array([1e3, 1e3, 1e2, 1.0, 1.0, 0.0])
        state.guide.P = np.eye(6)
        pointer.tick(state, 0.0)


def _tell(status: TextIO | None, text: str) -> None:
    print(f"boresight: {text}", file=status if status is not None else sys.stderr, flush=True)


def inputs_of(service: Service) -> list[Input]:
    """Return the inputs of a site file, open; raises UserError."""
    inputs: list[Input] = []
    for one in service.file.input:
        key = "input"
        if one.udp:
            inputs.append(Udp(one.udp, f"{key}.udp"))
        if one.tcp:
            inputs.append(Tcp(one.tcp, f"{key}.tcp"))
        if one.serial:
            inputs.append(Serial(one.serial, one.baud, f"{key}.serial"))
        if one.listen:
            kind: Any = Udp if one.listen.startswith("udp://") else Tcp
            inputs.append(kind(one.listen, f"{key}.listen"))
    if not inputs:
        raise UserError("the site file has no [input]: give udp, tcp or serial")
    return inputs


def outs_of(service: Service) -> list[LineOut]:
    """Return the outputs for tracks, open; raises UserError."""
    table = service.file.output
    udp = (table.udp,) if isinstance(table.udp, str) else table.udp
    tcp = (table.tcp,) if isinstance(table.tcp, str) else table.tcp
    return [*(UdpOut(text, "output.udp") for text in udp), *(Broadcast(text, "output.tcp") for text in tcp)]
