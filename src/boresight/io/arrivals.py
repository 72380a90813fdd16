"""Whether the stamp of a live report can be, seen from its time of arrival: clocks ahead, clocks elsewhere."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

TOLERANCE = 0.25  # s that a stamp may lie in the future of its arrival
OLDEST = 30.0  # s that it may lie in the past
AGREE = 3  # reports in a row that say the same of a clock before it is believed
SPREAD = 1.0  # s within which they say the same
KEPT = 16  # leads that are kept of a source whose clock is ahead


@dataclass(slots=True)
class SourceHealth:
    """What one source's reports say of it: counts by reason, arrivals, stamps, clock.

    `ahead` (s) is how far the source's clock is ahead of ours, at least: the largest lead of its recent stamps over
    their arrivals; 0 for a clock that is not. Its stamps are taken with that much taken off.
    """

    counts: Counter[str] = field(default_factory=Counter)
    why: dict[str, str] = field(default_factory=dict)  # the newest refusal for each reason, in words
    arrived: float = -float("inf")  # s, newest arrival
    stamped: float = -float("inf")  # s, newest stamp taken
    delay: float = 0.0  # s from stamp to arrival, smoothed
    ahead: float = 0.0
    offset: float = 0.0  # s, median lead of the stamps that were refused for their time
    leads: list[float] = field(default_factory=list)  # of stamps in the future, newest last
    good: int = 0  # stamps in a row that were not

    def admit(self, t: float, arrival: float, oldest: float = OLDEST, tolerance: float = TOLERANCE) -> float | str:
        """Return the time to take a stamp `t` (s) for that arrived at `arrival` (s), or the reason to refuse it.

        A stamp further ahead of its arrival than `tolerance` is not taken, unless the last three agree to within a
        second: then the clock is ahead, and the lead is taken off from then on, until three in a row are not ahead.
        """
        lead = t - arrival
        if not -oldest <= lead <= max(oldest, self.ahead + SPREAD):
            self.leads = [*self.leads[1 - AGREE :], lead]
            self.offset = sorted(self.leads)[len(self.leads) // 2]
            return "bad_time"
        if lead > tolerance:
            self.good = 0
            self.leads = [*self.leads[1 - KEPT :], lead]
            last = self.leads[-AGREE:]
            if not self.ahead and (len(last) < AGREE or max(last) - min(last) > SPREAD):
                return "clock_ahead"
            self.ahead = max(x for x in self.leads if abs(x - lead) <= SPREAD)
        elif self.ahead:
            self.good += 1
            if self.good < AGREE:
                return "clock_ahead"
            self.ahead, self.leads = 0.0, []
        taken = t - self.ahead
        self.stamped = max(self.stamped, taken)
        self.delay += 0.1 * (arrival - taken - self.delay)
        return taken

    def words(self) -> str:
        """Return what is wrong with the source's clock, in words; empty if nothing is."""
        if self.ahead:
            return f"clock ahead by {self.ahead:.1f} s"
        if self.counts["clock_ahead"] and self.leads and not self.good:
            return f"stamps {self.leads[-1]:.1f} s ahead of their arrival"
        if self.counts["bad_time"] and not self.counts["accepted"]:
            return f"stamps {abs(self.offset):.1f} s {'ahead of' if self.offset > 0 else 'behind'} their arrival"
        return ""

    def count(self, reason: str, text: str = "", n: int = 1) -> None:
        """Count `n` lines with one outcome, and keep its words."""
        self.counts[reason] += n
        if text:
            self.why[reason] = text

    def saved(self) -> dict[str, Any]:
        """Return plain values from which `restored` makes the same again."""
        return {name: getattr(self, name) for name in self.__slots__ if name not in ("counts", "why")} | {
            "counts": dict(self.counts),
            "why": self.why,
        }


def restored(saved: dict[str, Any]) -> SourceHealth:
    """Return what `SourceHealth.saved` took apart."""
    return SourceHealth(**{**saved, "counts": Counter(saved["counts"])})
