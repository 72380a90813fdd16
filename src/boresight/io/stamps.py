"""What is wrong with stamps: wild ones, other units and epochs, clocks set back, logs laid end to end, offsets.

Pure functions on columns. A stamp that would make the reports after it late is worth less than they are: it is refused.
Everything else is said, with its likely cause and the remedy, and left as it is.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.types import FloatArray, Sensor

IntArray = NDArray[np.int64]
FEW = 0.05  # of a sensor's reports may be wild; more are another clock
LEAST_JUMP = 10.0  # s
FAR = 1800.0  # s: an outermost stamp further off than this, and than ten times what the rest spans, is wild
BEHIND = 600.0  # s: a report stamped further before those around it is wild, not late
LARGEST = 1e11  # s: no date
ANOTHER_EPOCH = 1e6  # s
LONGEST_DELAY = 600.0  # s between stamp and arrival; more is another clock
MOST_PARTS = 3000  # of one sensor's stamps between jumps; more is no clock at all
MOST_COMPARED = 5000  # rows of a sensor whose offset is looked at
AROUND = 5  # rows of other sensors before and after, to compare a stamp with
UNIX = (9.4e8, 4.2e9)  # s: 1999 to 2103
UNITS = {"milliseconds": 1e3, "microseconds": 1e6, "nanoseconds": 1e9}
UNIT_WORD = {"milliseconds": "ms", "microseconds": "us", "nanoseconds": "ns"}
DAY, WEEK = 86400.0, 604800.0
OFFSETS: dict[float, str] = {  # s: what two clocks differ by, and why
    18.0: "GPS time against UTC (18 s since 2017)",
    19.0: "TAI against GPS time",
    37.0: "TAI against UTC",
    315964782.0: "seconds since the GPS epoch of 1980 against Unix time",
    315964800.0: "seconds since 1980 against Unix time",
    946684800.0: "seconds since 2000 against Unix time",
    946728000.0: "seconds since J2000 against Unix time",
    978307200.0: "seconds since 2001 against Unix time",
    2208988800.0: "seconds since 1900 (NTP) against Unix time",
}


class Finding(NamedTuple):
    """One thing that is wrong with the stamps of one sensor."""

    sensor: str
    column: str  # t_s or t_recv_s
    cause: str  # wild | unit | epoch | midnight | week | set_back | end_to_end | offset | arrival …
    rows: int  # of the sensor that it concerns
    offset: float  # s, to add to the stamps to mend it; NaN where that would not
    text: str


@dataclass(slots=True)
class Stamps:
    """What to make of stamps: arrival of each row (n,) (s), rows that are refused with the reason, what is wrong."""

    arrival: FloatArray
    place: Callable[[int], str] = "row {}".format
    refused: dict[int, str] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)


def examine(
    t: FloatArray,
    recv: FloatArray,
    sensor: IntArray,
    scan: IntArray,
    sensors: Sequence[Sensor],
    others: Sequence[tuple[str, float, float]] = (),
    place: Callable[[int], str] = "row {}".format,
) -> Stamps:
    """Return what to make of the stamps of detections, in the order of their file.

    Args:
        t: (n,) validity (s).
        recv: (n,) arrival (s), NaN where it is not given.
        sensor: (n,) index into `sensors`.
        scan: (n,) numbers of the looks.
        sensors: their declarations.
        others: name, first and last stamp (s) of platforms and targets, which tell the epoch.
        place: names a row in words.
    """
    out = Stamps(np.zeros(len(t)), place)
    jump = np.array([_jump(t, scan, np.flatnonzero(sensor == i), s.period) for i, s in enumerate(sensors)])
    good = np.ones(len(t), dtype=bool)
    end_to_end = _laid_end_to_end(t, sensor, jump) if np.isnan(recv).all() else []
    for i in range(len(sensors)):
        _refuse(out, good, t, _wild(t, np.flatnonzero(sensor == i), jump[i]), sensors, sensor)
    if len(sensors) > 1 and not end_to_end:
        _refuse(out, good, t, _unlike_others(t, sensor, jump, good), sensors, sensor)
    _refuse(out, good, t, _outermost(t, good, others), sensors, sensor)
    _tell_wild(out, sensor, sensors)
    units = _units(out, t, scan, sensor, good, sensors)
    epochs = _epochs(out, good, t, recv, sensor, sensors, others, set(units), bool(end_to_end))
    for i, s in enumerate(sensors):
        if i not in units:
            _set_back(out, t, np.flatnonzero((sensor == i) & good), jump[i], s)
    for i in end_to_end:
        rows = int((sensor == i).sum())
        text = "its rows stand after other sensors' of the same time, without t_recv_s: logs laid end to end"
        _say(out, sensors[i], "t_s", "end_to_end", rows, math.nan, f"{text}; all rows are merged by stamp")
    arrival = _arrival(out, t, recv, sensor, good, sensors, jump, bool(end_to_end))
    if not end_to_end and not units and not epochs:
        _offsets(out, t, arrival, sensor, good, sensors, jump)
    out.arrival = arrival
    return out


def _say(out: Stamps, sensor: Sensor, column: str, cause: str, rows: int, offset: float, text: str) -> None:
    out.findings.append(Finding(sensor.id, column, cause, rows, offset, f"{sensor.id}: {column}: {text}"))


def _refuse(
    out: Stamps,
    good: NDArray[np.bool_],
    t: FloatArray,
    why: dict[int, str],
    sensors: Sequence[Sensor],
    sensor: IntArray,
) -> None:
    for row, reason in why.items():
        if good[row]:
            good[row] = False
            out.refused[row] = f"its stamp t_s = {t[row]:.10g}{_date(t[row])} is wild: {reason}"


def _tell_wild(out: Stamps, sensor: IntArray, sensors: Sequence[Sensor]) -> None:
    for i, s in enumerate(sensors):
        rows = [row for row in out.refused if sensor[row] == i]
        if rows:
            more = f"; {len(rows)} such rows in all" if len(rows) > 1 else ""
            text = f"{out.place(rows[0])} is refused: {out.refused[rows[0]]}{more}"
            _say(out, s, "t_s", "wild", len(rows), math.nan, text)


def _date(t: float) -> str:
    """Unix seconds as a date in brackets, where they may be some."""
    if not UNIX[0] <= t <= UNIX[1]:
        return ""
    return f" ({datetime.fromtimestamp(t, UTC).strftime('%Y-%m-%d %H:%M:%S')} UTC)"


def _jump(t: FloatArray, scan: IntArray, rows: IntArray, period: float | None) -> float:
    """From which step on (s) the stamps of one sensor are not those of one running clock."""
    if len(rows) < 2:
        return LEAST_JUMP
    number, first, looks = np.unique(scan[rows], return_index=True, return_inverse=True)
    order = np.argsort(first)
    moment = _medians(t[rows], looks)[order]
    steps = np.abs(np.diff(moment))
    steps = steps[steps > 0.0]
    step = float(np.median(steps)) if len(steps) else 0.0
    low, high = np.full(len(number), np.inf), np.full(len(number), -np.inf)
    np.minimum.at(low, looks, t[rows])
    np.maximum.at(high, looks, t[rows])
    spans = high - low
    span = float(np.median(spans)) if len(number) >= 4 else 0.0
    # a step in another unit than the declared period must not make the jump too short
    return max(LEAST_JUMP, 5.0 * step, 3.0 * span, 3.0 * min(period or 0.0, 100.0 * step))


def _medians(values: FloatArray, group: IntArray) -> FloatArray:
    order = np.lexsort((values, group))
    cuts = np.flatnonzero(np.r_[True, np.diff(group[order]) != 0, True])
    middle = (cuts[:-1] + cuts[1:] - 1) // 2
    return np.asarray(values[order][middle], dtype=np.float64)


def _wild(t: FloatArray, rows: IntArray, jump: float) -> dict[int, str]:
    """Few reports of one sensor stamped so far from those around them that the order of arrival contradicts it."""
    mine = t[rows]
    if len(rows) < 4 or not (np.diff(mine) < -jump).any():
        return {}
    cuts = np.r_[0, np.flatnonzero(np.abs(np.diff(mine)) > jump) + 1, len(mine)]
    k = len(cuts) - 1
    if k > MOST_PARTS:
        return {}
    begin, end = np.minimum.reduceat(mine, cuts[:-1]), np.maximum.reduceat(mine, cuts[:-1])
    size = np.diff(cuts)
    best, before = size.astype(np.float64), np.full(k, -1)
    for j in range(1, k):  # the heaviest sequence of parts that a running clock could have stamped
        fits = np.flatnonzero(begin[j] >= end[:j] - jump)
        if len(fits):
            gap = np.maximum(begin[j] - end[fits], 0.0)
            worth = best[fits] - 1e-4 * np.log1p(gap)  # of two as heavy that with the shorter silences
            best[j] += worth.max()
            i = fits[np.argmax(worth)]
            before[j] = i
    kept = []
    j = int(np.argmax(best))
    while j >= 0:
        kept.append(j)
        j = int(before[j])
    kept.reverse()
    odd = [j for j in range(k) if j not in set(kept)]
    if size[odd].sum() > max(FEW * len(rows), 1.0) or len(odd) == 0:
        return {}
    out: dict[int, str] = {}
    for j in odd:
        after, until = [i for i in kept if i > j], [i for i in kept if i < j]
        near = begin[after[0]] if after else end[until[-1]]
        ahead = bool(after) and begin[j] > near
        off = float(begin[j] - near)
        if ahead or abs(off) > BEHIND:
            side = "after" if off > 0 else "before"
            for row in rows[cuts[j] : cuts[j + 1]].tolist():
                out[row] = f"{_seconds(abs(float(t[row] - near)))} {side} the stamps around it"
    return out


def _seconds(value: float) -> str:
    if value < 7200.0:
        return f"{value:.6g} s"
    if value < 2.0 * DAY:
        return f"{value / 3600.0:.3g} h"
    return f"{value / DAY:.4g} days"


def _reference(
    t: FloatArray, sensor: IntArray, good: NDArray[np.bool_], i: int, rows: IntArray, around: int = AROUND
) -> tuple[FloatArray, FloatArray]:
    """The median stamps of the few rows of other sensors before, and of those after, each of `rows` in the file."""
    other = np.flatnonzero(good & (sensor != i))
    if not len(other):
        return np.full(len(rows), np.nan), np.full(len(rows), np.nan)
    at = np.searchsorted(other, rows)[:, None]
    before, after = (
        np.asarray(np.median(t[other[np.clip(at + near, 0, len(other) - 1)]], axis=1))
        for near in (np.arange(-around, 0), np.arange(around))
    )
    return before, after


def _unlike_others(t: FloatArray, sensor: IntArray, jump: FloatArray, good: NDArray[np.bool_]) -> dict[int, str]:
    """Few reports of a sensor that differ from the other sensors' around them by far more than its others do."""
    out: dict[int, str] = {}
    for i in range(len(jump)):
        rows = np.flatnonzero(good & (sensor == i))
        if len(rows) < 4:
            continue
        limit = jump[i] + float(np.max(jump[np.arange(len(jump)) != i])) + BEHIND
        before, after = _reference(t, sensor, good, i, rows, 1)
        near = np.stack([t[rows] - before, t[rows] - after])
        middle = float(np.median(near))
        rows = rows[(np.abs(near - middle) > limit).any(axis=0)]  # most are not: the rest is looked at closely
        if not len(rows) > 0:
            continue
        n = near.shape[1]
        before, after = _reference(t, sensor, good, i, rows)
        off = t[rows] - 0.5 * (before + after)
        apart = 0.5 * np.abs(after - before)  # where all clocks jump, a stamp on either side is right
        odd = np.flatnonzero(np.abs(off - middle) > limit + apart)
        if 0 < len(odd) <= max(FEW * n, 1.0):
            for k in odd.tolist():
                side = "after" if off[k] > middle else "before"
                far = _seconds(abs(float(off[k] - middle)))
                out[int(rows[k])] = f"{far} {side} what the other sensors say around it"
    return out


