"""Tracker and pointer in one: looks in, tracks and commands out, the pointer following one of the tracks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from boresight.engine.guide import GuideOutput, Guiding, GuidingState
from boresight.engine.loop import Item, Tick
from boresight.engine.track import Tracking, TrackOutput, TrackState
from boresight.kernels.tracker import NOTHING
from boresight.pointing.follow import FollowState
from boresight.tracking.tracker import TrackerState
from boresight.types import NO_TRACK

SHOWN, HIT = 2, 1  # columns of `Tracks.life`: above zero where a track is shown; when it was last reported (s)


class ChainOutput(NamedTuple):
    """What both gave."""

    track: TrackOutput
    guide: GuideOutput


class ChainState(NamedTuple):
    """Both states."""

    track: TrackState
    guide: GuidingState


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """A tracker whose tracks guide a pointer with a `pointing.follow.TrackGuide`.

    `follow` is "track:ID" (that track alone), "nearest" (to the antenna) or "strongest" (most probably a target); of
    the last two the pointer stays with its track while that is shown. `sigma_up` (m) is the height's where tracks have
    none.
    """

    tracking: Tracking
    guiding: Guiding
    follow: str
    sigma_up: float = 10.0

    def init(self) -> ChainState:
        """Return the state before the first item."""
        return ChainState(self.tracking.init(), self.guiding.init())

    def step(self, state: ChainState, items: Sequence[Item]) -> tuple[ChainState, ChainOutput]:
        """Take items in order of arrival; tracks reach the pointer at every tick."""
        track, tracked = self.tracking.step(state.track, items)
        ticks = [item for item in items if isinstance(item, Tick)]
        if ticks:
            self._follow(track.tracker, state.guide)
        guide, guided = self.guiding.step(state.guide, ticks)
        return ChainState(track, guide), ChainOutput(tracked, guided)

    def finish(self, state: ChainState) -> tuple[ChainState, ChainOutput]:
        """Give what is left of the tracks."""
        track, tracked = self.tracking.finish(state.track)
        guide, guided = self.guiding.finish(state.guide)
        return ChainState(track, guide), ChainOutput(tracked, guided)

    def _follow(self, now: TrackerState, guiding: GuidingState) -> None:
        """Put the chosen track's state into the pointer's."""
        pointer = guiding.pointer
        state = pointer.guide
        assert isinstance(state, FollowState)
        tr, d = now.window.tracks, self.tracking.tracker.dimensions
        shown = np.flatnonzero(tr.life[: int(tr.live[0]), SHOWN] > 0.0)
        number = now.names.of(tr.birth[shown])
        shown, number = shown[number != NO_TRACK], number[number != NO_TRACK]
        i = self._chosen(state.track, shown, number, tr.x[shown, :d], tr.weight[shown, NOTHING])
        if i < 0:  # the last one goes on by its prediction until the pointer gives it up
            return
        k = int(shown[i])
        hit = float(tr.life[k, HIT])
        if int(number[i]) != state.track:
            pointer.last[0] = pointer.since[0] = hit
        state.t, state.track, state.q = float(tr.time[0]), int(number[i]), self.tracking.tracker.plan.settings.q
        x, P = np.zeros(6), np.zeros((6, 6))
        own = [*range(d), *range(3, 3 + d)]
        x[own] = tr.x[k, : 2 * d]
        P[np.ix_(own, own)] = tr.P[k, : 2 * d, : 2 * d]
        if d == 2:
            P[2, 2] = self.sigma_up**2
        state.x, state.P = x, P
        pointer.last[0] = max(pointer.last[0], hit) if math.isfinite(pointer.last[0]) else hit

    def _chosen(self, held: int, shown: np.ndarray, number: np.ndarray, x: np.ndarray, nothing: np.ndarray) -> int:
        """Return the place in `shown` of the track to follow, -1 for none."""
        if self.follow.startswith("track:"):
            wanted = np.flatnonzero(number == int(self.follow.removeprefix("track:")))
            return int(wanted[0]) if len(wanted) else -1
        if not len(shown):
            return -1
        same = np.flatnonzero(number == held)
        if len(same):
            return int(same[0])
        least = np.linalg.norm(x, axis=1) if self.follow == "nearest" else nothing
        return int(np.argmin(least))
