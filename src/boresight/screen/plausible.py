"""Throw out what no target can be: too near or far, below the horizon, faster than anything flies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from boresight.errors import UserError
from boresight.screen.prediction import Verdict
from boresight.types.sensor import FloatArray


class Seen(NamedTuple):
    """The last report let through, and the run of reports since that moved too fast."""

    t: float = -math.inf
    position: FloatArray | None = None
    fast: tuple[tuple[float, FloatArray], ...] = ()


@dataclass(frozen=True, slots=True)
class PlausibilityScreen:
    """Limits on slant range (m), elevation (rad) and speed (m/s) between reports, on positions about the sensor, ENU.

    `slack` (m) is what noise may add to a step. After `reopen` reports in a row that are too fast against the last
    good one, but not against each other, the last good one is given up.
    """

    range_limits: tuple[float, float] = (0.0, math.inf)
    elevation_limits: tuple[float, float] = (-math.pi / 2, math.pi / 2)
    speed_limit: float = math.inf
    slack: float = 0.0
    reopen: int = 4

    def __post_init__(self) -> None:
        for name, (low, high) in (("range", self.range_limits), ("elevation", self.elevation_limits)):
            if not low < high:
                raise UserError(f"screen: the lower limit of {name} must be below the upper one")
        if not (self.speed_limit > 0 and self.slack >= 0 and self.reopen >= 2):
            raise UserError("screen: speed_limit must be above zero, slack not below, and reopen at least 2")

    def init(self) -> Seen:
        """Return the state before the first report."""
        return Seen()

    def step(self, state: Seen, t: float, position: ArrayLike) -> tuple[Seen, Verdict]:
        """Judge a position (3,) about the sensor (m, ENU) at time `t` (s), and remember it."""
        p = np.asarray(position, dtype=np.float64)
        last = max([state.t, *(s for s, _ in state.fast)])
        if t <= last:
            return state, Verdict.DUPLICATE if t == last else Verdict.STALE
        if not self.range_limits[0] <= float(np.linalg.norm(p)) <= self.range_limits[1]:
            return state, Verdict.OUT_OF_RANGE
        elevation = math.atan2(p[2], math.hypot(p[0], p[1]))
        if not self.elevation_limits[0] <= elevation <= self.elevation_limits[1]:
            return state, Verdict.OUT_OF_ELEVATION
        if state.position is None:
            return Seen(t, p), Verdict.UNTESTED
        if self._reachable(state.t, state.position, t, p):
            return Seen(t, p), Verdict.GOOD
        if state.fast and not self._reachable(*state.fast[-1], t, p):
            return Seen(state.t, state.position, ((t, p),)), Verdict.TOO_FAST
        fast = (*state.fast, (t, p))
        if len(fast) >= self.reopen:
            return Seen(t, p), Verdict.REOPENED
        return Seen(state.t, state.position, fast), Verdict.TOO_FAST

    def _reachable(self, t0: float, p0: FloatArray, t1: float, p1: FloatArray) -> bool:
        return float(np.linalg.norm(p1 - p0)) <= self.speed_limit * (t1 - t0) + self.slack
