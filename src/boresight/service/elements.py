"""Orbital elements as a guide source: a report a second of where SGP4 has the satellite."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping

from boresight.errors import UserError
from boresight.pointing.elements import Satellite
from boresight.pointing.pointer import Pointer, PointerState
from boresight.pointing.satellite import ecef_at

PERIOD = 1.0  # s
DAY = 86400.0


class Elements:
    """The satellites that guide, by source id; says nothing for sources without elements.

    Elements further from their epoch than `oldest` (days, by source id) are not used, and elements that SGP4 cannot
    propagate cost nothing but their own reports: `faults` says why, `counts` how often.
    """

    def __init__(
        self, pointer: Pointer, satellites: Mapping[str, Satellite], oldest: Mapping[str, float] | None = None
    ) -> None:
        index = {s.id: i for i, s in enumerate(pointer.guide.sources)}
        self.pointer = pointer
        self.sources = [(index[name], name, one) for name, one in satellites.items() if name in index]
        self.oldest = dict(oldest or {})
        self.last = -math.inf
        self.faults: dict[str, str] = {}
        self.counts: Counter[str] = Counter()

    def report(self, state: PointerState, t: float) -> None:
        """Give the filter each satellite's position at `t` (Unix s), at most once a second."""
        if not self.sources or 0.0 <= t - self.last < PERIOD:
            return
        self.last = t
        for source, name, one in self.sources:
            age, limit = (t - one.epoch) / DAY, self.oldest.get(name, math.inf)
            if abs(age) > limit:
                self._fault(name, "elements_old", f"elements {age:.0f} days old, more than {limit:g}")
                continue
            try:
                where = ecef_at(one, t)[0]
            except UserError as error:
                self._fault(name, "elements_failed", str(error).rpartition(": ")[2])
                continue
            self.faults.pop(name, None)
            self.pointer.take(state, source, t, where)

    def usable(self, t: float) -> bool:
        """Return whether any satellite's elements are young enough at `t` (Unix s)."""
        return any(abs(t - one.epoch) <= DAY * self.oldest.get(name, math.inf) for _, name, one in self.sources)

    def told(self, t: float) -> str:
        """Return what there is to say of the elements at `t` (Unix s): their age, or why they are not used."""
        return "  ".join(
            f"{name}: {self.faults[name]}" if name in self.faults else f"{name} elements {(t - one.epoch) / DAY:.1f} d"
            for _, name, one in self.sources
        )

    def _fault(self, name: str, kind: str, why: str) -> None:
        self.counts[kind] += 1
        self.faults[name] = why
