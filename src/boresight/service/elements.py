"""Orbital elements as a guide source: a report a second of where SGP4 has the satellite."""

from __future__ import annotations

import math
from collections.abc import Mapping

from boresight.pointing.pointer import Pointer, PointerState
from boresight.pointing.satellite import Satellite, ecef_at

PERIOD = 1.0  # s


class Elements:
    """The satellites that guide, by source id; says nothing for sources without elements."""

    def __init__(self, pointer: Pointer, satellites: Mapping[str, Satellite]) -> None:
        index = {s.id: i for i, s in enumerate(pointer.guide.sources)}
        self.pointer = pointer
        self.sources = [(index[name], one) for name, one in satellites.items() if name in index]
        self.last = -math.inf

    def report(self, state: PointerState, t: float) -> None:
        """Give the filter each satellite's position at `t` (Unix s), at most once a second."""
        if not self.sources or t - self.last < PERIOD:
            return
        self.last = t
        for source, one in self.sources:
            self.pointer.take(state, source, t, ecef_at(one, t)[0])
