"""Late reports: a window of the recent past is kept, rewound to a late report's time, and replayed in order.

Within the window the result is that of processing in order of time, whatever the order of arrival; reports older than
the window are counted and left out.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

from boresight.errors import UserError
from boresight.filters.protocol import Filter
from boresight.models.protocols import MeasurementModel, MotionModel
from boresight.types.sensor import FloatArray

S = TypeVar("S")


class Report(NamedTuple):
    """One report: time of validity (s), the sensor at its pose at that time, the measurement (m,)."""

    t: float
    sensor: MeasurementModel
    z: FloatArray


class WindowState(NamedTuple):
    """The filter's state after the newest report, and what is needed to go back."""

    state: Any  # of the filter, after the report with the latest time
    base: Any  # of the filter, before the first report of the window
    reports: tuple[Report, ...]  # of the window, by time
    states: tuple[Any, ...]  # after each of them
    too_late: int  # reports older than the window, left out


class Fate(NamedTuple):
    """What became of one report."""

    used: bool
    replayed: int  # reports that were processed again


@dataclass(frozen=True, slots=True)
class LateReports(Generic[S]):
    """Any filter, made to take reports in any order of arrival within `window` seconds of the newest.

    Reports of exactly one time are processed in order of arrival, which moves a nonlinear filter's result by what its
    linearisation does. Raises UserError for a window that is not positive.
    """

    filter: Filter[S]
    motion: MotionModel
    window: float = 5.0

    def __post_init__(self) -> None:
        if not self.window > 0.0 or not math.isfinite(self.window):
            raise UserError(f"window must be a positive number of seconds, not {self.window!r}")

    def init(self, state: S) -> WindowState:
        """Begin from a state of the filter."""
        return WindowState(state, state, (), (), 0)

    def update(self, now: WindowState, t: float, sensor: MeasurementModel, z: FloatArray) -> tuple[WindowState, Fate]:
        """Take one report of any age; raises UserError as the filter does."""
        newest = now.reports[-1].t if now.reports else now.base.t
        if t < max(newest - self.window, now.base.t):
            return now._replace(too_late=now.too_late + 1), Fate(False, 0)
        at = bisect_right([r.t for r in now.reports], t)
        reports = (*now.reports[:at], Report(t, sensor, z), *now.reports[at:])
        states = list(now.states[:at])
        state = states[-1] if states else now.base
        for report in reports[at:]:
            state = self.filter.predict(state, self.motion, report.t)
            state, _ = self.filter.update(state, report.sensor, report.z)
            states.append(state)
        gone = 0  # reports that have left the window; the state after the last of them is the new base
        while gone < len(reports) and reports[gone].t < reports[-1].t - self.window:
            gone += 1
        base = states[gone - 1] if gone else now.base
        return (
            WindowState(state, base, reports[gone:], tuple(states[gone:]), now.too_late),
            Fate(True, len(reports) - at - 1),
        )
