"""The one loop: items come from a source in order of arrival, an estimator takes them, sinks take what it gives.

Nothing here knows a clock, a file or a socket. A file replays the arrivals that were recorded; a live source stamps
what comes with its own clock. The same items in the same order give the same bits, wherever they come from.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple, Protocol, TypeVar

from boresight.io.jsonlines import Fix
from boresight.pointing.reports import Report
from boresight.types import Scan

S = TypeVar("S")
O_co = TypeVar("O_co", covariant=True)
O_contra = TypeVar("O_contra", contravariant=True)


class Tick(NamedTuple):
    """A moment at which nothing need have arrived: what is due by then is given out."""

    t_recv: float  # s


# Each carries its validity (`t`, of a scan `t_look`) and its arrival (`t_recv`); several reports are of one look.
Item = Scan | Fix | Report | Tick | tuple[Report, ...]


class Source(Protocol):
    """Items in order of arrival, in portions: what is taken in one step."""

    def __iter__(self) -> Iterator[Sequence[Item]]: ...


class Estimator(Protocol[S, O_co]):
    """Frozen configuration; `step` and `finish` consume the state they are given."""

    def init(self) -> S:
        """Return the state before the first item."""
        ...

    def step(self, state: S, items: Sequence[Item]) -> tuple[S, O_co]:
        """Take items in order of arrival; how they are portioned makes no difference to what comes out in the end."""
        ...

    def finish(self, state: S) -> tuple[S, O_co]:
        """Give what is left when no more items come."""
        ...


class Sink(Protocol[O_contra]):
    """Takes what an estimator gives; a sink that cannot deliver counts that, and raises nothing."""

    def take(self, output: O_contra) -> None:
        """Take the output of one step."""
        ...


def run(
    source: Iterable[Sequence[Item]],
    estimator: Estimator[S, Any],
    sinks: Sequence[Sink[Any]] = (),
    state: S | None = None,
    *,
    finish: bool = True,
) -> S:
    """Take all items of a source through an estimator, from `state` (a fresh one); consumes it, returns the last."""
    now = estimator.init() if state is None else state
    for items in source:
        now, output = estimator.step(now, items)
        for sink in sinks:
            sink.take(output)
    if finish:
        now, output = estimator.finish(now)
        for sink in sinks:
            sink.take(output)
    return now
