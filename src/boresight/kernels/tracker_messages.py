"""Sensors that report one target a message, and addresses: what a message says of its target, and of the others.

A message is of one target, and that it is not of another says next to nothing of that one: any of them might have been
next. Of a target that sends every I seconds is one message in I / m, where the sensor gives one every m seconds; so
its misses add up to what an expected interval says (exp(-t / I) after t seconds without one), and a silent sensor says
nothing. An address is evidence: it may be wrong, missing, or another target's too.
"""

from __future__ import annotations

import math

from numba import njit

from boresight.kernels.options import LEAF
from boresight.kernels.tracker import (
    ADDRESS,
    EVERY,
    INTERVAL,
    LAST,
    MESSAGES,
    NO_ADDRESS,
    PASSED,
    SPACING,
    VOTES,
    Look,
    SensorTable,
    Tracks,
)
from boresight.types.sensor import FloatArray

SELDOM = 0.01  # share of the messages that are one target's where nothing is known of its interval
LONGEST = 4.0  # times the mean: a gap between two messages of a target counts for no more
SILENCE = 3.0  # times a target's interval: after as long without any message the sensor was silent, not the targets
OWN_RATE, SENSOR_RATE = 0.2, 0.05  # share that the newest interval has in a mean
FORGET = 0.99  # what remains of the messages before with each new one: their mean is over some hundred
OTHER = 0.1  # odds that a message near a target is another's, where its address says so
MORE_ADDRESSES = 10.0  # addresses that there may be beside those of the tracks
MOST_VOTES, ESTABLISHED = 20.0, 3.0


@njit(**LEAF)
def mean_with(mean: float, gap: float, share: float) -> float:
    """Return the mean time (s, 0: none yet) with one more gap (s) in it."""
    if gap <= 0.0:
        return mean
    return mean + share * (min(gap, LONGEST * mean) - mean) if mean > 0.0 else gap


@njit(**LEAF)
def note_pace(tr: Tracks, sensor: SensorTable, elapsed: float, count: int) -> None:
    """Learn how often such a sensor reports: `count` detections, `elapsed` (s) after those before."""
    if sensor.single and count > 0 and elapsed < math.inf:
        pace = tr.pace[sensor.number]
        interval = sensor.interval if sensor.interval > 0.0 else pace[EVERY]
        if pace[SPACING] > 0.0 and 0.0 < SILENCE * interval < elapsed:
            elapsed = count * pace[SPACING]
        pace[PASSED] = FORGET * pace[PASSED] + elapsed
        pace[MESSAGES] = FORGET * pace[MESSAGES] + count
        pace[SPACING] = pace[PASSED] / pace[MESSAGES]  # many may bear the same stamp


@njit(**LEAF)
def in_message(tr: Tracks, i: int, sensor: SensorTable, count: int) -> float:
    """Return the probability that one of `count` detections is of track `i`, if its target sends at all."""
    own = tr.spoken[i, sensor.spoken, INTERVAL]
    return float(share_of_messages(sensor, tr.pace[sensor.number], count, own))


@njit(**LEAF)
def share_of_messages(sensor: SensorTable, pace: FloatArray, count: int, own: float) -> float:
    """Return the probability that `count` messages hold one of a target that sends every `own` (s; 0: as others do)."""
    interval = own if own > 0.0 else (sensor.interval if sensor.interval > 0.0 else pace[EVERY])
    if interval <= 0.0 or pace[SPACING] <= 0.0:
        return SELDOM
    return float(min(1.0, max(count, 1) * pace[SPACING] / interval))


