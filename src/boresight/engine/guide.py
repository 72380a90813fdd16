"""The pointing chain as an estimator: reports of guide sources in, a command at every tick that is due out."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from boresight.engine.loop import Item, Tick
from boresight.pointing.pointer import Place, Pointer, PointerState, Pointing
from boresight.pointing.reports import Report

EARLY = 1e-6  # s before it is due that a tick gives a command


class GuideOutput(NamedTuple):
    """Commands in order, fates of reports (source, fate), and the state as it is now."""

    pointings: list[Pointing]
    fates: list[tuple[int, int]]
    state: PointerState


class GuidingState(NamedTuple):
    """The pointer's state, and when the next command is due (s)."""

    pointer: PointerState
    due: float


@dataclass(frozen=True, slots=True, eq=False)
class Guiding:
    """A pointer that gives commands at `rate` (Hz).

    `place` tells where a moving antenna is, from what had arrived by a time (s); `guides` gives the pointer what is
    not reported but computed (orbital elements), before every command.
    """

    pointer: Pointer
    rate: float
    place: Callable[[float], Place] | None = None
    guides: Callable[[PointerState, float], None] | None = None

    def init(self) -> GuidingState:
        """Return the state before the first report."""
        return GuidingState(self.pointer.init(), -math.inf)

    def step(self, state: GuidingState, items: Sequence[Item]) -> tuple[GuidingState, GuideOutput]:
        """Take reports in order of arrival; a tick gives a command if one is due."""
        now, due = state
        out: list[Pointing] = []
        fates: list[tuple[int, int]] = []
        for item in items:
            if isinstance(item, Tick):
                t = item.t_recv
                if t < due - EARLY:
                    continue
                period = 1.0 / self.rate
                due = due + period if due + period > t else t + period
                if self.guides is not None:
                    self.guides(now, t)
                now, pointing = self.pointer.tick(now, t, None if self.place is None else self.place(t))
                if pointing is not None:
                    out.append(pointing)
            elif isinstance(item, Report):
                fates.append((item.source, self._take(now, item)))
            elif isinstance(item, tuple) and item and isinstance(item[0], Report):
                best = item[0] if len(item) == 1 else min(item, key=lambda r: self._surprise(now, r))
                fates.append((best.source, self._take(now, best)))
        return GuidingState(now, due), GuideOutput(out, fates, now)

    def finish(self, state: GuidingState) -> tuple[GuidingState, GuideOutput]:
        """Give nothing more: a command belongs to a tick."""
        return state, GuideOutput([], [], state.pointer)

    def _take(self, state: PointerState, r: Report) -> int:
        return self.pointer.take(state, r.source, r.t, r.z, r.origin, r.axes)

    def _surprise(self, state: PointerState, r: Report) -> float:
        return self.pointer.guide.surprise(state.guide, r.source, r.t, r.z, r.origin, r.axes)
