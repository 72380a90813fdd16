"""When rows are written, and the prediction of tracks to now."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from boresight.kernels.tracker import HIDDEN, VISIBLE, Tracks
from boresight.tracking.core import Plan
from boresight.types import FloatArray

ROW_INTERVAL = 0.1  # s: at most one row a track in this time
QUIET_INTERVAL = 0.4  # s: spacing of the rows ahead where no report is expected
GAPS_KEPT = 9


@dataclass(slots=True, eq=False)
class Clock:
    """What has arrived when: decides at which times rows are due, from the past alone."""

    arrival: float = -np.inf  # s, the newest time of arrival
    emitted: float = -np.inf  # s, time of the newest row
    last: dict[int, float] = field(default_factory=dict)  # sensor -> newest arrival
    gaps: dict[int, list[float]] = field(default_factory=dict)  # sensor -> its last intervals


def note_arrival(clock: Clock, sensor: int, t_recv: float) -> None:
    """Remember that a look of `sensor` has come."""
    if sensor in clock.last and t_recv > clock.last[sensor]:
        gaps = clock.gaps.setdefault(sensor, [])
        gaps.append(t_recv - clock.last[sensor])
        del gaps[:-GAPS_KEPT]
    clock.last[sensor] = t_recv
    clock.arrival = max(clock.arrival, t_recv)


def period_of(clock: Clock, sensor: int, declared: float | None) -> float | None:
    """Return the declared period of a sensor, else the median of its last intervals."""
    if declared is not None:
        return declared
    gaps = clock.gaps.get(sensor)
    return float(np.median(gaps)) if gaps else None


def due_at_arrival(clock: Clock, periods: dict[int, float | None]) -> list[float]:
    """Return the times of the rows that the newest arrival calls for: now, and ahead while no report is expected.

    The times ahead depend on the past alone, so that a recording that ends here gives the same rows.
    """
    now = clock.arrival
    if now - clock.emitted < ROW_INTERVAL:
        return []
    expected = [clock.last[s] + p for s, p in periods.items() if p and s in clock.last and clock.last[s] + p > now]
    times = [now]
    if expected:
        until = min(expected)
        ahead = now + QUIET_INTERVAL
        while ahead < until and len(times) < 100:
            times.append(ahead)
            ahead += QUIET_INTERVAL
    clock.emitted = times[-1]
    return times


def due_before(clock: Clock, t_recv: float) -> list[float]:
    """Return the times at which rows are missing since the last one, the next arrival having been late."""
    times = []
    while np.isfinite(clock.emitted) and clock.emitted + 0.5 < t_recv:
        clock.emitted += QUIET_INTERVAL
        times.append(clock.emitted)
    return times


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Rows of tracks.parquet as columns; `birth` is the detection that began the track."""

    t: FloatArray
    t_known: FloatArray
    track_id: NDArray[np.int64]
    birth: NDArray[np.int64]
    coasting: np.ndarray
    position: FloatArray  # (n, d)
    velocity: FloatArray  # (n, d)
    covariance: FloatArray  # (n, d, d)

    def select(self, keep: NDArray[np.bool_], names: Mapping[int, int]) -> Rows:
        """Return the rows of `keep` (n,), with the track ids that `names` gives their births."""
        parts = {name: getattr(self, name)[keep] for name in self.__dataclass_fields__}
        parts["track_id"] = np.array([names[int(b)] for b in parts["birth"]], dtype=np.int64)
        return Rows(**parts)


def rows_at(tr: Tracks, plan: Plan, t: float, t_known: float, coast_after: float) -> Rows | None:
    """Predict the shown tracks to time `t` (s), those that are still probable then; None where there is none."""
    n = int(tr.live[0])
    d = plan.settings.d
    dt = max(0.0, t - float(tr.time[0]))
    survive = math.exp(-dt / plan.settings.survival_time)
    target = survive * (tr.weight[:n, VISIBLE] + tr.weight[:n, HIDDEN])
    shown = np.nonzero((tr.life[:n, 2] > 0.0) & (target >= plan.settings.hide_below))[0]
    if len(shown) == 0:
        return None
    x, P = tr.x[shown], tr.P[shown]
    pos, vel = slice(0, d), slice(d, 2 * d)
    cross = P[:, pos, vel]
    covariance = P[:, pos, pos] + dt * (cross + cross.transpose(0, 2, 1)) + dt**2 * P[:, vel, vel]
    covariance = covariance + np.eye(d) * (plan.settings.q * dt**3 / 3.0)
    return Rows(
        t=np.full(len(shown), t),
        t_known=np.full(len(shown), t_known),
        track_id=np.zeros(len(shown), np.int64),  # numbered by the tracker
        birth=tr.birth[shown].copy(),
        coasting=float(tr.time[0]) - tr.life[shown, 1] > coast_after,
        position=x[:, pos] + dt * x[:, vel],
        velocity=x[:, vel].copy(),
        covariance=covariance,
    )
