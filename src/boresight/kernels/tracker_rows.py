"""When rows of tracks are due, decided from the past alone, and the prediction of the shown tracks to these times."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from boresight.kernels.options import BARE, KERNEL
from boresight.kernels.tracker import HIDDEN, VISIBLE, IntArray, Models, Settings, Tracks
from boresight.kernels.tracker_copies import longer
from boresight.kernels.tracker_models import expected_noise
from boresight.types.sensor import FloatArray

ROW_INTERVAL = 0.1  # s: at most one row a track in this time
QUIET_INTERVAL = 0.4  # s: spacing of the rows ahead where no report is expected
LONGEST_GAP = 0.5  # s: so long may rows be missing when the next arrival is late
MOST_AHEAD = 100
GAPS_KEPT = 9
ARRIVAL, EMITTED, PENDING = 0, 1, 2


class Clock(NamedTuple):
    """What has arrived when."""

    now: FloatArray  # (3,) newest arrival (s), time of the newest row (s), whether rows are still due for the arrival
    last: FloatArray  # (S,) s, newest arrival of each sensor; -inf: none yet
    gaps: FloatArray  # (S, GAPS_KEPT) s, its last intervals, the newest last
    known: IntArray  # (S,) how many of them there are


class RowTable(NamedTuple):
    """Rows of tracks as columns, with room for more than there are."""

    used: IntArray  # (1,)
    t: FloatArray  # (N,)
    t_known: FloatArray  # (N,)
    birth: IntArray  # (N,)
    coasting: NDArray[np.bool_]  # (N,)
    position: FloatArray  # (N, d)
    velocity: FloatArray  # (N, d)
    covariance: FloatArray  # (N, d, d)


def row_table(size: int, d: int) -> RowTable:
    """Return an empty table with room for `size` rows."""
    return RowTable(
        np.zeros(1, np.int64), np.empty(size), np.empty(size), np.empty(size, np.int64), np.empty(size, np.bool_),
        np.empty((size, d)), np.empty((size, d)), np.empty((size, d, d)),
    )  # fmt: skip


def rows_with_room(rows: RowTable, size: int) -> RowTable:
    """Return the rows in arrays for at least `size` of them."""
    return rows._replace(
        **{name: longer(getattr(rows, name), int(rows.used[0]), size) for name in RowTable._fields[1:]}
    )


@njit(**BARE)
def note_arrival(clock: Clock, sensor: int, t_recv: float) -> None:
    """Remember that a look of `sensor` has come."""
    if t_recv > clock.last[sensor] > -math.inf:
        n = clock.known[sensor]
        if n == GAPS_KEPT:
            for i in range(n - 1):
                clock.gaps[sensor, i] = clock.gaps[sensor, i + 1]
            n -= 1
        clock.gaps[sensor, n] = t_recv - clock.last[sensor]
        clock.known[sensor] = n + 1
    clock.last[sensor] = t_recv
    clock.now[ARRIVAL] = max(clock.now[ARRIVAL], t_recv)
    clock.now[PENDING] = 1.0


@njit(**BARE)
def median_of(values: FloatArray, n: int) -> float:
    """Return the median of the first few values."""
    low, high = math.nan, math.nan  # the values of the two middle ranks
    for i in range(n):
        below, same = 0, 0
        for j in range(n):
            below += 1 if values[j] < values[i] else 0
            same += 1 if values[j] == values[i] else 0
        if below <= (n - 1) // 2 < below + same:
            low = values[i]
        if below <= n // 2 < below + same:
            high = values[i]
    return 0.5 * (low + high)


@njit(**BARE)
def next_expected(clock: Clock, period: FloatArray) -> float:
    """Return when the next look may be expected (s), inf for never.

    `period` (S,) is what each sensor declares; where it is NaN the median of its last intervals stands for it. A sensor
    that is not used has period 0.
    """
    now = clock.now[ARRIVAL]
    soonest = math.inf
    for i in range(len(period)):
        p = period[i]
        if math.isnan(p):
            p = median_of(clock.gaps[i], clock.known[i]) if clock.known[i] > 0 else 0.0
        if p > 0.0 and now < clock.last[i] + p < soonest:
            soonest = clock.last[i] + p
    return soonest


@njit(**BARE)
def shown_until(tr: Tracks, s: Settings) -> float:
    """Return the time (s) after which no track can be probable enough to be shown, if nothing comes in."""
    if s.hide_below <= 0.0:
        return math.inf
    until: float = tr.time[0] - s.survival_time * math.log(s.hide_below)
    return until


@njit(**KERNEL)
def times_due(tr: Tracks, s: Settings, clock: Clock, period: FloatArray, t_recv: float) -> int:
    """Return at how many times rows may be due for the newest arrival and from then until `t_recv` (s): not fewer.

    However long nothing comes in, there are none once no track can be shown any more.
    """
    now = clock.now[ARRIVAL]
    until = next_expected(clock, period)
    ahead = min((until - now) / QUIET_INTERVAL, 1.0 * MOST_AHEAD) if until < math.inf else 0.0
    late = (min(t_recv, shown_until(tr, s)) - now) / QUIET_INTERVAL if t_recv < math.inf else 0.0
    return int(ahead + max(late, 0.0)) + 4


@njit(**KERNEL)
def rows_at_arrival(
    tr: Tracks,
    s: Settings,
    clock: Clock,
    period: FloatArray,
    coast_after: float,
    rows: RowTable,
    models: Models | None,
) -> None:
    """Add the rows that the newest arrival calls for: now, and ahead while no report is expected.

    The times ahead depend on the past alone, so that a recording that ends here gives the same rows.
    """
    clock.now[PENDING] = 0.0
    now = clock.now[ARRIVAL]
    if now - clock.now[EMITTED] < ROW_INTERVAL:
        return
    add_rows(tr, s, now, now, coast_after, rows, models)
    clock.now[EMITTED] = now
    until = next_expected(clock, period)
    if until < math.inf:
        t = now + QUIET_INTERVAL
        for _ in range(MOST_AHEAD - 1):
            if t >= until:
                break
            add_rows(tr, s, t, now, coast_after, rows, models)
            clock.now[EMITTED] = t
            t += QUIET_INTERVAL


@njit(**BARE)
def rows_before(
    tr: Tracks,
    s: Settings,
    clock: Clock,
    t_recv: float,
    coast_after: float,
    rows: RowTable,
    models: Models | None,
) -> None:
    """Add the rows that are missing since the last one, the next arrival having been late."""
    until = shown_until(tr, s)
    while clock.now[EMITTED] > -math.inf and clock.now[EMITTED] + LONGEST_GAP < t_recv:
        if clock.now[EMITTED] > until:
            clock.now[EMITTED] = t_recv - LONGEST_GAP
            break
        clock.now[EMITTED] += QUIET_INTERVAL
        add_rows(tr, s, clock.now[EMITTED], clock.now[EMITTED], coast_after, rows, models)


@njit(**BARE)
def add_rows(
    tr: Tracks, s: Settings, t: float, t_known: float, coast_after: float, rows: RowTable, models: Models | None
) -> None:
    """Predict the shown tracks to time `t` (s) and add those that are still probable then; there must be room.

    The filter's place is that of the point that is reported; what is meant by the target's place lies `extent` from it.
    """
    d = s.d
    used = rows.used[0]
    dt = max(0.0, t - tr.time[0])
    survive = math.exp(-dt / s.survival_time)
    q3 = s.q * dt**3 / 3.0
    for i in range(tr.live[0]):
        if not (tr.life[i, 2] > 0.0 and survive * (tr.weight[i, VISIBLE] + tr.weight[i, HIDDEN]) >= s.hide_below):
            continue
        unheard = t - tr.life[i, 1]
        if unheard > s.hide_after:
            continue
        if models is not None:
            q3 = expected_noise(tr, i, s, models, dt) * dt**3 / 3.0
        rows.t[used] = t
        rows.t_known[used] = t_known
        rows.birth[used] = tr.birth[i]
        rows.coasting[used] = unheard > coast_after
        for a in range(d):
            rows.position[used, a] = tr.x[i, a] + dt * tr.x[i, d + a]
            rows.velocity[used, a] = tr.x[i, d + a]
            for b in range(d):
                cross = tr.P[i, a, d + b] + tr.P[i, b, d + a]
                rows.covariance[used, a, b] = tr.P[i, a, b] + dt * cross + dt * dt * tr.P[i, d + a, d + b]
            rows.covariance[used, a, a] += q3 + s.extent**2
        used += 1
    rows.used[0] = used
