"""Alignment as a stage: a fast bearing sensor's reports become one value per object at each look of a slow sensor.

Every report goes into one value at most, so values are independent of each other; a value is late by what it waits for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from boresight.errors import UserError
from boresight.stages.protocol import Belief, Note, Stepped
from boresight.stages.scene import Scene
from boresight.stages.streaks import NOTHING_MEASURED, Report, by_streak, by_track, held_reports, value_of
from boresight.types import Fate, Scan

KINDS = ("interpolate", "compress", "compress_innovations", "window")
SPENT = "in the value of row {}"
STANDS = "stands for the value of {} reports"
TOLERANCE = 1e-6  # s


@dataclass(slots=True, eq=False)
class Held:
    """What one fast sensor has reported and not yet been asked for."""

    reports: list[Report] = field(default_factory=list)
    looks: list[float] = field(default_factory=list)  # s, validity of the looks held, ascending
    blank: list[int] = field(default_factory=list)  # rows that say a look saw nothing
    epochs: list[float] = field(default_factory=list)  # s, times asked for, ascending


@dataclass(frozen=True, slots=True, eq=False)
class AlignStage:
    """Bring the reports of `fast` sensors to the times at which the `slow` sensor looked.

    - `interpolate`: the line through the last report before that time and the first after it; the rest is unused.
    - `compress`: the least-squares line through all since the last time (shao2012 (4)–(7), at any times).
    - `compress_innovations`: the mean innovation against a predicted track, at the mean time of its reports.
    - `window`: a polynomial of `order` (None: chosen) through at most `past` reports before and `future` after
      (mao2015), weighted as `time_distance` says.

    Reports are grouped into streaks, one object each: a report continues the streak nearest to it within
    `gate`·√2·σ + `rate`·Δt; for `compress_innovations` it belongs to the nearest predicted track within `gate`
    standard deviations, and is unassociated where there is none. A streak that does not reach the time is read off at
    its own middle. After `hold` seconds without a look of the slow sensor a time is taken as asked for.
    """

    scene: Scene
    kind: str
    slow: int
    fast: frozenset[int]
    rate: float  # rad/s, of a streak against its last report
    order: int | None = 2
    past: int = 60
    future: int = 10
    time_distance: bool = False
    gate: float = 4.0
    hold: float = 3.0  # s

    def __post_init__(self) -> None:
        if self.order is not None and self.order not in (1, 2, 3):
            raise UserError(f"align: order is 1, 2 or 3, or 0 to have it chosen, not {self.order}")
        if not (self.past >= 2 and self.future >= 0 and self.gate > 0 and self.hold > 0 and self.rate >= 0):
            raise UserError("align: past must be at least 2, future and rate not negative, gate and hold above zero")

    @property
    def waits(self) -> int:
        """How many looks after the time asked for are needed."""
        return {"interpolate": 1, "window": self.future}.get(self.kind, 0)

    def init(self) -> dict[int, Held]:
        """Return the state before the first look."""
        return {s: Held() for s in sorted(self.fast)}

    def step(self, state: dict[int, Held], scan: Scan, belief: Belief) -> tuple[Any, Stepped]:
        """Hold a fast sensor's look, ask for values at a slow one's; give the values that are now due."""
        out: list[Scan] = []
        notes: list[Note] = []
        if scan.sensor in self.fast:
            held = state[scan.sensor]
            reports = held_reports(self.scene, scan)
            if reports is None:  # no navigation: the tracker says so
                return state, Stepped((scan,))
            t = self.scene.look_time(scan)
            held.reports += reports
            held.blank += scan.empty_rows
            held.looks.append(t)
            held.looks.sort()
            if not held.epochs and t - held.looks[0] > self.hold:
                held.epochs.append(t)
        else:
            out.append(scan)
            if scan.sensor == self.slow:
                for held in state.values():
                    held.epochs = sorted({*held.epochs, self.scene.look_time(scan)})
        for sensor, held in state.items():
            while held.epochs and self._due(held):
                made, told = self._values(sensor, held, held.epochs.pop(0), scan.t_recv, belief)
                out += made
                notes += told
        return state, Stepped(tuple(out), tuple(notes))

    def finish(self, state: dict[int, Held]) -> tuple[Note, ...]:
        """Reports whose time was never asked for."""
        why = "the recording ended before its value was due"
        return tuple(
            Note(row, fate, why)
            for held in state.values()
            for rows, fate in (([r.row for r in held.reports], Fate.UNUSED), (held.blank, Fate.NO_DETECTION))
            for row in rows
        )

    def _due(self, held: Held) -> bool:
        t = held.epochs[0]
        after = sum(x > t + TOLERANCE for x in held.looks)
        reached = bool(held.looks) and held.looks[-1] >= t - TOLERANCE
        return (reached and after >= self.waits) or (len(held.epochs) > 1 and held.epochs[-1] - t > self.hold)

    def _values(
        self, sensor: int, held: Held, at: float, t_recv: float, belief: Belief
    ) -> tuple[list[Scan], list[Note]]:
        limit = self._until(held, at)
        mine = [r for r in held.reports if r.t <= limit]
        held.reports = [r for r in held.reports if r.t > limit]
        looked = [t for t in held.looks if t <= limit]
        held.looks = [t for t in held.looks if t > limit]
        blank, held.blank = tuple(held.blank), []
        if not looked:
            return [], [Note(row, Fate.NO_DETECTION, "the look saw nothing") for row in blank]
        notes: list[Note] = []
        if self.kind == "compress_innovations":
            groups, strangers = by_track(self.scene, sensor, mine, belief, self.gate, t_recv)
            notes += [Note(r.row, Fate.UNASSOCIATED, "no track near to compress it with") for r in strangers]
            values = [g.value() for g in groups]
            members: Sequence[Sequence[Report]] = [g.reports for g in groups]
            t_look = float(np.mean(looked))
        else:
            members = by_streak(mine, self.rate, self.gate)
            values = []
            chosen = []
            for streak in members:
                kept, idle = self._choose(streak, at)
                values.append(value_of(self.scene, sensor, kept, at, self._order(kept), self._weighting(), t_recv))
                chosen.append(kept)
                notes += [Note(r.row, Fate.UNUSED, "alignment took others of its object") for r in idle]
            members, t_look = chosen, at
        for value, group in zip(values, members, strict=True):
            if len(group) > 1:
                notes.append(Note(value.row, Fate.ALIGNED, STANDS.format(len(group)), value.row))
                where = SPENT.format(value.row)
                notes += [Note(r.row, Fate.ALIGNED, where, value.row) for r in group if r.row != value.row]
        latency = self.scene.sensors[sensor].latency
        values = values or [NOTHING_MEASURED]
        full = [v for v in values if v.row >= 0]
        scan = Scan(
            sensor, t_look + latency, t_recv,
            np.array([v.t for v in full]) + latency,
            np.array([v.z for v in full]).reshape(-1, 7), np.array([v.R for v in full]).reshape(-1, 7, 7),
            np.array([v.row for v in full], dtype=np.int64), blank,
        )  # fmt: skip
        return [scan], notes

    def _until(self, held: Held, at: float) -> float:
        """The time up to which reports are spent: the time asked for, or that of the last future look used."""
        if not self.waits:
            return at + TOLERANCE
        later = [t for t in held.looks if t > at + TOLERANCE][: self.waits]
        return (later[-1] if later else at) + TOLERANCE

    def _choose(self, streak: list[Report], at: float) -> tuple[list[Report], list[Report]]:
        before = [r for r in streak if r.t <= at + TOLERANCE]
        after = [r for r in streak if r.t > at + TOLERANCE]
        if self.kind == "compress":
            return streak, []
        past, future = (1, 1) if self.kind == "interpolate" else (self.past, self.future)
        kept = before[-past:] + after[:future]
        chosen = {r.row for r in kept}
        return kept, [r for r in streak if r.row not in chosen]

    def _order(self, kept: list[Report]) -> int | None:
        if self.kind in ("interpolate", "compress"):
            return 1
        return self.order

    def _weighting(self) -> bool:
        return self.time_distance and self.kind == "window"