def _outermost(t: FloatArray, good: NDArray[np.bool_], others: Sequence[tuple[str, float, float]]) -> dict[int, str]:
    """The few first or last stamps of all, far from the rest and from navigation and truth."""
    rows = np.flatnonzero(good)
    if len(rows) < 4:
        return {}
    order = rows[np.argsort(t[rows], kind="stable")]
    few = max(int(0.01 * len(rows)), min(3, len(rows) // 4))
    out: dict[int, str] = {}
    for head in (True, False):
        for n in range(few, 0, -1):
            odd, rest = (order[:n], order[n:]) if head else (order[-n:], order[:-n])
            spans = float(t[rest[-1]] - t[rest[0]])
            gap = float(t[rest[0]] - t[odd[-1]] if head else t[odd[0]] - t[rest[-1]])
            inside = any(low - FAR <= t[row] <= high + FAR for _, low, high in others for row in odd.tolist())
            if gap > max(FAR, 10.0 * spans) and not inside:
                side = "before" if head else "after"
                near = t[rest[0]] if head else t[rest[-1]]
                for row in odd.tolist():
                    out[row] = f"{_seconds(abs(float(t[row] - near)))} {side} all others"
                break
    return out


def _look_step(t: FloatArray, scan: IntArray, rows: IntArray) -> float:
    _, first, looks = np.unique(scan[rows], return_index=True, return_inverse=True)
    steps = np.abs(np.diff(_medians(t[rows], looks)[np.argsort(first)]))
    steps = steps[steps > 0.0]
    return float(np.median(steps)) if len(steps) else math.nan


def _units(
    out: Stamps, t: FloatArray, scan: IntArray, sensor: IntArray, good: NDArray[np.bool_], sensors: Sequence[Sensor]
) -> list[int]:
    """Sensors whose stamps are not seconds: too large for a date, or looks thousands of periods apart."""
    found = []
    for i, s in enumerate(sensors):
        rows = np.flatnonzero(good & (sensor == i))
        if not len(rows):
            continue
        middle, step = float(np.median(np.abs(t[rows]))), _look_step(t, scan, rows)
        word = next((w for w, f in UNITS.items() if UNIX[0] * f <= middle <= UNIX[1] * f), None)
        why = "" if word is None else f": as seconds they lie in the year {middle / DAY / 365.25 + 1970:.0f}"
        if word is not None and middle < LARGEST:
            word = None
        if word is None and s.period is not None and math.isfinite(step):
            word = next((w for w, f in UNITS.items() if 0.5 <= step / (s.period * f) <= 2.0), None)
            why = f": looks are {step:.6g} apart, the declared period is {s.period:g} s"
        if word is None and middle <= LARGEST:
            continue
        found.append(i)
        rule, mend = "these are too large for seconds", "import with --time-unit (boresight import csv)"
        if word is not None:
            rule = f"these look like {word}{why}"
            mend = f"import with --time-unit {UNIT_WORD[word]} (boresight import csv), or divide by {UNITS[word]:g}"
        if middle > LARGEST:
            mend = f"not used: {mend}"
            for row in rows.tolist():
                unit = "too large for seconds" if word is None else f"in {word}"
                out.refused[row] = f"its stamp t_s = {t[row]:.10g} is {unit}"
                good[row] = False
        _say(out, s, "t_s", "unit", len(rows), math.nan, f"{rule}; {mend}")
    return found


def _epochs(
    out: Stamps,
    good: NDArray[np.bool_],
    t: FloatArray,
    recv: FloatArray,
    sensor: IntArray,
    sensors: Sequence[Sensor],
    others: Sequence[tuple[str, float, float]],
    units: set[int],
    end_to_end: bool,
) -> list[int]:
    """Rows stamped in another epoch than the rest: refused, with the offset that would mend them."""
    rows = np.flatnonzero(good & ~np.isin(sensor, list(units)))
    if not len(rows):
        return []
    order = rows[np.argsort(t[rows], kind="stable")]
    cuts = np.r_[0, np.flatnonzero(np.diff(t[order]) > ANOTHER_EPOCH) + 1, len(order)]
    if len(cuts) == 2:
        return _apart(out, t, order, sensor, sensors, others)
    groups = [order[a:b] for a, b in itertools.pairwise(cuts.tolist())]
    main = max(groups, key=lambda g: (_known(t[g], others), UNIX[0] <= t[g[0]] <= UNIX[1], len(g)))
    found = []
    for group in groups:
        if group is main:
            continue
        for i in np.unique(sensor[group]).tolist():
            mine = np.sort(group[sensor[group] == i])
            found.append(i)
            offset = _exact(_epoch_offset(t, recv, sensor, main, mine, i, end_to_end))
            low, high = float(t[mine].min()), float(t[mine].max())
            cause = _why(offset) or ("since the device was switched on, or of the day" if abs(low) < 1e7 else "")
            cause = f" ({cause})" if cause else ""
            whole = len(mine) == int(((sensor == i) & good).sum())
            which = "its" if whole else f"{len(mine)} of its {int((sensor == i).sum())}"
            text = (
                f"{which} stamps ({low:.10g} … {high:.10g} s) count from another epoch than the others{cause}; "
                f"not used: add about {offset:.10g} s "
                f"(boresight import csv --time-offset {sensors[i].id}={offset:.10g})"
            )
            _say(out, sensors[i], "t_s", "epoch", len(mine), offset, text)
            for row in mine.tolist():
                good[row] = False
                out.refused[row] = f"its stamp t_s = {t[row]:.10g} counts from another epoch than the others"
    return found


def _known(t: FloatArray, others: Sequence[tuple[str, float, float]]) -> bool:
    return any(high >= t.min() - FAR and low <= t.max() + FAR for _, low, high in others)


def _apart(
    out: Stamps,
    t: FloatArray,
    order: IntArray,
    sensor: IntArray,
    sensors: Sequence[Sensor],
    others: Sequence[tuple[str, float, float]],
) -> list[int]:
    """Say where all detections lie in another epoch than navigation or truth."""
    low, high = float(t[order[0]]), float(t[order[-1]])
    for name, first, last in others:
        if first - high > ANOTHER_EPOCH or low - last > ANOTHER_EPOCH:
            offset = first - low
            cause = f" ({why})" if (why := _why(offset)) else ""
            text = f"the detections ({low:.10g} … {high:.10g} s) count from another epoch than {name} ({first:.10g} …"
            text += f" {last:.10g} s){cause}; add about {offset:.10g} s to one of them"
            out.findings.append(Finding("", "t_s", "epoch", len(order), offset, text))
    return []


def _epoch_offset(
    t: FloatArray, recv: FloatArray, sensor: IntArray, main: IntArray, mine: IntArray, i: int, end_to_end: bool
) -> float:
    """What to add to the stamps of `mine` (s): by arrival, else by the rows around them in the file."""
    known = mine[np.isfinite(recv[mine])]
    by_main = main[np.isfinite(recv[main])]
    if len(known) and len(by_main):
        delay = float(np.median(recv[by_main] - t[by_main]))
        if abs(delay) < LONGEST_DELAY:
            return float(np.median(recv[known] - t[known])) - delay
    if end_to_end:
        return float(t[main].min() - t[mine].min())
    within = np.zeros(len(t), dtype=bool)
    within[main] = True
    before, after = _reference(t, np.where(within, -1, i), within, i, mine)
    return float(np.median(0.5 * (before + after) - t[mine]))


def _why(offset: float, within: float = 0.6) -> str:
    """The usual reason for two clocks to differ by so much (s), known to `within` s; an empty string for none."""
    size = abs(offset)
    for known, why in OFFSETS.items():
        if abs(size - known) < (min(within, 3.0) if known < 100.0 else 25.0):
            return why
    quarter = size / 900.0
    if size < 15.0 * 3600.0 and round(quarter) > 0 and abs(size - 900.0 * round(quarter)) < 3.0:
        return "a time zone"
    return ""


def _exact(offset: float) -> float:
    """An offset (s), made that of two known clocks where it is as near as steps between reports allow."""
    known = next((k for k in OFFSETS if abs(abs(offset) - k) < (0.6 if k < 100.0 else 3.0)), abs(offset))
    return math.copysign(known, offset)


def _set_back(out: Stamps, t: FloatArray, rows: IntArray, jump: float, sensor: Sensor) -> None:
    """Say where the clock of one sensor steps back for good."""
    mine = t[rows]
    if len(rows) < 2:
        return
    newest = np.maximum.accumulate(mine)
    back = np.flatnonzero((np.diff(mine) < -jump) & (newest[:-1] - mine[1:] > jump))
    if not len(back):
        return
    # one late report steps back too, but the next goes on where the last stopped
    real = [k for k in back.tolist() if float(np.median(mine[k + 1 : k + 6])) < newest[k] - jump]
    if not real:
        return
    k = real[0]
    forward = np.diff(mine)
    step = float(mine[k] - mine[k + 1]) + float(np.median(forward[forward > 0.0])) if (forward > 0.0).any() else 0.0
    lost = int((mine < newest - jump).sum())
    cause, words = "set_back", f"its clock was set back by {step:.6g} s (or two logs laid end to end)"
    for span, name, what in ((DAY, "midnight", "seconds of the day that pass midnight"), (WEEK, "week", "of the week")):
        if abs(step - span) < 3.0 * jump:
            cause, step = name, span
            words = f"it steps back by {span:g} s: {what}" if name == "midnight" else f"it steps back: seconds {what}"
    wraps = {
        2.0**32 / 1e3: "32 bits of milliseconds",
        2.0**32 / 1e6: "32 bits of microseconds",
        65.536: "16 bits of ms",
    }
    for span, name in wraps.items():
        if abs(step - span) < 0.3 * jump and span > 4.0 * jump:
            cause, words = "wrap", f"it steps back by {span:.6g} s: {name} that overflow"
            step = span
    unit = {"midnight": " (boresight import csv --time-unit s-of-day does it)", "week": " (--time-unit s-of-week)"}
    times = f" and at {len(real) - 1} more" if len(real) > 1 else ""
    text = (
        f"{words}, at {out.place(int(rows[k + 1]))}{times}; {lost} of its {len(rows)} rows come behind newer ones "
        f"and are late: add {step:.6g} s from there on{unit.get(cause, '')}"
    )
    _say(out, sensor, "t_s", cause, lost, step, text)


def _laid_end_to_end(t: FloatArray, sensor: IntArray, jump: FloatArray) -> list[int]:
    """Sensors whose rows stand behind a whole block of others' rows of the same time."""
    cuts = np.r_[0, np.flatnonzero(np.diff(sensor) != 0) + 1, len(sensor)]
    if len(cuts) < 3:
        return []
    first = cuts[:-1]
    low, high = np.minimum.reduceat(t, first), np.maximum.reduceat(t, first)
    span = high - low
    who = sensor[first]
    found: list[int] = []
    for j in range(1, len(first)):
        back = float(high[j - 1] - low[j])
        limit = max(float(jump[who[j]]), float(jump[who[j - 1]]))
        overlap = min(float(high[j] - low[j]), float(high[j - 1] - low[j - 1]))
        if back > limit and span[j - 1] >= 0.5 * back and overlap > limit and int(who[j]) not in found:
            found.append(int(who[j]))
    return found


def _arrival(
    out: Stamps,
    t: FloatArray,
    recv: FloatArray,
    sensor: IntArray,
    good: NDArray[np.bool_],
    sensors: Sequence[Sensor],
    jump: FloatArray,
    end_to_end: bool,
) -> FloatArray:
    """The arrival of every row (s): as given where that can be, else the newest stamp so far in the file."""
    n = len(t)
    given = np.isfinite(recv)
    if end_to_end:
        arrival = np.zeros(n)
        for i in range(len(sensors)):
            rows = np.flatnonzero(sensor == i)
            arrival[rows] = newest(t[rows], good[rows])
        return arrival
    so_far = newest(t, good)
    if not given.any():
        return so_far
    use = given & good
    if use.any():
        given &= ~_wrong_arrivals(out, t, recv, sensor, use, sensors, jump)
    arrival = np.where(given, recv, np.nan)
    if not given.any():
        return so_far
    full = given[good].all()
    if full:  # the times of arrival order the reports, whatever the order of the file
        return np.where(given, arrival, np.interp(np.arange(n), np.flatnonzero(given), arrival[given]))
    # a row without one comes with the newest before it
    late = np.where(given, arrival, -np.inf)
    held = np.maximum.accumulate(late)
    return np.maximum.accumulate(np.where(given, arrival, np.maximum(held, so_far)))


def newest(t: FloatArray, good: NDArray[np.bool_]) -> FloatArray:
    """The running maximum of the good stamps; before the first of them, that."""
    if not good.any():
        return np.maximum.accumulate(t)
    out = np.maximum.accumulate(np.where(good, t, -np.inf))
    return np.where(np.isfinite(out), out, t[good][0])


def _wrong_arrivals(
    out: Stamps,
    t: FloatArray,
    recv: FloatArray,
    sensor: IntArray,
    use: NDArray[np.bool_],
    sensors: Sequence[Sensor],
    jump: FloatArray,
) -> NDArray[np.bool_]:
    """Rows whose t_recv_s cannot be, which are taken as arriving with their neighbours in the file."""
    wrong = np.zeros(len(t), dtype=bool)
    delay = recv - t
    for i, s in enumerate(sensors):
        rows = np.flatnonzero(use & (sensor == i))
        if not len(rows):
            continue
        middle = float(np.median(delay[rows]))
        if abs(middle) > LONGEST_DELAY:
            wrong[(sensor == i) & np.isfinite(recv)] = True
            ratio = float(np.median(recv[rows])) / max(abs(float(np.median(t[rows]))), 1e-9)
            unit = next((w for w, f in UNITS.items() if abs(ratio / f - 1.0) < 1e-3), None)
            why = _why(middle)
            cause = unit or why or "another epoch or unit than t_s"
            text = f"arrival lies {middle:.10g} s from t_s in the median: {cause}. It is not used: rows arrive in"
            text += " the order of the file, with the newest stamp so far"
            _say(out, s, "t_recv_s", "arrival", len(rows), -middle, text)
            continue
        limit = max(LONGEST_DELAY, 20.0 * float(np.median(np.abs(delay[rows] - middle))))
        odd = rows[np.abs(delay[rows] - middle) > limit]
        # late by much is no fault of the stamps when the arrivals around agree with it
        if len(odd):
            near = recv[rows]
            k = np.searchsorted(rows, odd)
            before, after = near[np.maximum(k - 1, 0)], near[np.minimum(k + 1, len(near) - 1)]
            agree = (recv[odd] >= np.minimum(before, after) - jump[i]) & (
                recv[odd] <= np.maximum(before, after) + jump[i]
            )
            odd = odd[~agree]
        if len(odd):
            wrong[odd] = True
            row = int(odd[0])
            text = (
                f"{len(odd)} of {len(rows)} are wild, the first at {out.place(row)}: {recv[row]:.10g} s for a stamp of "
            )
            _say(
                out,
                s,
                "t_recv_s",
                "wild",
                len(odd),
                math.nan,
                f"{text}{t[row]:.10g} s; they arrive with their neighbours",
            )
            continue
        why = _why(middle, 1.0)
        if middle < -max(1.0, 0.05 * jump[i]):
            wrong[(sensor == i) & np.isfinite(recv)] = True
            cause = why or "one of the two clocks is wrong"
            text = (
                f"reports arrive {-middle:.6g} s before they are valid (median): {cause}. It is not used: rows arrive"
            )
            text += " in the order of the file, with the newest stamp so far"
            _say(out, s, "t_recv_s", "arrival_before", len(rows), -middle, text)
        elif middle > 5.0 and why:
            text = f"reports arrive {middle:.6g} s after they are valid (median): {why}? If so, subtract it"
            _say(out, s, "t_recv_s", "arrival_after", len(rows), -middle, text)
    return wrong


def _offsets(
    out: Stamps,
    t: FloatArray,
    arrival: FloatArray,
    sensor: IntArray,
    good: NDArray[np.bool_],
    sensors: Sequence[Sensor],
    jump: FloatArray,
) -> None:
    """Name constant offsets between sensors: the order of arrival tells them, or the two ends."""
    order = np.flatnonzero(good)
    order = order[np.argsort(arrival[order], kind="stable")]
    present = [i for i in range(len(sensors)) if (sensor[order] == i).sum() >= 4]
    if len(present) < 2:
        return
    latency = np.array([s.latency for s in sensors])
    true = t - latency[sensor]
    sorted_t, sorted_sensor = true[order], sensor[order]
    off: dict[int, float] = {}
    spread: dict[int, float] = {}
    for i in present:
        rows = np.flatnonzero(sorted_sensor == i)
        rows = rows[:: max(len(rows) // MOST_COMPARED, 1)]
        before, after = _reference(sorted_t, sorted_sensor, np.ones(len(order), dtype=bool), i, rows)
        d = sorted_t[rows] - 0.5 * (before + after)
        off[i] = float(np.median(d))
        spread[i] = 1.4826 * float(np.median(np.abs(d - off[i])))
    pair = len(present) == 2
    for i in present:
        if not abs(off[i]) > max(3.0, 4.0 * spread[i], 0.3 * min(jump[i], LEAST_JUMP)):
            continue
        why = _why(off[i], 1.5 * max(spread[i], 1.0) if pair else 1.0)
        if pair and why.startswith("GPS") and off[i] < 0.0:
            continue  # of two clocks that of GPS time is ahead
        if pair and not why and (sensor == i).sum() > len(order) / 2.0:
            continue  # of two clocks that of fewer reports is named
        side = "ahead of" if off[i] > 0 else "behind"
        who = f"'{sensors[present[1] if i == present[0] else present[0]].id}'" if pair else "the other sensors"
        size = next((v for v, w in OFFSETS.items() if w == why and v < 100.0), abs(off[i]))
        text = (
            f"its stamps lie {size:.4g} s {side} those of {who} that arrive at the same time, constantly: "
            f"{why or 'a clock that is not synchronised, or a delay of its reports'}? If its clock is wrong, import "
            f"with --time-offset {sensors[i].id}={-math.copysign(size, off[i]):.4g}; if the delay is right, declare "
            "its latency_s"
        )
        _say(out, sensors[i], "t_s", "offset", int((sensor == i).sum()), -math.copysign(size, off[i]), text)
        if pair:
            return
    if any(f.cause == "offset" for f in out.findings):
        return
    _shifted_spans(out, true, sensor, good, sensors, present)


def _shifted_spans(
    out: Stamps,
    t: FloatArray,
    sensor: IntArray,
    good: NDArray[np.bool_],
    sensors: Sequence[Sensor],
    present: Sequence[int],
) -> None:
    """A file sorted by stamp hides an offset, but for its ends: one sensor begins and ends later."""
    spans = {i: (t[good & (sensor == i)].min(), t[good & (sensor == i)].max()) for i in present}
    for i in present:
        first = min(spans[j][0] for j in present if j != i)
        last = max(spans[j][1] for j in present if j != i)
        begin, end = float(spans[i][0] - first), float(spans[i][1] - last)
        offset = 0.5 * (begin + end)
        if abs(begin - end) < 4.0 and _why(offset) and min(abs(begin), abs(end)) > 10.0:
            side = "later" if offset > 0 else "earlier"
            text = (
                f"it begins and ends {abs(offset):.4g} s {side} than the other sensors: {_why(offset)}? If so, import "
                f"with --time-offset {sensors[i].id}={-_exact(offset):.4g}"
            )
            _say(out, sensors[i], "t_s", "offset", int((sensor == i).sum()), -offset, text)
            return
