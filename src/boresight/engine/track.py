"""The tracker as an estimator: looks (and navigation) in, rows, decisions and notes out; stages may stand before it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from boresight.engine.loop import Item, Sink, Tick
from boresight.engine.loop import run as run_loop
from boresight.engine.pipeline import Pipeline
from boresight.engine.portions import MOST_LOOKS, Portions
from boresight.io.jsonlines import Fix
from boresight.kernels.tracker_rows import EMITTED, LONGEST_GAP
from boresight.stages.protocol import Belief, Note
from boresight.tracking.names import Names
from boresight.tracking.output import Decisions, Rows
from boresight.tracking.run import believed
from boresight.tracking.tracker import Tracker, TrackerState
from boresight.types import Scan


class TakesFixes(Protocol):
    """Live navigation: what the tracker's pose tracks are made of."""

    def take(self, fix: Fix) -> None:
        """Keep a stamp of a platform's navigation."""
        ...


class TrackOutput(NamedTuple):
    """What one step gives: rows and smoothed rows in order, final decisions, notes of stages, and the state."""

    rows: list[Rows]
    decisions: list[Decisions]
    smoothed: list[Rows]
    notes: list[Note]
    state: TrackerState  # as it is now; the next step consumes it


class TrackState(NamedTuple):
    """The tracker's state and the stages'.

    `names`: the tracks' numbers before rows were given for a time at which nothing had arrived, if there were any since
    the newest arrival: with the end of a recording such rows are not its own.
    """

    tracker: TrackerState
    held: list[Any]
    names: Names | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Tracking:
    """A tracker, the stages before it, and where the navigation of its platforms goes if it comes live."""

    tracker: Tracker
    pipeline: Pipeline = field(default_factory=Pipeline)
    navigation: TakesFixes | None = None

    def init(self) -> TrackState:
        """Return the state before the first look."""
        return TrackState(self.tracker.init(), self.pipeline.init())

    def step(self, state: TrackState, items: Sequence[Item]) -> tuple[TrackState, TrackOutput]:
        """Take looks and navigation in order of arrival; a tick gives the rows due by then."""
        now, held, names = state
        out = TrackOutput([], [], [], [], now)
        looks: list[Scan] = []
        for item in items:
            if isinstance(item, Scan):
                looks.append(item)
            elif isinstance(item, Fix) and self.navigation is not None:
                self.navigation.take(item)
        if looks:
            now, held = self._looks(now, held, looks, out)
            names = None
        for item in reversed(items):
            if isinstance(item, Tick):
                if names is None and now.window.clock.now[EMITTED] + LONGEST_GAP < item.t_recv:
                    out.rows.extend(self.tracker.due(now, math.nextafter(now.arrival, math.inf)).rows)
                    names = now.names.copy()
                out.rows.extend(self.tracker.due(now, item.t_recv).rows)
                break
        return TrackState(now, held, names), out._replace(state=now)

    def finish(self, state: TrackState) -> tuple[TrackState, TrackOutput]:
        """Give the rows that the last arrival calls for, and the decisions still open."""
        notes = self.pipeline.finish(state.held)
        if state.names is not None:
            state.tracker.names = state.names
        now, left = self.tracker.finish(state.tracker)
        return TrackState(now, state.held), TrackOutput(left.rows, left.decisions, left.smoothed, notes, now)

    def _looks(
        self, now: TrackerState, held: list[Any], looks: list[Scan], out: TrackOutput
    ) -> tuple[TrackerState, list[Any]]:
        tracker, pipeline = self.tracker, self.pipeline
        if not pipeline.stages:
            now, given = tracker.steps(now, looks)
            _add(out, given)
            return now, held
        for scan in looks:  # a stage may ask what the tracker believes before every look
            _add(out, tracker.tick(now, scan.t_recv))
            held, ready, notes = pipeline.step(held, scan, Belief(*believed(tracker, now)))
            out.notes.extend(notes)
            for one in ready:
                now, given = tracker.step(now, one)
                _add(out, given)
        return now, held


def _add(out: TrackOutput, given: Any) -> None:
    out.rows.extend(given.rows)
    out.decisions.extend(given.decisions)
    out.smoothed.extend(given.smoothed)


@dataclass(slots=True)
class Collected:
    """A sink that keeps everything: rows, smoothed rows, decisions, notes."""

    rows: list[Rows] = field(default_factory=list)
    decisions: list[Decisions] = field(default_factory=list)
    smoothed: list[Rows] = field(default_factory=list)
    notes: list[Note] = field(default_factory=list)

    def take(self, output: TrackOutput) -> None:
        """Keep what a step gave."""
        self.rows += output.rows
        self.decisions += output.decisions
        self.smoothed += output.smoothed
        self.notes += output.notes


def run(
    tracker: Tracker,
    scans: Iterable[Scan],
    state: TrackerState | None = None,
    *,
    finish: bool = True,
    watch: Callable[[TrackerState, TrackOutput], None] | None = None,
) -> tuple[TrackerState, list[Rows], list[Decisions]]:
    """Take a tracker through looks in order of arrival, from `state` (a fresh one); consumes it.

    `watch` is called with the state and what each look gave, also at the end; with it looks are taken one by one.
    """
    kept = Collected()
    sinks: list[Sink[TrackOutput]] = [kept]
    if watch is not None:
        sinks.append(Watched(watch))
    begin = None if state is None else TrackState(state, [])
    source = Portions(scans, 1 if watch is not None else MOST_LOOKS)
    end = run_loop(source, Tracking(tracker), sinks, begin, finish=finish)
    return end.tracker, kept.rows, kept.decisions


@dataclass(frozen=True, slots=True)
class Watched:
    """A sink that calls a function with the tracker's state and the output of each step."""

    call: Callable[[TrackerState, TrackOutput], None]

    def take(self, output: TrackOutput) -> None:
        """Call it."""
        self.call(output.state, output)
