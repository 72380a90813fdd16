"""The clock of a live run: UTC at its start, then the monotonic clock, slowly led after UTC; it never steps."""

from __future__ import annotations

import time
from collections.abc import Callable

SLEW = 2e-4  # s a second by which it follows the wall clock
STEPPED = 0.5  # s between it and the wall clock from which on the wall clock has stepped, and is not followed


class Clock:
    """Call it for the time (Unix s). A step of the wall clock is told by `stepped`, and changes nothing."""

    def __init__(self, wall: Callable[[], float] = time.time, monotonic: Callable[[], float] = time.monotonic) -> None:
        self.wall, self.monotonic = wall, monotonic
        self.checked = monotonic()
        self.tied = wall() - self.checked
        self.told = 0.0

    def __call__(self) -> float:
        """Return the time (Unix s)."""
        return self.tied + self.monotonic()

    def stepped(self) -> str:
        """Follow the wall clock by a little; return in words that it has stepped since last asked, or nothing."""
        now = self.monotonic()
        dt, self.checked = now - self.checked, now
        off = self.wall() - (self.tied + now)
        if abs(off) < STEPPED:
            self.tied += max(min(off, SLEW * dt), -SLEW * dt)
        if abs(off - self.told) < STEPPED:
            return ""
        step, self.told = off - self.told, off
        return f"the wall clock stepped by {step:+.1f} s; this run goes on by its own, {off:+.1f} s from it"
