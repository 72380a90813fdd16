"""Recorded items as a source: in portions that are worth one call of a kernel, with ticks where they are wanted."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from boresight.engine.loop import Item, Tick
from boresight.types import Scan

MOST_LOOKS, MOST_REPORTS = 256, 10_000  # that reach the kernel in one call


@dataclass(frozen=True, slots=True)
class Portions:
    """Looks in order of arrival, as many at a time as a kernel takes at once (`most`); `progress` hears of each."""

    scans: Iterable[Scan]
    most: int = MOST_LOOKS
    progress: Callable[[Scan], None] | None = None

    def __iter__(self) -> Iterator[Sequence[Item]]:
        some: list[Scan] = []
        reports = 0
        for scan in self.scans:
            some.append(scan)
            reports += len(scan.t)
            if len(some) >= self.most or reports >= MOST_REPORTS:
                yield from self._given(some)
                some, reports = [], 0
        yield from self._given(some)

    def _given(self, some: list[Scan]) -> Iterator[Sequence[Item]]:
        if some:
            yield some
        if self.progress is not None:
            for scan in some:
                self.progress(scan)


def arrival_of(item: Item) -> float:
    """Return an item's time of arrival (s)."""
    return item.t_recv if hasattr(item, "t_recv") else item[0].t_recv


def in_order(*streams: Iterable[Item]) -> Iterator[Item]:
    """Merge streams of items, each in order of arrival, into one; what arrives together keeps the streams' order."""
    return heapq.merge(*streams, key=arrival_of)


def ticked(items: Iterable[Item], rate: float) -> Iterator[Sequence[Item]]:
    """Put ticks at `rate` (Hz) between items, the first with the first arrival, and one after the last item.

    A tick comes after what has arrived before its time; what arrives at its time is taken first.
    """
    first: float | None = None
    k, tick = 0, 0.0
    some: list[Item] = []
    for item in items:
        arrival = arrival_of(item)
        if first is None:
            first = tick = arrival
        while tick < arrival:
            some.append(Tick(tick))
            yield some
            some = []
            k += 1
            tick = first + k / rate
        some.append(item)
    if first is not None:
        yield [*some, Tick(tick)]
