"""Lines to reports, and reports to a pointer, one by one."""

from __future__ import annotations

from boresight.pointing.pointer import Pointer, PointerState
from boresight.pointing.reports import Report
from boresight.service.feed import Feed


def parse(feed: Feed, data: bytes, now: float) -> list[Report]:
    return [report for some in feed.decode(data, now) for report in some]


def give(pointer: Pointer, state: PointerState, r: Report) -> int:
    return pointer.take(state, r.source, r.t, r.z, r.origin, r.axes)