@njit(**LEAF)
def note_message(tr: Tracks, i: int, sensor: SensorTable, t: float, address: int) -> None:
    """Remember that track `i` had a message at time `t` (s), and whose address it gave."""
    kept = tr.spoken[i, sensor.spoken]
    gap = t - kept[LAST]
    if sensor.single and gap < math.inf:
        kept[INTERVAL] = mean_with(kept[INTERVAL], gap, OWN_RATE)
        pace = tr.pace[sensor.number]
        pace[EVERY] = mean_with(pace[EVERY], gap, SENSOR_RATE)
    kept[LAST] = max(t, kept[LAST])
    if address == NO_ADDRESS:
        return
    if kept[ADDRESS] == address:
        kept[VOTES] = min(kept[VOTES] + 1.0, MOST_VOTES)
    elif kept[VOTES] > 0.0:
        kept[VOTES] -= 1.0
    else:
        kept[ADDRESS], kept[VOTES] = address, 1.0


@njit(**LEAF)
def find_owned(tr: Tracks, sensor: SensorTable, look: Look, owned: FloatArray) -> None:
    """Fill whether a track has the address of each detection (m,): 1 or 0."""
    for k in range(len(look.dt)):
        owned[k] = 0.0
        if look.address[k] != NO_ADDRESS:
            for i in range(tr.live[0]):
                if tr.spoken[i, sensor.spoken, ADDRESS] == look.address[k]:
                    owned[k] = 1.0


@njit(**LEAF)
def with_address(
    tr: Tracks, i: int, sensor: SensorTable, address: int, owned: float, log_ratio: float, nis: float, p_d: float
) -> float:
    """Return the log-likelihood ratio of a detection for track `i`, over nothing, with what its address says.

    `log_ratio` is that without it, `nis` its distance, `p_d` the probability of a detection; `owned` is 1 where a track
    has that address. An address that is not the track's own is a wrong one, or another target's, which may be as near:
    what stands against it is then not clutter alone.
    """
    if address == NO_ADDRESS:
        return log_ratio
    own = tr.spoken[i, sensor.spoken, ADDRESS]
    if own == address:
        return log_ratio + math.log((1.0 - sensor.wrong_id) * (tr.live[0] + MORE_ADDRESSES))
    if own == NO_ADDRESS:
        return log_ratio + (math.log(sensor.wrong_id) if owned > 0.0 else 0.0)
    return log_ratio + min(math.log(sensor.wrong_id), math.log(sensor.wrong_id / (OTHER * p_d)) - 0.5 * nis - log_ratio)


@njit(**LEAF)
def are_two(tr: Tracks, i: int, j: int) -> bool:
    """Whether two tracks that both have messages have addresses that differ."""
    for a in range(tr.spoken.shape[1]):
        one, other = tr.spoken[i, a], tr.spoken[j, a]
        established = one[VOTES] >= ESTABLISHED and other[VOTES] >= ESTABLISHED and one[ADDRESS] != other[ADDRESS]
        if established and abs(one[LAST] - other[LAST]) < SILENCE * max(one[INTERVAL], other[INTERVAL]):
            return True
    return False


@njit(**LEAF)
def take_over(tr: Tracks, i: int, weaker: int) -> None:
    """Let track `i`, with which another has become one, have the address that was heard last."""
    for a in range(tr.spoken.shape[1]):
        if tr.spoken[weaker, a, LAST] > tr.spoken[i, a, LAST]:
            for b in range(tr.spoken.shape[2]):
                tr.spoken[i, a, b] = tr.spoken[weaker, a, b]


@njit(**LEAF)
def forget_messages(tr: Tracks, i: int) -> None:
    """Let a new track have had no message."""
    for a in range(tr.spoken.shape[1]):
        kept = tr.spoken[i, a]
        kept[LAST], kept[INTERVAL], kept[ADDRESS], kept[VOTES] = -math.inf, 0.0, NO_ADDRESS, 0.0


@njit(**LEAF)
def part_told(tr: Tracks, sensor: SensorTable, count: int) -> float:
    """Return which part of all targets a look with `count` detections tells of: 1 where it tells of all."""
    return share_of_messages(sensor, tr.pace[sensor.number], count, 0.0) if sensor.single else 1.0
